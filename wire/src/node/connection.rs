//! The session of a node: it subscribes, then shows its token, and leaves when there is a reason to.

use std::io::Read;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use prost::Message as _;
use thiserror::Error;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Subscriber;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use crate::convert::{decode, shown};
use crate::keys::{self, Address, Answering, Channel, KeyError, NodeId, Place, Role, RunName, Secret, Worker, Workers};
use crate::session::{self, SessionError, ZenohFile, ZenohFileError};
use crate::{WIRE_VERSION, proto};

/// How long a node waits for the run to show itself.
const RUN_TIMEOUT: Duration = Duration::from_secs(10);

/// How often it asks for the run's settings meanwhile.
const INFO_INTERVAL: Duration = Duration::from_millis(20);

/// How long a session may take to close.
const CLOSING: Duration = Duration::from_millis(500);

/// How a node finds its run. `sim run` gives these to the nodes that it starts, as arguments and in the environment; the secret
/// in the environment alone.
#[derive(Clone, Debug, clap::Parser)]
pub struct Options {
    /// Where the simulator listens, like tcp/127.0.0.1:7447
    #[arg(long, env = "RELOOP_ENDPOINT", value_name = "ENDPOINT")]
    pub endpoint: String,
    /// Name of the run
    #[arg(long, env = "RELOOP_RUN", value_name = "NAME")]
    pub run: RunName,
    /// Worker to serve; * serves all
    #[arg(long, env = "RELOOP_WORKER", value_name = "WORKER", default_value = "*")]
    pub worker: Workers,
    /// Name of this node, for people; made of the process number where it is not said
    #[arg(long, env = "RELOOP_NAME", value_name = "NAME")]
    pub name: Option<String>,
    /// What it must know to be let in, from the environment: RELOOP_SECRET.
    #[arg(skip = Secret::of_this_process())]
    pub secret: Option<Secret>,
    /// A Zenoh configuration (JSON5) with this node's certificate, to connect to another host by TLS; docs/hosts.md has examples
    #[arg(long, env = "RELOOP_ZENOH_CONFIG", value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
    /// Leave when standard input ends, so that nothing outlives the process that started this one
    #[arg(long, env = "RELOOP_EXIT_WITH_PARENT")]
    pub exit_with_parent: bool,
}

/// Why a node left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Ctrl-C, or the signal to terminate.
    Interrupted,
    /// Standard input ended.
    ParentGone,
    /// The simulator left or died.
    SimGone,
}

/// Why a node cannot join a run.
#[derive(Debug, Error)]
pub enum NodeError {
    /// Its session failed.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Its Zenoh configuration cannot be used.
    #[error(transparent)]
    ZenohFile(#[from] ZenohFileError),
    /// A name cannot be part of a key.
    #[error(transparent)]
    Name(#[from] KeyError),
    /// There is a simulator, but not of this run.
    #[error("no run {run} at {endpoint} within {} s\n  hint: `sim run -v` names its run and its endpoint in its log", RUN_TIMEOUT.as_secs())]
    NoRun {
        /// The run.
        run: RunName,
        /// Where.
        endpoint: String,
    },
    /// The planner would wait for predictions that nobody makes.
    #[error(
        "this planner needs a predictor, and run {run} has none\n  hint: give it one with `sim run --predictor ctrv`"
    )]
    NoPredictor {
        /// The run.
        run: RunName,
    },
    /// The simulator is of another build.
    #[error(
        "the simulator speaks version {theirs} of the messages, this node version {ours}\n  hint: build both from the same revision"
    )]
    WrongVersion {
        /// Its version.
        theirs: u32,
        /// Ours.
        ours: u32,
    },
    /// The simulator does not let it in.
    #[error("{node} is refused: {reason}{}", refusal_hint(*.told_secret))]
    Refused {
        /// This node.
        node: String,
        /// Why, as the simulator says.
        reason: String,
        /// Whether this node was told a secret.
        told_secret: bool,
    },
    /// There is the simulator of this run, and it says nothing to this node: no seat of it has this secret.
    #[error(
        "the simulator of run {run} at {endpoint} does not know this node: nobody let it in within {} s\n  hint: is RELOOP_SECRET what `sim run` said? Each \
         run has another, unless you set it for the simulator too",
        RUN_TIMEOUT.as_secs()
    )]
    Unknown {
        /// The run.
        run: RunName,
        /// Where.
        endpoint: String,
    },
    /// The signal handler could not be set.
    #[error("cannot listen for Ctrl-C: {0}")]
    Signals(String),
}

fn refusal_hint(told_secret: bool) -> &'static str {
    if told_secret {
        "\n  hint: whoever runs the simulator decides it; its log says the same"
    } else {
        "\n  hint: `sim run` says the secret of a planner that it waits for; put it into RELOOP_SECRET"
    }
}

/// A node's place on the bus. Subscribe first, then [`Connection::serve`].
pub struct Connection {
    options: Options,
    place: Place,
    session: Session,
    /// Whether the simulator has let this node in. Until then it may hear what is told another, and has no answer to it.
    admitted: Arc<AtomicBool>,
    /// Kept because dropping them ends them.
    subscribers: Mutex<Vec<Subscriber<()>>>,
}

/// What the watchers of a node tell it.
enum Notice {
    Sim { version: u32 },
    Admission(proto::Admission),
    Stop(Stop),
}

impl Connection {
    /// Connects to the simulator. By TLS the program is first started anew in its own place, with one thread for the bus
    /// ([`session::settle_for`]).
    ///
    /// # Errors
    /// [`NodeError`] where there is none.
    pub fn open(options: &Options) -> Result<Self, NodeError> {
        let place = match &options.secret {
            Some(secret) => Place::seat(&options.run, secret)?,
            None => Place::open_floor(&options.run),
        };
        let zenoh_file = options.zenoh_config.as_deref().map(ZenohFile::read).transpose()?;
        session::settle_for(&options.endpoint);
        let session = session::open_client_with(&options.endpoint, zenoh_file.as_ref())?;
        let (admitted, subscribers) = (Arc::default(), Mutex::default());
        Ok(Self { options: options.clone(), place, session, admitted, subscribers })
    }

    /// What this node answers with.
    #[must_use]
    pub fn voice(&self) -> Voice {
        Voice { place: self.place.clone(), session: self.session.clone() }
    }

    /// What the run is: asks the simulator until it says so.
    ///
    /// # Errors
    /// [`NodeError::NoRun`] where nobody answers, [`NodeError::Session`] where the bus fails.
    pub fn run_info(&self) -> Result<proto::RunInfo, NodeError> {
        let Options { run, endpoint, .. } = &self.options;
        let until = Instant::now() + RUN_TIMEOUT;
        while Instant::now() < until {
            let replies = self.session.get(keys::info(run)).timeout(RUN_TIMEOUT).wait();
            let mut replies = replies.map_err(SessionError::bus("ask for the run's settings"))?.into_iter();
            if let Some(sample) = replies.find_map(|reply| reply.into_result().ok()) {
                let info = proto::RunInfo::decode(&*sample.payload().to_bytes());
                let wrong = |e: prost::DecodeError| SessionError::bus("read the run's settings")(e.into());
                return Ok(info.map_err(wrong)?);
            }
            // The simulator is on the bus a moment before it has settings to tell.
            std::thread::sleep(INFO_INTERVAL);
        }
        Err(NodeError::NoRun { run: run.clone(), endpoint: endpoint.clone() })
    }

    /// Hears all that the simulator tells of `channels` of its workers' episodes, in order; `end` is an episode's last. This
    /// is for recorders and viewers: a listener that falls behind does not hold up the drives, and is cut off if it reads
    /// nothing for a deadline.
    ///
    /// `hear` is called by the transport: while it blocks, nothing else is heard.
    ///
    /// # Errors
    /// [`NodeError::Session`].
    pub fn subscribe(
        &self,
        channels: &[Channel],
        hear: impl Fn(Address, ZBytes) + Clone + Send + Sync + 'static,
    ) -> Result<(), NodeError> {
        for channel in channels {
            let hear = hear.clone();
            self.listen(self.place.tape_channel(&self.options.worker, *channel), move |key, payload| {
                if let Some(address) = Address::parse(key) {
                    hear(address, payload);
                }
            })?;
        }
        Ok(())
    }

    /// Hears what the simulator tells this node of its workers' episodes, in order. While `hear` works, nothing else is heard.
    pub(super) fn hear_told(&self, hear: impl Fn(Worker, ZBytes) + Send + Sync + 'static) -> Result<(), NodeError> {
        let admitted = Arc::clone(&self.admitted);
        self.listen(self.place.told(&self.options.worker), move |key, payload| {
            if let Some(worker) = Place::told_of(key).filter(|_| admitted.load(Ordering::Relaxed)) {
                hear(worker, payload);
            }
        })
    }

    fn listen(&self, key: String, hear: impl Fn(&str, ZBytes) + Send + Sync + 'static) -> Result<(), NodeError> {
        let subscriber = self.session.declare_subscriber(key);
        let subscriber = subscriber.callback(move |sample| hear(sample.key_expr().as_str(), sample.payload().clone()));
        let subscriber = subscriber.wait().map_err(SessionError::bus("subscribe"))?;
        self.subscribers.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(subscriber);
        Ok(())
    }

    /// Shows the token of `role`, and returns when the simulator leaves, when Ctrl-C comes, or, where that was asked for,
    /// when standard input ends.
    ///
    /// # Errors
    /// [`NodeError`] where the run is not there, of another version, or does not let this node in.
    pub fn serve(self, role: Role) -> Result<Stop, NodeError> {
        let name = self.options.name.clone().unwrap_or_else(|| format!("{role}-{}", std::process::id()));
        let node = NodeId::new(role, self.options.worker.clone(), &name, &self.session.zid().to_string())?;
        let (notify, notices) = sync_channel(16);
        self.stop_on_signals(&notify)?;
        let (door, admitted) = (notify.clone(), Arc::clone(&self.admitted));
        self.listen(self.place.door(&self.session.zid().to_string()), move |_, payload| {
            if let Ok(word) = decode::<proto::Admission>(&payload.to_bytes()) {
                admitted.store(word.accepted, Ordering::Relaxed);
                let _ = door.try_send(Notice::Admission(word));
            }
        })?;
        let _watch = self.watch_sim(&notify)?;
        if self.options.exit_with_parent {
            watch_standard_input(notify);
        }
        // Subscribers stand: the simulator may count on this node from here on.
        let token = self.session.liveliness().declare_token(node.key(&self.place)).wait();
        let _token = token.map_err(SessionError::bus("declare the token"))?;
        let result = self.wait(&node, &notices);
        self.close();
        result
    }

    /// Listens on without a seat, and returns when the simulator leaves, when Ctrl-C comes, or, where that was asked for, when standard input
    /// ends; `lull` later, for what is still on its way. Nothing is heard any more then.
    ///
    /// # Errors
    /// [`NodeError`] where the run is not there, or of another version.
    pub fn stay(self, lull: Duration) -> Result<Stop, NodeError> {
        let (notify, notices) = sync_channel(16);
        self.stop_on_signals(&notify)?;
        let watch = self.watch_sim(&notify)?;
        if self.options.exit_with_parent {
            watch_standard_input(notify);
        }
        let stop = loop {
            match notices.recv() {
                Ok(Notice::Sim { version }) if version != WIRE_VERSION => {
                    return Err(NodeError::WrongVersion { theirs: version, ours: WIRE_VERSION });
                }
                Ok(Notice::Stop(stop)) => break stop,
                Ok(Notice::Sim { .. } | Notice::Admission(_)) => {}
                // Every sender gone means that the session is: so is the simulator.
                Err(_) => break Stop::SimGone,
            }
        };
        std::thread::sleep(lull);
        drop(watch);
        self.close();
        Ok(stop)
    }

    /// Closes the session. A planner that is deep in thought holds the transport's thread: it is not waited for, and ends with the process.
    fn close(self) {
        let (closed, end) = sync_channel(1);
        std::thread::spawn(move || {
            if let Err(e) = self.session.close().wait() {
                tracing::debug!("closing the session: {e}");
            }
            drop(self);
            let _ = closed.try_send(());
        });
        let _ = end.recv_timeout(CLOSING);
    }

    fn wait(&self, node: &NodeId, notices: &Receiver<Notice>) -> Result<Stop, NodeError> {
        let Options { run, endpoint, .. } = &self.options;
        let first = notices.recv_timeout(RUN_TIMEOUT);
        let mut next =
            first.map_err(|_: RecvTimeoutError| NodeError::NoRun { run: run.clone(), endpoint: endpoint.clone() });
        // Whoever sits on the open floor is told nothing unless it is refused.
        let mut is_let_in = self.place.is_open();
        loop {
            match next? {
                Notice::Stop(stop) => return Ok(stop),
                Notice::Sim { version } if version != WIRE_VERSION => {
                    return Err(NodeError::WrongVersion { theirs: version, ours: WIRE_VERSION });
                }
                Notice::Sim { .. } => {}
                Notice::Admission(word) if word.accepted => {
                    is_let_in = true;
                    tracing::info!("serving run {run} at {endpoint}");
                }
                Notice::Admission(word) => {
                    let (node, reason) = (node.to_string(), shown(&word.reason));
                    return Err(NodeError::Refused { node, reason, told_secret: !self.place.is_open() });
                }
            }
            // Every sender gone means that the session is: so is the simulator.
            let gone = Notice::Stop(Stop::SimGone);
            next = if is_let_in {
                Ok(notices.recv().unwrap_or(gone))
            } else {
                match notices.recv_timeout(RUN_TIMEOUT) {
                    Err(RecvTimeoutError::Timeout) => {
                        Err(NodeError::Unknown { run: run.clone(), endpoint: endpoint.clone() })
                    }
                    notice => Ok(notice.unwrap_or(gone)),
                }
            };
        }
    }

    fn watch_sim(&self, notify: &SyncSender<Notice>) -> Result<Subscriber<()>, NodeError> {
        let notify = notify.clone();
        let watch = self
            .session
            .liveliness()
            .declare_subscriber(self.place.sim())
            .history(true)
            .callback(move |sample| {
                let Some(sim) = NodeId::parse(sample.key_expr().as_str()) else { return };
                let notice = match sample.kind() {
                    SampleKind::Put => Notice::Sim { version: sim.version },
                    SampleKind::Delete => Notice::Stop(Stop::SimGone),
                };
                // Full: there is a notice to stop among those that wait.
                let _ = notify.try_send(notice);
            })
            .wait();
        Ok(watch.map_err(SessionError::bus("watch the simulator"))?)
    }

    fn stop_on_signals(&self, notify: &SyncSender<Notice>) -> Result<(), NodeError> {
        let notify = notify.clone();
        let set = ctrlc::set_handler(move || {
            let _ = notify.try_send(Notice::Stop(Stop::Interrupted));
        });
        match set {
            // Another node of this process has it; tests do that.
            Ok(()) | Err(ctrlc::Error::MultipleHandlers) => Ok(()),
            Err(e) => Err(NodeError::Signals(e.to_string())),
        }
    }
}

/// What a node speaks with: only what it says with this is its answer.
#[derive(Clone)]
pub struct Voice {
    place: Place,
    session: Session,
}

impl Voice {
    /// The key under which this node answers on `channel` about the episodes of `worker`.
    #[must_use]
    pub fn key(&self, worker: &Worker, channel: Channel) -> String {
        self.place.answer(&Answering { worker: worker.clone(), channel, session: self.session.zid().to_string() })
    }

    /// Says it, to the simulator.
    ///
    /// # Errors
    /// [`SessionError::Bus`] where the session is closed.
    pub fn say(&self, worker: &Worker, channel: Channel, message: Vec<u8>) -> Result<(), SessionError> {
        session::send(&self.session, &self.key(worker, channel), message)
    }

    /// What the simulator answers who asks for a message of the tape, as an episode's scene; none within `patience`.
    #[must_use]
    pub fn ask(&self, address: &Address, patience: Duration) -> Option<Vec<u8>> {
        let replies = self.session.get(self.place.tape(address)).timeout(patience).wait().ok()?;
        let sample = replies.into_iter().find_map(|reply| reply.into_result().ok())?;
        Some(sample.payload().to_bytes().into_owned())
    }

    /// The session that it speaks in.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }
}

/// Nothing is ever written there; it ends when the parent closes it or dies.
fn watch_standard_input(notify: SyncSender<Notice>) {
    std::thread::spawn(move || {
        let mut buffer = [0; 64];
        while matches!(std::io::stdin().read(&mut buffer), Ok(1..)) {}
        let _ = notify.try_send(Notice::Stop(Stop::ParentGone));
    });
}
