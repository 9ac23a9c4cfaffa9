//! What a training is told: one TOML file, the paper's values where it says nothing. `docs/learning.md` shows it whole.
//!
//! ```text
//! file ──▶ Settings (checks names and types) ──▶ changes (--set key=value) ──▶ Settings (checks sense)
//! ```

use std::path::PathBuf;

use network::weights::{CostForm, Variant};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::{Table, Value};

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Which of the paper's systems comes out.
    pub mode: Mode,
    /// Whether the authors' quirks are kept (`training.md` 5).
    pub rules: Rules,
    /// Where random numbers start: first weights, order, dropout. Another seed, another training.
    pub seed: u64,
    /// Weights to begin with, a file; if left out, as PyTorch draws them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<PathBuf>,
    /// How often all windows are seen.
    pub epochs: usize,
    /// So many of them, the first, without the planner.
    pub epochs_without_planner: usize,
    /// Windows in a step; the last of an epoch has what is left.
    pub batch: usize,
    /// Adam's, at first.
    pub learning_rate: f64,
    /// It is halved whenever so many epochs have passed; 0: never.
    pub halve_every: usize,
    /// The gradient is made no longer than this (L2 norm over all parameters, before Adam).
    pub clip: f64,
    /// The probability with which a number is dropped in training, wherever `network.md` names dropout.
    pub dropout: f64,
    /// Whose predictions the planner is given.
    pub predictor: Predictor,
    /// Where the planner starts.
    pub initial_controls: InitialControls,
    /// Whether the predictor's own losses stay in the sum when the planner is on.
    pub keep_predictor_loss: bool,
    /// A checkpoint is written whenever so many steps were done, and after each epoch; 0: after epochs alone.
    pub checkpoint_every: u64,
    /// Whether the weights after each epoch are kept, as `weights/epoch-NN.f32.safetensors`.
    pub keep_epochs: bool,
    /// Adam.
    pub adam: AdamSettings,
    /// How much each loss counts.
    pub loss: LossWeights,
    /// The planner in training.
    pub planner: PlannerSettings,
    /// The planner's weights, which are learned.
    pub cost: CostSettings,
    /// Where the planner's gradient ends.
    pub cut: Cut,
}

/// The paper's systems. `sep` and `il-pred` are the same training: they differ in who drives with the weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Predictor, cost and planner, jointly.
    Dipp,
    /// The predictor alone, for a planner of hand-tuned weights.
    Sep,
    /// The predictor alone, whose own plan is driven.
    IlPred,
    /// The AV's plan alone: nobody is predicted.
    Il,
}

/// Whether quirks of the published code are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rules {
    /// As published.
    Authors,
    /// With what `training.md` 5 says in brackets.
    Mended,
}

/// Whose predictions the planner is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Predictor {
    /// The network's.
    Network,
    /// Constant turn rate and velocity.
    Ctrv,
    /// What happened.
    Oracle,
}

/// Where the planner starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialControls {
    /// With the network's controls.
    Network,
    /// Straight on, at the speed that is driven.
    Zero,
}

/// Adam's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamSettings {
    /// How much of the mean of gradients stays in a step.
    pub beta1: f64,
    /// How much of the mean of their squares.
    pub beta2: f64,
    /// Added to the root of the latter.
    pub epsilon: f64,
}

/// How much each loss counts (the paper's lambdas).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossWeights {
    /// Of the best future of all.
    pub prediction: f64,
    /// Of the scores.
    pub score: f64,
    /// Of the planned trajectory.
    pub plan: f64,
    /// Of the planner's cost.
    pub cost: f64,
}

/// The planner in training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlannerSettings {
    /// Gauss-Newton iterations that are gone through, and back.
    pub iterations: usize,
    /// How much of each step is taken.
    pub step: f64,
}

/// The planner's weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CostSettings {
    /// How they come out of the network.
    pub kind: CostKind,
    /// Where they begin.
    pub start: CostStart,
    /// Whether they are learned.
    pub learn: bool,
    /// The weight of a penalty on how far their logarithms are from where they began; 0: none.
    pub prior: f64,
    /// A learning rate of their own, halved as the other; if left out, the other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learning_rate: Option<f64>,
}

/// How the planner's weights come out of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CostKind {
    /// The authors': shares of nine, two of them thrown away. The hand-tuned cost cannot be said so (`training.md` 7).
    Softmax,
    /// A positive number each.
    Exp,
}

impl CostKind {
    /// The same as a weights file has it.
    #[must_use]
    pub fn form(self) -> CostForm {
        match self {
            Self::Softmax => CostForm::Shares,
            Self::Exp => CostForm::Exponentials,
        }
    }
}

/// Where the planner's weights begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CostStart {
    /// As the seed has it.
    Random,
    /// At the hand-tuned cost; as shares, at 0.76 of it.
    HandTuned,
}

/// Where the planner's gradient ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cut {
    /// Before the predictions.
    pub predictions: bool,
    /// Before the network's controls.
    pub controls: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: Mode::Dipp,
            rules: Rules::Mended,
            seed: 42,
            start: None,
            epochs: 20,
            epochs_without_planner: 5,
            batch: 32,
            learning_rate: 2e-4,
            halve_every: 4,
            clip: 5.0,
            dropout: 0.1,
            predictor: Predictor::Network,
            initial_controls: InitialControls::Network,
            keep_predictor_loss: true,
            checkpoint_every: 0,
            keep_epochs: false,
            adam: AdamSettings::default(),
            loss: LossWeights::default(),
            planner: PlannerSettings::default(),
            cost: CostSettings::default(),
            cut: Cut::default(),
        }
    }
}

impl Default for AdamSettings {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 }
    }
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { prediction: 0.5, score: 1.0, plan: 1.0, cost: 1e-3 }
    }
}

impl Default for PlannerSettings {
    fn default() -> Self {
        Self { iterations: 2, step: 0.4 }
    }
}

impl Default for CostSettings {
    fn default() -> Self {
        Self { kind: CostKind::Softmax, start: CostStart::Random, learn: true, prior: 0.0, learning_rate: None }
    }
}

/// Settings that cannot be understood, or make no sense.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SettingsError {
    /// The file.
    #[error("{0}\nhint: docs/learning.md shows every setting, docs/cql.md those of cql")]
    File(String),
    /// A change of it.
    #[error(
        "--set {change}: {reason}\nhint: as in --set epochs=10 or --set cost.kind=exp; docs/learning.md shows every setting"
    )]
    Change {
        /// As it was typed.
        change: String,
        /// Why.
        reason: String,
    },
    /// A value that cannot be meant.
    #[error("{key} is {value}, but it must be {needed}")]
    Value {
        /// The setting.
        key: &'static str,
        /// Its value.
        value: String,
        /// Which are possible.
        needed: &'static str,
    },
}

/// What may differ where a training is continued: nothing that was done so far depends on it.
const FREE: [&str; 3] = ["epochs", "checkpoint_every", "keep_epochs"];

impl Settings {
    /// Those of a file, with changes of the form `key=value`, where a key is written with dots (`cost.kind=exp`).
    ///
    /// # Errors
    /// [`SettingsError`] names line or key.
    pub fn read(text: &str, changes: &[String]) -> Result<Self, SettingsError> {
        let settings: Self = read(text, changes)?;
        settings.check()?;
        Ok(settings)
    }

    /// Those of a table in which any may be left out.
    ///
    /// # Errors
    /// [`SettingsError`] names the key.
    pub fn of_table(table: Table) -> Result<Self, SettingsError> {
        let settings: Self = table.try_into().map_err(|error| SettingsError::File(error.message().to_owned()))?;
        settings.check()?;
        Ok(settings)
    }

    /// As a table in which none is left out.
    #[must_use]
    pub fn table(&self) -> Table {
        // Structs of numbers, words and tables: what TOML has. The seed is checked.
        Table::try_from(self).unwrap_or_default()
    }

    /// As a file in which none is left out.
    #[must_use]
    pub fn text(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// How training goes otherwise than by `other`: `batch is 16 here and 32 there`.
    #[must_use]
    pub fn differences(&self, other: &Table) -> Vec<String> {
        differences(&self.table(), other, &FREE)
    }

    /// Which network is trained.
    #[must_use]
    pub fn variant(&self) -> Variant {
        match self.mode {
            Mode::Dipp => Variant::Joint,
            Mode::Sep | Mode::IlPred => Variant::Separate,
            Mode::Il => Variant::Imitation,
        }
    }

    fn check(&self) -> Result<(), SettingsError> {
        let is = |holds: bool, key, value: &dyn ToString, needed| {
            if holds { Ok(()) } else { Err(SettingsError::Value { key, value: value.to_string(), needed }) }
        };
        let at_least_one = |key, value: usize| is(value > 0, key, &value, "1 or more");
        let positive = |key, value: f64| is(value.is_finite() && value > 0.0, key, &value, "finite and above 0");
        let no_less_than_0 = |key, value: f64| is(value.is_finite() && value >= 0.0, key, &value, "finite, 0 or more");
        let share = |key, value: f64| is((0.0..1.0).contains(&value), key, &value, "0 or more, and below 1");
        is(self.seed < 1 << 63, "seed", &self.seed, "below 2^63")?;
        at_least_one("epochs", self.epochs)?;
        at_least_one("batch", self.batch)?;
        positive("learning_rate", self.learning_rate)?;
        positive("clip", self.clip)?;
        share("dropout", self.dropout)?;
        share("adam.beta1", self.adam.beta1)?;
        share("adam.beta2", self.adam.beta2)?;
        positive("adam.epsilon", self.adam.epsilon)?;
        no_less_than_0("loss.prediction", self.loss.prediction)?;
        no_less_than_0("loss.score", self.loss.score)?;
        no_less_than_0("loss.plan", self.loss.plan)?;
        no_less_than_0("loss.cost", self.loss.cost)?;
        at_least_one("planner.iterations", self.planner.iterations)?;
        positive("planner.step", self.planner.step)?;
        no_less_than_0("cost.prior", self.cost.prior)?;
        self.cost.learning_rate.map_or(Ok(()), |rate| positive("cost.learning_rate", rate))
    }
}

/// Settings of a file with changes, of whatever training; what makes no sense is not found here.
pub(crate) fn read<S: DeserializeOwned>(text: &str, changes: &[String]) -> Result<S, SettingsError> {
    // First as it stands: these messages show the line.
    toml::from_str::<S>(text).map_err(|error| SettingsError::File(error.to_string().trim_end().to_owned()))?;
    let mut table: Table = toml::from_str(text).map_err(|error| SettingsError::File(error.to_string()))?;
    for change in changes {
        let refused = |reason: String| SettingsError::Change { change: change.clone(), reason };
        merge(&mut table, parse_change(change).map_err(refused)?);
        table.clone().try_into::<S>().map_err(|error| refused(error.message().to_owned()))?;
    }
    table.try_into().map_err(|error| SettingsError::File(error.message().to_owned()))
}

/// In what two tables of settings differ, but for the keys that are `free` to.
pub(crate) fn differences(here: &Table, there: &Table, free: &[&str]) -> Vec<String> {
    let (mut own, mut other) = (Vec::new(), Vec::new());
    flatten("", here, &mut own);
    flatten("", there, &mut other);
    let said = |list: &[(String, String)], key: &str| {
        let found = list.iter().find(|(own, _)| own == key);
        found.map_or_else(|| "not set".to_owned(), |(_, value)| value.clone())
    };
    let only_there = other.iter().filter(|(key, _)| !own.iter().any(|(own, _)| own == key));
    let keys = own.iter().chain(only_there).map(|(key, _)| key).filter(|key| !free.contains(&key.as_str()));
    keys.map(|key| (key, said(&own, key), said(&other, key)))
        .filter(|(_, here, there)| here != there)
        .map(|(key, here, there)| format!("{key} is {here} here and {there} there"))
        .collect()
}

/// Puts `changes` over `table`; tables within are merged, all else is replaced.
pub fn merge(table: &mut Table, changes: Table) {
    for (key, value) in changes {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(own)), Value::Table(changes)) => merge(own, changes),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

/// `cost.kind=exp` as a table; a value that is no TOML is a word.
fn parse_change(change: &str) -> Result<Table, String> {
    let (key, value) = change.split_once('=').ok_or("it is not of the form key=value")?;
    let (key, value) = (key.trim(), value.trim());
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if key.is_empty() || !key.chars().all(plain) {
        return Err("that is no key".to_owned());
    }
    let as_it_stands = format!("{key} = {value}");
    let as_a_word = || format!("{key} = {}", Value::String(value.to_owned()));
    toml::from_str(&as_it_stands).or_else(|_| toml::from_str(&as_a_word())).map_err(|error| error.message().to_owned())
}

fn flatten(prefix: &str, table: &Table, out: &mut Vec<(String, String)>) {
    for (key, value) in table {
        match value {
            Value::Table(table) => flatten(&format!("{prefix}{key}."), table, out),
            value => out.push((format!("{prefix}{key}"), value.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(changes: &[&str]) -> Result<Settings, SettingsError> {
        Settings::read("", &changes.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    fn refusal(change: &str) -> String {
        changed(&[change]).unwrap_err().to_string().lines().next().unwrap().to_owned()
    }

    #[test]
    fn settings_survive_toml() {
        let settings = changed(&["cost.learning_rate=0.01", "mode=il-pred", "cut.controls=true"]).unwrap();
        assert_eq!(Settings::read(&settings.text(), &[]).unwrap(), settings);
        assert_eq!(settings.variant(), Variant::Separate);
    }

    #[test]
    fn a_change_is_over_the_file_and_leaves_its_neighbours() {
        let file = "epochs = 3\ncost = { kind = \"exp\", prior = 1 }";
        let settings = Settings::read(file, &["cost.start = hand-tuned".into(), "clip=2".into()]).unwrap();
        assert_eq!((settings.epochs, settings.clip), (3, 2.0));
        let cost = CostSettings { kind: CostKind::Exp, start: CostStart::HandTuned, prior: 1.0, ..Default::default() };
        assert_eq!(settings.cost, cost);
    }

    #[test]
    fn what_is_misspelt_or_senseless_is_named() {
        assert!(refusal("epoch=3").starts_with("--set epoch=3: unknown field `epoch`"), "{}", refusal("epoch=3"));
        assert!(refusal("cost.kid=exp").contains("unknown field `kid`"));
        assert!(refusal("mode=dip").contains("unknown variant `dip`"));
        assert_eq!(refusal("epochs"), "--set epochs: it is not of the form key=value");
        assert_eq!(refusal("a\nb=1"), "--set a");
        assert_eq!(refusal("batch=0"), "batch is 0, but it must be 1 or more");
        assert_eq!(refusal("dropout=1"), "dropout is 1, but it must be 0 or more, and below 1");
        assert_eq!(refusal("learning_rate=nan"), "learning_rate is NaN, but it must be finite and above 0");
        let file = Settings::read("\n\nbach = 3", &[]).unwrap_err().to_string();
        assert!(file.contains("line 3") && file.contains("unknown field `bach`"), "{file}");
    }

    #[test]
    fn differences_are_told_by_key_but_not_what_may_change() {
        let there = changed(&["cost.learning_rate=0.01", "epochs=3"]).unwrap().table();
        let here = changed(&["batch=16", "epochs=30", "keep_epochs=true"]).unwrap();
        assert_eq!(
            here.differences(&there),
            ["batch is 16 here and 32 there", "cost.learning_rate is not set here and 0.01 there"]
        );
        assert!(here.differences(&here.table()).is_empty());
    }

    #[test]
    fn the_documentation_shows_every_default() {
        let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/learning.md")).unwrap();
        let block = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        assert_eq!(toml::from_str::<Table>(block).unwrap(), Settings::default().table());
    }
}
