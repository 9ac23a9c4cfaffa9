//! `sim replay --from STEP`: recorded plans bring a drive to a step, and from there on somebody drives it to its end. What comes of it is
//! a run like any other, whose settings say that it is a fork.
//!
//! The nodes of who takes over hear the whole episode: its scene, and every observation from step 0 on, which they answer. Before the step
//! their plans are passed over. So a planner that remembers remembers what it would if it had driven there itself.

use std::path::{Path, PathBuf};

use episode::protocol::{Motion, Protocol};
use evaluation::replay::Recorded;
use results::folder::recording_of;
use results::settings::{Fork, RunFile, SceneLine};
use thiserror::Error;

use super::cast::{self, Means};
use super::{Asked, asked};
use crate::cli::{Entrant, ReplayArgs, RunArgs};
use crate::request::{Request, checked_label};
use crate::run::beginning::{Beginning, Lead};
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::interrupt::Interrupts;
use crate::run::{Done, Task, run_task};

/// A drive that cannot be taken over.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ForkError {
    #[error("--from takes over the drives of one run\nhint: give one folder")]
    OneRun,
    #[error("the episode {id} cannot be taken over at step {step}: {why}")]
    Episode { id: String, step: u32, why: String },
    #[error("no recorded episode of {} goes beyond step {step}\nhint: `sim run --record all` keeps recordings", run.display())]
    Nothing { run: PathBuf, step: u32 },
    #[error("{0} goes with --driver or --planner-command: who takes over, if it is not the run's own driver")]
    WithDriver(&'static str),
    #[error(
        "the AV of this run was played back, not driven, and who takes over would be too\nhint: fork a run of another driver than human"
    )]
    Playback,
}

/// Takes over the drives of the run in `folder` at step `from`.
///
/// # Errors
/// [`ForkError`], or what cannot be read or driven; what is done is kept, and the same command goes on.
pub fn run(
    arguments: &ReplayArgs,
    from: u32,
    cores: u16,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> anyhow::Result<Done> {
    let [folder] = &arguments.runs[..] else { return Err(ForkError::OneRun.into()) };
    let Asked { file, episodes } = asked(folder, arguments)?;
    let digest = results::digest(folder)?;
    let request = request(folder, &file, arguments, from, digest, cores)?;
    let (mut lines, mut left_out) = (Vec::new(), 0);
    for line in episodes.into_iter().map(|at| &file.scenes[at]) {
        match can_be_led(&recording(folder, line), from) {
            Ok(()) => lines.push(line),
            Err(_) if arguments.episodes.is_empty() => left_out += 1,
            Err(why) => return Err(ForkError::Episode { id: line.id.clone(), step: from, why }.into()),
        }
    }
    if lines.is_empty() {
        return Err(ForkError::Nothing { run: folder.clone(), step: from }.into());
    }
    if left_out > 0 {
        console.line(&format!("note: {left_out} episodes have no recording that goes beyond step {from}"));
    }
    let led = |line: &SceneLine| {
        let lead = Lead::Recording { path: recording(folder, line), until: from };
        (line.id.clone(), Beginning { lead: Some(lead), ..Beginning::default() })
    };
    let scenes = cast::scenes(&request.machine.scenarios, lines.iter().copied())?;
    let task = Task { beginnings: lines.iter().copied().map(led).collect(), ..Task::of(scenes) };
    Ok(run_task(&request, task, clock, console, interrupts)?)
}

fn recording(folder: &Path, line: &SceneLine) -> PathBuf {
    recording_of(folder, &line.id)
}

/// Whether a recording has the plans of all steps before `step`, and its drive goes on then.
fn can_be_led(path: &Path, step: u32) -> Result<(), String> {
    if !path.exists() {
        return Err("it has no recording".to_owned());
    }
    let bytes = recording::load(path).map_err(|error| error.to_string())?;
    let recorded = Recorded::read(&bytes).map_err(|error| error.to_string())?;
    if recorded.is_over_at(step) {
        return Err(format!("it ends after {} steps", recorded.steps()));
    }
    recorded.plans(step).map(drop).map_err(|error| error.to_string())
}

/// Who takes over, and by which rules: those of the run.
fn request(
    folder: &Path,
    file: &RunFile,
    arguments: &ReplayArgs,
    from: u32,
    digest: String,
    cores: u16,
) -> anyhow::Result<Request> {
    let fork = &arguments.fork;
    let is_own = fork.driver.is_none() && fork.planner_command.is_none();
    let parallel = arguments.parallel.unwrap_or(cores);
    let mut request = if is_own {
        let options = [("--predictor", fork.predictor.is_some()), ("--features", fork.features.is_some())];
        if let Some((option, _)) = options.into_iter().find(|(_, given)| *given) {
            return Err(ForkError::WithDriver(option).into());
        }
        let means = Means {
            scenarios: arguments.scenarios.clone(),
            weights: fork.weights.clone(),
            parallel,
            in_process: arguments.in_process,
        };
        let mut request = cast::again(folder, file, &means)?;
        request.settings.deadline_s = fork.deadline.map_or(request.settings.deadline_s, |time| time.as_secs_f64());
        request
    } else {
        let driver = fork.driver.clone().unwrap_or_else(|| results::drivers::DEFAULT.to_owned());
        let entrant = Entrant { label: driver.clone(), driver, weights: fork.weights.clone(), ..Entrant::default() };
        let scenarios = if arguments.scenarios.is_empty() { &file.machine.scenarios } else { &arguments.scenarios };
        let usual = RunArgs::of(&entrant);
        let asked = RunArgs {
            planner_command: fork.planner_command.clone(),
            predictor: fork.predictor,
            features: fork.features.clone(),
            scenarios: scenarios.clone(),
            parallel: Some(parallel),
            in_process: arguments.in_process,
            deadline: fork.deadline.unwrap_or(usual.deadline),
            ..usual
        };
        Request::resolve(asked, cores)?
    };
    let played_back =
        |protocol: &Protocol| matches!(protocol, Protocol::Strict(strict) if strict.motion == Motion::Playback);
    if played_back(&file.settings.protocol) && !played_back(&request.settings.protocol) {
        return Err(ForkError::Playback.into());
    }
    cast::be_as_late(&mut request, folder, file);
    let label = fork.label.clone().unwrap_or_else(|| format!("{}-from-{from}", request.settings.driver));
    let settings = &mut request.settings;
    settings.driver = checked_label(&label)?;
    settings.protocol = file.settings.protocol.clone();
    settings.record = fork.record.unwrap_or_default();
    settings.fork = Some(Fork { driver: file.settings.driver.clone(), digest, step: from });
    if let Some(timeout) = arguments.start_timeout {
        request.machine.start_timeout_s = timeout.as_secs_f64();
    }
    request.out.clone_from(&fork.out);
    Ok(request)
}
