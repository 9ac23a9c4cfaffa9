//! `verify DIR`: holds the Gauss-Newton planner to a folder of vectors that the authors' code produced: cases of the planner by
//! itself, or episodes of their closed loop.
//!
//! Every quantity of every case is computed with each of the two linear solvers; the worst deviation of each is printed beside
//! its tolerance. The folder's README defines the arrays.

mod case;
mod closed_loop;
mod npz;
mod quantities;

use std::fmt;
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use case::{CaseError, controls, problem};
pub use npz::{Npz, NpzError};
pub use quantities::Quantity;

use crate::gauss_newton::LinearSolver;

/// The worst deviation of a quantity, and in which case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worst {
    /// Deviation, in the quantity's own measure.
    pub deviation: f64,
    /// The case; empty if no case has the quantity.
    pub case: String,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Report {
    /// Cases read.
    pub cases: usize,
    /// Each quantity with its worst deviation by the sweep and by the dense solver.
    pub quantities: Vec<(Quantity, Worst, Worst)>,
}

/// Why a folder cannot be verified.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// The folder cannot be listed.
    #[error("cannot list {path}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// There is nothing in it.
    #[error("{0} holds no .npz file\nhint: give the folder with the planner's vectors")]
    Empty(PathBuf),
    /// A case cannot be used.
    #[error("case {name}")]
    Case {
        /// The case.
        name: String,
        /// Why.
        source: CaseError,
    },
}

/// The `.npz` files of a folder, by name.
///
/// # Errors
/// [`VerifyError::Folder`], [`VerifyError::Empty`].
pub fn cases(folder: &Path) -> Result<Vec<PathBuf>, VerifyError> {
    let error = |source| VerifyError::Folder { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.extension().is_some_and(|e| e == "npz") {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() { Err(VerifyError::Empty(folder.to_owned())) } else { Ok(paths) }
}

/// Verifies every case of a folder, or every episode of the planner if it has any.
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify(folder: &Path) -> Result<Report, VerifyError> {
    let mut paths = cases(folder)?;
    let episodes = paths.iter().any(|path| closed_loop::route_of(path).is_some());
    paths.retain(|path| !episodes || closed_loop::route_of(path).is_some());
    let wanted: &[Quantity] = if episodes { &Quantity::OF_EPISODES } else { &Quantity::OF_CASES };
    let mut report = Report {
        cases: paths.len(),
        quantities: wanted.iter().map(|q| (*q, Worst::default(), Worst::default())).collect(),
    };
    for path in &paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for linear in [LinearSolver::Sweep, LinearSolver::Dense] {
            let found = deviations(path, linear);
            for (quantity, deviation) in found.map_err(|source| VerifyError::Case { name: name.clone(), source })? {
                report.add(quantity, linear, deviation, &name);
            }
        }
    }
    Ok(report)
}

fn deviations(path: &Path, linear: LinearSolver) -> Result<quantities::Deviations, CaseError> {
    let npz = Npz::read(path)?;
    match closed_loop::route_of(path) {
        Some(route) => closed_loop::deviations(&npz, &Npz::read(&route)?, linear),
        None => quantities::deviations(&npz, linear),
    }
}

impl Report {
    fn add(&mut self, quantity: Quantity, linear: LinearSolver, deviation: f64, case: &str) {
        let Some((_, sweep, dense)) = self.quantities.iter_mut().find(|(q, _, _)| *q == quantity) else { return };
        let worst = if linear == LinearSolver::Sweep { sweep } else { dense };
        // What is not a number is worst of all.
        let deviation = if deviation.is_nan() { f64::INFINITY } else { deviation };
        if worst.case.is_empty() || deviation > worst.deviation {
            *worst = Worst { deviation, case: case.to_owned() };
        }
    }

    /// Whether every deviation is within its tolerance, and every quantity was seen.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.quantities.iter().all(|(q, sweep, dense)| q.holds(sweep) && q.holds(dense))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} cases; worst deviation of each quantity, by linear solver", self.cases)?;
        writeln!(
            f,
            "{:<26} {:<9} {:>9}  {:<33} {:>8}  {:<33}",
            "quantity", "tolerance", "sweep", "worst case", "dense", "worst case"
        )?;
        for (quantity, sweep, dense) in &self.quantities {
            let tolerance = match quantity.tolerance() {
                0.0 => "exact".to_owned(),
                tolerance => format!("{tolerance:.0e} {}", quantity.measure()),
            };
            let verdict = if quantity.holds(sweep) && quantity.holds(dense) { "" } else { "  OUT" };
            let line = format!(
                "{:<26} {tolerance:<9} {:>9.1e}  {:<33} {:>8.1e}  {:<33}{verdict}",
                quantity.name(),
                sweep.deviation,
                sweep.case,
                dense.deviation,
                dense.case
            );
            writeln!(f, "{}", line.trim_end())?;
        }
        write!(f, "{}", if self.holds() { "all within tolerance" } else { "OUT OF TOLERANCE" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The folder of shared data, beside the repository; it is not part of it.
    fn shared(folder: &str) -> Option<PathBuf> {
        let beside = |up: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(up).join("shared");
        let roots = std::env::var_os("RELOOP_SHARED").map(PathBuf::from);
        let found = roots.into_iter().chain([beside("../.."), beside("../../..")]).find(|path| path.is_dir());
        let path = found?.join(folder);
        path.is_dir().then_some(path)
    }

    fn holds(folder: &str) {
        let Some(folder) = shared(folder) else {
            eprintln!("skipped: no shared/{folder} beside the repository (or set RELOOP_SHARED)");
            return;
        };
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
