//! `verify DIR`: holds the Gauss-Newton planner to a folder of vectors that the authors' code produced: cases of the planner by
//! itself, or episodes of their closed loop.
//!
//! Every quantity of every case is computed with each of the two linear solvers; the worst deviation of each is printed beside
//! its tolerance. The folder's README defines the arrays.

mod batch;
mod case;
mod closed_loop;
mod quantities;

use std::path::Path;

use thiserror::Error;
use vectors::{FolderError, Npz, Report, npz_files};

pub use case::{CaseError, controls, problem};

use crate::gauss_newton::LinearSolver;

/// Why a folder cannot be verified.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A case cannot be used.
    #[error("case {name}")]
    Case {
        /// The case.
        name: String,
        /// Why.
        source: CaseError,
    },
}

/// Verifies every case of a folder and of the folder `batch` in it, or every episode of the planner if it has any.
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify(folder: &Path) -> Result<Report, VerifyError> {
    let mut paths = npz_files(folder)?;
    let episodes = paths.iter().any(|path| closed_loop::route_of(path).is_some());
    paths.retain(|path| !episodes || closed_loop::route_of(path).is_some());
    let batches = folder.join("batch");
    if batches.is_dir() {
        paths.extend(npz_files(&batches)?);
    }
    let quantities = if episodes { &quantities::OF_EPISODES[..] } else { &quantities::OF_CASES };
    let mut report = Report::new(&["sweep", "dense"], quantities);
    for path in &paths {
        report.count_case();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for (column, linear) in [LinearSolver::Sweep, LinearSolver::Dense].into_iter().enumerate() {
            let found = deviations(path, linear);
            for (quantity, deviation) in found.map_err(|source| VerifyError::Case { name: name.clone(), source })? {
                report.add(column, quantity, deviation, &name);
            }
        }
    }
    Ok(report)
}

fn deviations(path: &Path, linear: LinearSolver) -> Result<quantities::Deviations, CaseError> {
    let npz = Npz::read(path)?;
    match (closed_loop::route_of(path), batch::size(&npz)) {
        (Some(route), _) => closed_loop::deviations(&npz, &Npz::read(&route)?, linear),
        (None, Some(size)) => batch::deviations(&npz, size, linear),
        (None, None) => quantities::deviations(&npz, linear),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(folder: &str) {
        let Some(folder) = vectors::shared(folder) else { return };
        let report = verify(&folder).unwrap();
        assert!(report.holds(), "{report}");
    }

    #[test]
    fn every_vector_of_the_planner_holds_with_either_linear_solver() {
        holds("dipp/planner-vectors");
    }

    #[test]
    fn the_plans_of_the_authors_closed_loop_hold_with_either_linear_solver() {
        holds("dipp/closed-loop-vectors");
    }
}
