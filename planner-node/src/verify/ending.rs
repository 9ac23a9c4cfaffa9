//! How a search ended, in the authors' words, and the objectives that it went through.

use gauss_newton::{Status, Summary};
use vectors::{Npz, relative, worst_deviation};

use super::case::CaseError;

/// The largest relative deviation of objectives. The authors' history may be longer: of a case that converged before others of its
/// batch it goes on as it is, and what was never reached is infinite.
pub(super) fn history_deviation(got: &[f64], wanted: &[f64]) -> f64 {
    let Some((both, beyond)) = wanted.split_at_checked(got.len()) else { return f64::INFINITY };
    let last = got.last().copied().unwrap_or(f64::NAN);
    let compared = both.iter().zip(got).chain(beyond.iter().filter(|e| e.is_finite()).map(|e| (e, &last)));
    // An objective that is no number is none for both.
    let compared = compared.filter(|(wanted, got)| wanted.is_finite() || got.is_finite());
    let (wanted, got): (Vec<f64>, Vec<f64>) = compared.unzip();
    worst_deviation(got, &wanted, relative)
}

/// The authors' words on how a search ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ending {
    /// The iteration, from 0, that led to the best controls; 0 too where those are the initial ones.
    pub best_iteration: f64,
    /// Iterations until it converged, or until the factorization failed; -1 where neither was.
    pub converged_after: f64,
    /// One of the constants.
    pub status: f64,
}

impl Ending {
    pub const FAILED: f64 = -1.0;
    pub const STARTED: f64 = 0.0;
    pub const CONVERGED: f64 = 1.0;
    pub const ITERATION_LIMIT: f64 = 2.0;

    /// How they would tell ours.
    pub fn of(summary: &Summary) -> Self {
        let (status, converged_after) = match summary.status {
            Status::Converged => (Self::CONVERGED, summary.iterations as f64),
            Status::IterationLimit => (Self::ITERATION_LIMIT, -1.0),
            Status::Diverged | Status::Singular { .. } => (Self::FAILED, summary.iterations as f64),
        };
        Self { best_iteration: summary.best_after.saturating_sub(1) as f64, converged_after, status }
    }
}

/// How many pairs differ.
pub(super) fn differences(pairs: &[(f64, f64)]) -> f64 {
    pairs.iter().filter(|(a, b)| a != b).count() as f64
}

/// How many of the authors' words on how the search ended are others than ours.
pub(super) fn ended_otherwise(npz: &Npz, ours: &Ending) -> Result<f64, CaseError> {
    Ok(differences(&[
        (ours.best_iteration, npz.number("test_best_iter")?),
        (ours.converged_after, npz.number("test_converged_iter")?),
        (ours.status, npz.number("test_status")?),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_may_go_on_where_a_case_has_converged_and_not_otherwise() {
        let ours = [4.0, 2.0, 1.0];
        assert_eq!(history_deviation(&ours, &ours), 0.0);
        assert_eq!(history_deviation(&ours, &[4.0, 2.0, 1.0, 1.0, f64::INFINITY]), 0.0);
        assert_eq!(history_deviation(&ours, &[4.0, 2.0, 1.0, 0.5]), 1.0);
        assert_eq!(history_deviation(&ours, &[4.0, 2.0]), f64::INFINITY);
        assert_eq!(history_deviation(&ours, &[4.0, 2.0, f64::INFINITY]), f64::INFINITY);
        assert_eq!(history_deviation(&[4.0, f64::NAN], &[4.0, f64::INFINITY]), 0.0);
    }
}
