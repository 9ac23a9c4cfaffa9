//! Who a node is, as its liveliness token says.

use std::fmt;

use super::place::in_token;
use super::{KeyError, Place, Role, Workers, check};
use crate::WIRE_VERSION;

/// A node.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId {
    /// What it does.
    pub role: Role,
    /// Whom it serves.
    pub workers: Workers,
    /// Its own name, for people.
    pub name: String,
    /// Its bus session, which no other node has. Neither the sim's token says one, nor those of version 1.
    pub session: Option<String>,
    /// The version of the messages it speaks, see [`WIRE_VERSION`].
    pub version: u32,
}

impl NodeId {
    /// A node of this build.
    ///
    /// # Errors
    /// [`KeyError`] where `name` or `session` cannot be part of a key.
    pub fn new(role: Role, workers: Workers, name: &str, session: &str) -> Result<Self, KeyError> {
        let (name, session) = (check("node name", name)?, check("session", session)?);
        Ok(Self { role, workers, name, session: Some(session), version: WIRE_VERSION })
    }

    /// The simulator of this build.
    #[must_use]
    pub fn sim() -> Self {
        Self { role: Role::Sim, workers: Workers::All, name: "sim".to_owned(), session: None, version: WIRE_VERSION }
    }

    /// The key of its liveliness token at `place`.
    #[must_use]
    pub fn key(&self, place: &Place) -> String {
        let (role, workers, name, version) = (self.role, self.workers.in_token(), &self.name, self.version);
        place.token(&match &self.session {
            Some(session) => format!("{role}/{workers}/{name}/{session}/{version}"),
            None => format!("{role}/{workers}/{name}/{version}"),
        })
    }

    /// Who `key` is the token of.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let chunks = in_token(key)?;
        let (role, workers, name, session, version) = match chunks.as_slice() {
            [role, workers, name, session, version] => (role, workers, name, Some(check("session", session)), version),
            [role, workers, name, version] => (role, workers, name, None, version),
            _ => return None,
        };
        Some(Self {
            role: Role::ALL.into_iter().find(|known| known.to_string() == *role)?,
            workers: workers.parse().ok()?,
            name: check("node name", name).ok()?,
            session: session.transpose().ok()?,
            version: version.parse().ok()?,
        })
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} (worker {})", self.role, self.name, self.workers)
    }
}
