//! To write a planner or a predictor: implement [`Planner`] and [`PlannerFactory`] (or [`Predictor`] and
//! [`PredictorFactory`]) and call [`serve_planner`] (or [`serve_predictor`]). Who drives agents that react implements [`Traffic`] and
//! [`TrafficFactory`], and calls [`serve_traffic`]. The rest is done here: the session, the
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
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use prost::Message as _;
use world::observation::{Briefing, Observation};
use world::plan::{Prediction, UncheckedPlan, UncheckedPrediction};
use world::traffic::{Taken, UncheckedMoves};
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::{Session, Wait};

pub use connection::{Connection, NodeError, Options, Stop, Voice};
use desk::{Desk, Mind, Needs, Service};
pub use history::History;

use crate::convert::Message;
use crate::envelope::{self, Telling};
use crate::keys::{Role, Worker, Workers};
use crate::proto;
use crate::session::{self, SessionError};

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

/// A planner may be a function, or a closure that keeps what it needs.
impl<F: FnMut(&StepInput<'_>) -> Result<UncheckedPlan, String> + Send> Planner for F {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        self(step)
    }
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

/// What makes planners may be a closure.
impl<F: Fn(&Briefing) -> Result<Box<dyn Planner>, String> + Send + Sync> PlannerFactory for F {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        self(briefing)
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

/// A predictor may be a function, or a closure that keeps what it needs.
impl<F: FnMut(&StepInput<'_>) -> Result<UncheckedPrediction, String> + Send> Predictor for F {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        self(step)
    }
}

/// Makes a predictor for each episode.
pub trait PredictorFactory: Send + Sync {
    /// A predictor for the episode of `briefing`.
    ///
    /// # Errors
    /// A sentence on why there can be none; the episode ends as failed with it.
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String>;
}

/// What makes predictors may be a closure.
impl<F: Fn(&Briefing) -> Result<Box<dyn Predictor>, String> + Send + Sync> PredictorFactory for F {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        self(briefing)
    }
}

/// Drives the agents that react through one episode.
pub trait Traffic: Send {
    /// Where each of `taken` is a step later.
    ///
    /// # Errors
    /// A sentence on why that cannot be told; the episode ends as failed with it.
    fn moves(&mut self, step: &StepInput<'_>, taken: &[Taken]) -> Result<UncheckedMoves, String>;
}

/// Traffic may be a function, or a closure that keeps what it needs.
impl<F: FnMut(&StepInput<'_>, &[Taken]) -> Result<UncheckedMoves, String> + Send> Traffic for F {
    fn moves(&mut self, step: &StepInput<'_>, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        self(step, taken)
    }
}

/// Makes traffic for each episode.
pub trait TrafficFactory: Send + Sync {
    /// Traffic for the episode of `briefing`.
    ///
    /// # Errors
    /// A sentence on why there can be none; the episode ends as failed with it.
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String>;
}

/// What makes traffic may be a closure.
impl<F: Fn(&Briefing) -> Result<Box<dyn Traffic>, String> + Send + Sync> TrafficFactory for F {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String> {
        self(briefing)
    }
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

/// Answers observations with where the agents are next that react, until the run ends or the node is told to stop.
///
/// # Errors
/// [`NodeError`] where the run cannot be joined.
pub fn serve_traffic(options: &Options, factory: Arc<dyn TrafficFactory>) -> Result<Stop, NodeError> {
    serve(options, Arc::new(Traffics(factory)))
}

struct Planners(Arc<dyn PlannerFactory>);

impl Service for Planners {
    fn role(&self) -> Role {
        Role::Planner
    }

    fn needs(&self) -> Needs {
        if self.0.needs_prediction() { Needs::Prediction } else { Needs::Nothing }
    }

    fn start(&self, briefing: &Briefing) -> Result<Mind, String> {
        let mut planner = self.0.start(briefing)?;
        Ok(Box::new(move |step, _| planner.plan(step).and_then(|plan| encoded(proto::Plan::from(&plan)))))
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

    fn needs(&self) -> Needs {
        Needs::Nothing
    }

    fn start(&self, briefing: &Briefing) -> Result<Mind, String> {
        let mut predictor = self.0.start(briefing)?;
        Ok(Box::new(move |step, _| predictor.predict(step).and_then(|p| encoded(proto::Prediction::from(&p)))))
    }

    fn refusal(&self, step: u32, error: String) -> Vec<u8> {
        proto::Prediction { step, error, ..Default::default() }.encode_to_vec()
    }
}

struct Traffics(Arc<dyn TrafficFactory>);

impl Service for Traffics {
    fn role(&self) -> Role {
        Role::Traffic
    }

    fn needs(&self) -> Needs {
        Needs::Taken
    }

    fn start(&self, briefing: &Briefing) -> Result<Mind, String> {
        let mut traffic = self.0.start(briefing)?;
        Ok(Box::new(move |step, taken| {
            traffic.moves(step, taken).and_then(|moves| encoded(proto::TrafficMoves::from(&moves)))
        }))
    }

    fn refusal(&self, step: u32, error: String) -> Vec<u8> {
        proto::TrafficMoves { step, error, ..Default::default() }.encode_to_vec()
    }
}

/// An answer that the simulator would not refuse unread.
pub(crate) fn bounded<M: Message>(message: M) -> Result<M, String> {
    let (bytes, limit) = (message.encoded_len(), M::MAX_BYTES);
    if bytes > limit {
        return Err(format!("its {} has {bytes} bytes; at most {limit} are taken", M::NAME.to_lowercase()));
    }
    Ok(message)
}

/// The same as it travels.
fn encoded<M: Message>(message: M) -> Result<Vec<u8>, String> {
    bounded(message).map(|message| message.encode_to_vec())
}

fn serve(options: &Options, service: Arc<dyn Service>) -> Result<Stop, NodeError> {
    let connection = Connection::open(options)?;
    // Said now, or every episode would end in silence at its first deadline.
    if service.needs() == Needs::Prediction && !connection.run_info()?.predictor {
        return Err(NodeError::NoPredictor { run: options.run.clone() });
    }
    let role = service.role();
    let voice = connection.voice();
    match &options.worker {
        Workers::One(worker) => {
            let desk = Mutex::new(Attended::new(worker, voice, service)?);
            connection.hear_told(move |_, payload| {
                desk.lock().unwrap_or_else(PoisonError::into_inner).attend(&payload);
            })?;
        }
        Workers::All => {
            let desks = Desks { voice, service, queues: Mutex::default() };
            connection.hear_told(move |worker, payload| desks.hand(worker, payload))?;
        }
    }
    connection.serve(role)
}

/// Messages that may wait for a worker's thread. An honest simulator sends an observation and waits for the answer.
const QUEUE: usize = 256;

/// The threads of the workers that a node serves which serves all.
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
        let (sender, receiver) = sync_channel::<ZBytes>(QUEUE);
        let (voice, service) = (self.voice.clone(), Arc::clone(&self.service));
        std::thread::spawn(move || match Attended::new(&worker, voice, service) {
            Ok(mut desk) => receiver.iter().for_each(|payload| desk.attend(&payload)),
            Err(e) => tracing::error!("worker {worker} is not served: {e}"),
        });
        sender
    }
}

/// An answer up to this size fits the transport's queue whole.
const AT_ONCE: usize = 256 * 1024;

/// A worker's desk, and where its answers go.
struct Attended {
    desk: Desk,
    worker: Worker,
    session: Session,
    publisher: Publisher<'static>,
}

impl Attended {
    fn new(worker: &Worker, voice: Voice, service: Arc<dyn Service>) -> Result<Self, SessionError> {
        let desk = Desk::new(service);
        let publisher = session::publisher(voice.session(), voice.key(worker, desk.channel()))?;
        Ok(Self { desk, worker: worker.clone(), session: voice.session().clone(), publisher })
    }

    /// Takes in what the simulator tells, and answers where an answer is due.
    ///
    /// A node of one worker does so in the transport's own thread: to wake another, and that to wake the transport's, takes longer than
    /// many a plan. What would wait there for room in the transport's queue, which this very thread empties, is sent by another one.
    fn attend(&mut self, payload: &ZBytes) {
        let told = payload.to_bytes();
        let (episode, telling, message) = match envelope::open::<Telling>(&told) {
            Ok(told) => told,
            Err(e) => return tracing::error!("worker {}: {e}", self.worker),
        };
        let Some((saying, answer)) = self.desk.take(episode, telling, message) else { return };
        let is_large = answer.len() > AT_ONCE;
        let answer = envelope::seal(episode, saying, answer.into());
        if is_large {
            let (session, key) = (self.session.clone(), self.publisher.key_expr().to_string());
            std::thread::spawn(move || said(&session, session::send(&session, &key, answer)));
        } else {
            said(&self.session, self.publisher.put(answer).wait().map_err(SessionError::bus("send")));
        }
    }
}

fn said(session: &Session, answer: Result<(), SessionError>) {
    match answer {
        // Closed by this process itself: nobody waits for the answer.
        Err(e) if !session.is_closed() => tracing::error!("an answer is lost: {e}"),
        _ => {}
    }
}
