//! `sim validity`: where replayed agents would have had to react, and what the figures are without that.

use std::collections::BTreeMap;
use std::sync::Arc;

use episode::Episode;
use episode::metrics::{Counted, METRICS};
use evaluation::drives::Run;

use crate::stage::Stage;

/// What `--format csv` says of each metric: of all steps, and without.
fn figures(csv: &str) -> BTreeMap<String, (Option<f64>, Option<f64>)> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        (cells[2].to_owned(), (cells[4].parse().ok(), cells[6].parse().ok()))
    };
    csv.lines().skip(1).map(row).collect()
}

#[test]
fn nobody_would_have_had_to_react_to_the_logged_av() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver human --record none --out human");
    let told = stage.good_sim("validity human").out;
    assert!(told.contains("At 0 of ") && told.contains("The AV is 0.0 m from where the log has it"), "{told}");
    let figures = figures(&stage.good_sim("validity human --format csv").out);
    assert!(figures.len() > 20 && figures.values().all(|(all, without)| all == without), "{figures:?}");
}

#[test]
fn contacts_with_who_would_have_braked_are_gone_without_those_steps() {
    let stage = Stage::new();
    stage.good_sim("run demo --driver gn-ctrv --record none --out gn");
    let figures = figures(&stage.good_sim("validity gn --format csv --out steps.parquet").out);
    let (all, without) = figures["contacts"];
    assert!(all.unwrap() > 0.0 && without.unwrap() < all.unwrap(), "{figures:?}");
    let (all, without) = figures["progress_m"];
    assert!(without.unwrap() < all.unwrap(), "{figures:?}");
    let scenes = stage.good_sim("validity gn --scenes --format csv").out;
    let react: Vec<usize> =
        scenes.lines().skip(1).map(|line| line.split(',').nth(4).unwrap().parse().unwrap()).collect();
    assert!(react.contains(&0) && react.iter().any(|steps| *steps > 0), "{scenes}");
    let table = results::parquet::Table::read(&stage.path("steps.parquet")).unwrap();
    let flagged = table.flags("must_react").unwrap().into_iter().filter(|react| *react).count();
    assert_eq!(flagged, react.iter().sum::<usize>());
}

#[test]
fn a_drive_judged_again_from_its_steps_measures_what_was_measured() {
    let stage = Stage::new();
    for (driver, protocol) in [("gn-ctrv", "strict"), ("idm", "strict"), ("human", "strict"), ("idm", "paper")] {
        let name = format!("{driver}-{protocol}");
        let motion = "--record none --scenarios small.toml";
        stage.good_sim(&format!("run --driver {driver} --protocol {protocol} {motion} --out {name}"));
        let run = Run::open(&stage.path(&name), &[stage.path("small.toml").display().to_string()]).unwrap();
        let numbers = run.results.numbers().unwrap();
        let measured = run.each(&[], |_, driven| {
            let driven = driven.unwrap();
            let mut episode = Episode::new(Arc::clone(&driven.scene), &run.file.settings.protocol).unwrap();
            episode.retrace(driven.steps());
            episode.measure(Counted::ALL)
        });
        for (row, values) in measured.unwrap().iter().enumerate() {
            for (metric, value) in METRICS.iter().zip(values) {
                let stored = numbers[metric.name][row];
                let is_near = match (stored, *value) {
                    (Some(stored), Some(value)) => (stored - value).abs() <= 1e-9 * stored.abs().max(1.0),
                    (stored, value) => stored.is_none() && value.is_none_or(f64::is_nan),
                };
                assert!(is_near, "{name}, row {row}, {}: {stored:?} {value:?}", metric.name);
            }
        }
    }
}

#[test]
fn what_cannot_be_checked_is_said() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm --record none --out idm");
    let other = stage.sim("validity idm --scenarios demo");
    assert!(other.code == Some(2) && other.err.contains("--scenarios says where its scenes are now"), "{other:?}");
    let none = stage.sim("validity nowhere");
    assert!(none.code == Some(2) && none.err.contains("nowhere is not there"), "{none:?}");
}
