//! Which weights a recorded plan was made with.
//!
//! The recording says so only where its run has a command for the planner, and names a file then. But the plan tells what each term
//! cost, and the term's residuals are computed again, so a weight shows wherever they are not all zero. The weights that are tried must
//! explain what was told.

use std::fmt::Write;

use gauss_newton::constants::{DT, TERMS, Term};
use world::plan::{Control, Diagnostics, Prediction};
use world::vehicle::Limits;

use crate::{Weights, WeightsError};

/// Costs that differ by less, relatively and absolutely, are the same.
const ROUNDING: (f64, f64) = (1e-6, 1e-9);

/// What is known of a plan's costs.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    /// Half the sum of squares of each term's residuals, before weighting.
    pub squares: [f64; TERMS],
    /// What the plan says that each term cost; `None` where the situation does not tell the term's residuals.
    pub told: [Option<f64>; TERMS],
    /// Whether the controls were cut to what the vehicle can follow after they were costed.
    pub cut: bool,
}

/// What a planner says that each term cost; `None` where it does not speak of these terms.
pub(super) fn told(diagnostics: &Diagnostics) -> Option<[f64; TERMS]> {
    let mut told = [0.0; TERMS];
    for (term, cost) in Term::ALL.iter().zip(&mut told) {
        *cost = diagnostics.objective.iter().find(|(name, _)| name == term.name())?.1;
    }
    Some(told)
}

/// Whether any control is at one of the limits, from the steering angle `wheel` (rad) on.
pub(super) fn cut(controls: &[Control], mut wheel: f64) -> bool {
    let Limits { acceleration, steering, steering_rate } = Limits::STRICT;
    let at = |value: f64, limit: f64| value.abs() >= limit - 1e-9;
    controls.iter().any(|c| {
        let turn = c.steering - wheel;
        wheel = c.steering;
        at(c.acceleration, acceleration) || at(c.steering, steering) || at(turn, steering_rate * DT)
    })
}

impl Costs {
    /// The weights to explain the plan by, and what is to be said of them: those `given`; without any, those that the plan's run names
    /// (`named`); else those tuned by hand or those that came with the prediction, as they explain what was told.
    ///
    /// # Errors
    /// Where the weights cannot be had; where none are given and those that are tried are not those of the plan.
    pub fn weights(
        &self,
        given: Option<&Weights>,
        named: Option<&str>,
        prediction: &Prediction,
    ) -> Result<([f64; TERMS], Option<String>), String> {
        let (whose, tried) = match (given, named) {
            (Some(given), _) => ("the given".to_owned(), vec![given.of(prediction)?]),
            (None, Some(named)) => {
                // The first line says why; the others are for who typed it.
                let why = |e: WeightsError| e.to_string().lines().next().unwrap_or_default().to_owned();
                let weights: Weights =
                    named.parse().map_err(|e| format!("its run has --weights {named}: {}", why(e)))?;
                (format!("its run's ({named})"), vec![weights.of(prediction)?])
            }
            (None, None) => {
                let mut tried = vec![Weights::HandTuned.of(prediction)?];
                if prediction.cost_weights().is_some() {
                    tried.push(Weights::Learned.of(prediction)?);
                }
                ("the hand-tuned".to_owned(), tried)
            }
        };
        if let Some(weights) = tried.iter().find(|weights| self.others(weights).is_empty()) {
            return Ok((*weights, None));
        }
        if self.cut {
            let said = "its controls were cut to what the vehicle can follow after it was costed, or it was made with other weights";
            return Ok((tried[0], Some(format!("{said} than {whose}: what it told is not what is below"))));
        }
        let mut text = format!("the plan was not made with {whose} weights:");
        for (i, (term, weight)) in self.others(&tried[0]).iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // Writing to a string cannot fail.
            let _ = write!(text, "{comma} {} ", term.name());
            let _ = match weight {
                Some(weight) => write!(text, "{weight:.4}, not {:.4}", tried[0][*term as usize]),
                None => write!(text, "costs nothing here"),
            };
        }
        if given.is_some() { Ok((tried[0], Some(text))) } else { Err(text) }
    }

    /// The terms whose cost these weights do not explain, and the weight that would, if any.
    fn others(&self, weights: &[f64; TERMS]) -> Vec<(Term, Option<f64>)> {
        let mut others = Vec::new();
        for term in Term::ALL {
            let (k, squares) = (term as usize, self.squares[term as usize]);
            let Some(told) = self.told[k] else { continue };
            let cost = weights[k] * weights[k] * squares;
            if (cost - told).abs() > ROUNDING.0 * told.abs() + ROUNDING.1 {
                others.push((term, (squares > 0.0).then(|| (told / squares).sqrt())));
            }
        }
        others
    }
}
