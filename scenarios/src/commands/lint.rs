//! `scenarios lint`: what to know of scenes before believing their results.

use std::io::Write;

use scenarios::lint::{self, Severity};

use super::Failure;
use super::scenes::Scenes;
use super::table::{count, table};
use crate::cli::{Level, LintArguments};

pub fn run(arguments: &LintArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let scenes = Scenes::survey(&arguments.inputs)?;
    let at_least = match arguments.at_least {
        Level::Note => Severity::Note,
        Level::Warning => Severity::Warning,
        Level::Error => Severity::Error,
    };
    let mut table = table(&["scene", "severity", "finding"]);
    let mut numbers = [0; 3];
    let mut number = 0;
    scenes.into_records(|found| {
        number += 1;
        let findings: Vec<(Severity, String)> = match found.scene {
            Ok((scene, findings)) => {
                lint::lint(&scene, &findings).iter().map(|lint| (lint.severity(), lint.to_string())).collect()
            }
            Err(error) => vec![(Severity::Error, format!("{error}; {}", error.hint()))],
        };
        for (severity, text) in findings {
            numbers[severity as usize] += 1;
            if severity >= at_least {
                table.add_row([found.name.clone(), severity.to_string(), text]);
            }
        }
    });
    let [notes, warnings, errors] = numbers;
    let mut write = || {
        if table.row_count() > 0 {
            writeln!(out, "{}\n", table.trim_fmt())?;
        }
        let parts = [count(errors, "error"), count(warnings, "warning"), count(notes, "note")];
        writeln!(out, "{}: {}", count(number, "scene"), parts.join(", "))
    };
    write().map_err(Failure::Output)?;
    Ok(errors > 0)
}
