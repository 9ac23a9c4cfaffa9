//! `scenarios list`: a scene a row.

use std::io::Write;

use comfy_table::Cell;
use scenarios::lint::{self, Severity};
use scenarios::{SceneEntry, Source};
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
    let scenes = Scenes::open(&arguments.inputs)?;
    let mut table = table(&HEAD);
    let mut grave = false;
    for (index, entry) in scenes.iter() {
        let (scene, findings) = scenes.set.load(index)?;
        let lints = lint::lint(&scene, &findings);
        let count = |severity| lints.iter().filter(|lint| lint.severity() == severity).count();
        grave |= count(Severity::Error) > 0;
        table.add_row(row(entry, &scene, count(Severity::Warning), count(Severity::Error)));
    }
    writeln!(out, "{}", table.trim_fmt()).map_err(Failure::Output)?;
    Ok(grave)
}

fn row(entry: &SceneEntry, scene: &Scene, warnings: usize, errors: usize) -> Vec<Cell> {
    let agents = |kind| super::inspect::others(scene).filter(|track| track.kind == kind).count();
    let signal_steps = (0..scene.steps()).filter(|step| !scene.signals(*step).is_empty()).count();
    vec![
        Cell::new(&entry.id),
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
        Cell::new(origin(&entry.source)),
    ]
}

/// Where a scene lies, as far as a row has room: the file's name, and the record where there may be several.
fn origin(source: &Source) -> String {
    match source {
        Source::File { path, record, .. } => {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
            if *record == 0 { name.into_owned() } else { format!("{name} #{record}") }
        }
        Source::Generated { .. } => source.to_string(),
    }
}
