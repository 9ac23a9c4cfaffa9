//! A user's own Zenoh configuration, from a JSON5 file: certificates above all. What the bus itself needs stays as it is.

use std::fmt;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use serde_json::Value;
use thiserror::Error;
use zenoh::Config;

/// What a file may say of a session. `tls` says who may come, the rest how fast it goes.
const TAKEN: [&str; 8] = [
    "transport/link/tls",
    "transport/link/tcp",
    "transport/link/tx",
    "transport/link/rx",
    "transport/unicast/open_timeout",
    "transport/unicast/accept_timeout",
    "transport/unicast/accept_pending",
    "transport/unicast/max_sessions",
];

/// What every file of Zenoh's may hold, and is said by reloop itself: a file made for other programs too can be given as it is.
const OWN: [&str; 11] = [
    "id",
    "mode",
    "metadata",
    "connect",
    "listen",
    "open",
    "scouting",
    "timestamping",
    "transport/link/rx/max_message_size",
    "transport/link/tx/lease",
    "transport/link/tx/queue",
];

/// The fields that name files. A name that begins with no slash is looked for beside the configuration.
const FILES: [&str; 5] =
    ["root_ca_certificate", "listen_private_key", "listen_certificate", "connect_private_key", "connect_certificate"];

/// Levels of objects and lists.
const DEEPEST: usize = 32;

const TLS: &str = "transport/link/tls";

/// Why a configuration cannot be used. No error shows a value: it may be a secret.
#[derive(Debug, Error)]
pub enum ZenohFileError {
    /// It cannot be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// It is no JSON5.
    #[error("{path}:{line}:{column}: not JSON5 from here on\n  hint: docs/hosts.md has examples")]
    Syntax {
        /// The file.
        path: String,
        /// From one.
        line: usize,
        /// From one.
        column: usize,
    },
    /// A field has a value that it cannot have, or there is none of this name.
    #[error("{path}: {field}: {reason}")]
    Field {
        /// The file.
        path: String,
        /// Like `transport/link/tls/enable_mtls`.
        field: String,
        /// What is wrong.
        reason: String,
    },
    /// A field that would not do here what it says.
    #[error("{path}: {field} cannot be set for reloop: {reason}")]
    NotTaken {
        /// The file.
        path: String,
        /// Like `access_control`.
        field: String,
        /// Why not, and what to do.
        reason: &'static str,
    },
}

/// A configuration, checked.
#[derive(Clone)]
pub struct ZenohFile {
    path: PathBuf,
    /// Settings by field, as JSON.
    settings: Vec<(String, String)>,
}

/// Not what it says: there may be secrets.
impl fmt::Debug for ZenohFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ZenohFile({})", self.path.display())
    }
}

impl ZenohFile {
    /// Reads and checks the file at `path`.
    ///
    /// # Errors
    /// [`ZenohFileError`].
    pub fn read(path: &Path) -> Result<Self, ZenohFileError> {
        let shown = || path.display().to_string();
        let unreadable = |e: std::io::Error| ZenohFileError::Unreadable { path: shown(), reason: e.to_string() };
        let path = path.canonicalize().map_err(unreadable)?;
        let text = fs::read_to_string(&path).map_err(unreadable)?;
        Self::parse(path, &text)
    }

    /// Checks `text`, which lies at `path`.
    pub(crate) fn parse(path: PathBuf, text: &str) -> Result<Self, ZenohFileError> {
        let mut file = Self { path, settings: Vec::new() };
        let fault = |line, column| ZenohFileError::Syntax { path: file.shown(), line, column };
        if is_too_deep(text) {
            return Err(fault(1, 1));
        }
        match json5::from_str(text) {
            Ok(value @ Value::Object(_)) => file.take("", value).map(|()| file),
            Ok(_) => Err(fault(1, 1)),
            Err(json5::Error::Message { location, .. }) => {
                let (line, column) = location.map_or((1, 1), |at| (at.line, at.column));
                Err(fault(line, column))
            }
        }
    }

    /// Where it lies, from the root.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether who connects must show a certificate.
    #[must_use]
    pub fn asks_for_certificates(&self) -> bool {
        self.settings.contains(&(format!("{TLS}/enable_mtls"), "true".to_owned()))
    }

    pub(super) fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    fn shown(&self) -> String {
        self.path.display().to_string()
    }

    /// Takes `value` for what lies at `field`, and in it.
    fn take(&mut self, field: &str, value: Value) -> Result<(), ZenohFileError> {
        if lies_in(field, &OWN) {
            tracing::info!("{}: {field} is reloop's own, and not taken from there", self.shown());
            return Ok(());
        }
        match value {
            Value::Object(fields) => fields.into_iter().try_for_each(|(name, value)| {
                let below = if field.is_empty() { name } else { format!("{field}/{name}") };
                self.take(&below, value)
            }),
            value if lies_in(field, &TAKEN) => self.take_setting(field, value),
            _ => Err(ZenohFileError::NotTaken { path: self.shown(), field: field.to_owned(), reason: why_not(field) }),
        }
    }

    fn take_setting(&mut self, field: &str, value: Value) -> Result<(), ZenohFileError> {
        let bad = |reason: String| ZenohFileError::Field { path: self.shown(), field: field.to_owned(), reason };
        // Zenoh takes null for what nobody said.
        if let Err(e) = Config::default().insert_json5(field, &value.to_string()) {
            let said = super::reason(&e);
            let expected = said.rsplit_once(", expected ").and_then(|(_, rest)| rest.split('"').next());
            return Err(bad(
                expected.map_or("there is no such field".to_owned(), |expected| format!("expected {expected}"))
            ));
        }
        let value = match (names_a_file(field), value) {
            (true, Value::String(name)) => {
                let named = self.path.parent().unwrap_or(Path::new("")).join(name);
                File::open(&named).map_err(|e| bad(format!("{}: {e}", named.display())))?;
                Value::String(named.display().to_string())
            }
            (_, value) => value,
        };
        self.settings.push((field.to_owned(), value.to_string()));
        Ok(())
    }
}

/// Whether what is in `text` lies deeper than anything of Zenoh's does: who reads it calls itself for each level.
fn is_too_deep(text: &str) -> bool {
    let mut depth = 0_usize;
    text.bytes().any(|byte| {
        match byte {
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth > DEEPEST
    })
}

fn lies_in(field: &str, places: &[&str]) -> bool {
    places.iter().any(|place| field.strip_prefix(place).is_some_and(|rest| rest.is_empty() || rest.starts_with('/')))
}

fn names_a_file(field: &str) -> bool {
    field.rsplit_once('/').is_some_and(|(section, name)| section == TLS && FILES.contains(&name))
}

/// Why what lies at `field` is not taken.
fn why_not(field: &str) -> &'static str {
    if lies_in(field, &["access_control"]) {
        "in Zenoh what one subject may do no other's denial takes away, so that rules of yours would open what the simulator's own \
         close\n  hint: `sim run --planner-certificate NAME` says who may be the planner"
    } else if lies_in(field, &["transport/auth"]) {
        "passwords and bare keys are not built in, and would be asked of nobody\n  hint: transport/link/tls with enable_mtls lets in \
         who has a certificate of yours"
    } else {
        "it would change what the bus promises, or do nothing\n  hint: leave it out; docs/hosts.md says what is taken"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ZenohFile, String> {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("ca.pem"), "").unwrap();
        let path = folder.path().join("mine.json5");
        fs::write(&path, text).unwrap();
        let file = ZenohFile::read(&path);
        file.map_err(|e| e.to_string().replace(&folder.path().canonicalize().unwrap().display().to_string(), ""))
    }

    #[test]
    fn certificates_are_taken_and_looked_for_beside_the_file() {
        let file = read(
            "{ mode: 'peer', transport: { link: { tls: { root_ca_certificate: 'ca.pem', enable_mtls: true } } } }",
        );
        let file = file.unwrap();
        let beside = Value::String(file.path().with_file_name("ca.pem").display().to_string()).to_string();
        let tls = |name: &str| format!("transport/link/tls/{name}");
        let settings = file.settings().to_vec();
        assert!(settings.contains(&(tls("root_ca_certificate"), beside)), "{settings:?}");
        assert_eq!(settings.len(), 2, "mode is not taken: {settings:?}");
        assert!(file.asks_for_certificates());
    }

    #[test]
    fn what_is_wrong_is_named_by_file_and_field() {
        let tls = |fields: &str| read(&format!("{{ transport: {{ link: {{ tls: {{ {fields} }} }} }} }}")).unwrap_err();
        assert_eq!(tls("root_ca: 'x'"), "/mine.json5: transport/link/tls/root_ca: there is no such field");
        assert_eq!(tls("enable_mtls: 'yes'"), "/mine.json5: transport/link/tls/enable_mtls: expected a boolean");
        assert!(
            tls("listen_private_key: 'no.pem'")
                .starts_with("/mine.json5: transport/link/tls/listen_private_key: /no.pem: ")
        );
        assert!(read("{ transport: {").unwrap_err().starts_with("/mine.json5:1:"));
        assert!(read("5").unwrap_err().contains("not JSON5"));
        assert!(read(&"[".repeat(1_000_000)).unwrap_err().contains("not JSON5"));
    }

    #[test]
    fn what_would_open_the_bus_or_do_nothing_is_refused() {
        for (text, field) in [
            ("{ access_control: { enabled: true } }", "access_control/enabled"),
            ("{ transport: { auth: { usrpwd: { password: 'x' } } } }", "transport/auth/usrpwd/password"),
            ("{ transport: { unicast: { lowlatency: true } } }", "transport/unicast/lowlatency"),
            ("{ plugins_loading: { enabled: true } }", "plugins_loading/enabled"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(field) && said.contains("hint: "), "{said}");
        }
    }

    proptest::proptest! {
        #[test]
        fn a_configuration_that_is_damaged_is_taken_or_refused(
            at in 0_usize..1_000, cut in 0_usize..6, by in proptest::collection::vec(proptest::num::u8::ANY, 0..6),
        ) {
            let mut bytes = include_bytes!("../../../examples/hosts/sim.json5").to_vec();
            let at = at.min(bytes.len());
            let end = (at + cut).min(bytes.len());
            bytes.splice(at..end, by);
            crate::fuzzing::zenoh_config(&bytes);
        }
    }

    #[test]
    fn no_secret_is_shown() {
        let secret = "c2VjcmV0";
        for text in [
            format!("{{ transport: {{ link: {{ tls: {{ enable_mtls: '{secret}' }} }} }} }}"),
            format!("{{ transport: {{ link: {{ tls: {{ connect_private_key_base64: ['{secret}'] }} }} }} }}"),
            format!("{{ transport: {{ auth: {{ usrpwd: {{ password: '{secret}' }} }} }} }}"),
            format!("{{ transport: {{ link: {{ tls: {{ connect_private_key_base64: '{secret}' "),
        ] {
            assert!(!read(&text).unwrap_err().contains(secret), "{text}");
        }
        let file =
            read(&format!("{{ transport: {{ link: {{ tls: {{ connect_private_key_base64: '{secret}' }} }} }} }}"));
        assert!(!format!("{file:?}").contains(secret));
    }
}
