//! Bus sessions. The simulator's is a router inside its own process, on a TCP port of its own; every node is a client of
//! it, so that nodes hear each other through the simulator. No multicast, no gossip, no shared memory.

use std::net::{Ipv4Addr, TcpListener};
use std::time::Duration;

use thiserror::Error;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Session, Wait};

use crate::convert::MAX_MESSAGE_BYTES;

/// How long a node may say nothing at all before the simulator takes it for dead. Zenoh's own threads send a sign of life
/// four times as often, so that a node that merely computes is not meant.
pub const NODE_LEASE: Duration = Duration::from_secs(5);

/// How long nodes wait for a silent simulator: its death is seen by the closed connection, so silence means a debugger.
const SIM_LEASE: Duration = Duration::from_secs(60);

/// How long a node tries to reach the simulator.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Batches (64 KiB each) that wait for a slow reader before the sender waits.
const QUEUED_BATCHES: usize = 8;

/// Free ports tried, in case another process takes one between the choice and the use.
const PORT_ATTEMPTS: usize = 16;

/// Why a session could not be used.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The router could not listen.
    #[error(
        "cannot listen on {endpoint}: {reason}\n  hint: leave the endpoint out, and a free port of this machine is taken"
    )]
    Listen {
        /// Where.
        endpoint: String,
        /// What the transport says.
        reason: String,
    },
    /// No simulator was found.
    #[error(
        "cannot reach a simulator at {endpoint}: {reason}\n  hint: `sim run -v` names its endpoint in its log; is the run still on?"
    )]
    Connect {
        /// Where.
        endpoint: String,
        /// What the transport says.
        reason: String,
    },
    /// An open session refused something.
    #[error("the bus failed ({what}): {reason}")]
    Bus {
        /// What was tried.
        what: &'static str,
        /// What it says.
        reason: String,
    },
}

impl SessionError {
    /// Wraps the transport's own error, which is no [`std::error::Error`] itself.
    pub(crate) fn bus(what: &'static str) -> impl FnOnce(zenoh::Error) -> Self {
        move |e| Self::Bus { what, reason: reason(&e) }
    }
}

/// What the transport says, without the line of its source that it ends with.
fn reason(error: &zenoh::Error) -> String {
    let text = error.to_string();
    match text.find(" at /") {
        Some(end) if text[end..].contains(".rs:") => text[..end].to_owned(),
        _ => text,
    }
}

/// A router session that listens on `endpoint` (`tcp/127.0.0.1:7447`), or on a free port of the loopback where there is none.
/// Gives back the endpoint too.
///
/// `stall` is how long a send waits for a reader that takes nothing; then that reader is cut off. It must stay below the
/// deadline of a step: a sender that waits is the simulator's own thread.
///
/// # Errors
/// [`SessionError::Listen`].
pub fn open_router(endpoint: Option<&str>, stall: Duration) -> Result<(Session, String), SessionError> {
    let mut failure = None;
    for _ in 0..if endpoint.is_some() { 1 } else { PORT_ATTEMPTS } {
        let endpoint = match endpoint {
            Some(endpoint) => endpoint.to_owned(),
            None => free_endpoint()?,
        };
        let settings = [
            ("mode", r#""router""#.to_owned()),
            ("listen/endpoints", format!("[{endpoint:?}]")),
            ("transport/link/tx/lease", SIM_LEASE.as_millis().to_string()),
            ("transport/link/tx/queue/congestion_control/block/wait_before_close", stall.as_micros().to_string()),
        ];
        match open(&settings) {
            Ok(session) => return Ok((session, endpoint)),
            Err(reason) => failure = Some(SessionError::Listen { endpoint, reason }),
        }
    }
    Err(failure.unwrap_or(SessionError::Bus { what: "open", reason: "no attempt was made".to_owned() }))
}

/// A client session of the router at `endpoint`.
///
/// # Errors
/// [`SessionError::Connect`].
pub fn open_client(endpoint: &str) -> Result<Session, SessionError> {
    let settings = [
        ("mode", r#""client""#.to_owned()),
        ("connect/endpoints", format!("[{endpoint:?}]")),
        ("connect/timeout_ms", CONNECT_TIMEOUT.as_millis().to_string()),
        ("connect/exit_on_failure", "true".to_owned()),
        ("transport/link/tx/lease", NODE_LEASE.as_millis().to_string()),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", SIM_LEASE.as_micros().to_string()),
    ];
    open(&settings).map_err(|reason| SessionError::Connect { endpoint: endpoint.to_owned(), reason })
}

fn open(settings: &[(&str, String)]) -> Result<Session, String> {
    let shared = [
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        // A router waits this long (500 ms by default) for others that it may find; there are none.
        ("scouting/delay", "0".to_owned()),
        // Messages carry the step; a wall-clock stamp would only cost.
        ("timestamping/enabled", "false".to_owned()),
        ("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES.to_string()),
        ("transport/link/tx/queue/size/real_time", QUEUED_BATCHES.to_string()),
    ];
    let mut config = Config::default();
    for (key, value) in shared.iter().chain(settings) {
        config.insert_json5(key, value).map_err(|e| format!("{key}: {}", reason(&e)))?;
    }
    zenoh::open(config).wait().map_err(|e| reason(&e))
}

fn free_endpoint() -> Result<String, SessionError> {
    let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|listener| listener.local_addr());
    port.map(|address| format!("tcp/{address}"))
        .map_err(|e| SessionError::Listen { endpoint: "tcp/127.0.0.1:0".to_owned(), reason: e.to_string() })
}

/// What sends message after message under `key`, as [`send`] does one: the key is looked up once.
///
/// # Errors
/// [`SessionError::Bus`] where the session is closed.
pub(crate) fn publisher(session: &Session, key: String) -> Result<Publisher<'static>, SessionError> {
    session
        .declare_publisher(key)
        .priority(Priority::RealTime)
        .congestion_control(CongestionControl::Block)
        .express(true)
        .wait()
        .map_err(SessionError::bus("declare a publisher"))
}

/// Sends `payload` under `key`: reliable, in order with all else that this session sends, at once. Waits while a reader's
/// queue is full.
///
/// # Errors
/// [`SessionError::Bus`] where the session is closed.
pub fn send(session: &Session, key: &str, payload: impl Into<ZBytes>) -> Result<(), SessionError> {
    session
        .put(key, payload)
        // One priority for all: messages of different priorities overtake each other.
        .priority(Priority::RealTime)
        .congestion_control(CongestionControl::Block)
        .express(true)
        .wait()
        .map_err(SessionError::bus("send"))
}
