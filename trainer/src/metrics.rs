//! What a training says of itself as it goes: `metrics.csv` with a row an epoch, `steps.csv` with a row a step.
//!
//! The first columns of `metrics.csv` are those of the curves that other implementations left, so that they can be laid side by side.
//! Rows are added; when a training is continued, those behind its checkpoint are dropped first.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::schedule::Schedule;
use crate::step::{Sums, Terms};
use crate::whole_file::{self, WriteError};

/// The header of `metrics.csv`.
#[must_use]
pub fn epoch_header() -> String {
    let side = |side: &str| {
        let columns = ["loss", "plannerADE", "plannerFDE", "predictorADE", "predictorFDE", "part_mfma", "part_plan"];
        columns.iter().chain(&["part_cost"]).map(|column| format!("{side}_{column}")).collect::<Vec<_>>().join(",")
    };
    let parts =
        "train_part_prediction,train_part_score,train_part_prior,val_part_prediction,val_part_score,val_part_prior";
    let weights = numbered("w", 9);
    let (train, val) = (side("train"), side("val"));
    format!("run,epoch,lr,planning,{train},{val},{weights},{parts},gradient_norm,windows_per_second")
}

/// The header of `steps.csv`.
#[must_use]
pub fn step_header() -> String {
    let terms = "loss,prediction,score,mfma,plan,cost,prior,plannerADE,plannerFDE,predictorADE,predictorFDE";
    format!("step,epoch,lr,planning,windows,{terms},{},gradient_norm,seconds", numbered("w", 9))
}

fn numbered(name: &str, count: usize) -> String {
    (1..=count).map(|number| format!("{name}{number}")).collect::<Vec<_>>().join(",")
}

/// Seven digits, without those that say nothing.
pub(crate) fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// A step that is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepRow {
    /// Its number, from 1.
    pub step: u64,
    /// Its epoch, from 1.
    pub epoch: usize,
    /// What held.
    pub schedule: Schedule,
    /// How many windows it had.
    pub windows: usize,
    /// Losses and metrics.
    pub terms: Terms,
    /// The gradient's norm before clipping.
    pub gradient_norm: f64,
    /// How long it took (s).
    pub seconds: f64,
}

impl StepRow {
    fn line(&self) -> String {
        let Self { step, epoch, schedule, windows, terms, gradient_norm, seconds } = self;
        let has_cost = terms.cost_weights.iter().any(|weight| *weight != 0.0);
        let mut terms: Vec<String> = terms.numbers().into_iter().map(number).collect();
        if !schedule.planning {
            terms[4..6].fill_with(String::new);
        }
        if !has_cost {
            terms[11..].fill_with(String::new);
        }
        let planning = u8::from(schedule.planning);
        let (rate, terms, norm) = (number(schedule.learning_rate), terms.join(","), number(*gradient_norm));
        format!("{step},{epoch},{rate},{planning},{windows},{terms},{norm},{seconds:.4}")
    }
}

/// An epoch that is done.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochRow {
    /// The training's name.
    pub run: String,
    /// Which, from 1.
    pub epoch: usize,
    /// What held.
    pub schedule: Schedule,
    /// Over its steps.
    pub train: Sums,
    /// Over the batches of validation.
    pub validation: Sums,
    /// The planner's weights at its end.
    pub cost_weights: Option<[f64; 9]>,
    /// How fast it went, validation left out; none where no step was made since the program began.
    pub windows_per_second: Option<f64>,
}

impl EpochRow {
    fn line(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(String::new, number);
        let means = [&self.train, &self.validation].map(|sums| sums.means().map(|(terms, _)| terms));
        let planned = |terms: Option<Terms>| terms.filter(|_| self.schedule.planning);
        let run = self.run.replace([',', '"', '\n', '\r'], "_");
        let mut fields = vec![run, self.epoch.to_string(), number(Some(self.schedule.learning_rate))];
        fields.push(u8::from(self.schedule.planning).to_string());
        for terms in means {
            fields.push(number(terms.map(|terms| terms.total)));
            fields.push(number(terms.map(|terms| terms.planner_ade)));
            fields.push(number(terms.map(|terms| terms.planner_fde)));
            fields.push(number(terms.map(|terms| terms.predictor_ade)));
            fields.push(number(terms.map(|terms| terms.predictor_fde)));
            fields.push(number(terms.map(|terms| terms.mfma)));
            fields.push(number(planned(terms).map(|terms| terms.plan)));
            fields.push(number(planned(terms).map(|terms| terms.cost)));
        }
        fields.extend((0..9).map(|term| number(self.cost_weights.map(|weights| weights[term]))));
        for terms in means {
            fields.push(number(terms.map(|terms| terms.prediction)));
            fields.push(number(terms.map(|terms| terms.score)));
            fields.push(number(planned(terms).map(|terms| terms.prior)));
        }
        fields.push(number(self.train.means().map(|(_, norm)| norm)));
        fields.push(self.windows_per_second.map_or_else(String::new, |rate| format!("{rate:.2}")));
        fields.join(",")
    }
}

/// A file of rows to which rows are added.
#[derive(Debug)]
pub(crate) struct Rows {
    path: PathBuf,
    file: File,
}

impl Rows {
    /// Keeps of what is there the rows whose number in `column` is at most `last`; begins the file where there is none.
    pub fn open(path: PathBuf, header: &str, column: usize, last: u64) -> Result<Self, WriteError> {
        let before = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(WriteError::at(&path)(error)),
        };
        let number = |line: &str| line.split(',').nth(column).and_then(|field| field.parse::<u64>().ok());
        let mut text = format!("{header}\n");
        // A line that was cut off has no end.
        let whole = before.split_inclusive('\n').filter(|line| line.ends_with('\n')).skip(1);
        text.extend(whole.filter(|line| number(line).is_some_and(|number| number <= last)));
        whole_file::write(&path, text.as_bytes())?;
        let file = OpenOptions::new().append(true).open(&path).map_err(WriteError::at(&path))?;
        Ok(Self { path, file })
    }

    pub fn add(&mut self, line: &str) -> Result<(), WriteError> {
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(WriteError::at(&self.path))
    }

    pub fn sync(&self) -> Result<(), WriteError> {
        self.file.sync_data().map_err(WriteError::at(&self.path))
    }
}

/// The two files of a training.
#[derive(Debug)]
pub struct Metrics {
    epochs: Rows,
    steps: Rows,
}

impl Metrics {
    /// Those in `folder`, as they were after so many epochs and steps.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn open(folder: &Path, epochs: usize, steps: u64) -> Result<Self, WriteError> {
        Ok(Self {
            epochs: Rows::open(folder.join("metrics.csv"), &epoch_header(), 1, epochs as u64)?,
            steps: Rows::open(folder.join("steps.csv"), &step_header(), 0, steps)?,
        })
    }

    /// A step more.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn step(&mut self, row: &StepRow) -> Result<(), WriteError> {
        self.steps.add(&row.line())
    }

    /// An epoch more.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn epoch(&mut self, row: &EpochRow) -> Result<(), WriteError> {
        self.epochs.add(&row.line())
    }

    /// Brings them to the disk: before a checkpoint that is behind them.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn sync(&self) -> Result<(), WriteError> {
        self.steps.sync()?;
        self.epochs.sync()
    }
}

/// The last row of the `metrics.csv` in `folder`, by column; none where there is no row.
///
/// # Errors
/// Those of the file system.
pub fn last_epoch(folder: &Path) -> io::Result<Option<Vec<(String, String)>>> {
    let text = fs::read_to_string(folder.join("metrics.csv"))?;
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    let pairs = |row: &str| header.split(',').map(String::from).zip(row.split(',').map(String::from)).collect();
    Ok(lines.next_back().map(pairs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn step(step: u64) -> StepRow {
        let schedule = Schedule::of(&Settings::default(), 0);
        StepRow { step, epoch: 1, schedule, windows: 32, terms: Terms::default(), gradient_norm: 1.0, seconds: 0.5 }
    }

    #[test]
    fn rows_have_a_field_for_each_column() {
        let mut row = EpochRow {
            run: "a,b".to_owned(),
            epoch: 6,
            schedule: Schedule::of(&Settings::default(), 5),
            train: Sums::default(),
            validation: Sums::default(),
            cost_weights: Some([2.0; 9]),
            windows_per_second: None,
        };
        row.train.add(&Terms { plan: 3.0, ..Terms::default() }, 4.0);
        let line = row.line();
        let field = |name: &str| {
            let column = epoch_header().split(',').position(|column| column == name).unwrap();
            line.split(',').nth(column).unwrap().to_owned()
        };
        assert_eq!(line.split(',').count(), epoch_header().split(',').count());
        assert_eq!([field("run"), field("epoch"), field("planning")], ["a_b", "6", "1"]);
        let numbers = [field("train_part_plan"), field("val_loss"), field("w9"), field("gradient_norm")];
        assert_eq!(numbers, ["3.0", "", "2.0", "4.0"]);
        assert_eq!(step(1).line().split(',').count(), step_header().split(',').count());
    }

    #[test]
    fn the_first_columns_are_those_of_the_curves_of_others() {
        let Some(folder) = vectors::shared("dipp/trained") else { return };
        let text = fs::read_to_string(folder.join("curves.csv")).unwrap();
        assert!(epoch_header().starts_with(text.lines().next().unwrap()));
    }

    #[test]
    fn rows_behind_the_checkpoint_are_dropped_and_so_is_half_a_row() {
        let folder = tempfile::tempdir().unwrap();
        let mut metrics = Metrics::open(folder.path(), 0, 0).unwrap();
        for number in 1..=5 {
            metrics.step(&step(number)).unwrap();
        }
        metrics.steps.file.write_all(b"2,1,0.0").unwrap();
        drop(metrics);
        let mut metrics = Metrics::open(folder.path(), 0, 3).unwrap();
        metrics.step(&step(4)).unwrap();
        let text = fs::read_to_string(folder.path().join("steps.csv")).unwrap();
        let first: Vec<&str> = text.lines().map(|line| line.split(',').next().unwrap()).collect();
        assert_eq!(first, ["step", "1", "2", "3", "4"]);
        assert_eq!(last_epoch(folder.path()).unwrap(), None);
    }
}
