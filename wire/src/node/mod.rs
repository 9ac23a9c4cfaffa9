//! To write a planner or a predictor: implement [`Planner`] and [`PlannerFactory`] (or [`Predictor`] and
//! [`PredictorFactory`]) and call [`serve_planner`] (or [`serve_predictor`]). The rest is done here: the session, the
//! barrier, one thread for each worker, the agents' history, an honest refusal where the planner fails or panics, and a
//! clean end when the run ends.
//!
//! | file | what |
//! | --- | --- |
//! | `mod.rs` | the traits, and serving |
//! | `connection.rs` | the session of a node: token, watch over the simulator, reasons to stop |
//! | `desk.rs` | one worker's episodes, without IO: messages in, answers out |
//! | `history.rs` | what was seen so far |

mod connection;
pub(crate) mod desk;
mod history;

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use prost::Message as _;
use world::observation::{Briefing, Observation};
use world::plan::{Prediction, UncheckedPlan, UncheckedPrediction};
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::{Session, Wait};

pub use connection::{Connection, NodeError, Options, Stop};
use desk::{Desk, Mind, Service};
pub use history::History;

use crate::keys::{Address, Channel, Role, RunName, Worker};
use crate::proto;
use crate::session::{self, SessionError};
use crate::waiting;

/// All that is known at a step.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// What was told before the first step.
    pub briefing: &'a Briefing,
    /// What is to be seen now.
    pub observation: &'a Observation,
    /// What was seen before, this step included.
    pub history: &'a History,
    /// What the predictor expects; only for planners that asked for it.
    pub prediction: Option<&'a Prediction>,
}

/// Plans for one episode.
pub trait Planner: Send {
    /// The plan for this step.
    ///
    /// # Errors
    /// A sentence on why there is none; the episode ends as failed with it.
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String>;
}

/// Makes a planner for each episode.
pub trait PlannerFactory: Send + Sync {
    /// A planner for the episode of `briefing`.
    ///
    /// # Errors
    /// A sentence on why there can be none; the episode ends as failed with it.
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String>;

    /// Whether its planners are called only once the step's prediction is there. A run without a predictor is refused then.
    fn needs_prediction(&self) -> bool {
        false
    }
}

/// Predicts for one episode.
pub trait Predictor: Send {
    /// The prediction for this step.
    ///
    /// # Errors
    /// A sentence on why there is none; the episode ends as failed with it.
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String>;
}

/// Makes a predictor for each episode.
pub trait PredictorFactory: Send + Sync {
    /// A predictor for the episode of `briefing`.
    ///
    /// # Errors
    /// A sentence on why there can be none; the episode ends as failed with it.
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String>;
}

/// Answers observations with plans until the run ends or the node is told to stop.
///
/// # Errors
/// [`NodeError`] where the run cannot be joined.
pub fn serve_planner(options: &Options, factory: Arc<dyn PlannerFactory>) -> Result<Stop, NodeError> {
    serve(options, Arc::new(Planners(factory)))
}

/// Answers observations with predictions until the run ends or the node is told to stop.
///
/// # Errors
/// [`NodeError`] where the run cannot be joined.
pub fn serve_predictor(options: &Options, factory: Arc<dyn PredictorFactory>) -> Result<Stop, NodeError> {
    serve(options, Arc::new(Predictors(factory)))
}

struct Planners(Arc<dyn PlannerFactory>);

impl Service for Planners {
    fn role(&self) -> Role {
        Role::Planner
    }

    fn needs_prediction(&self) -> bool {
        self.0.needs_prediction()
    }

    fn start(&self, briefing: &Briefing) -> Result<Mind, String> {
        let mut planner = self.0.start(briefing)?;
        Ok(Box::new(move |step| planner.plan(step).map(|plan| proto::Plan::from(&plan).encode_to_vec())))
    }

    fn refusal(&self, step: u32, error: String) -> Vec<u8> {
        proto::Plan { step, error, ..Default::default() }.encode_to_vec()
    }
}

struct Predictors(Arc<dyn PredictorFactory>);

impl Service for Predictors {
    fn role(&self) -> Role {
        Role::Predictor
    }

    fn needs_prediction(&self) -> bool {
        false
    }

    fn start(&self, briefing: &Briefing) -> Result<Mind, String> {
        let mut predictor = self.0.start(briefing)?;
        Ok(Box::new(move |step| predictor.predict(step).map(|p| proto::Prediction::from(&p).encode_to_vec())))
    }

    fn refusal(&self, step: u32, error: String) -> Vec<u8> {
        proto::Prediction { step, error, ..Default::default() }.encode_to_vec()
    }
}

fn serve(options: &Options, service: Arc<dyn Service>) -> Result<Stop, NodeError> {
    let connection = Connection::open(options)?;
    let mut channels = vec![Channel::Scene, Channel::Observation, Channel::End];
    if service.needs_prediction() {
        // Said now, or every episode would end in silence at its first deadline.
        if !connection.run_info()?.predictor {
            return Err(NodeError::NoPredictor { run: options.run.clone() });
        }
        channels.push(Channel::Prediction);
    }
    let role = service.role();
    let desks = Desks { run: options.run.clone(), session: connection.session(), service, queues: Mutex::default() };
    let desks = Arc::new(desks);
    connection.subscribe_live(&channels, move |address, payload| desks.hand(address, payload))?;
    connection.serve(role)
}

/// Messages that may wait for a worker's thread. An honest simulator sends an observation and waits for the answer.
const QUEUE: usize = 256;

/// How long a node waits for the scene of an episode that it joined late.
const SCENE_QUERY: Duration = Duration::from_secs(3);

/// The threads of the workers that this node serves.
struct Desks {
    run: RunName,
    session: Session,
    service: Arc<dyn Service>,
    /// A worker's thread ends when its sender is dropped with this map.
    queues: Mutex<BTreeMap<Worker, SyncSender<(Address, ZBytes)>>>,
}

impl Desks {
    /// Hands a message to the thread of its worker. Called by the transport: never blocks.
    fn hand(&self, address: Address, payload: ZBytes) {
        let mut queues = self.queues.lock().unwrap_or_else(PoisonError::into_inner);
        let queue = queues.entry(address.worker.clone()).or_insert_with(|| self.start_thread());
        if let Err(TrySendError::Full((address, _))) = queue.try_send((address, payload)) {
            tracing::error!(
                "{} messages wait unread: {} of {} is dropped",
                QUEUE,
                address.channel.name(),
                address.scene
            );
        }
    }

    fn start_thread(&self) -> SyncSender<(Address, ZBytes)> {
        let (sender, receiver) = sync_channel(QUEUE);
        let (run, session, desk) = (self.run.clone(), self.session.clone(), Desk::new(Arc::clone(&self.service)));
        std::thread::spawn(move || attend(&run, &session, desk, &receiver));
        sender
    }
}

/// A worker's thread.
fn attend(run: &RunName, session: &Session, mut desk: Desk, messages: &Receiver<(Address, ZBytes)>) {
    let mut answers: Option<(Address, Publisher<'static>)> = None;
    while let Some((address, payload)) = waiting::receive(messages, None) {
        if address.channel == Channel::Observation && !desk.knows(&address.scene) {
            let scene = Address { channel: Channel::Scene, ..address.clone() };
            if let Some(bytes) = ask(session, &scene.key(run)) {
                let _ = desk.take(&scene, &bytes);
            }
        }
        let Some((channel, answer)) = desk.take(&address, &payload.to_bytes()) else { continue };
        let address = Address { channel, ..address };
        let sent = match answers.as_ref().filter(|(of, _)| *of == address) {
            Some((_, publisher)) => publisher.put(answer).wait().map_err(SessionError::bus("send")),
            // The first of an episode.
            None => session::publisher(session, address.key(run)).and_then(|publisher| {
                let sent = publisher.put(answer).wait().map_err(SessionError::bus("send"));
                answers = Some((address, publisher));
                sent
            }),
        };
        match sent {
            Ok(()) => {}
            // Closed by this process itself: nobody waits for the answer.
            Err(_) if session.is_closed() => return,
            Err(e) => tracing::error!("an answer is lost: {e}"),
        }
    }
}

/// The document of `key`, if anybody has it.
fn ask(session: &Session, key: &str) -> Option<Vec<u8>> {
    let replies = session.get(key).timeout(SCENE_QUERY).wait().ok()?;
    replies.into_iter().find_map(|reply| reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned()))
}
