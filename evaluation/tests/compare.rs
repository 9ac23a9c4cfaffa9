//! Laws of a comparison, over runs that were never driven.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::PathBuf;

use episode::protocol::{EndingCollision, Motion, Protocol, StrictSettings};
use evaluation::compare::figures::{FIGURES, PASSED, Verdict};
use evaluation::compare::gate::{self, FailOn};
use evaluation::compare::outcome::Fault;
use evaluation::compare::run::{Episode, Run};
use evaluation::compare::{CompareError, Comparison, json, junit, markdown, text};
use proptest::prelude::*;
use results::settings::Build;
use world::pcg::Pcg32;

/// An episode of a scene; its figures are `shift` off what the scene makes them.
fn episode(scene: &str, faults: Vec<Fault>, shift: impl Fn(&str) -> f64) -> Episode {
    let value = |(at, (name, _)): (usize, &(&str, _))| match *name {
        PASSED => Some(f64::from(u8::from(faults.is_empty()))),
        _ if faults.contains(&Fault::DriverFailed) => None,
        _ => Some(at as f64 + shift(name)),
    };
    Episode {
        scene: scene.to_owned(),
        sha256: format!("content of {scene}"),
        end: faults.first().map_or("horizon", |fault| fault.name()).to_owned(),
        detail: faults.first().map(|fault| format!("step 9: {} of {scene}", fault.name())).unwrap_or_default(),
        steps: 150,
        values: FIGURES.iter().enumerate().map(value).collect(),
        faults,
    }
}

fn run(name: &str, episodes: Vec<Episode>) -> Run {
    Run {
        folder: PathBuf::from(format!("runs/{name}")),
        driver: name.to_owned(),
        latency: None,
        traffic: None,
        protocol: Protocol::default(),
        build: Build { version: "0.1.0".to_owned(), git_revision: "abc".to_owned(), wire_version: 2 },
        deadline_s: 5.0,
        episodes,
    }
}

/// A run over scenes 0, 1, ... with these faults and shifts.
fn drawn(name: &str, rows: &[(u8, f64)]) -> Run {
    let faults = |kind: u8| match kind {
        0 => vec![Fault::Collision],
        1 => vec![Fault::OffRoad, Fault::RedLight],
        2 => vec![Fault::DriverFailed],
        _ => Vec::new(),
    };
    let episode = |(at, (kind, shift)): (usize, &(u8, f64))| episode(&format!("s{at}"), faults(*kind), |_| *shift);
    run(name, rows.iter().enumerate().map(episode).collect())
}

fn strict(change: impl FnOnce(&mut StrictSettings)) -> Protocol {
    let mut settings = StrictSettings::default();
    change(&mut settings);
    Protocol::Strict(settings)
}

fn rows() -> impl Strategy<Value = Vec<((u8, f64), (u8, f64))>> {
    let row = || (0_u8..8, prop_oneof![Just(0.0), -3.0..3.0]);
    proptest::collection::vec((row(), row()), 1..25)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn swapping_the_runs_mirrors_everything(rows in rows()) {
        let (a, b): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let (a, b) = (drawn("a", &a), drawn("b", &b));
        let (there, back) = (Comparison::of(&a, &b, 3).unwrap(), Comparison::of(&b, &a, 3).unwrap());
        prop_assert_eq!(&there.new_failures, &back.mended);
        prop_assert_eq!(&there.mended, &back.new_failures);
        prop_assert_eq!(&there.a, &back.b);
        prop_assert_eq!(
            (there.pairs, there.alike, there.both_fail, there.mcnemar_p, there.flips_needed),
            (back.pairs, back.alike, back.both_fail, back.mcnemar_p, back.flips_needed)
        );
        let near = |one: Option<f64>, other: Option<f64>| match (one, other) {
            (Some(one), Some(other)) => (one - other).abs() < 1e-9,
            (one, other) => one == other,
        };
        for (one, other) in there.figures.iter().zip(&back.figures) {
            prop_assert_eq!((one.a, one.b, one.p, one.pairs), (other.b, other.a, other.p, other.pairs));
            prop_assert!(near(one.difference, other.difference.map(|difference| -difference)));
            prop_assert!(near(one.interval.map(|at| at.low), other.interval.map(|at| -at.high)), "{one:?} {other:?}");
            prop_assert!(near(one.interval.map(|at| at.high), other.interval.map(|at| -at.low)), "{one:?} {other:?}");
            prop_assert!(near(one.detectable, other.detectable));
            let mirrored = match other.verdict {
                Verdict::Better => Verdict::Worse,
                Verdict::Worse => Verdict::Better,
                other => other,
            };
            prop_assert_eq!(one.verdict, mirrored);
        }
    }

    #[test]
    fn a_run_beside_itself_is_no_difference(rows in rows()) {
        let (a, _): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let comparison = Comparison::of(&drawn("a", &a), &drawn("a", &a), 0).unwrap();
        prop_assert_eq!((comparison.alike, comparison.new_failures.len(), comparison.mended.len()), (a.len(), 0, 0));
        prop_assert!(comparison.figures.iter().all(|figure| matches!(figure.verdict, Verdict::Same | Verdict::NoValue)));
        prop_assert!(text::render(&comparison, &[], 80).contains("B drives exactly as A"));
    }
}

/// 200 scenes of one driver, in one of which it drives otherwise.
fn planted() -> Comparison {
    let mut generator = Pcg32::new(5, 5);
    let rows: Vec<(u8, f64)> = (0..200).map(|_| (generator.bits() as u8 % 40, generator.between(-5.0, 5.0))).collect();
    let (a, mut b) = (drawn("idm", &rows), drawn("idm", &rows));
    let at = rows.iter().position(|(kind, _)| *kind > 2).unwrap();
    b.episodes[at] =
        episode(
            &format!("s{at}"),
            vec![Fault::Collision],
            |name| if name == "progress_m" { -40.0 } else { rows[at].1 },
        );
    Comparison::of(&a, &b, 0).unwrap()
}

#[test]
fn one_planted_regression_among_two_hundred_scenes_is_found_and_nothing_else() {
    let comparison = planted();
    let [new] = &*comparison.new_failures else { panic!("{:?}", comparison.new_failures) };
    assert_eq!((&*new.faults[0].detail, comparison.mended.len()), (&*format!("step 9: collision of {}", new.scene), 0));
    assert_eq!((comparison.pairs, comparison.alike), (200, 199));
    let moved: Vec<_> =
        comparison.figures.iter().filter(|figure| figure.differing > 0).map(|figure| figure.name).collect();
    assert_eq!(moved, [PASSED, "progress_m"]);
    assert!(
        comparison.figures.iter().all(|figure| matches!(figure.verdict, Verdict::Same | Verdict::NotDistinguishable))
    );
    let rules = ["new-failures", "missing-scenes", "progress_m<-5"].map(|rule| rule.parse().unwrap());
    let hits: Vec<bool> = gate::check(&comparison, &rules).unwrap().iter().map(|gate| gate.hit).collect();
    assert_eq!(hits, [true, false, false]);
    let report = junit::render(&comparison, &[]).unwrap();
    assert_eq!(report.matches("<failure").count(), 1, "{report}");
}

#[test]
fn what_cannot_be_compared_is_refused_with_every_difference() {
    let a = drawn("a", &[(9, 0.0)]);
    let mut b = a.clone();
    b.protocol = Protocol::Paper;
    let message = |a: &Run, b: &Run| Comparison::of(a, b, 0).unwrap_err().to_string();
    insta::assert_snapshot!(message(&a, &b), @"
    the protocols differ: strict in A, paper in B; numbers of one are never held to the other's
    hint: drive one of them again with --protocol
    ");
    b.protocol = strict(|settings| {
        settings.horizon = 80;
        settings.ending_collision = EndingCollision::None;
    });
    insta::assert_snapshot!(message(&a, &b), @r#"
    the rules of strict differ:
      ending-collision: "at-fault" in A, "none" in B
      horizon: 150 in A, 80 in B
    hint: drive one of them again with the other's --set
    "#);
    b.protocol = strict(|settings| settings.motion = Motion::Playback);
    let comparison = Comparison::of(&a, &b, 0).unwrap();
    assert!(text::render(&comparison, &[], 80).contains("another motion: bicycle in A, playback in B"));
    b.traffic = Some("mixed, seed 7".to_owned());
    let among = |a: &Run, b: &Run| text::render(&Comparison::of(a, b, 0).unwrap(), &[], 120);
    assert!(among(&a, &b).contains("protocol strict, another traffic (A: replayed; B: mixed, seed 7), "));
    assert!(among(&b, &b).contains("protocol strict, traffic mixed, seed 7,"));
    b.episodes.push(b.episodes[0].clone());
    assert!(matches!(Comparison::of(&a, &b, 0), Err(CompareError::Twice { .. })));
    b.episodes.clear();
    assert!(matches!(Comparison::of(&a, &b, 0), Err(CompareError::NoPair { only_a: 1, .. })));
}

#[test]
fn scenes_without_a_partner_are_left_out_and_named() {
    let mut a = drawn("a", &[(9, 0.0), (9, 0.0), (9, 0.0), (9, 0.0)]);
    let mut b = a.clone();
    a.episodes[0].scene = "old".to_owned();
    b.episodes[0].scene = "new".to_owned();
    b.episodes[1].sha256 = "another".to_owned();
    b.episodes[2].end = "undrivable".to_owned();
    let comparison = Comparison::of(&a, &b, 0).unwrap();
    let left = &comparison.left_out;
    assert_eq!(
        [&left.only_a, &left.only_b, &left.other_content, &left.undrivable].map(|scenes| scenes.join(",")),
        ["old", "new", "s1", "s2"]
    );
    assert_eq!(comparison.pairs, 1);
    assert!(gate::check(&comparison, &[FailOn::MissingScenes]).unwrap()[0].hit);
    assert_eq!(junit::render(&comparison, &[]).unwrap().matches("<skipped").count(), 4);
}

#[test]
fn a_driver_that_fails_is_a_failure_with_a_reason_and_has_no_other_figure() {
    let comparison = Comparison::of(&drawn("a", &[(9, 0.0), (9, 1.0)]), &drawn("b", &[(2, 0.0), (9, 2.0)]), 0).unwrap();
    assert_eq!(comparison.new_failures[0].faults[0].fault, Fault::DriverFailed);
    assert_eq!((comparison.b.passed, comparison.b.driver_failed.len()), (1, 1));
    let pairs = |name| comparison.figure(name).unwrap().pairs;
    assert_eq!((pairs(PASSED), pairs("progress_m")), (2, 1));
    assert!(text::render(&comparison, &[], 100).contains("the driver failed in 1 scene of B"));
}

#[test]
fn rules_are_read_and_senseless_ones_explained() {
    let parse = |text: &str| text.parse::<FailOn>();
    for rule in ["new-failures", "missing-scenes", "progress_m<-5%", "nuplan_score<-0.01", "passed<-0.02"] {
        assert_eq!(parse(rule).unwrap().to_string(), rule);
    }
    assert_eq!(parse(" progress_m < -5 % ").unwrap().to_string(), "progress_m<-5%");
    let error = |text: &str| parse(text).unwrap_err().to_string();
    insta::assert_snapshot!(["progress_m", "progess_m>1", "progress_m>", "progress_m>nan", "collision>1%"].map(error).join("\n"), @r#"
    it is neither new-failures nor missing-scenes nor 'METRIC>X' or 'METRIC<X'; in quotes, for the shell takes > and < for itself
    there is no figure "progess_m" to compare; docs/compare.md lists them
    the limit "" is no number; write it as 0.5, -2 or 5%
    the limit "nan" is no number; write it as 0.5, -2 or 5%
    collision is a share of scenes: write 0.01 for one percentage point, without %
    "#);
    let comparison = Comparison::of(&drawn("a", &[(2, 0.0)]), &drawn("b", &[(2, 0.0)]), 0).unwrap();
    let refused = gate::check(&comparison, &[parse("progress_m<-5%").unwrap()]).unwrap_err().to_string();
    assert!(refused.starts_with("--fail-on progress_m<-5%: no paired scene has a value of progress_m"), "{refused}");
}

#[test]
fn a_rule_asks_for_the_difference_or_its_share_of_a() {
    let (a, b) = (drawn("a", &[(9, 1.0); 9]), drawn("b", &[(9, 0.0); 9]));
    let comparison = Comparison::of(&a, &b, 0).unwrap();
    let mean = comparison.figure("progress_m").unwrap().a.unwrap();
    let hit = |rule: String| gate::check(&comparison, &[rule.parse().unwrap()]).unwrap()[0].hit;
    assert!(
        hit("progress_m<-0.9".to_owned()) && !hit("progress_m<-1.1".to_owned()) && !hit("progress_m>0.9".to_owned())
    );
    let percent = 100.0 / mean;
    assert!(hit(format!("progress_m<-{}%", 0.9 * percent)) && !hit(format!("progress_m<-{}%", 1.1 * percent)));
}

#[test]
fn text_and_markdown_tell_flips_first_and_keep_to_the_width() {
    let a: Vec<(u8, f64)> = (0..30).map(|at| (if at == 3 { 0 } else { 9 }, f64::from(at % 7))).collect();
    let b: Vec<(u8, f64)> = (0..30)
        .map(|at| {
            (
                if at == 7 {
                    1
                } else if at == 8 {
                    2
                } else {
                    9
                },
                f64::from(at % 5) - 1.5,
            )
        })
        .collect();
    let (mut a, mut b) = (drawn("idm", &a), drawn("dipp", &b));
    for (name, _) in
        FIGURES.iter().filter(|(name, _)| ![PASSED, "nuplan_score", "speeding", "progress_m"].contains(name))
    {
        let at = FIGURES.iter().position(|(other, _)| other == name).unwrap();
        let driven = a.episodes.iter_mut().chain(&mut b.episodes).filter(|episode| !episode.driver_failed());
        driven.for_each(|episode| episode.values[at] = Some(0.5));
    }
    b.episodes[5].values[10] = None;
    let speeding = FIGURES.iter().position(|(name, _)| *name == "speeding").unwrap();
    a.episodes
        .iter_mut()
        .enumerate()
        .for_each(|(at, episode)| episode.values[speeding] = Some(f64::from(u8::from(at < 4))));
    b.episodes
        .iter_mut()
        .enumerate()
        .for_each(|(at, episode)| episode.values[speeding] = Some(f64::from(u8::from(at < 9))));
    let comparison = Comparison::of(&a, &b, 0).unwrap();
    let gates =
        gate::check(&comparison, &["new-failures", "nuplan_score>0"].map(|rule| rule.parse().unwrap())).unwrap();
    insta::assert_snapshot!("text", text::render(&comparison, &gates, 100));
    insta::assert_snapshot!("markdown", markdown::render(&comparison, &gates));
    insta::assert_snapshot!("junit", junit::render(&comparison, &gates).unwrap());
    let narrow = text::render(&comparison, &gates, 80);
    assert!(narrow.lines().all(|line| line.chars().count() <= 80), "{narrow}");
    let told: serde_json::Value = serde_json::from_str(&json::render(&comparison, &gates).unwrap()).unwrap();
    let fields: Vec<&String> = told.as_object().unwrap().keys().collect();
    let page = include_str!("../../docs/compare.md");
    for field in fields {
        assert!(page.contains(&format!("`{field}`")), "docs/compare.md does not tell of {field}");
    }
}
