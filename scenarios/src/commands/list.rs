//! `scenarios list`: a scene a row.

use std::io::Write;

use comfy_table::Cell;
use scenarios::lint::{self, Severity};
use world::scene::{AgentKind, Scene};

use super::Failure;
use super::inspect::{av_path, fastest};
use super::scenes::Scenes;
use super::table::table;
use crate::cli::ListArguments;

const HEAD: [&str; 12] = [
    "scene",
    ">steps",
    ">AV m",
    ">max m/s",
    ">veh",
    ">ped",
    ">cyc",
    ">lanes",
    ">signals",
    ">warnings",
    ">errors",
    "from",
];

pub fn run(arguments: &ListArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let mut table = table(&HEAD);
    let (mut grave, mut errors) = (false, Vec::new());
    Scenes::survey(&arguments.inputs)?.into_records(|found| match found.scene {
        Ok((scene, findings)) => {
            let lints = lint::lint(&scene, &findings);
            let count = |severity| lints.iter().filter(|lint| lint.severity() == severity).count();
            grave |= count(Severity::Error) > 0;
            table.add_row(row(&found.name, &scene, [count(Severity::Warning), count(Severity::Error)], found.origin));
        }
        Err(error) => {
            table.add_row(row_of_none(found.name, found.origin));
            errors.push(error);
        }
    });
    writeln!(out, "{}", table.trim_fmt()).map_err(Failure::Output)?;
    for error in &errors {
        eprintln!("error: {error}\nhint: {}", error.hint());
    }
    Ok(grave || !errors.is_empty())
}

/// The row of a record that gives no scene: what there is to say follows the table.
fn row_of_none(name: String, origin: String) -> Vec<String> {
    let nothing = std::iter::repeat_n("-".to_owned(), HEAD.len() - 3);
    std::iter::once(name).chain(nothing).chain(["1".to_owned(), origin]).collect()
}

fn row(name: &str, scene: &Scene, [warnings, errors]: [usize; 2], origin: String) -> Vec<Cell> {
    let agents = |kind| super::inspect::others(scene).filter(|track| track.kind == kind).count();
    let signal_steps = (0..scene.steps()).filter(|step| !scene.signals(*step).is_empty()).count();
    vec![
        Cell::new(name),
        Cell::new(scene.steps()),
        Cell::new(format!("{:.1}", av_path(scene))),
        Cell::new(format!("{:.1}", fastest(scene))),
        Cell::new(agents(AgentKind::Vehicle)),
        Cell::new(agents(AgentKind::Pedestrian)),
        Cell::new(agents(AgentKind::Cyclist)),
        Cell::new(scene.map().lanes.len()),
        Cell::new(signal_steps),
        Cell::new(warnings),
        Cell::new(errors),
        Cell::new(origin),
    ]
}
