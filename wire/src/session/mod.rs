//! Bus sessions. The simulator's is a router inside its own process; every node is a client of it. No multicast, no gossip, no shared
//! memory.
//!
//! The router has two doors. **Inside** is a socket in a folder that nobody but the simulator's user can enter: what the simulator starts
//! comes that way. **Outside** is there only where somebody asked for it, over TCP or TLS.
//!
//! | file | what |
//! | --- | --- |
//! | `mod.rs` | opening sessions, sending |
//! | `access.rs` | who may say and hear what |
//! | `refusal.rs` | why somebody is not let in, in words that help |
//! | `threads.rs` | how many threads they have |
//! | `zenoh_file.rs` | a user's own Zenoh configuration |

mod access;
mod refusal;
mod threads;
mod zenoh_file;

use std::net::{TcpListener, ToSocketAddrs};
use std::time::Duration;

use tempfile::TempDir;
use thiserror::Error;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Session, Wait};

pub use access::Guarded;
pub use refusal::refused_by_tls;
pub use threads::{RUNTIME_VARIABLE, needs_one_thread, runtime, settle, settle_for};
pub use zenoh_file::{ZenohFile, ZenohFileError};

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
        "cannot listen on {endpoint}: {reason}\n  hint: without an endpoint there is a socket in $TMPDIR, for your own processes alone"
    )]
    Listen {
        /// Where.
        endpoint: String,
        /// What the transport says.
        reason: String,
    },
    /// No simulator was found.
    #[error("cannot reach a simulator at {endpoint}: {reason}")]
    Connect {
        /// Where.
        endpoint: String,
        /// Why, and what to do.
        reason: String,
    },
    /// Certificates are to decide who is let in, and nobody is asked for one.
    #[error(
        "certificates say who may be the planner, but nobody is asked for one\n  hint: listen with --endpoint tls/HOST:PORT, and set enable_mtls and \
         the simulator's own certificate in --zenoh-config; docs/hosts.md has examples"
    )]
    NoCertificates,
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

/// How a router is opened.
#[derive(Debug)]
pub struct RouterSettings<'a> {
    /// Where others than the user's own processes may come in, like `tcp/127.0.0.1:7447`; port 0 is a free one.
    pub outside: Option<&'a str>,
    /// How long a send waits for a reader that takes nothing; then that reader is cut off. It must stay below the deadline of a
    /// step: a sender that waits is the simulator's own thread.
    pub stall: Duration,
    /// The user's own settings.
    pub zenoh_file: Option<&'a ZenohFile>,
    /// A seat that certificates guard.
    pub guarded: Option<&'a Guarded>,
}

/// The simulator's session, and where others find it.
pub struct Router {
    /// The session.
    pub session: Session,
    /// Where processes of the same user connect to.
    pub inside: String,
    /// Where others do.
    pub outside: Option<String>,
    /// Of the socket: it is gone with this.
    pub folder: TempDir,
}

/// A router session.
///
/// # Errors
/// [`SessionError::Listen`], [`SessionError::NoCertificates`].
pub fn open_router(settings: &RouterSettings<'_>) -> Result<Router, SessionError> {
    let RouterSettings { outside, stall, zenoh_file, guarded } = *settings;
    let is_tls = outside.is_some_and(|endpoint| endpoint.starts_with("tls/"));
    let certified = is_tls && zenoh_file.is_some_and(ZenohFile::asks_for_certificates);
    if guarded.is_some() && !certified {
        return Err(SessionError::NoCertificates);
    }
    // Others can neither enter it nor look into it.
    let folder = tempfile::Builder::new().prefix("reloop-").tempdir();
    let no_folder =
        |e: std::io::Error| SessionError::Listen { endpoint: "a socket of its own".to_owned(), reason: e.to_string() };
    let folder = folder.map_err(no_folder)?;
    let inside = format!("unixsock-stream/{}", folder.path().join("bus").display());
    let mut failure = None;
    for _ in 0..PORT_ATTEMPTS {
        let outside = outside.map(with_free_port).transpose()?;
        let doors: Vec<&str> = [Some(inside.as_str()), outside.as_deref()].into_iter().flatten().collect();
        let own = [
            ("mode", r#""router""#.to_owned()),
            ("listen/endpoints", format!("{doors:?}")),
            ("access_control", access::control(certified, guarded)),
            ("transport/link/rx/max_message_size", MAX_READ_BYTES.to_string()),
            ("transport/link/tx/queue/congestion_control/block/wait_before_close", stall.as_micros().to_string()),
        ];
        match open(zenoh_file, &own) {
            Ok(session) => return Ok(Router { session, inside, outside, folder }),
            Err(reason) => {
                failure = Some(SessionError::Listen { endpoint: outside.unwrap_or_else(|| inside.clone()), reason })
            }
        }
        // Another process may have taken the port between the choice and the use.
        if !settings.outside.is_some_and(wants_free_port) {
            break;
        }
    }
    Err(failure.unwrap_or(SessionError::Bus { what: "open", reason: "no attempt was made".to_owned() }))
}

/// The common name of the certificate at the far end of the session that is named `id`; none where it has no certificate.
#[must_use]
pub fn certificate_of(session: &Session, id: &str) -> Option<String> {
    let mut links = session.info().links().wait().filter(|link| link.zid().to_string() == id);
    links.find_map(|link| link.auth_identifier().map(str::to_owned))
}

/// Whether somebody beyond this machine may reach `endpoint`; so it is said of one that cannot be read, too.
#[must_use]
pub fn is_beyond_loopback(endpoint: &str) -> bool {
    if endpoint.starts_with("unixsock-stream/") {
        return false;
    }
    let addresses = address(endpoint).to_socket_addrs();
    !addresses.is_ok_and(|mut addresses| addresses.all(|address| address.ip().is_loopback()))
}

/// A client session of the router at `endpoint`.
///
/// # Errors
/// [`SessionError::Connect`].
pub fn open_client(endpoint: &str) -> Result<Session, SessionError> {
    open_client_with(endpoint, None)
}

/// The same with the user's own settings.
///
/// # Errors
/// [`SessionError::Connect`].
pub fn open_client_with(endpoint: &str, zenoh_file: Option<&ZenohFile>) -> Result<Session, SessionError> {
    let mut own = vec![
        ("mode", r#""client""#.to_owned()),
        ("connect/endpoints", format!("[{endpoint:?}]")),
        ("connect/timeout_ms", CONNECT_TIMEOUT.as_millis().to_string()),
        ("connect/exit_on_failure", "true".to_owned()),
        ("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES.to_string()),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", NODE_STALL.as_micros().to_string()),
    ];
    open(zenoh_file, &own).map_err(|reason| {
        // A client says no more than that it gave up. A peer that tries once and listens nowhere says why.
        own.extend([
            ("mode", r#""peer""#.to_owned()),
            ("connect/timeout_ms", "0".to_owned()),
            ("listen/endpoints", "[]".to_owned()),
        ]);
        let why = match open(zenoh_file, &own) {
            Ok(session) => session.close().wait().map_or(reason, |()| "it was not there in time".to_owned()),
            Err(why) => why,
        };
        SessionError::Connect { endpoint: endpoint.to_owned(), reason: refusal::explained(&why) }
    })
}

fn open(zenoh_file: Option<&ZenohFile>, own: &[(&str, String)]) -> Result<Session, String> {
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
    let users = zenoh_file.into_iter().flat_map(ZenohFile::settings).map(|(key, value)| (key.as_str(), value));
    for (key, value) in users.chain(shared.iter().chain(own).map(|(key, value)| (*key, value))) {
        config.insert_json5(key, value).map_err(|e| format!("{key}: {}", reason(&e)))?;
    }
    zenoh::open(config).wait().map_err(|e| reason(&e))
}

/// The address of an endpoint, without its protocol before and its settings behind.
fn address(endpoint: &str) -> &str {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, address)| address);
    address.split(['?', '#']).next().unwrap_or(address)
}

fn wants_free_port(endpoint: &str) -> bool {
    address(endpoint).ends_with(":0")
}

/// `endpoint`, with a port of its host that nobody listens on in the place of 0.
fn with_free_port(endpoint: &str) -> Result<String, SessionError> {
    if !wants_free_port(endpoint) {
        return Ok(endpoint.to_owned());
    }
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
