//! One episode as a run would drive it, by nodes or in this process, for whoever has it in hand: nothing of it is stored.

use std::sync::atomic::AtomicBool;

use episode::Episode;
use results::files::at;
use results::folder::{Folder, Opened};
use scenarios::{SceneSet, SetError};
use thiserror::Error;
use world::plan::Plan;

use super::beginning::{Beginning, NotBegun};
use super::clock::WallClock;
use super::console::Console;
use super::line::LineDriver;
use super::process::Groups;
use super::shared::Shared;
use super::witness::Witness;
use super::worker::Worker;
use super::{RunError, begun, reach};
use crate::request::Request;

/// An episode that cannot be driven.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum NotDriven {
    #[error(transparent)]
    Run(#[from] RunError),
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error("there is no scene {0} in these sets\nhint: `sim status --offer` lists the scenes of each")]
    NoScene(String),
    #[error("the scene cannot be driven: {0}")]
    NotBegun(#[from] NotBegun),
    #[error("{0}")]
    Nodes(String),
}

/// Gives `hand` the episode of `scene`, its driver, and what is set when it is to stop. `lead` is driven before the driver's own plans.
///
/// # Errors
/// [`NotDriven`].
pub fn one<T>(
    request: &Request,
    scene: &str,
    lead: Vec<Plan>,
    (clock, console, groups): (WallClock, &Console, &Groups),
    hand: impl FnOnce(Episode, &mut Witness<'_, LineDriver>, &AtomicBool) -> T,
) -> Result<T, NotDriven> {
    let set = SceneSet::open(&request.machine.scenarios)?;
    let place = set.entries().iter().position(|entry| entry.id.as_str() == scene);
    let set = set.only(&[place.ok_or_else(|| NotDriven::NoScene(scene.to_owned()))?]);
    let (loaded, _) = set.load_hashed(0)?;
    let file = begun(request, &set);
    // What nodes say is logged in a folder as that of any run, which goes with the episode.
    let temporary =
        tempfile::tempdir().map_err(at("create a folder in", &std::env::temp_dir())).map_err(RunError::from)?;
    let (Opened::New(folder) | Opened::Unfinished(folder) | Opened::Finished(folder)) =
        Folder::open(temporary.path(), &file).map_err(RunError::from)?;
    let reach = reach(&file, false, console)?;
    let shared = Shared::new((set, file, folder), reach, None, clock, console, groups);
    let _log = shared.logs.open(&loaded);
    let begun = Beginning::default().begin(
        &loaded,
        &request.settings.protocol,
        request.settings.traffic.as_ref().map(|traffic| &traffic.hand_over),
    )?;
    let mut worker = Worker::new(0, &shared);
    worker.start_nodes().map_err(NotDriven::Nodes)?;
    let mut driver = worker.driver(&begun.scene, None).map_err(NotDriven::Nodes)?;
    driver.driver.lead_by(lead);
    Ok(hand(begun.episode, &mut driver, &shared.stop))
}
