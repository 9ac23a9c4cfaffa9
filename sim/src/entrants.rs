//! A file of who drives: what a command line has no room for, as planners of one's own, and the trainings of `trainer ablate`.
//!
//! ```toml
//! [[entrant]]
//! label = "mine"
//! planner-command = "python {here}/planner.py"    # {here}: the file's folder
//! predictor = "ctrv"
//!
//! [[entrant]]
//! label = "five-iterations"
//! driver = "dipp"
//! weights = "five-iterations/weights.safetensors" # seen from the file
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use clap::ValueEnum as _;
use results::drivers::{self, DRIVERS, Predictor};
use results::files::{FileError, at};
use serde::Deserialize;
use thiserror::Error;

use crate::cli::Entrant;

/// A file that names nobody.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum EntrantsError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}: {what}\nhint: docs/running.md shows such a file", path.display())]
    Format { path: PathBuf, what: String },
    #[error("{}: entrant {label}: {what}", path.display())]
    Entrant { path: PathBuf, label: String, what: String },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    entrant: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Row {
    label: String,
    driver: Option<String>,
    weights: Option<PathBuf>,
    predictor: Option<String>,
    planner_command: Option<String>,
}

/// Who drives by the file under `path`.
///
/// # Errors
/// [`EntrantsError`] names the entrant.
pub fn read(path: &Path) -> Result<Vec<Entrant>, EntrantsError> {
    parse(&fs::read_to_string(path).map_err(at("read", path))?, path)
}

/// Who drives by the text of the file under `path`.
///
/// # Errors
/// [`EntrantsError`] names the entrant.
pub fn parse(text: &str, path: &Path) -> Result<Vec<Entrant>, EntrantsError> {
    let file: File = toml::from_str(text).map_err(|error| EntrantsError::Format {
        path: path.to_owned(),
        what: error.to_string().trim_end().to_owned(),
    })?;
    let here = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entrant = |row: Row| {
        let label = row.label.clone();
        row.entrant(here).map_err(|what| EntrantsError::Entrant { path: path.to_owned(), label, what })
    };
    file.entrant.into_iter().map(entrant).collect()
}

impl Row {
    fn entrant(self, here: &Path) -> Result<Entrant, String> {
        let driver = match (self.driver, &self.planner_command) {
            (Some(_), Some(_)) => return Err("driver and planner-command are two: leave one out".to_owned()),
            (None, None) => return Err("driver or planner-command says who drives".to_owned()),
            (None, Some(_)) => drivers::DEFAULT.to_owned(), // not asked: the command is
            (Some(driver), None) if drivers::find(&driver).is_none() => {
                let known: Vec<&str> = DRIVERS.iter().map(|driver| driver.name).collect();
                return Err(format!("{driver:?} is no driver; there are {}", known.join(", ")));
            }
            (Some(driver), None) => driver,
        };
        let predictor = self.predictor.map(|name| Predictor::from_str(&name, false)).transpose();
        Ok(Entrant {
            label: self.label,
            driver,
            weights: self.weights.map(|file| here.join(file)),
            predictor: predictor.map_err(|error| format!("predictor: {error}"))?,
            planner_command: self.planner_command.map(|command| command.replace("{here}", &here.to_string_lossy())),
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn told(text: &str) -> Result<Vec<Entrant>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("entrants.toml");
        fs::write(&path, text).unwrap();
        let folder = folder.path().to_string_lossy().into_owned();
        read(&path).map_err(|error| error.to_string().replace(&folder, "."))
    }

    #[test]
    fn places_are_seen_from_the_file() {
        let entrants = told(
            "[[entrant]]\nlabel = 'a'\nplanner-command = 'sh {here}/p.sh'\npredictor = 'ctrv'\n\
             [[entrant]]\nlabel = 'b'\ndriver = 'dipp'\nweights = 'b/w.safetensors'\n",
        );
        let entrants = entrants.unwrap();
        assert!(entrants[0].planner_command.as_ref().unwrap().ends_with("/p.sh"));
        assert!(!entrants[0].planner_command.as_ref().unwrap().contains("{here}"));
        assert_eq!((entrants[0].predictor, entrants[1].predictor), (Some(Predictor::Ctrv), None));
        assert!(entrants[1].weights.as_ref().unwrap().ends_with("b/w.safetensors"));
    }

    #[test]
    fn what_names_nobody_is_told_by_entrant() {
        let refused = |text: &str| told(text).unwrap_err();
        assert!(refused("[[entrant]]\nlabel = 'a'\n").contains("entrant a: driver or planner-command says who drives"));
        let both = refused("[[entrant]]\nlabel = 'a'\ndriver = 'idm'\nplanner-command = 'x'\n");
        assert!(both.contains("entrant a: driver and planner-command are two"), "{both}");
        assert!(
            refused("[[entrant]]\nlabel = 'a'\ndriver = 'x'\n")
                .contains("entrant a: \"x\" is no driver; there are idm")
        );
        assert!(refused("[[entrant]]\nlabel = 'a'\ndriver = 'idm'\nspeed = 1\n").contains("unknown field `speed`"));
        let predictor = refused("[[entrant]]\nlabel = 'a'\ndriver = 'gn-ctrv'\npredictor = 'all'\n");
        assert!(predictor.contains("entrant a: predictor: "), "{predictor}");
        assert!(read(Path::new("nowhere.toml")).unwrap_err().to_string().contains("nowhere.toml"));
    }
}
