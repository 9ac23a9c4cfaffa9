//! A run in which nothing is driven: at frames of each scene's log the nodes are asked for a plan, over the bus as in a drive, and the
//! plan is judged.
//!
//! Each frame is an episode of its own, of one observation: to the nodes it is the first step of a drive that starts there, with the two
//! seconds before it in the briefing. So they see the logged AV in its own history, which is what the authors' open-loop test shows their
//! network; and no frame knows of another.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

use evaluation::open_loop::row::Row;
use evaluation::open_loop::{Definitions, Moment, frames};
use results::folder::{Folder, Opened};
use results::settings::RunFile;
use scenarios::SceneSet;
use wire::cores::Cores;
use wire::proto::{EndReason, EpisodeEnd};
use world::plan::{Plan, Prediction};
use world::scene::Scene;

use super::clock::WallClock;
use super::console::Console;
use super::core::{Drive, Ending, Event};
use super::drive::Driver;
use super::interrupt::Interrupts;
use super::shared::Shared;
use super::worker::Worker;
use super::{RunError, State, begun, drive_all, reach};
use crate::request::Request;

/// What is judged, and what came of it.
#[derive(Debug)]
pub struct Frames {
    definitions: Definitions,
    /// The rows of each scene, by its place in the set.
    rows: Mutex<BTreeMap<usize, Vec<Row>>>,
}

/// The frames of all scenes under one driver.
#[derive(Debug)]
pub struct Judged {
    /// Who was asked, as a run's file says it.
    pub file: RunFile,
    /// In the order of the scenes, and of time.
    pub rows: Vec<Row>,
}

/// Asks the driver of `request` for plans at the frames of all scenes.
///
/// # Errors
/// [`RunError`] where that does not come to its end; nothing is kept then.
pub fn judge(
    request: &Request,
    definitions: Definitions,
    scenes: &SceneSet,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> Result<Judged, RunError> {
    let file = begun(request, scenes);
    // What nodes say is logged in a folder as that of any run, which goes with its figures taken.
    let place = tempfile::tempdir().map_err(results::files::at("create a folder in", &std::env::temp_dir()))?;
    let (Opened::New(folder) | Opened::Unfinished(folder) | Opened::Finished(folder)) =
        Folder::open(place.path(), &file)?;
    let cores = file.machine.pin.then(Cores::of_this_thread).transpose().map_err(RunError::Pin)?;
    let reach = reach(&file, false, console)?;
    let run = (scenes.clone(), file.clone(), folder);
    let shared = Arc::new(Shared {
        frames: Some(Frames { definitions, rows: Mutex::default() }),
        ..Shared::new(run, reach, cores, clock, console, interrupts.nodes())
    });
    let total = scenes.entries().len();
    let ending = drive_all(&shared, (0..total).collect(), total, interrupts);
    console.end();
    let nothing = || State { done: 0, scenes: total, shard: None, folder: place.path().to_owned() };
    match ending {
        Ending::Complete => {}
        Ending::Broken(reason) => return Err(RunError::Broken { reason, state: nothing() }),
        Ending::Interrupted => return Err(RunError::Interrupted { state: nothing() }),
    }
    let rows = shared.frames.as_ref().map(Frames::take).unwrap_or_default();
    let file = file.with_hashes((0..total).map(|at| shared.scenes.known_sha256(at).unwrap_or_default()));
    Ok(Judged { file, rows: rows.into_values().flatten().collect() })
}

impl Frames {
    fn take(&self) -> BTreeMap<usize, Vec<Row>> {
        std::mem::take(&mut *self.rows.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn store(&self, scene: usize, rows: Vec<Row>) {
        self.rows.lock().unwrap_or_else(PoisonError::into_inner).insert(scene, rows);
    }
}

/// What a scene's frames came to.
struct Asked {
    rows: Vec<Row>,
    /// Whether a plan failed to come.
    failed: bool,
    /// Whether the nodes are gone, and could not be started again.
    lost: bool,
}

impl Worker<'_> {
    /// Asks for plans at all frames of a scene and stores what they are worth; none where the run is stopped before that.
    pub(super) fn judge(&mut self, Drive { scene, repeatable, .. }: Drive, frames: &Frames) -> Option<Event> {
        let shared = self.shared;
        let asked = match shared.scenes.load_hashed(scene) {
            Err(error) => {
                let id = shared.scenes.entries()[scene].id.as_str();
                let row = Row { failure: error.to_string(), ..Row::of(id, 0) };
                Asked { rows: vec![row], failed: false, lost: false }
            }
            Ok((loaded, _)) => {
                let _log = shared.logs.open(&loaded);
                self.ask_at_all_frames(&loaded, frames.definitions)?
            }
        };
        if self.stood_still() && asked.failed && repeatable {
            return Some(Event::Disturbed { worker: self.number, scene, missed: None });
        }
        frames.store(scene, asked.rows);
        Some(Event::Driven { worker: self.number, driver_failed: asked.lost, recorded: false, missed: None })
    }

    fn ask_at_all_frames(&mut self, scene: &Arc<Scene>, definitions: Definitions) -> Option<Asked> {
        let mut asked = Asked { rows: Vec::new(), failed: false, lost: false };
        for frame in frames(scene.steps()) {
            if self.shared.stop.load(Ordering::Relaxed) {
                return None;
            }
            let moment = match Moment::new(scene, definitions, frame) {
                Ok(moment) => moment,
                Err(error) => {
                    let row = Row { failure: error.to_string(), ..Row::of(scene.id().as_str(), frame) };
                    asked.rows.push(row);
                    continue;
                }
            };
            let answer = if asked.lost { Err("its worker has no nodes".to_owned()) } else { self.ask(scene, &moment) };
            let row = match answer {
                Ok((plan, prediction)) => moment.judge(&plan, prediction.as_ref()),
                Err(reason) => {
                    asked.failed = true;
                    // Whoever did not answer as it must is not asked again, as in a run.
                    asked.lost = asked.lost || self.start_nodes().is_err();
                    moment.without_plan(reason)
                }
            };
            asked.rows.push(row);
        }
        Some(asked)
    }

    /// The plan at a moment, and what was predicted for it.
    fn ask(&mut self, scene: &Arc<Scene>, moment: &Moment) -> Result<(Plan, Option<Prediction>), String> {
        let protocol = self.shared.file.settings.protocol.name().to_owned();
        let mut driver = self.driver(scene, None)?;
        let mut end = EpisodeEnd {
            scene: scene.id().to_string(),
            protocol,
            reason: EndReason::Horizon.into(),
            detail: "one plan was asked for".to_owned(),
            ..EpisodeEnd::default()
        };
        let answer = driver
            .brief(&moment.briefing())
            .and_then(|()| driver.answer(&moment.observation()))
            .and_then(|plan| driver.dismiss(&end).map(|()| plan));
        if let Err(reason) = &answer {
            end.set_reason(EndReason::DriverFailed);
            end.detail.clone_from(reason);
        }
        // Nobody records: there is nothing that could fail.
        let _ = driver.end(&[], &mut end);
        Ok((answer?, driver.driver.prediction.take()))
    }
}
