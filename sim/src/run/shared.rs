//! What all workers of a run share, and how programs are started on its bus.

use std::cell::RefCell;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use results::folder::Folder;
use results::part::Part;
use results::settings::RunFile;
use results::trace::Trace;
use scenarios::SceneSet;
use wire::cores::Cores;
use wire::hub::{BarrierError, Hub, Minds, Seat};

use super::beginning::Beginnings;
use super::bus_threads;
use super::calling;
use super::clock::WallClock;
use super::console::Console;
use super::frames::Frames;
use super::in_process::DrivenLogs;
use super::process::{Groups, Process, program};
use super::ready::Ahead;
use super::scene_index::SceneIndex;
use super::voice::Voice;

/// No recorder has this number.
const NO_RECORDER: u64 = u64::MAX;

/// Who looks at each episode when it is stored, and at its files.
pub type Onlooker = Box<dyn Fn(&Folder, &Part) + Send + Sync>;

/// What all workers share. Nothing of it changes during a run, but for `stop`, the recorder and the groups.
pub struct Shared {
    /// Where the scenes come from.
    pub scenes: SceneSet,
    /// Who drives, and by which rules.
    pub file: RunFile,
    /// What each episode says that it is of, see [`RunFile::identity`].
    pub identity: String,
    /// Where finished episodes go.
    pub folder: Folder,
    /// How episodes begin that are not their driver's from the first step on.
    pub beginnings: Beginnings,
    /// Who looks at each episode when it is stored.
    pub onlooker: Option<Onlooker>,
    /// By which plans take effect, or did in the drives that are led by others.
    pub trace: Option<Trace>,
    /// Where figures go, if nothing is driven: plans are asked for at frames of the log, and judged.
    pub frames: Option<Frames>,
    /// The bus; none where nobody is on it.
    pub hub: Option<Hub>,
    /// Who drives in this process, in the place of nodes.
    pub minds: Option<Minds>,
    /// What they may know of the log.
    pub logs: Arc<DrivenLogs>,
    /// The place of a planner that somebody else starts, and that serves all workers.
    pub external: Option<Arc<Seat>>,
    /// The place of the recorder that runs.
    pub recorder: Mutex<Option<Arc<Seat>>>,
    /// The number of the last recorder that a worker found gone or mute, else `NO_RECORDER`: it is replaced, so that this costs once.
    pub missed_recorder: AtomicU64,
    /// The cores, if each worker keeps to one of them with its nodes.
    pub cores: Option<Cores>,
    /// Since the program began.
    pub clock: WallClock,
    /// Where nodes' lines go.
    pub console: Console,
    /// The planners and predictors that run, to be ended by whoever ends the run.
    pub groups: Groups,
    /// Set when nothing more is to be begun or stored.
    pub stop: AtomicBool,
    /// Where nodes that read the log find the scenes.
    pub index: SceneIndex,
    /// Scenes that are made ready while others are driven.
    pub ahead: Ahead,
}

/// What drivers are reached by.
#[derive(Default)]
pub struct Reach {
    /// The bus; none where nobody is on it.
    pub hub: Option<Hub>,
    /// The place of a planner that somebody else starts.
    pub external: Option<Arc<Seat>>,
    /// Who drives in this process.
    pub minds: Option<Minds>,
    /// What they may know of the log.
    pub logs: Arc<DrivenLogs>,
}

impl Shared {
    /// What workers share in a run in which every episode is its driver's from the first step on, and nobody looks on.
    pub fn new(
        (scenes, file, folder): (SceneSet, RunFile, Folder),
        Reach { hub, external, minds, logs }: Reach,
        cores: Option<Cores>,
        clock: WallClock,
        console: &Console,
        groups: &Groups,
    ) -> Self {
        Self {
            scenes,
            identity: file.identity(),
            file,
            folder,
            beginnings: Beginnings::default(),
            onlooker: None,
            trace: None,
            frames: None,
            hub,
            minds,
            logs,
            external,
            recorder: Mutex::default(),
            missed_recorder: AtomicU64::new(NO_RECORDER),
            cores,
            clock,
            console: console.clone(),
            groups: groups.clone(),
            stop: AtomicBool::new(false),
            index: SceneIndex::default(),
            ahead: Ahead::default(),
        }
    }

    /// Starts a program of the workspace on the bus.
    ///
    /// # Errors
    /// Why not, as a sentence.
    pub fn start_program(
        &self,
        name: &str,
        process: &str,
        arguments: &[&str],
        seat: &Seat,
        groups: &Groups,
    ) -> Result<Process, String> {
        let mut command = Command::new(program(name).map_err(|error| error.to_string())?);
        command.args(arguments);
        bus_threads::set(&mut command, Some(1));
        self.start_command(process, command, seat, groups)
    }

    pub(super) fn start_command(
        &self,
        process: &str,
        mut command: Command,
        seat: &Seat,
        groups: &Groups,
    ) -> Result<Process, String> {
        calling::to_seat(&mut command, self.hub()?, seat);
        // The logs of a worker's nodes are one: what they say belongs together.
        let log = process.rsplit(' ').next().unwrap_or(process);
        let voice = Voice::new(process, &self.console, self.folder.logs().join(format!("{log}.log")));
        Process::start(process, command, groups, voice).map_err(|error| error.to_string())
    }

    /// The bus.
    ///
    /// # Errors
    /// That there is none, as a sentence.
    pub fn hub(&self) -> Result<&Hub, String> {
        self.hub.as_ref().ok_or_else(|| "this run has no bus".to_owned())
    }

    /// How often this process stood still.
    pub fn pauses(&self) -> u64 {
        self.hub.as_ref().map_or(0, Hub::pauses)
    }

    /// The place of the recorder that runs.
    pub(super) fn recorder(&self) -> Option<Arc<Seat>> {
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until a node is on the bus; `process` is looked at meanwhile, if the sim started it.
    ///
    /// # Errors
    /// Why it will not come, as a sentence.
    pub fn wait_for(&self, seat: &Seat, process: Option<&mut Process>) -> Result<(), String> {
        let name = process.as_ref().map(|process| process.name().to_owned());
        let process = RefCell::new(process);
        let gone = || process.borrow_mut().as_mut().and_then(|process| process.gone());
        let cancelled = || self.stop.load(Ordering::Relaxed) || gone().is_some();
        match self.hub()?.wait_for_nodes(&[seat], self.file.machine.start_timeout(), &cancelled) {
            Ok(()) => Ok(()),
            Err(error) => Err(match (gone(), name) {
                (Some(how), Some(name)) => format!("{name} {how} before it was on the bus"),
                _ if matches!(error, BarrierError::Missing { .. }) => {
                    format!("{error}\nhint: give it more time with --start-timeout; what it says itself stands above")
                }
                _ => error.to_string(),
            }),
        }
    }
}
