//! What a run decides: who drives which scene, what is started again, when it is over. No clock, no process, no bus: all of
//! that is behind [`Effects`], so that tests play a whole run with scripted failures.
//!
//! ```text
//! recorder:  starting ──▶ ready ──lost──▶ starting ──lost too often──▶ given up (the run goes on, unrecorded)
//!                           └──missed──▶ lost soon
//! worker:    starting ──▶ idle ──▶ driving ──▶ idle            every episode starts from a recorder and nodes that are
//!               ▲                    │ driver failed           known to be there: that is the start barrier
//!               └────────────────────┘
//! ```

use std::collections::VecDeque;

/// How often a scene is driven again because this program stood still.
const REPEATS: usize = 5;

/// How often in a row a part may fail to start before it is given up.
pub const TRIES: u32 = 3;

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// The recorder hears everything from here on.
    RecorderReady,
    /// The recorder cannot be started, or is gone.
    RecorderLost(String),
    /// A worker's nodes are there.
    NodesReady(usize),
    /// A worker's nodes cannot be started.
    NodesLost(usize, String),
    /// An episode is driven and stored.
    Driven {
        /// By whom.
        worker: usize,
        /// Whether its nodes did not answer as they must, so that they cannot be trusted with another.
        driver_failed: bool,
        /// Whether the recorder has all of it.
        recorded: bool,
        /// The recorder that was gone or mute at its end: that one will be told as lost, and until then no other episode begins.
        missed: Option<u32>,
    },
    /// An episode failed while this program stood still: that says nothing of the driver, and is not stored.
    Disturbed {
        /// By whom it was driven.
        worker: usize,
        /// Which.
        scene: usize,
        /// As of one that was driven.
        missed: Option<u32>,
    },
    /// The run cannot go on: a file that cannot be written.
    Broken(String),
    /// Somebody pressed Ctrl-C.
    Interrupted,
}

/// A scene to be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    /// Its place in the set.
    pub scene: usize,
    /// The number of the recorder that listens, if one does: how many were lost before it.
    pub recorder: Option<u32>,
    /// Whether it will be driven again if a pause of this program spoils it.
    pub repeatable: bool,
}

/// What the run does to the world. Nothing here waits: what comes of it is an [`Event`].
pub trait Effects {
    /// Starts the recorder, in the place of the one that is gone.
    fn start_recorder(&mut self);
    /// Starts a worker's nodes, in the place of those it has.
    fn start_nodes(&mut self, worker: usize);
    /// Makes a scene ready that somebody will drive next, if that is not under way.
    fn prepare(&mut self, scene: usize);
    /// Drives a scene.
    fn drive(&mut self, worker: usize, drive: Drive);
    /// Tells the user something that a table cannot.
    fn warn(&mut self, text: &str);
    /// Stops everything, now.
    fn halt(&mut self, ending: &Ending);
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Every scene has its episode.
    Complete,
    /// Ctrl-C.
    Interrupted,
    /// It could not go on, and why.
    Broken(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Recorder {
    NotWanted,
    Starting,
    Ready,
    /// A worker found it gone: its loss will be told.
    Missed,
    GivenUp,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Worker {
    Starting,
    Idle,
    Driving,
    GivenUp,
}

/// The state of a run.
#[derive(Debug)]
pub struct Core {
    /// Scenes that nobody has begun yet, in order.
    pending: VecDeque<usize>,
    /// What each worker is at.
    workers: Vec<Worker>,
    /// How often each worker's nodes failed to start, in a row.
    worker_losses: Vec<u32>,
    /// What the recorder is at.
    recorder: Recorder,
    /// How many recorders were lost before the present one.
    recorder_number: u32,
    /// How often the recorder was lost since it last had an episode whole.
    recorder_losses: u32,
    /// Scenes that a pause spoiled, as often as it did.
    spoiled: Vec<usize>,
    /// Whether any episode was driven: before that, a part that does not start is a mistake of the user's, to be told at once.
    proven: bool,
    /// How it ended, once it has.
    ending: Option<Ending>,
}

impl Core {
    /// A run over `scenes` by so many workers.
    #[must_use]
    pub fn new(scenes: Vec<usize>, workers: usize, record: bool) -> Self {
        let workers = workers.clamp(1, scenes.len().max(1));
        Self {
            pending: scenes.into(),
            workers: vec![Worker::Starting; workers],
            worker_losses: vec![0; workers],
            recorder: if record { Recorder::Starting } else { Recorder::NotWanted },
            recorder_number: 0,
            recorder_losses: 0,
            spoiled: Vec::new(),
            proven: false,
            ending: None,
        }
    }

    /// How many workers there are.
    #[must_use]
    pub fn workers(&self) -> usize {
        self.workers.len()
    }

    /// How it ended; none while it goes on.
    #[must_use]
    pub fn ending(&self) -> Option<&Ending> {
        self.ending.as_ref()
    }

    /// Sets everything going.
    pub fn start(&mut self, effects: &mut impl Effects) {
        if self.pending.is_empty() {
            return self.end(Ending::Complete, effects);
        }
        if self.recorder == Recorder::Starting {
            effects.start_recorder();
        }
        (0..self.workers.len()).for_each(|worker| effects.start_nodes(worker));
        self.pending.iter().take(self.workers.len()).for_each(|scene| effects.prepare(*scene));
    }

    /// Decides what follows from `event`.
    pub fn on(&mut self, event: Event, effects: &mut impl Effects) {
        if self.ending.is_some() {
            return;
        }
        match event {
            Event::Interrupted => return self.end(Ending::Interrupted, effects),
            Event::Broken(reason) => return self.end(Ending::Broken(reason), effects),
            Event::RecorderReady => self.recorder = Recorder::Ready,
            Event::RecorderLost(reason) => {
                self.recorder_number += 1;
                self.recorder_lost(reason, effects);
            }
            Event::NodesReady(worker) => {
                self.workers[worker] = Worker::Idle;
                self.worker_losses[worker] = 0;
            }
            Event::NodesLost(worker, reason) => self.nodes_lost(worker, reason, effects),
            Event::Disturbed { worker, scene, missed } => {
                effects.warn("this program stood still for a while: an episode that failed meanwhile is driven again");
                self.spoiled.push(scene);
                self.pending.push_front(scene);
                self.recorder_missed(missed);
                self.workers[worker] = Worker::Starting;
                effects.start_nodes(worker);
            }
            Event::Driven { worker, driver_failed, recorded, missed } => {
                self.proven = true;
                if recorded {
                    self.recorder_losses = 0;
                }
                self.recorder_missed(missed);
                self.workers[worker] = Worker::Idle;
                if driver_failed && !self.pending.is_empty() {
                    self.workers[worker] = Worker::Starting;
                    effects.start_nodes(worker);
                }
            }
        }
        self.dispatch(effects);
    }

    /// That it was missed may be told late: another has taken its place.
    fn recorder_missed(&mut self, missed: Option<u32>) {
        if self.recorder == Recorder::Ready && missed == Some(self.recorder_number) {
            self.recorder = Recorder::Missed;
        }
    }

    fn recorder_lost(&mut self, reason: String, effects: &mut impl Effects) {
        if !self.proven && self.recorder == Recorder::Starting {
            return self.end(Ending::Broken(reason), effects);
        }
        self.recorder_losses += 1;
        if self.recorder_losses < TRIES {
            effects.warn(&format!("{reason}; it is started again, the episodes of the moment have no whole recording"));
            self.recorder = Recorder::Starting;
            effects.start_recorder();
        } else {
            effects.warn(&format!("{reason}, {TRIES} times in a row: the run goes on without recordings"));
            self.recorder = Recorder::GivenUp;
        }
    }

    fn nodes_lost(&mut self, worker: usize, reason: String, effects: &mut impl Effects) {
        self.worker_losses[worker] += 1;
        if self.proven && self.worker_losses[worker] < TRIES {
            return effects.start_nodes(worker);
        }
        self.workers[worker] = Worker::GivenUp;
        if !self.proven || self.workers.iter().all(|worker| *worker == Worker::GivenUp) {
            self.end(Ending::Broken(reason), effects);
        } else {
            effects.warn(&format!("{reason}, {TRIES} times in a row: worker {worker} is given up, the others go on"));
        }
    }

    /// Hands scenes to whoever is free.
    fn dispatch(&mut self, effects: &mut impl Effects) {
        if self.ending.is_some() || matches!(self.recorder, Recorder::Starting | Recorder::Missed) {
            return;
        }
        let recorder = (self.recorder == Recorder::Ready).then_some(self.recorder_number);
        for worker in 0..self.workers.len() {
            if self.workers[worker] == Worker::Idle
                && let Some(scene) = self.pending.pop_front()
            {
                self.workers[worker] = Worker::Driving;
                let repeatable = self.spoiled.iter().filter(|spoiled| **spoiled == scene).count() < REPEATS;
                effects.drive(worker, Drive { scene, recorder, repeatable });
            }
        }
        if let Some(next) = self.pending.front() {
            effects.prepare(*next);
        }
        if self.pending.is_empty() && !self.workers.contains(&Worker::Driving) {
            self.end(Ending::Complete, effects);
        }
    }

    fn end(&mut self, ending: Ending, effects: &mut impl Effects) {
        effects.halt(&ending);
        self.ending = Some(ending);
    }
}
