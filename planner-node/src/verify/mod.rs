//! `verify DIR`: holds the Gauss-Newton planner to a folder of vectors that the authors' code produced: cases of the planner by
//! itself, or episodes of their closed loop.
//!
//! Every quantity of every case is computed with each of the two linear solvers; the worst deviation of each is printed beside
//! its tolerance. The folder's README defines the arrays.

mod batch;
mod case;
mod closed_loop;
mod ending;
mod quantities;
mod together;

use std::path::{Path, PathBuf};

use thiserror::Error;
use vectors::{FolderError, Npz, Report, npz_files};

pub use case::{CaseError, controls, problem};

use gauss_newton::LinearSolver;

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
    let mut kinds = Vec::new();
    let mut found = Vec::new();
    let mut left_out = 0;
    for path in files(folder)? {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let compared = compare(&path).map_err(|source| VerifyError::Case { name: name.clone(), source })?;
        kinds.push(compared.kind);
        left_out += compared.left_out;
        found.push((name, compared.deviations));
    }
    let mut report = Report::new(&COLUMNS.map(|(name, _)| name), &quantities::announced(&kinds));
    for (name, columns) in found {
        report.count_case();
        for (column, deviations) in columns.into_iter().enumerate() {
            for (quantity, deviation) in deviations {
                report.add(column, quantity, deviation, &name);
            }
        }
    }
    if left_out > 0 {
        report.note(format!("left out: {left_out} plans, for the file does not say which red light is ahead"));
    }
    Ok(report)
}

const COLUMNS: [(&str, LinearSolver); 2] = [("sweep", LinearSolver::Sweep), ("dense", LinearSolver::Dense)];

/// The files to verify; one at least.
fn files(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let batches = folder.join("batch");
    let batches = if batches.is_dir() { npz_files(&batches)? } else { Vec::new() };
    let mut paths = match npz_files(folder) {
        Err(FolderError::Empty(_)) if !batches.is_empty() => Vec::new(),
        paths => paths?,
    };
    let episodes = paths.iter().any(|path| closed_loop::route_of(path).is_some());
    paths.retain(|path| !episodes || closed_loop::route_of(path).is_some());
    paths.extend(batches);
    Ok(paths)
}

/// What came of a file.
struct Compared {
    kind: quantities::Kind,
    /// By each linear solver.
    deviations: Vec<quantities::Deviations>,
    /// Plans whose situation the file does not tell whole.
    left_out: usize,
}

fn compare(path: &Path) -> Result<Compared, CaseError> {
    let npz = Npz::read(path)?;
    let both = |of: &dyn Fn(LinearSolver) -> Result<quantities::Deviations, CaseError>| {
        COLUMNS.into_iter().map(|(_, linear)| of(linear)).collect::<Result<Vec<_>, _>>()
    };
    if let Some(route) = closed_loop::route_of(path) {
        let episode = closed_loop::read(&npz, &Npz::read(&route)?)?;
        let deviations = both(&|linear| Ok(closed_loop::deviations(&episode, linear)))?;
        return Ok(Compared { kind: quantities::Kind::Episode, deviations, left_out: episode.left_out });
    }
    let (kind, deviations) = match batch::size(&npz) {
        Some(size) => (quantities::Kind::Batch(size), both(&|linear| batch::deviations(&npz, size, linear))?),
        None => (quantities::Kind::of_case(&npz)?, both(&|linear| quantities::deviations(&npz, linear))?),
    };
    Ok(Compared { kind, deviations, left_out: 0 })
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
    fn a_part_of_the_vectors_holds_as_the_whole_does() {
        let Some(whole) = vectors::shared("dipp/planner-vectors") else { return };
        let part = tempfile::tempdir().unwrap();
        std::fs::create_dir(part.path().join("batch")).unwrap();
        let copy = |name: &str| std::fs::copy(whole.join(name), part.path().join(name)).unwrap();
        copy("batch/batch_of_three.npz");
        let report = verify(part.path()).unwrap();
        assert!(report.holds(), "{report}");
        assert_eq!(verify(&part.path().join("batch")).unwrap().to_string(), report.to_string());
        std::fs::remove_dir_all(part.path().join("batch")).unwrap();
        assert!(matches!(verify(part.path()), Err(VerifyError::Folder(FolderError::Empty(_)))));
        copy("singular_normal_matrix.npz");
        let report = verify(part.path()).unwrap();
        assert!(report.holds(), "{report}");
    }

    #[test]
    fn the_plans_of_the_authors_closed_loop_hold_with_either_linear_solver() {
        holds("dipp/closed-loop-vectors");
    }
}
