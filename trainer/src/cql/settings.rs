//! What a training is told: one TOML file, d3rlpy's defaults where it says nothing. `docs/cql.md` shows it whole.

use serde::{Deserialize, Serialize};
use toml::Table;

use crate::settings::{AdamSettings, SettingsError, differences, read};

/// How the policy is trained. Names and values are those of `CQLConfig` in d3rlpy 2.8.1, but for the first four and `goal_bonus`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Where random numbers start: first weights, order, sampled actions. Another seed, another training.
    pub seed: u64,
    /// How often all transitions are seen.
    pub epochs: usize,
    /// A checkpoint is written whenever so many steps were done, and after each epoch; 0: after epochs alone.
    pub checkpoint_every: u64,
    /// What is added to the reward, the metres driven, where the AV comes to its goal.
    pub goal_bonus: f64,
    /// Transitions in a step; what is left at an epoch's end is left out.
    pub batch_size: usize,
    /// Adam's, of the policy.
    pub actor_learning_rate: f64,
    /// Adam's, of the critics.
    pub critic_learning_rate: f64,
    /// Adam's, of the temperature's logarithm.
    pub temp_learning_rate: f64,
    /// Adam's, of alpha's logarithm.
    pub alpha_learning_rate: f64,
    /// What a reward a step later is worth.
    pub gamma: f64,
    /// How far targets follow the critics in a step.
    pub tau: f64,
    /// What the entropy is worth at first.
    pub initial_temperature: f64,
    /// How much the conservative term counts at first.
    pub initial_alpha: f64,
    /// The gap that alpha strives for.
    pub alpha_threshold: f64,
    /// How much the conservative term counts at any time.
    pub conservative_weight: f64,
    /// Actions that are sampled of the policy now, of the policy a step later, and anywhere.
    pub n_action_samples: usize,
    /// Adam.
    pub adam: AdamSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 42,
            epochs: 10,
            checkpoint_every: 0,
            goal_bonus: 10.0,
            batch_size: 256,
            actor_learning_rate: 1e-4,
            critic_learning_rate: 3e-4,
            temp_learning_rate: 1e-4,
            alpha_learning_rate: 1e-4,
            gamma: 0.99,
            tau: 0.005,
            initial_temperature: 1.0,
            initial_alpha: 1.0,
            alpha_threshold: 10.0,
            conservative_weight: 5.0,
            n_action_samples: 10,
            adam: AdamSettings::default(),
        }
    }
}

/// What may differ when a training goes on: nothing that was done so far depends on it.
const FREE: [&str; 2] = ["epochs", "checkpoint_every"];

impl Settings {
    /// Those of a file, with changes `key=value`.
    ///
    /// # Errors
    /// [`SettingsError`] names what cannot be.
    pub fn read(text: &str, changes: &[String]) -> Result<Self, SettingsError> {
        read::<Self>(text, changes)?.checked()
    }

    /// Those of a table in which any may be left out.
    ///
    /// # Errors
    /// [`SettingsError`] names the key.
    pub fn of_table(table: Table) -> Result<Self, SettingsError> {
        let settings: Self = table.try_into().map_err(|error| SettingsError::File(error.message().to_owned()))?;
        settings.checked()
    }

    /// As a table in which none is left out.
    #[must_use]
    pub fn table(&self) -> Table {
        // Numbers and a table of them. The seed is checked.
        Table::try_from(self).unwrap_or_default()
    }

    /// How training goes otherwise than by `other`: `gamma is 0.9 here and 0.99 there`.
    #[must_use]
    pub fn differences(&self, other: &Table) -> Vec<String> {
        differences(&self.table(), other, &FREE)
    }

    fn checked(self) -> Result<Self, SettingsError> {
        let is = |holds: bool, key, value: &dyn ToString, needed| {
            if holds { Ok(()) } else { Err(SettingsError::Value { key, value: value.to_string(), needed }) }
        };
        let positive = |key, value: f64| is(value.is_finite() && value > 0.0, key, &value, "finite and above 0");
        is(self.seed < 1 << 63, "seed", &self.seed, "below 2^63")?;
        is(self.epochs > 0, "epochs", &self.epochs, "1 or more")?;
        is(self.batch_size > 0, "batch_size", &self.batch_size, "1 or more")?;
        is(self.n_action_samples > 0, "n_action_samples", &self.n_action_samples, "1 or more")?;
        is(self.goal_bonus.is_finite(), "goal_bonus", &self.goal_bonus, "finite")?;
        positive("actor_learning_rate", self.actor_learning_rate)?;
        positive("critic_learning_rate", self.critic_learning_rate)?;
        positive("temp_learning_rate", self.temp_learning_rate)?;
        positive("alpha_learning_rate", self.alpha_learning_rate)?;
        is((0.0..1.0).contains(&self.gamma), "gamma", &self.gamma, "0 or more, and below 1")?;
        is((0.0..=1.0).contains(&self.tau), "tau", &self.tau, "from 0 to 1")?;
        positive("initial_temperature", self.initial_temperature)?;
        positive("initial_alpha", self.initial_alpha)?;
        is(self.alpha_threshold.is_finite(), "alpha_threshold", &self.alpha_threshold, "finite")?;
        positive("conservative_weight", self.conservative_weight)?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_misspelt_or_senseless_is_named() {
        let told = |change: &str| Settings::read("", &[change.to_owned()]).unwrap_err().to_string();
        assert!(told("gama=1").contains("unknown field `gama`"));
        assert!(told("gamma=1").starts_with("gamma is 1, but it must be 0 or more, and below 1"));
        let there = Settings::default().table();
        let here = Settings::read("", &["tau = 0.01".to_owned(), "epochs=3".to_owned()]).unwrap();
        assert_eq!(here.differences(&there), ["tau is 0.01 here and 0.005 there"]);
    }

    #[test]
    fn the_documentation_shows_every_default() {
        let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/cql.md")).unwrap();
        let block = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        assert_eq!(toml::from_str::<Table>(block).unwrap(), Settings::default().table());
    }
}
