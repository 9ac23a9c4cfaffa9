//! `verify [DIR]`: holds the Gauss-Newton planner to a folder of vectors that the authors' code produced: cases of the planner by
//! itself, or episodes of their closed loop. Without a folder, to vectors of our own that are built in.
//!
//! Every quantity of every case is computed with each of the two linear solvers; the worst deviation of each is printed beside
//! its tolerance. `vectors/README.md` defines the arrays.

mod batch;
mod case;
mod closed_loop;
mod ending;
mod own;
mod quantities;
mod together;

use std::borrow::Cow;
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
    let paths = files(folder)?;
    report(paths.iter().map(|path| (path.file_stem().unwrap_or_default().to_string_lossy(), compare(path))))
}

/// Verifies the cases that are built in: those of `checks/planner_vectors.py`, which shares no code with ours.
///
/// # Errors
/// [`VerifyError::Case`], which a test rules out; a deviation is no error.
pub fn verify_own() -> Result<Report, VerifyError> {
    let compare = |name, bytes| compare_planner(&Npz::parse(Path::new(name), bytes)?);
    report(own::CASES.into_iter().map(|(name, bytes)| (name.into(), compare(name, bytes))))
}

/// A table of what came of each case.
fn report<'a>(cases: impl Iterator<Item = (Cow<'a, str>, Result<Compared, CaseError>)>) -> Result<Report, VerifyError> {
    let compared = cases.map(|(name, compared)| match compared {
        Ok(compared) => Ok((name, compared)),
        Err(source) => Err(VerifyError::Case { name: name.into_owned(), source }),
    });
    let compared = compared.collect::<Result<Vec<_>, _>>()?;
    let kinds: Vec<_> = compared.iter().map(|(_, compared)| compared.kind).collect();
    let mut report = Report::new(&COLUMNS.map(|(name, _)| name), &quantities::announced(&kinds));
    let mut left_out = 0;
    for (name, compared) in compared {
        report.count_case();
        left_out += compared.left_out;
        for (column, deviations) in compared.deviations.into_iter().enumerate() {
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
    let Some(route) = closed_loop::route_of(path) else { return compare_planner(&npz) };
    let episode = closed_loop::read(&npz, &Npz::read(&route)?)?;
    let deviations = by_each_solver(|linear| Ok(closed_loop::deviations(&episode, linear)))?;
    Ok(Compared { kind: quantities::Kind::Episode, deviations, left_out: episode.left_out })
}

/// A case or a batch of the planner by itself.
fn compare_planner(npz: &Npz) -> Result<Compared, CaseError> {
    let (kind, deviations) = match batch::size(npz) {
        Some(size) => (quantities::Kind::Batch(size), by_each_solver(|linear| batch::deviations(npz, size, linear))?),
        None => (quantities::Kind::of_case(npz)?, by_each_solver(|linear| quantities::deviations(npz, linear))?),
    };
    Ok(Compared { kind, deviations, left_out: 0 })
}

fn by_each_solver(
    of: impl Fn(LinearSolver) -> Result<quantities::Deviations, CaseError>,
) -> Result<Vec<quantities::Deviations>, CaseError> {
    COLUMNS.into_iter().map(|(_, linear)| of(linear)).collect()
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
    fn our_own_vectors_hold_with_either_linear_solver() {
        let report = verify_own().unwrap();
        assert!(report.holds(), "{report}");
    }

    #[test]
    fn every_file_of_our_own_vectors_is_built_in_as_it_is() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
        let names = npz_files(&folder).unwrap().into_iter().map(|path| path.file_stem().unwrap().to_owned());
        assert_eq!(names.collect::<Vec<_>>(), own::CASES.map(|(name, _)| name));
        assert_eq!(verify(&folder).unwrap(), verify_own().unwrap());
    }

    #[test]
    fn any_number_of_our_own_vectors_that_is_off_makes_it_fail() {
        let (name, bytes) = own::CASES[2];
        let whole = Npz::parse(Path::new(name), bytes).unwrap();
        let come_to = |npz: &Npz| report(std::iter::once((name.into(), compare_planner(npz)))).unwrap();
        assert!(come_to(&whole).holds());
        for (array, _) in whole.shapes() {
            let mut changed = whole.clone();
            let values = changed.values_mut(array).unwrap();
            let (place, off) = match array {
                // In the middle is a velocity of a neighbor, which the planner does not read.
                "current_state" => (0, 0.01),
                // All that is read is whether it is negative.
                "train_status" => (0, -3.0),
                _ => (values.len() / 2, 0.01),
            };
            values[place] += off;
            let report = come_to(&changed);
            assert!(!report.holds(), "{array} is off\n{report}");
        }
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
