//! What a plan of controls costs: the recorded controls in the recorded situation, each term over time, the neighbors that bind, and what
//! the search would come to without each of the terms.

use std::fmt;

use wire::node::{History, StepInput};
use world::plan::UncheckedPrediction;
use world::scene::TrackId;

use super::weights;
use super::{ExplainError, RecordedStep};
use crate::Weights;
use crate::gauss_newton_planner::{Rules, Situation};
use gauss_newton::constants::{DT, STEPS, TERMS, Term, lane_step};
use gauss_newton::{Controls, Evaluation, LinearSolver, Problem, Settings, Solver, trajectory};

/// What is to be said of a plan of controls.
#[derive(Clone, Debug)]
pub struct Costs {
    scene: String,
    protocol: String,
    /// Whether the recording has a prediction; else everybody is expected to keep their velocity.
    predicted: bool,
    step: u32,
    status: String,
    iterations: u32,
    pub(super) weights: [f64; TERMS],
    /// What must be known of the weights.
    pub(super) doubt: Option<String>,
    /// Half the sum of squares of each term, second by second, and whole.
    pub(super) terms: Vec<(Term, [f64; SECONDS], f64)>,
    binding: Vec<Binding>,
    /// Seconds into the plan at which the stop before the red light is passed, and by how much at the end (m).
    red: Option<(f64, f64)>,
    /// How far before the light that stop is (m).
    stop_margin: f64,
    /// First control and end of the plan as the search goes on from the recorded controls, then without each term.
    again: Outcome,
    without: Vec<(Term, Outcome)>,
}

const SECONDS: usize = 5;

/// A neighbor nearer than is safe.
#[derive(Clone, Debug)]
struct Binding {
    seconds: f64,
    track: Option<TrackId>,
    distance: f64,
    missing: f64,
}

/// What a search came to.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    acceleration: f64,
    steering: f64,
    /// Where the AV would be after five seconds, in its own frame (m), and how fast (m/s).
    ahead: f64,
    left: f64,
    speed: f64,
}

impl Costs {
    /// Costs a step's plan under these weights; without any, under those that it was made with.
    ///
    /// # Errors
    /// [`ExplainError`].
    pub fn of(step: u32, recorded: &RecordedStep, weights: Option<&Weights>) -> Result<Self, ExplainError> {
        let RecordedStep { briefing, observation, prediction, plan, planner, .. } = recorded;
        let error = |what: String| ExplainError::Problem { step, what };
        let planned = plan.controls().ok_or(ExplainError::NoControls(step))?;
        let controls = Controls::from_pairs(planned.iter().map(|c| (c.acceleration, c.steering)));
        let controls = controls.ok_or(ExplainError::NoControls(step))?;
        let predicted = prediction.is_some();
        let prediction = match prediction {
            Some(prediction) => prediction.clone(),
            None => UncheckedPrediction { step, ..Default::default() }.check(step).map_err(|e| error(e.to_string()))?,
        };
        let rules = Rules::of(&briefing.protocol);
        let settings = rules.settings(briefing);
        let mut situation = Situation::default();
        let history = History::new(briefing);
        let input = StepInput { briefing, observation, history: &history, prediction: Some(&prediction) };
        situation.fill(rules, &input, &prediction).map_err(error)?;
        let mut problem = situation.with_inputs([1.0; TERMS], Problem::new).map_err(|e| error(e.to_string()))?;
        let mut at = Evaluation::default();
        at.evaluate(&problem, &settings.costing, &controls);
        let told = weights::told(plan.diagnostics());
        let costs = weights::Costs {
            squares: at.terms,
            // Who was expected where is known from the prediction alone.
            told: Term::ALL
                .map(|term| told.filter(|_| predicted || term != Term::Safety).map(|told| told[term as usize])),
            cut: rules == Rules::Strict && weights::cut(planned, observation.control.steering),
        };
        let (weights, doubt) = match weights {
            Some(given) => costs.weights(Some(given), None, &prediction).map_err(error)?,
            None => costs
                .weights(None, planner.weights.as_deref(), &prediction)
                .map_err(|what| ExplainError::OtherWeights { step, what })?,
        };
        problem.set_weights(weights).map_err(|e| error(e.to_string()))?;
        at.evaluate(&problem, &settings.costing, &controls);
        let binding = at.safety().iter().zip(&at.rows.safety).map(|(row, missing)| Binding {
            seconds: seconds(row.step),
            track: situation.track(row.neighbor),
            distance: row.distance,
            missing: *missing,
        });
        let binding = binding.collect();
        let red = (at.red_from < STEPS).then(|| (seconds(at.red_from), at.rows.red_light[STEPS - 1]));
        let terms = Term::ALL.map(|term| (term, over_time(&at, term, weights[term as usize]), at.terms[term as usize]));
        let search = |problem: &Problem| outcome(problem, &settings, &controls).map_err(|e| error(e.to_string()));
        let again = search(&problem)?;
        let mut without = Vec::new();
        for term in Term::ALL {
            let mut others = weights;
            others[term as usize] = 0.0;
            problem.set_weights(others).map_err(|e| error(e.to_string()))?;
            // Terms that weigh nothing as it is, or cost nothing, change nothing.
            without.push((term, search(&problem)?));
        }
        Ok(Self {
            scene: briefing.scene.to_string(),
            protocol: briefing.protocol.clone(),
            predicted,
            step,
            status: plan.diagnostics().status.clone(),
            iterations: plan.diagnostics().iterations,
            weights,
            doubt,
            terms: terms.to_vec(),
            binding,
            red,
            stop_margin: situation.stop_margin(),
            again,
            without,
        })
    }
}

fn seconds(step: usize) -> f64 {
    DT * (step + 1) as f64
}

/// The term's share of the objective in each second of the plan.
fn over_time(at: &Evaluation, term: Term, weight: f64) -> [f64; SECONDS] {
    let mut sums = [0.0; SECONDS];
    for (which, rows) in at.rows.parts() {
        if which != term {
            continue;
        }
        for (i, c) in rows.iter().enumerate() {
            let step = match term {
                Term::LanePosition | Term::LaneHeading => lane_step(i),
                Term::Safety => at.safety()[i].step,
                Term::Jerk | Term::SteeringChange => i + at.rows.extent.first_change,
                _ => i,
            };
            sums[step * SECONDS / STEPS] += 0.5 * weight * weight * c * c;
        }
    }
    sums
}

fn outcome(problem: &Problem, settings: &Settings, from: &Controls) -> Result<Outcome, gauss_newton::SolveError> {
    let mut solver = Solver::new(LinearSolver::Sweep);
    solver.solve(problem, settings, from)?;
    let best = solver.best();
    let last = trajectory(problem, &settings.costing.model, best)[STEPS - 1];
    let first = best.at(0);
    Ok(Outcome {
        acceleration: first.acceleration,
        steering: first.steering,
        ahead: last.x,
        left: last.y,
        speed: last.speed.max(0.0),
    })
}

impl fmt::Display for Costs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, protocol, step, status, iterations, .. } = self;
        writeln!(f, "scene {scene} under {protocol}, step {step}: {status} after {iterations} iterations")?;
        if !self.predicted {
            writeln!(f, "nobody predicted: everybody is expected to keep their velocity")?;
        }
        if let Some(doubt) = &self.doubt {
            writeln!(f, "{doubt}")?;
        }
        writeln!(f, "\nwhat the plan costs, second by second")?;
        writeln!(
            f,
            "{:<16} {:>8} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10}",
            "term", "weight", "1 s", "2 s", "3 s", "4 s", "5 s", "whole"
        )?;
        for (term, over_time, whole) in &self.terms {
            write!(f, "{:<16} {:>8.3}", term.name(), self.weights[*term as usize])?;
            for cost in over_time {
                write!(f, " {cost:>9.3}")?;
            }
            writeln!(f, " {whole:>10.3}")?;
        }
        writeln!(f)?;
        if self.binding.is_empty() {
            writeln!(f, "no neighbor in its path is nearer than is safe")?;
        }
        for b in &self.binding {
            let who = b.track.map_or_else(|| "a neighbor".to_owned(), |track| format!("track {track}"));
            writeln!(
                f,
                "at {:.1} s {who} is {:.1} m away, {:.1} m less than is safe",
                b.seconds, b.distance, b.missing
            )?;
        }
        if let Some((seconds, meters)) = self.red {
            writeln!(
                f,
                "at {seconds:.1} s it passes the stop {} m before the red light, by {meters:.1} m at the end",
                self.stop_margin
            )?;
        }
        writeln!(f, "\nwhat the search comes to from this plan, and without each term")?;
        writeln!(
            f,
            "{:<16} {:>12} {:>12} {:>9} {:>9} {:>9}",
            "without", "first m/s^2", "first rad", "ahead m", "left m", "m/s"
        )?;
        let outcomes = std::iter::once(("-", &self.again)).chain(self.without.iter().map(|(term, o)| (term.name(), o)));
        for (name, o) in outcomes {
            let line = format!(
                "{name:<16} {:>12.3} {:>12.4} {:>9.2} {:>9.2} {:>9.2}",
                o.acceleration, o.steering, o.ahead, o.left, o.speed
            );
            writeln!(f, "{line}")?;
        }
        Ok(())
    }
}
