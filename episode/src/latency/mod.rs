//! Latency: a plan that is asked for at t takes effect at t + delay, and the one before is followed until then. Time is virtual, so that
//! the same delays are the same drive, however long anything took.
//!
//! | module | what |
//! | --- | --- |
//! | here | how long plans take, as settings: `fixed:80ms`, `dist:normal:80ms:20ms`, ... |
//! | [`delays`] | delays drawn from a distribution |
//! | [`pipeline`] | plans under way: which is followed when, which come late, which are lost |

pub mod delays;
pub mod pipeline;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::guidance::STEP_US;
use world::plan::PLAN_STEPS;

/// A plan has ended by then (us): with this delay it has nothing left to say.
pub const TOO_LATE_US: u32 = PLAN_STEPS as u32 * STEP_US;

/// How long plans take from the observation that they answer until they take effect. Written as it is typed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Latency {
    /// Each as long (us), below [`TOO_LATE_US`].
    Fixed(u32),
    /// As long as the driver takes, by the clock.
    Measured,
    /// As long as a file says for each scene and step.
    Trace {
        /// SHA-256 of the file, in hexadecimal digits.
        sha256: String,
    },
    /// By chance.
    Drawn(Distribution),
}

/// Delays by chance: the same ones in the same scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// How long.
    pub shape: Shape,
    /// The share of plans that never arrive.
    pub loss: f64,
    /// What all delays follow from, with the scene's name.
    pub seed: u64,
}

/// How delays (us) are spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// All between two delays alike.
    Uniform(u32, u32),
    /// Around a mean, with a standard deviation; below zero is zero.
    Normal(u32, u32),
    /// Half of them below the first, one of a hundred above the second: the long tail of networks and schedulers.
    LogNormal(u32, u32),
}

/// A latency that is none.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "{text:?} is no latency: {why}\nhint: 80ms, measured, trace:FILE, dist:uniform:MIN:MAX, dist:normal:MEAN:DEVIATION or \
         dist:lognormal:MEDIAN:P99, these with :loss=SHARE or :seed=N behind; docs/latency.md tells of each"
)]
pub struct LatencyError {
    text: String,
    why: String,
}

impl Latency {
    /// Whether every plan takes effect at once.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::Fixed(0)
    }
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(delay) => write!(f, "fixed:{}", Time(*delay)),
            Self::Measured => f.write_str("measured"),
            Self::Trace { sha256 } => write!(f, "trace:{sha256}"),
            Self::Drawn(Distribution { shape, loss, seed }) => {
                match shape {
                    Shape::Uniform(least, most) => write!(f, "dist:uniform:{}:{}", Time(*least), Time(*most))?,
                    Shape::Normal(mean, deviation) => write!(f, "dist:normal:{}:{}", Time(*mean), Time(*deviation))?,
                    Shape::LogNormal(median, p99) => write!(f, "dist:lognormal:{}:{}", Time(*median), Time(*p99))?,
                }
                if *loss > 0.0 {
                    write!(f, ":loss={loss}")?;
                }
                write!(f, ":seed={seed}")
            }
        }
    }
}

/// A time in us, written in ms.
struct Time(u32);

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}ms", f64::from(self.0) / 1e3)
    }
}

impl From<Latency> for String {
    fn from(latency: Latency) -> Self {
        latency.to_string()
    }
}

impl TryFrom<String> for Latency {
    type Error = LatencyError;

    fn try_from(text: String) -> Result<Self, LatencyError> {
        text.parse()
    }
}

impl FromStr for Latency {
    type Err = LatencyError;

    fn from_str(text: &str) -> Result<Self, LatencyError> {
        let latency = match text.split_once(':') {
            None if text == "measured" => Ok(Self::Measured),
            None => time(text).map(Self::Fixed),
            Some(("fixed", delay)) => time(delay).map(Self::Fixed),
            Some(("trace", sha256)) if sha256.len() == 64 && sha256.bytes().all(|b| b.is_ascii_hexdigit()) => {
                Ok(Self::Trace { sha256: sha256.to_owned() })
            }
            Some(("trace", _)) => Err("a trace is named by its SHA-256 there, of 64 hexadecimal digits".to_owned()),
            Some(("dist", rest)) => distribution(rest).map(Self::Drawn),
            Some((kind, _)) => Err(format!("{kind:?} is none of fixed, measured, trace and dist")),
        };
        latency.map_err(|why| LatencyError { text: text.to_owned(), why })
    }
}

fn distribution(text: &str) -> Result<Distribution, String> {
    let mut words = text.split(':');
    let name = words.next().unwrap_or_default();
    let mut next = || words.next().ok_or_else(|| format!("{name} takes two times")).and_then(time);
    let (one, other) = (next()?, next()?);
    let ordered = |shape: Shape| match one <= other {
        true => Ok(shape),
        false => Err(format!("the second time of {name} is below the first")),
    };
    let shape = match name {
        "uniform" => ordered(Shape::Uniform(one, other))?,
        "normal" => Shape::Normal(one, other),
        "lognormal" if one == 0 => return Err("the median of lognormal is above 0".to_owned()),
        "lognormal" => ordered(Shape::LogNormal(one, other))?,
        _ => return Err(format!("{name:?} is none of uniform, normal and lognormal")),
    };
    let (mut loss, mut seed) = (0.0, 0);
    for word in words {
        match word.split_once('=') {
            Some(("loss", share)) => {
                loss = share.parse().ok().filter(|loss| (0.0..=1.0).contains(loss)).ok_or("loss lies in 0..1")?;
            }
            Some(("seed", number)) => seed = number.parse().map_err(|_| "a seed is a whole number")?,
            _ => return Err(format!("{word:?} is neither loss=SHARE nor seed=N")),
        }
    }
    Ok(Distribution { shape, loss, seed })
}

/// `80ms`, `1.5s`, `250us` or `0`, in us, below [`TOO_LATE_US`].
fn time(text: &str) -> Result<u32, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let scale = match unit {
        "us" => 1.0,
        "ms" => 1e3,
        "s" => 1e6,
        "" if number == "0" => 1.0,
        _ => return Err(format!("{text:?} is no time: write it with its unit, as 80ms, 1.5s or 250us")),
    };
    let us = number.parse::<f64>().map_err(|_| format!("{text:?} is no time"))? * scale;
    if us.round() >= f64::from(TOO_LATE_US) {
        return Err(format!("{text} is too late: a plan has ended after {} s", TOO_LATE_US / 1_000_000));
    }
    Ok(us.round() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_what_is_written() {
        for (typed, written) in [
            ("80ms", "fixed:80ms"),
            ("fixed:0.5s", "fixed:500ms"),
            ("fixed:250us", "fixed:0.25ms"),
            ("0", "fixed:0ms"),
            ("measured", "measured"),
            ("dist:uniform:20ms:1s", "dist:uniform:20ms:1000ms:seed=0"),
            ("dist:normal:80ms:20ms:loss=0.01:seed=7", "dist:normal:80ms:20ms:loss=0.01:seed=7"),
            ("dist:lognormal:80ms:80ms:seed=7:loss=1", "dist:lognormal:80ms:80ms:loss=1:seed=7"),
            (&format!("trace:{}", "a0".repeat(32)), &format!("trace:{}", "a0".repeat(32))),
        ] {
            let latency: Latency = typed.parse().unwrap();
            assert_eq!(latency.to_string(), written);
            assert_eq!(written.parse(), Ok(latency));
        }
        assert!("0s".parse::<Latency>().unwrap().is_none() && !"1us".parse::<Latency>().unwrap().is_none());
    }

    #[test]
    fn what_is_no_latency_says_why() {
        for (typed, why) in [
            ("80", "write it with its unit"),
            ("fixed:-1ms", "is no time"),
            ("fixed:5s", "5s is too late: a plan has ended after 5 s"),
            ("fixed:1e9s", "is no time"),
            ("fixed:..ms", "is no time"),
            ("measure", "is no time"),
            ("random:80ms", "is none of fixed, measured, trace and dist"),
            ("trace:x", "64 hexadecimal digits"),
            ("dist:uniform:80ms", "takes two times"),
            ("dist:uniform:80ms:20ms", "is below the first"),
            ("dist:pareto:80ms:90ms", "is none of uniform, normal and lognormal"),
            ("dist:lognormal:0ms:90ms", "is above 0"),
            ("dist:normal:80ms:20ms:loss=2", "loss lies in 0..1"),
            ("dist:normal:80ms:20ms:loss=NaN", "loss lies in 0..1"),
            ("dist:normal:80ms:20ms:seed=-1", "whole number"),
            ("dist:normal:80ms:20ms:seeds=1", "neither loss=SHARE nor seed=N"),
        ] {
            let error = typed.parse::<Latency>().unwrap_err().to_string();
            assert!(error.contains(why), "{typed}: {error}");
        }
    }
}
