//! Bus sessions. The simulator's is a router inside its own process, on a TCP port of its own; every node is a client of
//! it. No multicast, no gossip, no shared memory.

use std::net::{TcpListener, ToSocketAddrs};
use std::time::Duration;

use thiserror::Error;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Session, Wait};

use crate::convert::MAX_MESSAGE_BYTES;

/// How long either side may give no sign of life: a month, which is to say for ever. A death is seen by the closed connection. Who
/// is silent and not dead was stopped, and when everybody is, by Ctrl-Z or `docker pause`, all must find each other again. A
/// node that alone is frozen is noticed where it is needed: at a deadline.
const LEASE: Duration = Duration::from_secs(30 * 24 * 3600);

/// How long a node waits to send while the simulator takes nothing: as long.
const NODE_STALL: Duration = LEASE;

/// The largest message that the simulator reads at all. What is larger than it should be is read and refused by name; what is
/// larger than this costs its sender the connection.
const MAX_READ_BYTES: usize = 4 * MAX_MESSAGE_BYTES;

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

/// Who is no simulator may not show its token, nor answer in its place who asks for the run's settings or a scene.
const ACCESS: &str = r#"{
    enabled: true, default_permission: "allow",
    rules: [
        { id: "answers", permission: "deny", flows: ["ingress"], messages: ["declare_queryable", "reply"],
          key_exprs: ["**", "reloop/*/@tape/**"] },
        { id: "token", permission: "deny", flows: ["ingress"], messages: ["liveliness_token"],
          key_exprs: ["reloop/*/@node/sim/**"] },
    ],
    subjects: [{ id: "everybody" }],
    policies: [{ rules: ["answers", "token"], subjects: ["everybody"] }],
}"#;

/// Where Zenoh reads from how many threads it may have, and nowhere else.
pub const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// What [`RUNTIME_VARIABLE`] is best set to, for so many threads. By default Zenoh waits for the network in one thread, reads in another and
/// writes in a third: each step of a drive wakes all of them. So one does all three, and an answer that is given while reading wakes no
/// other.
#[must_use]
pub fn runtime(threads: u16) -> String {
    let handed_over = ["tx", "acc", "app", "net"].map(|name| format!("{name}: (handover: rx)")).join(", ");
    format!("(rx: (worker_threads: {threads}), {handed_over})")
}

/// A router session that listens on `endpoint` (`tcp/127.0.0.1:7447`), or on a free port of the loopback where there is none; port 0
/// is a free one too. Gives back the endpoint as nodes are to be told it.
///
/// `stall` is how long a send waits for a reader that takes nothing; then that reader is cut off. It must stay below the
/// deadline of a step: a sender that waits is the simulator's own thread.
///
/// # Errors
/// [`SessionError::Listen`].
pub fn open_router(endpoint: Option<&str>, stall: Duration) -> Result<(Session, String), SessionError> {
    let asked = endpoint.unwrap_or(ANY_PORT);
    let mut failure = None;
    for _ in 0..if wants_free_port(asked) { PORT_ATTEMPTS } else { 1 } {
        let endpoint = if wants_free_port(asked) { with_free_port(asked)? } else { asked.to_owned() };
        let settings = [
            ("mode", r#""router""#.to_owned()),
            ("listen/endpoints", format!("[{endpoint:?}]")),
            ("access_control", ACCESS.to_owned()),
            ("transport/link/rx/max_message_size", MAX_READ_BYTES.to_string()),
            ("transport/link/tx/queue/congestion_control/block/wait_before_close", stall.as_micros().to_string()),
        ];
        match open(&settings) {
            Ok(session) => return Ok((session, endpoint)),
            Err(reason) => failure = Some(SessionError::Listen { endpoint, reason }),
        }
    }
    Err(failure.unwrap_or(SessionError::Bus { what: "open", reason: "no attempt was made".to_owned() }))
}

/// Whether somebody beyond this machine may reach `endpoint`; so it is said of one that cannot be read, too.
#[must_use]
pub fn is_beyond_loopback(endpoint: &str) -> bool {
    let addresses = address(endpoint).to_socket_addrs();
    !addresses.is_ok_and(|mut addresses| addresses.all(|address| address.ip().is_loopback()))
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
        ("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES.to_string()),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", NODE_STALL.as_micros().to_string()),
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
        ("transport/link/tx/lease", LEASE.as_millis().to_string()),
        ("transport/link/tx/queue/size/real_time", QUEUED_BATCHES.to_string()),
    ];
    let mut config = Config::default();
    for (key, value) in shared.iter().chain(settings) {
        config.insert_json5(key, value).map_err(|e| format!("{key}: {}", reason(&e)))?;
    }
    zenoh::open(config).wait().map_err(|e| reason(&e))
}

/// Where nobody says where.
const ANY_PORT: &str = "tcp/127.0.0.1:0";

/// The address of an endpoint, without its protocol before and its settings behind.
fn address(endpoint: &str) -> &str {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, address)| address);
    address.split(['?', '#']).next().unwrap_or(address)
}

fn wants_free_port(endpoint: &str) -> bool {
    address(endpoint).ends_with(":0")
}

/// `endpoint` with a port of its host that nobody listens on, in the place of 0.
fn with_free_port(endpoint: &str) -> Result<String, SessionError> {
    let address = address(endpoint);
    let port = TcpListener::bind(address).and_then(|listener| listener.local_addr()).map(|free| free.port());
    port.map(|port| endpoint.replacen(address, &format!("{}{port}", &address[..address.len() - 1]), 1))
        .map_err(|e| SessionError::Listen { endpoint: endpoint.to_owned(), reason: e.to_string() })
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
    put(session, key, payload.into(), true)
}

/// Sends it likewise, but on one journey with what follows within a millisecond.
///
/// # Errors
/// As [`send`].
pub(crate) fn send_together(session: &Session, key: &str, payload: impl Into<ZBytes>) -> Result<(), SessionError> {
    put(session, key, payload.into(), false)
}

fn put(session: &Session, key: &str, payload: ZBytes, at_once: bool) -> Result<(), SessionError> {
    session
        .put(key, payload)
        // One priority for all: messages of different priorities overtake each other.
        .priority(Priority::RealTime)
        .congestion_control(CongestionControl::Block)
        .express(at_once)
        .wait()
        .map_err(SessionError::bus("send"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn port_0_is_a_free_one_of_the_same_host() {
        for endpoint in ["tcp/127.0.0.1:0", "tcp/localhost:0", "tcp/0.0.0.0:0", "tcp/127.0.0.1:0#iface=lo"] {
            assert!(wants_free_port(endpoint), "{endpoint}");
            let free = with_free_port(endpoint).unwrap();
            let (before, after) = endpoint.split_once(":0").unwrap();
            let port = free.strip_prefix(before).and_then(|rest| rest.strip_suffix(after)).unwrap();
            assert!(port.strip_prefix(':').unwrap().parse::<u16>().unwrap() > 0, "{free}");
        }
        assert!(!wants_free_port("tcp/127.0.0.1:7440"));
    }

    #[test]
    fn who_can_be_reached_from_elsewhere_is_known() {
        for endpoint in ["tcp/127.0.0.1:7447", "tcp/localhost:7447", "tcp/[::1]:7447", "tcp/127.0.0.1:7447#iface=lo"] {
            assert!(!is_beyond_loopback(endpoint), "{endpoint}");
        }
        for endpoint in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.0.7:7447", "tcp/what"] {
            assert!(is_beyond_loopback(endpoint), "{endpoint}");
        }
    }
}
