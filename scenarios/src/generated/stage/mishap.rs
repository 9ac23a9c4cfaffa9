//! What must not happen in a scene.

use thiserror::Error;
use world::scene::AgentKind;

/// What must not happen in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Mishap {
    /// The AV comes to the end of the map.
    #[error("the AV left the map")]
    AvLeaves,
    /// The AV stays where it is.
    #[error("the AV stood all the time")]
    AvStands,
    /// The AV's wheels would have had to turn further than they do.
    #[error("the AV went round too tight a bend")]
    TooTight,
    /// A vehicle went round a bend as none can.
    #[error("a vehicle went round a bend as none can")]
    Hurled,
    /// Somebody before the AV comes to the end of the map.
    #[error("somebody before the AV left the map")]
    Rim,
    /// Two touch.
    #[error("a {0} and a {1} touched")]
    Touch(AgentKind, AgentKind),
}
