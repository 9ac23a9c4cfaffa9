//! A failure a line, a remedy a column.

use std::collections::BTreeSet;

use serde::Serialize;

use super::BlameFormat;
use super::verdict::{Blamed, Count, Outcome, Remedy, Row};
use crate::compare::grid::{Grid, Side};
use crate::table::quoted;

/// The table, and below it how often each remedy helped.
///
/// # Errors
/// Where JSON cannot be written: a bug.
pub fn render(blamed: &Blamed, format: BlameFormat, width: usize) -> Result<String, serde_json::Error> {
    match format {
        BlameFormat::Text => Ok(text(blamed, width)),
        BlameFormat::Csv => Ok(csv(blamed)),
        BlameFormat::Json => json(blamed),
    }
}

fn text(blamed: &Blamed, width: usize) -> String {
    let Blamed { driver, run, before, episodes, failures, .. } = blamed;
    let head = format!("driver {driver}, {} of {episodes} episodes failed ({run})", failures.len());
    if failures.is_empty() {
        return head + "\n";
    }
    let names: Vec<String> = Remedy::ALL.iter().map(|remedy| blamed.name(*remedy)).collect();
    let mut columns =
        vec![("episode", Side::Left), ("fault", Side::Left), ("step", Side::Right), ("from", Side::Right)];
    columns.extend(names.iter().map(|name| (name.as_str(), Side::Words)));
    let mut grid = Grid::new(&columns);
    for row in failures {
        let failure = &row.failure;
        let first =
            [failure.scene.clone(), failure.fault.name().to_owned(), failure.step.to_string(), row.from.to_string()];
        grid.row(first.into_iter().chain(Remedy::ALL.iter().map(|remedy| cell(row, *remedy))));
    }
    let (reproduced, hopeless) = blamed.reproduced_and_hopeless();
    let mut lines = vec![
        format!("{head}, driven again from {before} steps before the fault"),
        String::new(),
        grid.text(width),
        format!("{reproduced} of {} failures came again with nothing changed; of these", failures.len()),
    ];
    for remedy in &Remedy::ALL[1..] {
        let Count { driven, saved } = blamed.count(*remedy);
        lines.push(match driven {
            0 => format!("  {}: none was driven so", what(blamed, *remedy)),
            _ => format!("  {} saves {saved} of {driven}", what(blamed, *remedy)),
        });
    }
    lines.push(format!("  nothing of it saves {hopeless}"));
    lines.extend(reasons(blamed).into_iter().map(|reason| format!("note: {reason}")));
    lines.join("\n") + "\n"
}

fn what(blamed: &Blamed, remedy: Remedy) -> String {
    match remedy {
        Remedy::Nothing => "nothing".to_owned(),
        Remedy::OraclePrediction => "prediction by the log".to_owned(),
        Remedy::OtherDriver => format!("the driver {}", blamed.other_driver),
        Remedy::HumanStart => "the human's start".to_owned(),
        Remedy::NoArtefacts => "leaving artefacts out".to_owned(),
    }
}

fn cell(row: &Row, remedy: Remedy) -> String {
    match row.outcome(remedy) {
        _ if remedy == Remedy::Nothing && row.is_reproduced() => "same".to_owned(),
        Outcome::Saved if remedy == Remedy::Nothing => "not reproduced: passes".to_owned(),
        Outcome::Saved => "saved".to_owned(),
        Outcome::Failed { fault, step } if remedy == Remedy::Nothing => {
            format!("not reproduced: {} at {step}", fault.name())
        }
        Outcome::Failed { fault, step } if *fault == row.failure.fault => format!("still, at {step}"),
        Outcome::Failed { fault, step } => format!("{} at {step}", fault.name()),
        Outcome::NotDriven { .. } => "-".to_owned(),
    }
}

/// Why something was not driven, each reason once, with how often.
fn reasons(blamed: &Blamed) -> Vec<String> {
    let mut told = BTreeSet::new();
    for remedy in Remedy::ALL {
        for row in &blamed.failures {
            if let Outcome::NotDriven { why } = row.outcome(remedy) {
                told.insert((remedy, why.clone()));
            }
        }
    }
    let line = |(remedy, why): (Remedy, String)| {
        let is = |row: &&Row| *row.outcome(remedy) == Outcome::NotDriven { why: why.clone() };
        let times = blamed.failures.iter().filter(is).count();
        format!("{}: {times} not driven, {why}", blamed.name(remedy))
    };
    told.into_iter().map(line).collect()
}

fn csv(blamed: &Blamed) -> String {
    let mut lines =
        String::from("episode,fault,step,from_step,reproduced,remedy,outcome,outcome_fault,outcome_step,why\n");
    for row in &blamed.failures {
        let failure = &row.failure;
        for remedy in Remedy::ALL {
            let (outcome, fault, step, why) = match row.outcome(remedy) {
                Outcome::Saved => ("saved", "", String::new(), ""),
                Outcome::Failed { fault, step } => ("failed", fault.name(), step.to_string(), ""),
                Outcome::NotDriven { why } => ("not-driven", "", String::new(), why.as_str()),
            };
            let remedy = remedy.name();
            lines += &format!(
                "{},{},{},{},{},{remedy},{outcome},{fault},{step},{}\n",
                quoted(&failure.scene),
                failure.fault.name(),
                failure.step,
                row.from,
                row.is_reproduced(),
                quoted(why),
            );
        }
    }
    lines
}

fn json(blamed: &Blamed) -> Result<String, serde_json::Error> {
    #[derive(Serialize)]
    struct Counted {
        remedy: Remedy,
        #[serde(flatten)]
        count: Count,
    }
    #[derive(Serialize)]
    struct Whole<'a> {
        #[serde(flatten)]
        blamed: &'a Blamed,
        /// The order of each failure's outcomes.
        remedies: [Remedy; 5],
        summary: Vec<Counted>,
    }
    let summary = Remedy::ALL.iter().map(|remedy| Counted { remedy: *remedy, count: blamed.count(*remedy) }).collect();
    Ok(serde_json::to_string_pretty(&Whole { blamed, remedies: Remedy::ALL, summary })? + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blame::failure::Failure;
    use crate::compare::outcome::Fault;

    fn blamed() -> Blamed {
        let failed = |fault, step| Outcome::Failed { fault, step };
        let not = |why: &str| Outcome::NotDriven { why: why.to_owned() };
        let row = |scene: &str, fault, step: u32, outcomes| Row {
            failure: Failure { scene: scene.to_owned(), fault, step, av: None },
            from: step.saturating_sub(30),
            outcomes,
        };
        let nobody = "no agent of the scene is an artefact";
        Blamed {
            run: "runs/gn-ctrv-strict-1".to_owned(),
            driver: "gn-ctrv".to_owned(),
            other_driver: "idm".to_owned(),
            before: 30,
            episodes: 20,
            failures: vec![
                row(
                    "cut-in",
                    Fault::Collision,
                    47,
                    [
                        failed(Fault::Collision, 47),
                        Outcome::Saved,
                        failed(Fault::Collision, 46),
                        Outcome::Saved,
                        not(nobody),
                    ],
                ),
                row(
                    "curve",
                    Fault::OffRoad,
                    12,
                    [
                        failed(Fault::OffRoad, 12),
                        failed(Fault::OffRoute, 60),
                        failed(Fault::OffRoad, 13),
                        not("the log has no AV there"),
                        not(nobody),
                    ],
                ),
                row(
                    "merge",
                    Fault::RedLight,
                    90,
                    [Outcome::Saved, Outcome::Saved, Outcome::Saved, Outcome::Saved, not(nobody)],
                ),
            ],
        }
    }

    #[test]
    fn a_failure_is_a_line_and_what_saves_it_a_column() {
        insta::assert_snapshot!(render(&blamed(), BlameFormat::Text, 100).unwrap(), @"
        driver gn-ctrv, 3 of 20 episodes failed (runs/gn-ctrv-strict-1), driven again from 30 steps before the fault

        episode fault     step from again           oracle          idm          human's start no artefacts
        ────────────────────────────────────────────────────────────────────────────────────────────────────
        cut-in  collision   47   17 same            saved           still, at 46 saved         -
        curve   off-road    12    0 same            off-route at 60 still, at 13 -             -
        merge   red-light   90   60 not reproduced: saved           saved        saved         -
                                    passes

        2 of 3 failures came again with nothing changed; of these
          prediction by the log saves 1 of 2
          the driver idm saves 0 of 2
          the human's start saves 1 of 1
          leaving artefacts out: none was driven so
          nothing of it saves 1
        note: human's start: 1 not driven, the log has no AV there
        note: no artefacts: 3 not driven, no agent of the scene is an artefact
        ");
    }

    #[test]
    fn a_spreadsheet_has_a_line_an_outcome() {
        let csv = render(&blamed(), BlameFormat::Csv, 80).unwrap();
        assert_eq!(csv.lines().count(), 1 + 3 * 5);
        assert!(csv.contains("\ncut-in,collision,47,17,true,other-driver,failed,collision,46,\n"), "{csv}");
        assert!(csv.contains("\nmerge,red-light,90,60,false,nothing,saved,,,\n"), "{csv}");
    }

    #[test]
    fn programs_get_all_of_it() {
        let json: serde_json::Value = serde_json::from_str(&render(&blamed(), BlameFormat::Json, 80).unwrap()).unwrap();
        assert_eq!(json["failures"][0]["outcomes"][2]["step"], 46);
        assert_eq!(json["summary"][3]["remedy"], "human-start");
        assert_eq!((&json["summary"][3]["driven"], &json["summary"][3]["saved"]), (&1.into(), &1.into()));
    }

    #[test]
    fn a_run_without_a_failure_has_nobody_to_blame() {
        let none = Blamed { failures: Vec::new(), ..blamed() };
        assert_eq!(
            render(&none, BlameFormat::Text, 80).unwrap(),
            "driver gn-ctrv, 0 of 20 episodes failed (runs/gn-ctrv-strict-1)\n"
        );
    }
}
