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

use prost::Message as _;
use world::observation::{Briefing, Observation};
use world::plan::{Prediction, UncheckedPlan, UncheckedPrediction};
use zenoh::Wait;
use zenoh::bytes::ZBytes;

pub use connection::{Connection, NodeError, Options, Stop, Voice};
use desk::{Desk, Mind, Service};
pub use history::History;

use crate::convert::Message;
use crate::envelope::{self, Telling};
use crate::keys::{Role, Worker};
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
        Ok(Box::new(move |step| planner.plan(step).and_then(|plan| encoded(&proto::Plan::from(&plan)))))
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
        Ok(Box::new(move |step| predictor.predict(step).and_then(|p| encoded(&proto::Prediction::from(&p)))))
    }

    fn refusal(&self, step: u32, error: String) -> Vec<u8> {
        proto::Prediction { step, error, ..Default::default() }.encode_to_vec()
    }
}

/// An answer as it travels; not one that the simulator would refuse unread.
fn encoded<M: Message>(message: &M) -> Result<Vec<u8>, String> {
    let bytes = message.encode_to_vec();
    let limit = M::MAX_BYTES;
    if bytes.len() > limit {
        return Err(format!("its {} has {} bytes; at most {limit} are taken", M::NAME.to_lowercase(), bytes.len()));
    }
    Ok(bytes)
}

fn serve(options: &Options, service: Arc<dyn Service>) -> Result<Stop, NodeError> {
    let connection = Connection::open(options)?;
    // Said now, or every episode would end in silence at its first deadline.
    if service.needs_prediction() && !connection.run_info()?.predictor {
        return Err(NodeError::NoPredictor { run: options.run.clone() });
    }
    let role = service.role();
    let desks = Desks { voice: connection.voice(), service, queues: Mutex::default() };
    connection.hear_told(move |worker, payload| desks.hand(worker, payload))?;
    connection.serve(role)
}

/// Messages that may wait for a worker's thread. An honest simulator sends an observation and waits for the answer.
const QUEUE: usize = 256;

/// The threads of the workers that this node serves.
struct Desks {
    voice: Voice,
    service: Arc<dyn Service>,
    /// A worker's thread ends when its sender is dropped with this map.
    queues: Mutex<BTreeMap<Worker, SyncSender<ZBytes>>>,
}

impl Desks {
    /// Hands a message to the thread of its worker. Called by the transport: never blocks.
    fn hand(&self, worker: Worker, payload: ZBytes) {
        let mut queues = self.queues.lock().unwrap_or_else(PoisonError::into_inner);
        let queue = queues.entry(worker.clone()).or_insert_with(|| self.start_thread(worker.clone()));
        if let Err(TrySendError::Full(_)) = queue.try_send(payload) {
            tracing::error!("{QUEUE} messages of worker {worker} wait unread: one is dropped");
        }
    }

    fn start_thread(&self, worker: Worker) -> SyncSender<ZBytes> {
        let (sender, receiver) = sync_channel(QUEUE);
        let (voice, desk) = (self.voice.clone(), Desk::new(Arc::clone(&self.service)));
        std::thread::spawn(move || attend(&worker, &voice, desk, &receiver));
        sender
    }
}

/// A worker's thread.
fn attend(worker: &Worker, voice: &Voice, mut desk: Desk, messages: &Receiver<ZBytes>) {
    let key = voice.key(worker, desk.channel());
    let publisher = match session::publisher(voice.session(), key) {
        Ok(publisher) => publisher,
        Err(e) => return tracing::error!("worker {worker} is not served: {e}"),
    };
    while let Some(payload) = waiting::receive(messages, None) {
        let told = payload.to_bytes();
        let (episode, telling, message) = match envelope::open::<Telling>(&told) {
            Ok(told) => told,
            Err(e) => {
                tracing::error!("worker {worker}: {e}");
                continue;
            }
        };
        let Some((saying, answer)) = desk.take(episode, telling, message) else { continue };
        match publisher.put(envelope::seal(episode, saying, answer.into())).wait() {
            Ok(()) => {}
            // Closed by this process itself: nobody waits for the answer.
            Err(_) if voice.session().is_closed() => return,
            Err(e) => tracing::error!("an answer is lost: {}", SessionError::bus("send")(e)),
        }
    }
}
