//! The simulator's side of the bus: the router session, a seat for each node, a line for each episode.
//!
//! | file | what |
//! | --- | --- |
//! | `mod.rs` | the hub: opening, run settings, queries, what strangers say |
//! | `nodes.rs` | who sits where, who is refused, the start barrier |
//! | `seat.rs` | what is said at a seat |
//! | `line.rs`, `line_error.rs` | one episode: an observation is told, its answers come; why there is none |
//! | `bus_line.rs` | over the bus |
//! | `here.rs` | to nodes' minds in this process |
//! | `inbox.rs` | what arrives for a line, and how long it is waited for |
//! | `tape.rs` | all that happens, for the recorder |
//!
//! Nothing here waits without a limit. A process that reads nothing is cut off after a deadline at most, see
//! [`crate::session::open_router`]; callbacks of the transport never block, an inbox that runs over is an error of its line.

mod bus_line;
mod here;
mod inbox;
mod line;
mod line_error;
mod nodes;
mod seat;
mod tape;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use prost::Message as _;
use tempfile::TempDir;
use world::scene::SceneId;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh::{Session, Wait};

pub use bus_line::{Cast, EpisodeLine};
pub use here::{HereLine, Minds};
pub use line::{Answers, Line};
pub use line_error::LineError;
pub use nodes::{BarrierError, NodeEvent};
pub use seat::Seat;

use crate::convert::shown;
use crate::keys::{self, Channel, NodeId, Place, Role, RunName, Secret, Worker, Workers};
use crate::proto;
use crate::pulse::Pulse;
use crate::session::{self, Guarded, Router, RouterSettings, SessionError, ZenohFile};
use nodes::Nodes;
use tape::Tape;

/// What is noticed of others is told so often, then no more: a stranger must not fill the disk.
const NOTICES: u64 = 100;

/// A reader that takes nothing is cut off after this, however long the deadline.
const LONGEST_STALL: Duration = Duration::from_secs(5);

/// How a hub is opened.
#[derive(Clone, Debug)]
pub struct HubSettings {
    /// Where others than the user's own processes may come in, like `tcp/127.0.0.1:7447`; nowhere where it is not said.
    pub endpoint: Option<String>,
    /// The longest that any step waits for its answers. A reader that takes nothing for so long is cut off.
    pub deadline: Duration,
    /// The user's own settings of the session.
    pub zenoh_file: Option<ZenohFile>,
    /// A seat that only the holders of certain certificates may take.
    pub guarded: Option<Guarded>,
}

impl Default for HubSettings {
    fn default() -> Self {
        Self { endpoint: None, deadline: Duration::from_secs(5), zenoh_file: None, guarded: None }
    }
}

/// The simulator's end of the bus. Closed by [`Hub::close`], or when dropped.
pub struct Hub {
    shared: Arc<Shared>,
    endpoint: String,
    outside: Option<String>,
    /// Kept because dropping them ends them. The token goes first: nodes leave when it does.
    _token: LivelinessToken,
    _subscribers: Vec<Subscriber<()>>,
    _queryables: Vec<Queryable<()>>,
    /// Of the socket.
    _folder: TempDir,
}

/// What the hub, its lines and the transport's callbacks share.
struct Shared {
    run: RunName,
    session: Session,
    /// What queries are answered with: the run's settings, the scene of each open line. By key.
    documents: Mutex<BTreeMap<String, ZBytes>>,
    /// Who is there.
    nodes: Nodes,
    /// How many episodes were begun.
    episodes: AtomicU64,
    /// How often somebody said what nobody asked for.
    notices: AtomicU64,
    /// Whether this process stood still.
    pulse: Pulse,
    /// What the recorder hears.
    tape: Tape,
    /// Where a certificate says who may sit.
    guarded: Option<Guarded>,
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
        let Router { session, inside, outside, folder } = session::open_router(&RouterSettings {
            outside: settings.endpoint.as_deref(),
            stall,
            zenoh_file: settings.zenoh_file.as_ref(),
            guarded: settings.guarded.as_ref(),
        })?;
        let open_floor = Place::open_floor(run);
        let shared = Arc::new(Shared {
            run: run.clone(),
            session: session.clone(),
            documents: Mutex::default(),
            nodes: Nodes::default(),
            episodes: AtomicU64::new(0),
            notices: AtomicU64::new(0),
            pulse: Pulse::start(),
            tape: Tape::new(&session, open_floor.clone(), stall)?,
            guarded: settings.guarded.clone(),
        });

        let mut subscribers = Vec::new();
        for selector in open_floor.everything() {
            let shared = Arc::clone(&shared);
            let subscriber = session.declare_subscriber(selector).allowed_origin(Locality::Remote);
            let subscriber = subscriber.callback(move |sample| shared.hear_stranger(&sample)).wait();
            subscribers.push(subscriber.map_err(SessionError::bus("subscribe"))?);
        }
        let (watch, floor) = (Arc::clone(&shared), open_floor.clone());
        let subscriber = session.liveliness().declare_subscriber(open_floor.nodes()).history(true);
        let subscriber = subscriber.callback(move |sample| watch.see_stranger(&floor, &sample)).wait();
        subscribers.push(subscriber.map_err(SessionError::bus("watch nodes"))?);

        let mut queryables = Vec::new();
        for key in [keys::info(run), open_floor.tape_channel(&Workers::All, Channel::Scene)] {
            let shared = Arc::clone(&shared);
            let queryable = session
                .declare_queryable(key)
                .callback(move |query| shared.answer(&query))
                .wait()
                .map_err(SessionError::bus("answer queries"))?;
            queryables.push(queryable);
        }

        // Last: who sees the token may rely on all of the above.
        let token = session.liveliness().declare_token(NodeId::sim().key(&open_floor)).wait();
        let token = token.map_err(SessionError::bus("declare the token"))?;
        Ok(Self {
            shared,
            endpoint: inside,
            outside,
            _token: token,
            _subscribers: subscribers,
            _queryables: queryables,
            _folder: folder,
        })
    }

    /// Where processes of the simulator's user connect to.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Where others do, if anywhere.
    #[must_use]
    pub fn outside(&self) -> Option<&str> {
        self.outside.as_deref()
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

    /// A seat for a node of `role` that serves `workers`, behind a secret of its own.
    ///
    /// # Errors
    /// [`SessionError`] where the session is closed, or the system gives no randomness.
    pub fn seat(&self, role: Role, workers: &Workers) -> Result<Seat, SessionError> {
        let secret = Secret::random().map_err(|e| SessionError::bus("make a secret")(e.into()))?;
        self.seat_with(role, workers, secret)
    }

    /// A seat for a node of `role` that serves `workers`, behind a secret that both sides know already.
    ///
    /// # Errors
    /// [`SessionError`] where the session is closed, or the secret cannot be part of a key.
    pub fn seat_with(&self, role: Role, workers: &Workers, secret: Secret) -> Result<Seat, SessionError> {
        Seat::open(&self.shared, role, workers, secret)
    }

    /// Waits until there is a node at every seat, and it listens.
    ///
    /// `cancelled` is asked some fifty times a second, so that an interrupted start ends at once.
    ///
    /// # Errors
    /// [`BarrierError`] names who is missing, or who speaks another version.
    pub fn wait_for_nodes(
        &self,
        seats: &[&Seat],
        timeout: Duration,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(), BarrierError> {
        let numbers: Vec<_> = seats.iter().map(|seat| seat.inner().number).collect();
        self.shared.nodes.wait_for(&numbers, timeout, &self.shared.pulse, cancelled)
    }

    /// Whether anybody listens in: the recorder, or whoever else.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.shared.tape.is_heard()
    }

    /// How often this process stood still until now, see [`crate::pulse`].
    #[must_use]
    pub fn pauses(&self) -> u64 {
        self.shared.pulse.pauses()
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

    /// A line for the episode `scene` on `worker`. With a predictor each step waits for a prediction too.
    ///
    /// # Errors
    /// [`LineError::Busy`] where this worker has an episode on, [`LineError::Bus`] where the session is closed.
    pub fn episode(&self, worker: &Worker, scene: &SceneId, cast: Cast<'_>) -> Result<EpisodeLine, LineError> {
        EpisodeLine::open(
            &self.shared,
            worker,
            scene,
            [Some(cast.planner), cast.predictor, cast.traffic, cast.recorder],
        )
    }

    /// A line without planner or predictor, which tells the recorder and whoever else listens in what [`HereLine`] says.
    ///
    /// # Errors
    /// As [`Hub::episode`].
    pub fn tape(&self, worker: &Worker, scene: &SceneId, recorder: Option<&Seat>) -> Result<EpisodeLine, LineError> {
        EpisodeLine::open(&self.shared, worker, scene, [None, None, None, recorder])
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
    /// Somebody put something where everybody may, and nobody is to. No node hears it.
    fn hear_stranger(&self, sample: &Sample) {
        self.noticed(&format!("somebody put {} on the bus: it is not counted", shown(sample.key_expr().as_str())));
    }

    /// Somebody shows a token where everybody may: who is meant has a seat.
    fn see_stranger(&self, floor: &Place, sample: &Sample) {
        let Some(node) = NodeId::parse(sample.key_expr().as_str()) else {
            return self.noticed("a node has a token that cannot be read");
        };
        if node.role != Role::Sim && sample.kind() == SampleKind::Put {
            let reason = self.nodes.refuse_stranger(&node);
            self.admit(floor, &node, Some(reason));
        }
    }

    /// Tells the user what others do that they should not.
    fn noticed(&self, what: &str) {
        match self.notices.fetch_add(1, Ordering::Relaxed) {
            NOTICES => tracing::warn!("more of this follows, and is not told: {what}"),
            count if count < NOTICES => tracing::warn!("{what}"),
            _ => {}
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
