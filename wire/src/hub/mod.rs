//! The simulator's side of the bus: the router session, the watch over the nodes, a line for each episode.
//!
//! | file | what |
//! | --- | --- |
//! | `mod.rs` | the hub: opening, run settings, queries, who hears what |
//! | `nodes.rs` | which nodes are there, the start barrier, deaths |
//! | `line.rs` | one episode: send an observation, wait for its answers |
//! | `tape.rs` | all that happens, for the recorder |
//!
//! Nothing here waits without a limit. A process that reads nothing is cut off after a deadline at most, see
//! [`crate::session::open_router`]; callbacks of the transport never block, an inbox that runs over is an error of its line.

mod line;
mod nodes;
mod tape;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use prost::Message as _;
use world::scene::SceneId;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

pub use line::{EpisodeLine, LineError};
pub use nodes::{BarrierError, NodeEvent, Wanted};

use crate::keys::{self, Address, Channel, NodeId, Role, RunName, Worker, Workers};
use crate::proto;
use crate::session::{self, SessionError};
use line::Inbox;
use nodes::Nodes;
use tape::Tape;

/// A reader that takes nothing is cut off after this, however long the deadline.
const LONGEST_STALL: Duration = Duration::from_secs(5);

/// How a hub is opened.
#[derive(Clone, Debug)]
pub struct HubSettings {
    /// Where to listen, like `tcp/127.0.0.1:7447`; a free port of the loopback where it is not said.
    pub endpoint: Option<String>,
    /// The longest that any step waits for its answers. A reader that takes nothing for so long is cut off.
    pub deadline: Duration,
}

impl Default for HubSettings {
    fn default() -> Self {
        Self { endpoint: None, deadline: Duration::from_secs(5) }
    }
}

/// The simulator's end of the bus. Closed by [`Hub::close`], or when dropped.
pub struct Hub {
    shared: Arc<Shared>,
    endpoint: String,
    /// Kept because dropping them ends them. The token goes first: nodes leave when it does.
    _token: LivelinessToken,
    _subscribers: Vec<Subscriber<()>>,
    _queryables: Vec<Queryable<()>>,
}

/// What the hub, its lines and the transport's callbacks share.
struct Shared {
    run: RunName,
    session: Session,
    /// The open lines' inboxes, for the callbacks to find them.
    inboxes: Mutex<BTreeMap<(Worker, SceneId), Arc<Inbox>>>,
    /// What queries are answered with: the run's settings, the scene of each open line. By key.
    documents: Mutex<BTreeMap<String, ZBytes>>,
    /// Who is there.
    nodes: Nodes,
    /// What the recorder hears.
    tape: Tape,
}

/// A poisoned lock is taken all the same: what it guards is whole between any two statements.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    /// Opens the bus of `run` with the default settings.
    ///
    /// # Errors
    /// See [`Hub::open_with`].
    pub fn open(run: &RunName) -> Result<Self, SessionError> {
        Self::open_with(run, &HubSettings::default())
    }

    /// Opens the bus of `run`.
    ///
    /// # Errors
    /// [`SessionError`] where it cannot listen.
    pub fn open_with(run: &RunName, settings: &HubSettings) -> Result<Self, SessionError> {
        let stall = LONGEST_STALL.min(settings.deadline);
        let (session, endpoint) = session::open_router(settings.endpoint.as_deref(), stall)?;
        let shared = Arc::new(Shared {
            run: run.clone(),
            session: session.clone(),
            inboxes: Mutex::default(),
            documents: Mutex::default(),
            nodes: Nodes::default(),
            tape: Tape::new(&session, stall),
        });

        let mut subscribers = Vec::new();
        for channel in [Channel::Plan, Channel::Prediction, Channel::Recorded] {
            let shared = Arc::clone(&shared);
            let subscriber = session
                .declare_subscriber(keys::channel(run, &Workers::All, channel))
                .callback(move |sample| shared.deliver(sample.key_expr().as_str(), sample.payload()))
                .wait()
                .map_err(SessionError::bus("subscribe"))?;
            subscribers.push(subscriber);
        }
        let watch = Arc::clone(&shared);
        let subscriber = session
            .liveliness()
            .declare_subscriber(keys::nodes(run, None))
            .history(true)
            .callback(move |sample| watch.observe_node(&sample))
            .wait()
            .map_err(SessionError::bus("watch nodes"))?;
        subscribers.push(subscriber);

        let mut queryables = Vec::new();
        for key in [keys::info(run), keys::channel(run, &Workers::All, Channel::Scene)] {
            let shared = Arc::clone(&shared);
            let queryable = session
                .declare_queryable(key)
                .callback(move |query| shared.answer(&query))
                .wait()
                .map_err(SessionError::bus("answer queries"))?;
            queryables.push(queryable);
        }

        // Last: who sees the token may rely on all of the above.
        let own =
            NodeId { role: Role::Sim, workers: Workers::All, name: "sim".to_owned(), version: crate::WIRE_VERSION };
        let token =
            session.liveliness().declare_token(own.key(run)).wait().map_err(SessionError::bus("declare the token"))?;
        Ok(Self { shared, endpoint, _token: token, _subscribers: subscribers, _queryables: queryables })
    }

    /// Where nodes connect to.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The run's name.
    #[must_use]
    pub fn run(&self) -> &RunName {
        &self.shared.run
    }

    /// Tells the settings of the run to everybody who listens, and to everybody who asks from now on.
    ///
    /// # Errors
    /// [`SessionError::Bus`].
    pub fn publish_run_info(&self, info: &proto::RunInfo) -> Result<(), SessionError> {
        let key = keys::info(&self.shared.run);
        let payload = ZBytes::from(info.encode_to_vec());
        lock(&self.shared.documents).insert(key.clone(), payload.clone());
        session::send(&self.shared.session, &key, payload)
    }

    /// Waits until every node in `wanted` is there and listens.
    ///
    /// `cancelled` is asked some fifty times a second, so that an interrupted start ends at once.
    ///
    /// # Errors
    /// [`BarrierError`] names who is missing, or who speaks another version.
    pub fn wait_for_nodes(
        &self,
        wanted: &[Wanted],
        timeout: Duration,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(), BarrierError> {
        self.shared.nodes.wait_for(wanted, timeout, cancelled)
    }

    /// The nodes that are there now.
    #[must_use]
    pub fn nodes(&self) -> Vec<NodeId> {
        self.shared.nodes.present()
    }

    /// Comings and goings of nodes from now on.
    #[must_use]
    pub fn watch(&self) -> std::sync::mpsc::Receiver<NodeEvent> {
        self.shared.nodes.watch()
    }

    /// A line for the episode `scene` on `worker`. With `expects_prediction` each step waits for a prediction too.
    ///
    /// # Errors
    /// [`LineError::Busy`] where this episode is already open on this worker, [`LineError::Bus`] where the session is closed.
    pub fn episode(
        &self,
        worker: &Worker,
        scene: &SceneId,
        expects_prediction: bool,
    ) -> Result<EpisodeLine, LineError> {
        EpisodeLine::open(&self.shared, worker, scene, expects_prediction)
    }

    /// Ends the session; nodes leave when they see it.
    pub fn close(self) {
        let session = self.shared.session.clone();
        drop(self);
        if let Err(e) = session.close().wait() {
            tracing::debug!("closing the bus: {e}");
        }
    }
}

impl Shared {
    /// Puts an answer into the inbox of its episode. Called by the transport: never blocks.
    fn deliver(&self, key: &str, payload: &ZBytes) {
        let Some(address) = Address::parse(key) else { return };
        let inbox = lock(&self.inboxes).get(&(address.worker, address.scene)).cloned();
        match inbox {
            Some(inbox) => inbox.deliver(address.channel, payload),
            None => tracing::debug!("{key}: no such episode is on"),
        }
    }

    fn observe_node(&self, sample: &zenoh::sample::Sample) {
        let Some(node) = NodeId::parse(sample.key_expr().as_str()) else {
            tracing::warn!("a node has a token that cannot be read: {}", sample.key_expr());
            return;
        };
        if node.role == Role::Sim {
            return;
        }
        if sample.kind() == zenoh::sample::SampleKind::Put {
            self.nodes.joined(node);
            return;
        }
        self.nodes.left(&node);
        for ((worker, _), inbox) in lock(&self.inboxes).iter() {
            if node.workers.serve(worker) {
                inbox.node_lost();
            }
        }
    }

    fn answer(&self, query: &Query) {
        let documents: Vec<(String, ZBytes)> = lock(&self.documents)
            .iter()
            .filter(|(key, _)| KeyExpr::try_from(key.as_str()).is_ok_and(|key| key.intersects(query.key_expr())))
            .map(|(key, payload)| (key.clone(), payload.clone()))
            .collect();
        for (key, payload) in documents {
            if let Err(e) = query.reply(key, payload).wait() {
                tracing::debug!("a query could not be answered: {e}");
            }
        }
    }
}
