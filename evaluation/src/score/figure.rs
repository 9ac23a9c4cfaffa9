//! What a score tells of a drive: its figures, each by name and unit.

use crate::table::Show;

/// One figure of a score.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Its name, with its unit: the column of files.
    pub name: String,
    /// Its unit, as people write it; `0/1` for what is so or not, empty for a share, a score or a number of things.
    pub unit: &'static str,
    /// What it says, in a sentence.
    pub meaning: &'static str,
    /// What a run's figure is.
    pub of_run: OfRun,
    /// Its head in the table, in lines, and how its numbers are written; none where it is not in the table.
    pub(crate) shown: Option<(&'static [&'static str], Show)>,
}

/// How a run's figure comes from those of its episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OfRun {
    /// The mean of the episodes that have it.
    Mean,
    /// Kilometres of the figure `distance` (m) for each of the figure `incidents`; an episode alone has none.
    KilometresPer {
        /// The figure of metres.
        distance: &'static str,
        /// The figure of incidents.
        incidents: &'static str,
    },
}

impl Figure {
    /// A figure whose mean is the run's, in no table.
    pub(crate) fn new(name: impl Into<String>, unit: &'static str, meaning: &'static str) -> Self {
        Self { name: name.into(), unit, meaning, of_run: OfRun::Mean, shown: None }
    }

    /// It stands in the table, as a share of the episodes (%).
    pub(crate) fn percent(self, head: &'static [&'static str]) -> Self {
        Self { shown: Some((head, Show::Percent)), ..self }
    }

    /// It stands in the table, as a mean with so many digits.
    pub(crate) fn mean(self, head: &'static [&'static str], digits: usize) -> Self {
        Self { shown: Some((head, Show::Mean(digits))), ..self }
    }

    /// It is one of runs alone.
    pub(crate) fn per(self, distance: &'static str, incidents: &'static str) -> Self {
        Self { of_run: OfRun::KilometresPer { distance, incidents }, ..self }
    }

    /// Whether episodes have it.
    #[must_use]
    pub fn is_of_episodes(&self) -> bool {
        self.of_run == OfRun::Mean
    }
}
