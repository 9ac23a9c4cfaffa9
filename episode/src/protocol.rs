//! The rules of an episode, as settings. They are written to `run.toml` with every default filled in, so that a run can be
//! repeated from its folder alone.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use world::vehicle::{BicycleModel, Limits, WHEELBASE};

/// Which rules. Numbers of one protocol are never mixed with another's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "name")]
pub enum Protocol {
    /// What an evaluator should believe: a bicycle model, oriented boxes, every agent, fault classes.
    Strict(StrictSettings),
    /// The authors' simulator, quirk for quirk: it exists to reproduce, so there is nothing to set.
    Paper,
}

impl Default for Protocol {
    fn default() -> Self {
        Self::Strict(StrictSettings::default())
    }
}

impl Protocol {
    /// The name that every file and table carries.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Strict(_) => "strict",
            Self::Paper => "paper",
        }
    }

    /// How the AV follows its plan, as tables name it.
    #[must_use]
    pub fn motion_name(&self) -> &'static str {
        match self {
            Self::Strict(settings) => match settings.motion {
                Motion::Bicycle => "bicycle",
                Motion::Playback => "playback",
            },
            Self::Paper => "first-pose",
        }
    }

    /// Which settings are not as usual, as `key = value`.
    #[must_use]
    pub fn changes(&self) -> Vec<String> {
        match self {
            Self::Strict(settings) => settings.changes(),
            Self::Paper => Vec::new(),
        }
    }

    /// # Errors
    /// [`SettingError`] names the first setting that makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        match self {
            Self::Strict(settings) => settings.check(),
            Self::Paper => Ok(()),
        }
    }
}

/// How the AV gets from one step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// By the kinematic bicycle model, from the plan's first control or from the tracker.
    #[default]
    Bicycle,
    /// The AV is put on the plan's first state. For log replay (driver `human`) alone: it judges the log itself.
    Playback,
}

/// The distance between the AV's axles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wheelbase {
    /// So many metres, whatever the AV's size.
    Fixed(f64),
    /// This share of the AV's length.
    OfLength(f64),
}

impl Default for Wheelbase {
    fn default() -> Self {
        Self::Fixed(WHEELBASE)
    }
}

impl Wheelbase {
    /// The wheelbase (m) of an AV of `length` (m).
    #[must_use]
    pub fn of(self, length: f64) -> f64 {
        match self {
            Self::Fixed(wheelbase) => wheelbase,
            Self::OfLength(share) => share * length,
        }
    }
}

/// Which contact ends an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndingCollision {
    /// One that the AV is at fault for; others are counted and the drive goes on.
    #[default]
    AtFault,
    /// Any.
    Any,
    /// None: the drive goes on to the horizon, as in nuPlan.
    None,
}

/// The settings of the strict protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct StrictSettings {
    /// Log index of step 0 (19: two seconds of history, as in the paper).
    pub start: u32,
    /// The most steps that are driven (150: 15 s).
    pub horizon: u32,
    /// How the AV moves.
    pub motion: Motion,
    /// Distance between the AV's axles.
    pub wheelbase: Wheelbase,
    /// Greatest acceleration and deceleration (m/s^2).
    pub max_acceleration: f64,
    /// Greatest angle of the front wheels to either side (rad).
    pub max_steering: f64,
    /// Greatest change of that angle (rad/s).
    pub max_steering_rate: f64,
    /// Greatest distance of the AV's centre to the route (m); beyond it the episode ends.
    pub off_route_distance: f64,
    /// Which contact ends the episode.
    pub ending_collision: EndingCollision,
}

impl Default for StrictSettings {
    fn default() -> Self {
        Self {
            start: 19,
            horizon: 150,
            motion: Motion::Bicycle,
            wheelbase: Wheelbase::default(),
            max_acceleration: Limits::STRICT.acceleration,
            max_steering: Limits::STRICT.steering,
            max_steering_rate: Limits::STRICT.steering_rate,
            off_route_distance: 5.0,
            ending_collision: EndingCollision::AtFault,
        }
    }
}

impl StrictSettings {
    /// These settings with changes `KEY=VALUE`; a value is TOML, a word needs no quotes. The motion is not changed so: what moves how
    /// depends on who drives.
    ///
    /// # Errors
    /// [`SettingError::Change`].
    pub fn with_changes(mut self, changes: &[String]) -> Result<Self, SettingError> {
        for change in changes {
            self = changed(self, &SET, change, |key| {
                (key == "motion").then_some("the motion has an option of its own: --motion")
            })?;
        }
        Ok(self)
    }

    /// What is not as usual, as `key = value`, but for the motion, which tables name themselves.
    #[must_use]
    pub fn changes(&self) -> Vec<String> {
        changes(self, &Self { motion: self.motion, ..Self::default() })
    }

    /// What the AV can do.
    #[must_use]
    pub fn limits(&self) -> Limits {
        Limits {
            acceleration: self.max_acceleration,
            steering: self.max_steering,
            steering_rate: self.max_steering_rate,
        }
    }

    /// How an AV of `length` (m) moves.
    ///
    /// # Errors
    /// [`SettingError`] where the wheelbase is a share of a length that the log does not know.
    pub fn vehicle(&self, length: f64) -> Result<BicycleModel, SettingError> {
        let wheelbase = positive("wheelbase", self.wheelbase.of(length))?;
        let limits = (self.max_acceleration, self.max_steering);
        Ok(BicycleModel { acceleration_clip: limits.0, steering_clip: limits.1, ..BicycleModel::new(wheelbase) })
    }
}

/// How settings are changed.
#[derive(Debug, PartialEq, Eq)]
pub struct SetBy {
    /// The option of the command line.
    pub option: &'static str,
    /// The page that tells of them.
    pub page: &'static str,
}

static SET: SetBy = SetBy { option: "--set", page: "docs/running.md" };

/// A setting that makes no sense.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SettingError {
    #[error("{setting} is {value}, but it must be {needed}")]
    Value { setting: &'static str, value: f64, needed: &'static str },
    #[error("{} {change}: {reason}\nhint: {} lists what can be set", by.option, by.page)]
    Change { by: &'static SetBy, change: String, reason: String },
    #[error(
        "agents that react need the protocol strict: paper is the authors' simulator, which replays the log\nhint: leave --traffic out, or drive under --protocol strict"
    )]
    ReactivePaper,
}

fn positive(setting: &'static str, value: f64) -> Result<f64, SettingError> {
    let needed = "finite and above 0";
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(SettingError::Value { setting, value, needed }) }
}

impl StrictSettings {
    fn check(&self) -> Result<(), SettingError> {
        positive("horizon", f64::from(self.horizon))?;
        positive("wheelbase", self.wheelbase.of(1.0))?;
        positive("max-acceleration", self.max_acceleration)?;
        positive("max-steering-rate", self.max_steering_rate)?;
        positive("off-route-distance", self.off_route_distance)?;
        positive("max-steering", self.max_steering)?;
        if self.max_steering >= 1.5 {
            let needed = "below 1.5 rad: its tangent must stay finite";
            return Err(SettingError::Value { setting: "max-steering", value: self.max_steering, needed });
        }
        Ok(())
    }
}

/// The settings with one of them changed, as `key=value`; `refused` says of a key why it is none to be changed.
pub(crate) fn changed<S: Serialize + DeserializeOwned>(
    settings: S,
    by: &'static SetBy,
    change: &str,
    refused: impl Fn(&str) -> Option<&'static str>,
) -> Result<S, SettingError> {
    let wrong = |reason: &str| {
        let (change, reason) = (change.to_owned(), reason.trim().to_owned());
        SettingError::Change { by, change, reason }
    };
    let (key, value) = change.split_once('=').ok_or_else(|| wrong("it is not KEY=VALUE"))?;
    let value = value.trim();
    let parsed: Result<toml::Table, _> = toml::from_str(&format!("{key} = {value}"));
    let parsed = parsed.or_else(|_| toml::from_str(&format!("{key} = {value:?}")));
    let parsed = parsed.map_err(|error| wrong(error.message()))?;
    if let Some(reason) = parsed.keys().find_map(|key| refused(key)) {
        return Err(wrong(reason));
    }
    let mut table = toml::Table::try_from(&settings).map_err(|error| wrong(&error.to_string()))?;
    table.extend(parsed);
    table.try_into().map_err(|error: toml::de::Error| wrong(error.message()))
}

/// What differs from the `usual`, as `key = value`.
pub(crate) fn changes<S: Serialize>(settings: &S, usual: &S) -> Vec<String> {
    let table = |settings: &S| toml::Table::try_from(settings).unwrap_or_default();
    let usual = table(usual);
    let changed = table(settings).into_iter().filter(|(key, value)| usual.get(key) != Some(value));
    changed.map(|(key, value)| format!("{key} = {value}")).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_toml_and_name_their_protocol() {
        for protocol in [Protocol::default(), Protocol::Paper] {
            let text = toml::to_string(&protocol).unwrap();
            assert!(text.starts_with(&format!("name = \"{}\"", protocol.name())), "{text}");
            assert_eq!(toml::from_str::<Protocol>(&text).unwrap(), protocol);
        }
    }

    #[test]
    fn what_is_left_out_has_its_default_and_what_is_misspelt_is_refused() {
        let protocol: Protocol = toml::from_str("name = \"strict\"\nhorizon = 50").unwrap();
        assert_eq!(protocol, Protocol::Strict(StrictSettings { horizon: 50, ..StrictSettings::default() }));
        assert!(toml::from_str::<StrictSettings>("horizn = 50").is_err());
    }

    #[test]
    fn a_senseless_setting_is_named() {
        let settings = StrictSettings { max_steering: 1.6, ..StrictSettings::default() };
        let error = Protocol::Strict(settings).check().unwrap_err().to_string();
        assert!(error.starts_with("max-steering is 1.6"), "{error}");
    }
}
