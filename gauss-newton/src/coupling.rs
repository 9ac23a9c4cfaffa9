//! The authors' coupling of a batch's samples, a bug that their numbers depend on (`docs/planner.md`).
//!
//! What a safety row is worth takes the length of the neighbor that is nearest in the batch's *first* sample: that index, in the
//! sample's own list. The Jacobian is each sample's own. So a row may be there in the one and not in the other.

use super::constants::KEY_STEPS;

/// Which neighbor is nearest at each key step.
pub type Nearest = [usize; KEY_STEPS.len()];

/// Which neighbors were nearest whenever a sample was evaluated: at its initial controls and after each iteration.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choices(pub(super) Vec<Nearest>);

impl Choices {
    /// Those of an evaluation; a sample that has converged stays where it is.
    pub(super) fn at(&self, evaluation: usize) -> Option<&Nearest> {
        self.0.get(evaluation).or(self.0.last())
    }
}
