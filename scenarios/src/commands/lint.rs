//! `scenarios lint`: what to know of scenes before believing their results.

use std::io::Write;

use scenarios::lint::{self, Severity};

use super::Failure;
use super::scenes::Scenes;
use super::table::{count, table};
use crate::cli::{Level, LintArguments};

pub fn run(arguments: &LintArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let scenes = Scenes::open(&arguments.inputs)?;
    let at_least = match arguments.at_least {
        Level::Note => Severity::Note,
        Level::Warning => Severity::Warning,
        Level::Error => Severity::Error,
    };
    let mut table = table(&["scene", "severity", "finding"]);
    let mut numbers = [0; 3];
    for (index, entry) in scenes.iter() {
        let (scene, findings) = scenes.set.load(index)?;
        for lint in lint::lint(&scene, &findings) {
            numbers[lint.severity() as usize] += 1;
            if lint.severity() >= at_least {
                table.add_row([entry.id.to_string(), lint.severity().to_string(), lint.to_string()]);
            }
        }
    }
    let [notes, warnings, errors] = numbers;
    let mut write = || {
        if table.row_count() > 0 {
            writeln!(out, "{}\n", table.trim_fmt())?;
        }
        let parts = [count(errors, "error"), count(warnings, "warning"), count(notes, "note")];
        writeln!(out, "{}: {}", count(scenes.len(), "scene"), parts.join(", "))
    };
    write().map_err(Failure::Output)?;
    Ok(errors > 0)
}
