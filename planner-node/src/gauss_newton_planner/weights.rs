//! Where the weights of the cost terms come from.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use gauss_newton::constants::{HAND_TUNED, TERMS, Term};
use serde::Deserialize;
use thiserror::Error;
use world::plan::Prediction;

/// The weights, or where they come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Weights {
    /// [`HAND_TUNED`].
    #[default]
    HandTuned,
    /// Those that come with the prediction.
    Learned,
    /// These.
    Given([f64; TERMS]),
}

/// Why a file gives no weights.
#[derive(Debug, Error)]
pub enum WeightsError {
    /// The file cannot be read.
    #[error("cannot read the weights in {path}: {source}\nhint: --weights is hand-tuned, learned, or a TOML file")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("{path}: {source}\nhint: one number for each of {}", Term::ALL.map(Term::name).join(", "))]
    Toml {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<toml::de::Error>,
    },
    /// A weight is not a finite number.
    #[error("{path}: the weight {term} is not finite")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The weight.
        term: &'static str,
    },
}

/// What a file of weights may hold.
const MOST_BYTES: u64 = 64 << 10;

/// A file of weights.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    speed: f64,
    acceleration: f64,
    jerk: f64,
    steering: f64,
    steering_change: f64,
    lane_position: f64,
    lane_heading: f64,
    red_light: f64,
    safety: f64,
}

impl FromStr for Weights {
    type Err = WeightsError;

    fn from_str(text: &str) -> Result<Self, WeightsError> {
        match text {
            "hand-tuned" => return Ok(Self::HandTuned),
            "learned" => return Ok(Self::Learned),
            _ => {}
        }
        let path = PathBuf::from(text);
        let text = read(&path).map_err(|source| WeightsError::Io { path: path.clone(), source })?;
        let f: Given =
            toml::from_str(&text).map_err(|e| WeightsError::Toml { path: path.clone(), source: Box::new(e) })?;
        let weights = [
            f.speed,
            f.acceleration,
            f.jerk,
            f.steering,
            f.steering_change,
            f.lane_position,
            f.lane_heading,
            f.red_light,
            f.safety,
        ];
        match Term::ALL.iter().find(|term| !weights[**term as usize].is_finite()) {
            Some(term) => Err(WeightsError::NotFinite { path, term: term.name() }),
            None => Ok(Self::Given(weights)),
        }
    }
}

/// The text of a file that is one, and no longer than nine numbers may be: a pipe may never begin and a device never end.
fn read(path: &Path) -> std::io::Result<String> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::other("it is no ordinary file"));
    }
    let mut text = String::new();
    File::open(path)?.take(MOST_BYTES + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MOST_BYTES {
        return Err(std::io::Error::other(format!("it is longer than {MOST_BYTES} bytes")));
    }
    Ok(text)
}

impl Weights {
    /// The weights at a step.
    ///
    /// # Errors
    /// Where they are to come with the prediction and do not.
    pub fn of(&self, prediction: &Prediction) -> Result<[f64; TERMS], String> {
        match self {
            Self::HandTuned => Ok(HAND_TUNED),
            Self::Given(weights) => Ok(*weights),
            Self::Learned => {
                let learned = prediction.cost_weights();
                let learned = learned.ok_or("the prediction has no cost weights; --weights hand-tuned needs none")?;
                learned
                    .try_into()
                    .map_err(|_| format!("the prediction has {} cost weights, but {TERMS} are needed", learned.len()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Result<Weights, WeightsError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.toml");
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().parse()
    }

    #[test]
    fn a_file_of_weights_names_each_term() {
        let text = Term::ALL.map(|term| format!("{} = {}.5\n", term.name(), term as usize)).concat();
        assert_eq!(file(&text).unwrap(), Weights::Given([0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5]));
        assert!(
            file(&text.replace("7.5", "nan")).unwrap_err().to_string().ends_with("the weight red_light is not finite")
        );
        assert!(matches!(file("speed = 1"), Err(WeightsError::Toml { .. })));
        let long = format!("# {}\n{text}", "x".repeat(1 << 16));
        assert!(file(&long).unwrap_err().to_string().contains("it is longer than 65536 bytes"));
        for endless in ["/dev/zero", "/dev"] {
            let refused = endless.parse::<Weights>().unwrap_err().to_string();
            assert!(refused.contains("it is no ordinary file"), "{refused}");
        }
        assert!(matches!("/nowhere".parse::<Weights>(), Err(WeightsError::Io { .. })));
    }
}
