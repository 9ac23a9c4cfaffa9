//! `sim replay --live`: the nodes of a run drive its recorded episodes again, and what everybody says is held to the recording.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use evaluation::replay::{Recorded, held};
use results::folder::{Folder, recording_of};
use results::part::Part;
use results::settings::{Build, Record, SceneLine};

use super::cast::{self, Means};
use super::{Asked, Outcome, Replayed, asked, told};
use crate::cli::ReplayArgs;
use crate::run::beginning::{Beginning, Lead};
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::interrupt::Interrupts;
use crate::run::shared::Onlooker;
use crate::run::{RunError, Task, run_task};

/// What was found of each episode.
type Found = Arc<Mutex<BTreeMap<String, Outcome>>>;

/// Has the run in `folder` driven again by its nodes, on so many cores. Nothing of the second drive is kept.
///
/// # Errors
/// [`super::ReplayRunError`], [`cast::CastError`], or what ends a run.
pub fn run(
    folder: &Path,
    arguments: &ReplayArgs,
    cores: u16,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> anyhow::Result<Replayed> {
    let Asked { file, episodes } = asked(folder, arguments)?;
    let recording = |line: &SceneLine| recording_of(folder, &line.id);
    let recorded: Vec<&SceneLine> =
        episodes.iter().copied().map(|at| &file.scenes[at]).filter(|line| recording(line).exists()).collect();
    let means = Means {
        scenarios: arguments.scenarios.clone(),
        weights: arguments.fork.weights.clone(),
        parallel: arguments.parallel.unwrap_or(cores),
        in_process: arguments.in_process,
    };
    let mut request = cast::again(folder, &file, &means)?;
    cast::take_as_long(&mut request, folder)?;
    let place = tempfile::tempdir().map_err(results::files::at("create a folder in", &std::env::temp_dir()))?;
    request.settings.record = Record::All;
    request.out = Some(place.path().join("again"));
    if let Some(timeout) = arguments.start_timeout {
        request.machine.start_timeout_s = timeout.as_secs_f64();
    }
    tell_what_changed(&file.build, &cast::changed_files(&file), console);
    let found = Found::default();
    if !recorded.is_empty() {
        // A fork was led up to its step: so it is now, by what it drove then.
        let until = file.settings.fork.as_ref().map_or(0, |fork| fork.step);
        let led = |line: &SceneLine| {
            let lead = (until > 0).then(|| Lead::Recording { path: recording(line), until });
            (line.id.clone(), Beginning { lead, ..Beginning::default() })
        };
        let scenes = cast::scenes(&request.machine.scenarios, recorded.iter().copied())?;
        let task = Task {
            beginnings: recorded.iter().copied().map(led).collect(),
            onlooker: Some(onlooker(folder.join("episodes"), Arc::clone(&found))),
            ..Task::of(scenes)
        };
        run_task(&request, task, clock, console, interrupts).map_err(RunError::with_nothing_kept)?;
    }
    let mut found = std::mem::take(&mut *found.lock().unwrap_or_else(PoisonError::into_inner));
    let outcome = |at: usize| (at, found.remove(&file.scenes[at].id).unwrap_or(Outcome::Unrecorded));
    let outcomes: Vec<(usize, Outcome)> = episodes.into_iter().map(outcome).collect();
    Ok(told(folder, &file, &outcomes, "are the same when driven again")?)
}

/// What is known to be another thing now, before anybody wonders.
fn tell_what_changed(build: &Build, files: &[&str], console: &Console) {
    let now = Build::this();
    let name = |build: &Build| format!("{} ({})", build.version, build.git_revision);
    if *build != now {
        console.line(&format!("note: the run was driven by the build {}, this is {}", name(build), name(&now)));
    }
    for file in files {
        console.line(&format!("note: {file}, which the planner's command names, is another file than it was"));
    }
}

/// Holds each second recording to the first as soon as it is there, and removes it.
fn onlooker(first: PathBuf, found: Found) -> Onlooker {
    Box::new(move |folder: &Folder, part: &Part| {
        let Some(scene) = part.end.as_ref().map(|end| end.scene.clone()) else { return };
        let second = |kind: &str| folder.episodes().join(format!("{scene}.{kind}"));
        let outcome = if part.recorded && part.recording_error.is_empty() {
            compare(&first.join(format!("{scene}.mcap")), &second("mcap")).map_or_else(Outcome::Differs, Outcome::Same)
        } else {
            let why = if part.recording_error.is_empty() { "nothing was driven" } else { &part.recording_error };
            Outcome::Differs(format!("it could not be recorded again: {why}"))
        };
        // What cannot be removed goes with the folder.
        let _ = fs::remove_file(second("mcap"));
        let _ = fs::remove_file(second("rrd"));
        found.lock().unwrap_or_else(PoisonError::into_inner).insert(scene, outcome);
    })
}

fn compare(then: &Path, now: &Path) -> Result<u32, String> {
    let read = |path: &Path| {
        let bytes = recording::load(path).map_err(|error| error.to_string())?;
        Recorded::read(&bytes).map_err(|error| format!("{}: {error}", path.display()))
    };
    held::hold(&read(then)?, &read(now)?).map_err(|parting| parting.to_string())
}
