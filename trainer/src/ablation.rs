//! A list of settings, each trained into a folder of its own, and a table of what came out.
//!
//! ```toml
//! seeds = [42, 43, 44]          # each run with each; if left out, with the seed in its settings
//! base = { epochs = 10 }        # what all have in common, over the defaults
//!
//! [[run]]
//! name = "dipp"
//!
//! [[run]]
//! name = "no-learnable-cost"
//! settings = { cost = { start = "hand-tuned", learn = false } }
//! ```

mod entrants;

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;
use toml::{Table, Value};

use crate::examples::Examples;
use crate::metrics::last_epoch;
use crate::settings::{Settings, SettingsError, merge};
use crate::step::Learner;
use crate::training::{Ended, Task, TrainingError, Watch, train};
use crate::whole_file::{self, WriteError};

/// A list that cannot be used.
#[derive(Debug, Error)]
pub enum ListError {
    /// It is none.
    #[error("{0}\nhint: docs/learning.md shows a list")]
    Format(String),
    /// A name that is no folder's, or twice there.
    #[error(
        "run {0:?}: a name is of letters, digits, '-', '_' and '.', begins with a letter or a digit, and is there once"
    )]
    Name(String),
    /// Settings of a run.
    #[error("run {name}: {source}")]
    Settings {
        /// Whose.
        name: String,
        /// What is wrong.
        source: SettingsError,
    },
}

/// One training of a list.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// What it is called in the table.
    pub name: String,
    /// Its folder.
    pub folder: String,
    /// How it is trained.
    pub settings: Settings,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    #[serde(default)]
    seeds: Vec<u64>,
    #[serde(default)]
    base: Table,
    run: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    #[serde(default)]
    settings: Table,
}

/// The trainings of a list, in its order, seed by seed.
///
/// # Errors
/// [`ListError`] names the run.
pub fn read(text: &str) -> Result<Vec<Run>, ListError> {
    let list: Text =
        toml::from_str(text).map_err(|error| ListError::Format(error.to_string().trim_end().to_owned()))?;
    let mut runs: Vec<Run> = Vec::new();
    for Entry { name, settings } in list.run {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let begins = name.starts_with(|c: char| c.is_ascii_alphanumeric());
        if !begins || !name.chars().all(plain) || runs.iter().any(|run| run.name == name) {
            return Err(ListError::Name(name));
        }
        let mut table = list.base.clone();
        merge(&mut table, settings);
        let refused = |source| ListError::Settings { name: name.clone(), source };
        let settings = Settings::of_table(table.clone()).map_err(refused)?;
        if list.seeds.is_empty() {
            runs.push(Run { name: name.clone(), folder: name.clone(), settings });
        }
        for seed in &list.seeds {
            table.insert("seed".to_owned(), Value::Integer(*seed as i64)); // checked with the settings
            let settings = Settings::of_table(table.clone()).map_err(refused)?;
            runs.push(Run { name: name.clone(), folder: format!("{name}-seed-{seed}"), settings });
        }
    }
    // `a` with seed 1, and one that is called `a-seed-1`.
    for (index, run) in runs.iter().enumerate() {
        if runs[..index].iter().any(|other| other.folder == run.folder) {
            return Err(ListError::Name(run.folder.clone()));
        }
    }
    Ok(runs)
}

/// What came out of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Which.
    pub run: Run,
    /// Its last row of `metrics.csv`, by column; empty where no epoch was done.
    pub last: Vec<(String, String)>,
    /// Why it went no further.
    pub failure: Option<String>,
}

/// Why the list was not gone through.
#[derive(Debug, Error)]
pub enum AblationError {
    /// A training that cannot begin.
    #[error("{name}: {source}")]
    Training {
        /// Which.
        name: String,
        /// Why.
        source: TrainingError,
    },
    /// There is nothing that learns by these settings.
    #[error("{name}: {source:#}")]
    Learner {
        /// Which.
        name: String,
        /// Why.
        source: anyhow::Error,
    },
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// What makes a learner of settings.
pub type MakeLearner<'a> = dyn Fn(&Settings) -> anyhow::Result<Box<dyn Learner>> + 'a;

/// What is trained, and where.
#[derive(Clone, Copy, Debug)]
pub struct List<'a> {
    /// The trainings.
    pub runs: &'a [Run],
    /// The folder of their folders.
    pub folder: &'a Path,
    /// Whether `ablation.csv`, `ablation.md` and `entrants.toml` are written there after each: not where these are a share of a list that others
    /// train too.
    pub writes_tables: bool,
    /// Whether each is drawn.
    pub rerun: bool,
}

/// Trains all of a list, each into its folder, going on where a training was stopped; one without a finite loss does
/// not keep others from theirs. None where somebody stopped it.
///
/// # Errors
/// [`AblationError`].
pub fn run(
    List { runs, folder, writes_tables, rerun }: &List<'_>,
    examples: &dyn Examples,
    learner: &MakeLearner<'_>,
    watch: &mut dyn Watch,
) -> Result<Option<Vec<Outcome>>, AblationError> {
    let mut outcomes = Vec::new();
    for run in *runs {
        let name = || run.folder.clone();
        let own = folder.join(&run.folder);
        let mut learner = learner(&run.settings).map_err(|source| AblationError::Learner { name: name(), source })?;
        let task = Task { settings: &run.settings, examples, folder: &own, resume: true, rerun: *rerun };
        let failure = match train(task, learner.as_mut(), watch) {
            Ok(Ended::Finished) => None,
            Ok(Ended::Stopped) => return Ok(None),
            Err(error @ (TrainingError::Step { .. } | TrainingError::NotFinite { .. })) => {
                Some(error.to_string().lines().next().unwrap_or_default().to_owned())
            }
            Err(source) => return Err(AblationError::Training { name: name(), source }),
        };
        let last = last_epoch(&own).map_err(|source| AblationError::Read { path: own.join("metrics.csv"), source })?;
        outcomes.push(Outcome { run: run.clone(), last: last.unwrap_or_default(), failure });
        if let Some(cost) = entrants::cost(&outcomes[outcomes.len() - 1]) {
            whole_file::write(&own.join("cost.toml"), cost.as_bytes())?;
        }
        if *writes_tables {
            whole_file::write(&folder.join("ablation.csv"), csv(&outcomes).as_bytes())?;
            whole_file::write(&folder.join("ablation.md"), markdown(&outcomes).as_bytes())?;
            whole_file::write(&folder.join("entrants.toml"), entrants::of(&outcomes).as_bytes())?;
        }
    }
    Ok(Some(outcomes))
}

/// What is tabulated: the column of `metrics.csv`, and what it is called in Markdown.
const COLUMNS: [(&str, &str); 14] = [
    ("val_loss", "loss"),
    ("val_plannerADE", "planner ADE m"),
    ("val_plannerFDE", "planner FDE m"),
    ("val_predictorADE", "predictor ADE m"),
    ("val_predictorFDE", "predictor FDE m"),
    ("w1", "speed"),
    ("w2", "acceleration"),
    ("w3", "jerk"),
    ("w4", "steering"),
    ("w5", "steering change"),
    ("w6", "lane position"),
    ("w7", "lane heading"),
    ("w8", "red light"),
    ("w9", "safety"),
];

impl Outcome {
    fn field(&self, column: &str) -> &str {
        self.last.iter().find(|(own, _)| own == column).map_or("", |(_, value)| value)
    }
}

/// A row a training.
#[must_use]
pub fn csv(outcomes: &[Outcome]) -> String {
    let columns: Vec<&str> = COLUMNS.iter().map(|(column, _)| *column).collect();
    let mut text = format!("name,seed,epoch,{},failure\n", columns.join(","));
    for outcome in outcomes {
        let fields: Vec<&str> = columns.iter().map(|column| outcome.field(column)).collect();
        let failure = outcome.failure.as_ref().map_or_else(String::new, |told| told.replace([',', '"'], ";"));
        let (name, seed, epoch) = (&outcome.run.name, outcome.run.settings.seed, outcome.field("epoch"));
        // Writing into memory does not fail.
        let _ = writeln!(text, "{name},{seed},{epoch},{},{failure}", fields.join(","));
    }
    text
}

/// A row a name: means over its seeds, with the least and the greatest where there are several.
#[must_use]
pub fn markdown(outcomes: &[Outcome]) -> String {
    let head: Vec<&str> = COLUMNS.iter().map(|(_, name)| *name).collect();
    let mut text = format!("| run | epochs | {} |\n| --- | ---: |{}\n", head.join(" | "), " ---: |".repeat(head.len()));
    let mut notes = String::new();
    for of_name in outcomes.chunk_by(|one, other| one.run.name == other.run.name) {
        let Some(first) = of_name.first() else { continue };
        let cells: Vec<String> = COLUMNS.iter().map(|(column, _)| cell(of_name, column)).collect();
        let epochs = cell(of_name, "epoch");
        let _ = writeln!(text, "| {} | {epochs} | {} |", first.run.name, cells.join(" | "));
        for outcome in of_name {
            if let Some(failure) = &outcome.failure {
                let _ = writeln!(notes, "- {} did not finish: {failure}", outcome.run.folder);
            }
        }
    }
    if notes.is_empty() { text } else { format!("{text}\n{notes}") }
}

fn cell(outcomes: &[Outcome], column: &str) -> String {
    let values: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.field(column).parse().ok()).collect();
    let (Some(first), count) = (values.first(), values.len()) else { return String::new() };
    let (low, high) = values.iter().fold((*first, *first), |(low, high), value| {
        (if *value < low { *value } else { low }, if *value > high { *value } else { high })
    });
    let mean = short(values.iter().sum::<f64>() / count as f64);
    if low == high { mean } else { format!("{mean} ({}..{})", short(low), short(high)) }
}

/// Three digits that mean something, or all before the point.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        size if size.fract() == 0.0 || size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        size if size >= 0.1 => 3,
        _ => 4,
    };
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{CostStart, Mode};

    const LIST: &str = r#"
        seeds = [1, 2]
        base = { epochs = 3, cost = { prior = 0.5 } }
        [[run]]
        name = "dipp"
        [[run]]
        name = "tuned"
        settings = { mode = "sep", cost = { start = "hand-tuned" } }
    "#;

    #[test]
    fn a_run_is_the_base_with_its_own_settings_over_it() {
        let runs = read(LIST).unwrap();
        let folders: Vec<&str> = runs.iter().map(|run| run.folder.as_str()).collect();
        assert_eq!(folders, ["dipp-seed-1", "dipp-seed-2", "tuned-seed-1", "tuned-seed-2"]);
        let settings = &runs[3].settings;
        assert_eq!((settings.seed, settings.epochs, settings.mode), (2, 3, Mode::Sep));
        assert_eq!((settings.cost.prior, settings.cost.start), (0.5, CostStart::HandTuned));
    }

    #[test]
    fn a_wrong_list_is_told_by_run() {
        let told = |text: &str| read(text).unwrap_err().to_string();
        assert!(told("[[run]]\nname = \"../x\"").starts_with("run \"../x\": a name is of"));
        assert!(told("[[run]]\nname = \"a\"\n[[run]]\nname = \"a\"").starts_with("run \"a\""));
        assert!(told("[[run]]\nname = \"a\"\nsettings = { epoch = 1 }").contains("run a: unknown field `epoch`"));
        assert!(told("[[run]]\nname = \"a\"\nset = 1").contains("unknown field `set`"));
        assert!(told("seeds = [1]").contains("missing field `run`"));
    }

    #[test]
    fn seeds_of_a_name_share_a_row() {
        let mut outcomes = Vec::new();
        for (run, loss) in read(LIST).unwrap().into_iter().zip(["1.5", "2.5", "10.25", ""]) {
            let last = vec![("epoch".to_owned(), "3".to_owned()), ("val_loss".to_owned(), loss.to_owned())];
            outcomes.push(Outcome { run, last, failure: loss.is_empty().then(|| "nothing, at all".to_owned()) });
        }
        let table = markdown(&outcomes);
        assert!(table.contains("| dipp | 3 | 2 (1.50..2.50) |"), "{table}");
        assert!(
            table.contains("| tuned | 3 | 10.2 |") && table.ends_with("did not finish: nothing, at all\n"),
            "{table}"
        );
        assert_eq!(csv(&outcomes).lines().count(), 5);
        assert!(csv(&outcomes).lines().all(|line| line.split(',').count() == 18));
    }
}
