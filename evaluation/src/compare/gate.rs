//! What makes `sim compare` fail: `--fail-on new-failures`, `missing-scenes`, `METRIC>X`, `METRIC<X`, `METRIC>X%`, `METRIC<X%`.
//!
//! A gate asks what is so in these scenes, not whether it may be chance: its line says that too.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;
use thiserror::Error;

use super::comparison::Comparison;
use super::figures::{FIGURES, Verdict, is_share};

/// A rule that a comparison must not break.
#[derive(Clone, Debug, PartialEq)]
pub enum FailOn {
    /// No scene may go from pass to fail.
    NewFailures,
    /// Every scene of A must be paired.
    MissingScenes,
    /// The difference of a figure has a limit.
    Figure {
        /// The figure.
        name: &'static str,
        /// Whether the difference must not lie above the limit; else not below.
        above: bool,
        /// The limit: of B - A in the figure's unit, or as a share of A's mean.
        limit: f64,
        /// Whether it is a share of A's mean.
        relative: bool,
    },
}

/// A rule that makes no sense.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum FailOnError {
    #[error(
        "it is neither new-failures nor missing-scenes nor 'METRIC>X' or 'METRIC<X'; in quotes, for the shell takes > and < for itself"
    )]
    Form,
    #[error("there is no figure {0:?} to compare; docs/compare.md lists them")]
    Name(String),
    #[error("the limit {0:?} is no number; write it as 0.5, -2 or 5%")]
    Limit(String),
    #[error("{0} is a share of scenes: write 0.01 for one percentage point, without %")]
    PercentOfShare(&'static str),
}

/// A rule that cannot be asked of these runs.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum GateError {
    #[error(
        "--fail-on {rule}: no paired scene has a value of {name} in both runs\nhint: take another figure, or leave the rule out"
    )]
    NoValue { rule: String, name: &'static str },
    #[error(
        "--fail-on {rule}: the mean of {name} in A is 0, so there is no share of it\nhint: give the limit in the figure's own unit, without %"
    )]
    OfNothing { rule: String, name: &'static str },
}

/// A rule, and whether it is broken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Gate {
    /// As it was typed.
    pub rule: String,
    /// Whether it is broken.
    pub hit: bool,
    /// What is so.
    pub finding: String,
}

impl FromStr for FailOn {
    type Err = FailOnError;

    fn from_str(text: &str) -> Result<Self, FailOnError> {
        match text.trim() {
            "new-failures" => return Ok(Self::NewFailures),
            "missing-scenes" => return Ok(Self::MissingScenes),
            _ => {}
        }
        let at = text.find(['>', '<']).ok_or(FailOnError::Form)?;
        let (name, limit) = (text[..at].trim(), text[at + 1..].trim());
        let known = FIGURES.iter().find(|(known, _)| *known == name);
        let name = known.ok_or_else(|| FailOnError::Name(name.to_owned()))?.0;
        let (number, relative) = limit.strip_suffix('%').map_or((limit, false), |number| (number.trim_end(), true));
        let value = number.parse().ok().filter(|value: &f64| value.is_finite());
        let value = value.ok_or_else(|| FailOnError::Limit(limit.to_owned()))?;
        if relative && is_share(name) {
            return Err(FailOnError::PercentOfShare(name));
        }
        let limit = if relative { value / 100.0 } else { value };
        Ok(Self::Figure { name, above: text[at..].starts_with('>'), limit, relative })
    }
}

impl fmt::Display for FailOn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NewFailures => f.write_str("new-failures"),
            Self::MissingScenes => f.write_str("missing-scenes"),
            Self::Figure { name, above, limit, relative } => {
                let sign = if *above { '>' } else { '<' };
                if *relative { write!(f, "{name}{sign}{}%", 100.0 * limit) } else { write!(f, "{name}{sign}{limit}") }
            }
        }
    }
}

/// Each rule, held to the comparison.
///
/// # Errors
/// [`GateError`] where a rule cannot be asked: it must not pass unseen.
pub fn check(comparison: &Comparison, rules: &[FailOn]) -> Result<Vec<Gate>, GateError> {
    rules.iter().map(|rule| held_to(comparison, rule)).collect()
}

fn held_to(comparison: &Comparison, rule: &FailOn) -> Result<Gate, GateError> {
    let text = rule.to_string();
    let FailOn::Figure { name, above, limit, relative } = rule else {
        let (count, what) = match rule {
            FailOn::NewFailures => (comparison.new_failures.len(), "passed in A and failed in B"),
            _ => (comparison.left_out.missing(), "of A without a partner in B"),
        };
        let finding = format!("{count} {} {what}", if count == 1 { "scene" } else { "scenes" });
        return Ok(Gate { rule: text, hit: count > 0, finding });
    };
    let no_value = || GateError::NoValue { rule: text.clone(), name };
    let figure = comparison.figure(name).ok_or_else(no_value)?;
    let (a, difference) = figure.a.zip(figure.difference).ok_or_else(no_value)?;
    if *relative && a == 0.0 {
        return Err(GateError::OfNothing { rule: text, name });
    }
    let value = if *relative { difference / a.abs() } else { difference };
    let hit = if *above { value > *limit } else { value < *limit };
    let value = if *relative { format!("{:+.2}%", 100.0 * value) } else { format!("{value:+.6}") };
    let chance = match figure.verdict {
        Verdict::NotDistinguishable => ", which may be chance",
        _ => "",
    };
    let finding = format!("B - A is {value} at n = {}{chance}", figure.pairs);
    Ok(Gate { rule: text, hit, finding })
}
