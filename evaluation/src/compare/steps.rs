//! What `steps.parquet` says of the scenes that flipped: when each fault began, and where the two drives part.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use results::parquet::{ParquetError, Table};

use super::outcome::Fault;
use crate::scenes::NOT_COUNTED;

/// Two drives have parted when their AVs are so far from each other (m).
pub const PARTED: f64 = 0.5;

/// The steps of some scenes of a run.
#[derive(Debug, Default)]
pub(crate) struct Steps(BTreeMap<String, Vec<Row>>);

/// A step.
#[derive(Debug)]
struct Row {
    step: u32,
    place: Option<(f64, f64)>,
    faults: Vec<Fault>,
    /// What happened, but for what does not count.
    events: Vec<String>,
}

impl Steps {
    /// The steps of `scenes` in the run in `folder`.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub(crate) fn read(folder: &Path, protocol: &str, scenes: &BTreeSet<&str>) -> Result<Self, ParquetError> {
        let mut names = vec!["step", "av_x_m", "av_y_m", "events"];
        names.extend(Fault::columns(protocol));
        let table = Table::read_of(&folder.join("steps.parquet"), &names, scenes)?;
        let flags = Fault::flags(&table, protocol)?;
        let numbers = table.numbers()?;
        let number = |column: &str, row: usize| numbers.get(column).and_then(|values| values[row]);
        let (steps, events) = (table.counts("step")?, table.text("events")?);
        let mut all = Self::default();
        for (row, scene) in table.text("scene")?.into_iter().enumerate() {
            let counted = events[row].lines().filter(|line| !line.ends_with(NOT_COUNTED));
            all.0.entry(scene).or_default().push(Row {
                step: steps[row],
                place: number("av_x_m", row).zip(number("av_y_m", row)),
                faults: flags.iter().filter(|(_, set)| set[row]).map(|(fault, _)| *fault).collect(),
                events: counted.map(str::to_owned).collect(),
            });
        }
        Ok(all)
    }

    /// A sentence on the begin of a fault.
    pub(crate) fn begin(&self, scene: &str, fault: Fault) -> Option<String> {
        let row = self.0.get(scene)?.iter().find(|row| row.faults.contains(&fault))?;
        let what = if row.events.is_empty() { fault.name().to_owned() } else { row.events.join("; ") };
        Some(format!("step {}: {what}", row.step))
    }

    /// The first step after which the AVs of the two drives are more than [`PARTED`] from each other; none where they never are while
    /// both drive.
    pub(crate) fn parting(&self, other: &Self, scene: &str) -> Option<u32> {
        let (here, there) = (self.0.get(scene)?, other.0.get(scene)?);
        let apart = |(one, two): &(&Row, &Row)| {
            let places = one.place.zip(two.place);
            places.is_some_and(|((x, y), (u, v))| (x - u) * (x - u) + (y - v) * (y - v) > PARTED * PARTED)
        };
        here.iter().zip(there).find(apart).map(|(row, _)| row.step)
    }
}
