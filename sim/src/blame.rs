//! `sim blame`: the failures of a run driven again from shortly before the fault, each time with one thing changed.
//!
//! A change is a run of its own in a folder that is then thrown away: episodes that recorded plans lead up to a step, as in a fork, or that
//! begin where the logged AV is then.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use evaluation::blame::artefacts::artefacts;
use evaluation::blame::failure::{Failure, failures};
use evaluation::blame::verdict::{Blamed, Outcome, Remedy, Row};
use evaluation::replay::Recorded;
use results::folder::{Folder, read_run_file, recording_of};
use results::part::Part;
use results::settings::{Node, Planner, Record, RunFile, Settings};
use results::summary::SummaryError;
use scenarios::SceneSet;
use tempfile::TempDir;
use thiserror::Error;
use world::plan::Plan;

use crate::cli::{BlameArgs, RunArgs};
use crate::replay::cast::{self, Means};
use crate::request::Request;
use crate::run::beginning::{Beginning, Beginnings, Lead};
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::interrupt::Interrupts;
use crate::run::shared::Onlooker;
use crate::run::{RunError, Task, run_task};

/// A run whose failures cannot be driven again.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum BlameError {
    #[error("{} has no failed episode {id}\nhint: `sim table --scenes` lists how each ended", run.display())]
    NoFailure { run: PathBuf, id: String },
}

/// The failures of a run, and what would have saved them.
///
/// # Errors
/// Where the run cannot be read, or cannot be driven again.
pub fn blame(
    arguments: &BlameArgs,
    cores: u16,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> anyhow::Result<Blamed> {
    let folder = &arguments.run;
    let mut failed = failures(folder)?;
    let file = read_run_file(folder)?.ok_or_else(|| SummaryError::NoRun(folder.clone()))?;
    let is_failed = |id: &String| failed.iter().any(|failure| failure.scene == *id);
    if let Some(id) = arguments.episodes.iter().find(|id| !is_failed(id)) {
        return Err(BlameError::NoFailure { run: folder.clone(), id: id.clone() }.into());
    }
    failed.retain(|failure| arguments.episodes.is_empty() || arguments.episodes.contains(&failure.scene));
    let parallel = arguments.parallel.unwrap_or(cores);
    let means = Means {
        scenarios: arguments.scenarios.clone(),
        weights: arguments.weights.clone(),
        parallel,
        in_process: arguments.in_process,
    };
    let own = cast::again(folder, &file, &means)?;
    let mut other = other_driver(arguments, &own, parallel)?;
    cast::be_as_late(&mut other, folder, &file);
    let mut blamed = Blamed {
        run: folder.display().to_string(),
        driver: file.settings.driver.clone(),
        other_driver: other.settings.driver.clone(),
        before: arguments.before,
        episodes: file.scenes.len(),
        failures: Vec::new(),
    };
    if failed.is_empty() {
        return Ok(blamed);
    }
    let line = |failure: &Failure| file.scenes.iter().find(|line| line.id == failure.scene);
    let scenes = cast::scenes(&own.machine.scenarios, failed.iter().filter_map(line))?;
    let place = tempfile::tempdir().map_err(results::files::at("create a folder in", &std::env::temp_dir()))?;
    let mut stage = Stage { place, scenes, clock, console, interrupts };
    let unrecorded = failed.iter().filter(|failure| !recording(folder, failure).exists()).count();
    console.begin("episodes", Remedy::ALL.len() * failed.len() + unrecorded, 0);
    let cases = stage.cases(folder, &own, failed, arguments.before);
    let rows = cases.and_then(|cases| stage.rows(&own, &other, &file, cases));
    console.end();
    blamed.failures = rows?;
    Ok(blamed)
}

/// The run of the other driver, under the rules of the run.
fn other_driver(arguments: &BlameArgs, own: &Request, parallel: u16) -> anyhow::Result<Request> {
    let asked = RunArgs {
        scenarios: own.machine.scenarios.clone(),
        parallel: Some(parallel),
        in_process: arguments.in_process,
        ..RunArgs::of(&arguments.driver)
    };
    let mut request = Request::resolve(asked, parallel)?;
    request.settings.protocol = own.settings.protocol.clone();
    Ok(request)
}

fn recording(folder: &Path, failure: &Failure) -> PathBuf {
    recording_of(folder, &failure.scene)
}

/// A failure that is to be driven again.
struct Case {
    failure: Failure,
    /// The first step that is driven anew.
    from: u32,
    /// What leads up to it; or why nothing does.
    lead: Result<Lead, String>,
}

/// Where failures are driven again.
struct Stage<'a> {
    /// For the runs; gone when all is known.
    place: TempDir,
    /// Those of the failures, in their order.
    scenes: SceneSet,
    clock: WallClock,
    console: &'a Console,
    interrupts: &'a Interrupts,
}

impl Stage<'_> {
    /// The failures with what leads up to them: their recordings, or the plans of the run's own driver, who drives those again that have none.
    fn cases(&mut self, folder: &Path, own: &Request, failed: Vec<Failure>, before: u32) -> anyhow::Result<Vec<Case>> {
        let from = |failure: &Failure| failure.step.saturating_sub(before);
        let unrecorded: Vec<usize> = (0..failed.len()).filter(|at| !recording(folder, &failed[*at]).exists()).collect();
        let steps = unrecorded.iter().map(|at| (failed[*at].scene.clone(), from(&failed[*at]))).collect();
        let mut driven = self.plans(folder, own, &unrecorded, steps)?;
        let case = |failure: Failure| {
            let (path, until) = (recording(folder, &failure), from(&failure));
            let lead = match driven.remove(&failure.scene) {
                None => Ok(Lead::Recording { path, until }),
                Some(plans) => plans.map(|plans| Lead::Plans(plans.into())),
            };
            Case { from: until, lead, failure }
        };
        Ok(failed.into_iter().map(case).collect())
    }

    /// The plans of the run's own driver in these scenes, up to a step each.
    fn plans(
        &mut self,
        folder: &Path,
        own: &Request,
        places: &[usize],
        steps: BTreeMap<String, u32>,
    ) -> anyhow::Result<Plans> {
        let found = Arc::new(Mutex::new(Plans::new()));
        if !places.is_empty() {
            let text =
                format!("note: {} failures have no recording: they are driven from their start first", places.len());
            self.console.line(&text);
            let mut request = own.clone();
            request.settings.record = Record::All;
            cast::take_as_long(&mut request, folder)?;
            let onlooker = taking_plans(steps, Arc::clone(&found));
            self.run("first", request, places, Beginnings::default(), Some(onlooker))?;
        }
        let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(std::mem::take(&mut *found))
    }

    /// What comes of each change.
    fn rows(&mut self, own: &Request, other: &Request, file: &RunFile, cases: Vec<Case>) -> anyhow::Result<Vec<Row>> {
        let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); cases.len()];
        for remedy in Remedy::ALL {
            let request = match remedy {
                Remedy::OraclePrediction => with_oracle(&own.settings)
                    .map(|settings| Request { settings, ..own.clone() })
                    .map_err(|why| format!("{} {why}", file.settings.driver)),
                Remedy::OtherDriver if is_same_driver(&own.settings, &other.settings) => {
                    Err("it is the run's own driver".to_owned())
                }
                Remedy::OtherDriver => Ok(other.clone()),
                Remedy::Nothing | Remedy::HumanStart | Remedy::NoArtefacts => Ok(own.clone()),
            };
            for (outcome, of_case) in self.outcomes(remedy, request, &cases)?.into_iter().zip(&mut outcomes) {
                of_case.push(outcome);
            }
        }
        let not_asked = || Outcome::NotDriven { why: String::new() };
        let row = |(case, outcomes): (Case, Vec<Outcome>)| {
            let mut outcomes = outcomes.into_iter();
            let outcomes = Remedy::ALL.map(|_| outcomes.next().unwrap_or_else(not_asked));
            Row { failure: case.failure, from: case.from, outcomes }
        };
        Ok(cases.into_iter().zip(outcomes).map(row).collect())
    }

    /// What comes of one change, in the order of the cases.
    fn outcomes(
        &mut self,
        remedy: Remedy,
        request: Result<Request, String>,
        cases: &[Case],
    ) -> anyhow::Result<Vec<Outcome>> {
        let begun: Vec<Result<Beginning, String>> = match &request {
            Ok(_) => (0..cases.len()).map(|at| self.beginning(remedy, at, &cases[at])).collect(),
            Err(why) => cases.iter().map(|_| Err(why.clone())).collect(),
        };
        let places: Vec<usize> = (0..cases.len()).filter(|at| begun[*at].is_ok()).collect();
        self.console.pass_over(cases.len() - places.len());
        let mut found = BTreeMap::new();
        let mut undrivable = BTreeMap::new();
        if let (Ok(request), false) = (request, places.is_empty()) {
            let beginning = |(case, begun): (&Case, &Result<Beginning, String>)| {
                Some((case.failure.scene.clone(), begun.as_ref().ok()?.clone()))
            };
            let beginnings = cases.iter().zip(&begun).filter_map(beginning).collect();
            let folder = self.run(remedy.name(), request, &places, beginnings, None)?;
            found = failures(&folder)?.into_iter().map(|failure| (failure.scene.clone(), failure)).collect();
            undrivable = evaluation::blame::failure::undrivable(&folder)?;
        }
        let outcome = |(case, begun): (&Case, Result<Beginning, String>)| {
            let scene = &case.failure.scene;
            match (begun, undrivable.get(scene)) {
                (Err(why), _) => Outcome::NotDriven { why },
                (Ok(_), Some(why)) => Outcome::NotDriven { why: why.clone() },
                (Ok(beginning), None) => Outcome::of(found.get(scene), beginning.later),
            }
        };
        Ok(cases.iter().zip(begun).map(outcome).collect())
    }

    /// How a case begins under a change; or why it cannot.
    fn beginning(&self, remedy: Remedy, at: usize, case: &Case) -> Result<Beginning, String> {
        let lead = || case.lead.clone().map(|lead| Beginning { lead: Some(lead), ..Beginning::default() });
        match remedy {
            Remedy::Nothing | Remedy::OraclePrediction | Remedy::OtherDriver => lead(),
            Remedy::HumanStart if case.from == 0 => Err("the drive began where the human was".to_owned()),
            Remedy::HumanStart => Ok(Beginning { later: case.from, ..Beginning::default() }),
            Remedy::NoArtefacts => {
                let (scene, findings) = self.scenes.load(at).map_err(|error| error.to_string())?;
                let without = artefacts(&scene, &findings, &case.failure);
                if without.is_empty() {
                    return Err("no agent of the scene is an artefact".to_owned());
                }
                Ok(Beginning { without, ..lead()? })
            }
        }
    }

    /// Drives these scenes in a folder of this name, which is given back.
    fn run(
        &self,
        name: &str,
        mut request: Request,
        places: &[usize],
        beginnings: Beginnings,
        onlooker: Option<Onlooker>,
    ) -> anyhow::Result<PathBuf> {
        request.out = Some(self.place.path().join(name));
        let console = self.console.shared(name.to_owned());
        let task = Task { beginnings, onlooker, ..Task::of(self.scenes.only(places)) };
        let done = run_task(&request, task, self.clock, &console, self.interrupts);
        Ok(done.map_err(RunError::with_nothing_kept)?.folder)
    }
}

/// Plans by scene; or why there are none.
type Plans = BTreeMap<String, Result<Vec<Plan>, String>>;

/// Takes the plans out of each recording, up to a step, and removes it.
fn taking_plans(steps: BTreeMap<String, u32>, found: Arc<Mutex<Plans>>) -> Onlooker {
    Box::new(move |folder: &Folder, part: &Part| {
        let Some(scene) = part.end.as_ref().map(|end| end.scene.clone()) else { return };
        let file = |kind: &str| folder.episodes().join(format!("{scene}.{kind}"));
        let until = steps.get(&scene).copied().unwrap_or(0);
        let plans = recording::load(&file("mcap")).map_err(|error| error.to_string()).and_then(|bytes| {
            let recorded = Recorded::read(&bytes).map_err(|error| error.to_string())?;
            recorded.plans(until).map_err(|error| error.to_string())
        });
        // What cannot be removed goes with the folder.
        let _ = fs::remove_file(file("mcap"));
        let _ = fs::remove_file(file("rrd"));
        let plans = plans.map_err(|why| format!("it could not be driven again: {why}"));
        found.lock().unwrap_or_else(PoisonError::into_inner).insert(scene, plans);
    })
}

/// The same planner with the log's own future; or why there is no such thing.
fn with_oracle(settings: &Settings) -> Result<Settings, &'static str> {
    let Some(node) = &settings.predictor else { return Err("has no predictions") };
    let plans_by_network = matches!(&settings.planner, Planner::Node(planner) if planner.name == "network");
    let predictor = match node.name.as_str() {
        "oracle" => return Err("has the log's own future already"),
        _ if settings.traffic.is_some() => {
            return Err("drives among agents that react: the log's future is not theirs");
        }
        "network" if plans_by_network => return Err("plans without looking at predictions"),
        // Where its plans begin, and what they cost, is the network's still.
        "network" => {
            let mut options = node.options.clone();
            options.extend(["--futures", "log"].map(str::to_owned));
            Node { reads_log: true, options, ..node.clone() }
        }
        _ => Node::named("oracle", true),
    };
    Ok(Settings { predictor: Some(predictor), ..settings.clone() })
}

fn is_same_driver(one: &Settings, other: &Settings) -> bool {
    (&one.planner, &one.predictor) == (&other.planner, &other.predictor)
}
