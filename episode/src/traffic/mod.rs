//! Traffic that reacts. Replay is the rule: an agent is taken over from the log only where the AV has left the log, or the log would bring the
//! agent into it; from then on its states are told by whoever drives it, until it leaves. `docs/traffic.md` has the rule with its numbers.
//!
//! ```text
//! Episode::observe ──▶ observation ──┐
//! Episode::taken ──▶ who, from when ─┴─▶ a traffic model ──▶ Episode::move_traffic ──▶ Episode::advance: judges see who reacts where he is
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | the settings |
//! | [`hand_over`] | the rule: who is taken over, when |
//! | [`company`] | who is, where they are, who leaves |

pub mod company;
pub mod hand_over;

use serde::{Deserialize, Serialize};

use crate::protocol::{self, SetBy, SettingError};

/// Who may be taken over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TrafficSettings {
    /// Who is farther from the AV (m) is left to the log.
    pub radius: f64,
    /// The AV, or an agent that reacts, that is farther than this (m) from where the log has it has left the log.
    pub left_log: f64,
    /// What people on foot do.
    pub pedestrians: Pedestrians,
}

/// What people on foot do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pedestrians {
    /// What they did in the log.
    #[default]
    Replayed,
    /// They stop for a car that is in their way.
    Stop,
}

impl Default for TrafficSettings {
    fn default() -> Self {
        Self { radius: 60.0, left_log: 1.0, pedestrians: Pedestrians::Replayed }
    }
}

impl TrafficSettings {
    /// # Errors
    /// [`SettingError`] names the first setting that makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        let needed = "finite and not below 0";
        for (setting, value) in [("radius", self.radius), ("left-log", self.left_log)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(SettingError::Value { setting, value, needed });
            }
        }
        Ok(())
    }

    /// These settings with changes, `key=value` each.
    ///
    /// # Errors
    /// [`SettingError`] says what is wrong with which.
    pub fn with_changes(self, changes: &[String]) -> Result<Self, SettingError> {
        static SET: SetBy = SetBy { option: "--traffic-set", page: "docs/traffic.md" };
        let changed =
            changes.iter().try_fold(self, |settings, change| protocol::changed(settings, &SET, change, |_| None))?;
        changed.check().map(|()| changed)
    }

    /// What is not as usual, as `key = value`.
    #[must_use]
    pub fn changes(&self) -> Vec<String> {
        protocol::changes(self, &Self::default())
    }
}
