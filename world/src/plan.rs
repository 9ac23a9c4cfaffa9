//! Plans: where the AV wants to be in the next five seconds. And predictions: where the others may be.

use thiserror::Error;

use crate::geometry::Pose;
use crate::scene::{LARGEST_NUMBER, TrackId, is_in_range};

/// Length of a step (s).
pub const STEP_SECONDS: f64 = 0.1;

/// Poses of a plan and of a predicted trajectory: 5 s.
pub const PLAN_STEPS: usize = 50;

/// One state of a plan, in the log's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanState {
    /// x (m).
    pub x: f64,
    /// y (m).
    pub y: f64,
    /// Heading (rad).
    pub heading: f64,
    /// Speed (m/s).
    pub speed: f64,
}

/// One control of the bicycle model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Control {
    /// Acceleration (m/s^2).
    pub acceleration: f64,
    /// Angle of the front wheels (rad), positive to the left.
    pub steering: f64,
}

/// Why a plan is what it is, in the planner's own words. Never the time it took: that would not repeat.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagnostics {
    /// The objective's terms by name, in the planner's order.
    pub objective: Vec<(String, f64)>,
    /// Iterations used.
    pub iterations: u32,
    /// How the search ended.
    pub status: String,
}

/// A plan as it came in. [`UncheckedPlan::check`] makes a [`Plan`] of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UncheckedPlan {
    /// The step of the observation that it answers.
    pub step: u32,
    /// States at 0.1 s, 0.2 s, ... 5.0 s after the observation.
    pub states: Vec<PlanState>,
    /// Controls of each of these steps, or none.
    pub controls: Vec<Control>,
    /// Why.
    pub diagnostics: Diagnostics,
}

/// A plan that is whole: [`PLAN_STEPS`] states, and as many controls or none, of numbers up to [`LARGEST_NUMBER`].
#[derive(Clone, Debug, PartialEq)]
pub struct Plan(UncheckedPlan);

/// What is wrong with a plan or a prediction from outside.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AnswerError {
    /// It answers another step.
    #[error("it answers step {got}, but step {expected} was asked for")]
    WrongStep {
        /// The step asked for.
        expected: u32,
        /// The step answered.
        got: u32,
    },
    /// It is too short or too long.
    #[error("it has {got} {what}, but {expected} are needed")]
    WrongLength {
        /// Of what.
        what: &'static str,
        /// As many as needed.
        expected: usize,
        /// As many as came.
        got: usize,
    },
    /// A number is infinite, not a number, or beyond [`LARGEST_NUMBER`].
    #[error("{what} {index} is not finite, or beyond {LARGEST_NUMBER:e}")]
    OutOfRange {
        /// Of what.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
    },
    /// A probability is outside [0, 1], or they do not sum to 1.
    #[error("the probabilities are not a distribution: they sum to {sum}")]
    Probabilities {
        /// Their sum, as text.
        sum: String,
    },
}

impl UncheckedPlan {
    /// The plan, if it answers `step` and is whole.
    ///
    /// # Errors
    /// [`AnswerError`] names the first thing that is wrong.
    pub fn check(self, step: u32) -> Result<Plan, AnswerError> {
        check_step(step, self.step)?;
        check_length("states", PLAN_STEPS, self.states.len())?;
        if !self.controls.is_empty() {
            check_length("controls", PLAN_STEPS, self.controls.len())?;
        }
        check_range("state", &self.states, |s| [s.x, s.y, s.heading, s.speed])?;
        check_range("control", &self.controls, |c| [c.acceleration, c.steering])?;
        Ok(Plan(self))
    }
}

impl Plan {
    /// The step that it answers.
    #[must_use]
    pub fn step(&self) -> u32 {
        self.0.step
    }

    /// The [`PLAN_STEPS`] states; state `k` is wanted `k + 1` steps after the observation.
    #[must_use]
    pub fn states(&self) -> &[PlanState] {
        &self.0.states
    }

    /// The [`PLAN_STEPS`] controls, if the planner thinks in controls.
    #[must_use]
    pub fn controls(&self) -> Option<&[Control]> {
        (!self.0.controls.is_empty()).then_some(&self.0.controls)
    }

    /// Why.
    #[must_use]
    pub fn diagnostics(&self) -> &Diagnostics {
        &self.0.diagnostics
    }

    /// The plan without its guarantee, to be sent or changed.
    #[must_use]
    pub fn into_unchecked(self) -> UncheckedPlan {
        self.0
    }
}

/// Where one agent is expected.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedTrajectory {
    /// Which track.
    pub track: TrackId,
    /// Poses at 0.1 s, 0.2 s, ... 5.0 s after the observation, in the log's frame.
    pub poses: Vec<Pose>,
}

/// One joint future of all agents.
#[derive(Clone, Debug, PartialEq)]
pub struct Future {
    /// Its probability.
    pub probability: f64,
    /// The agents' trajectories.
    pub trajectories: Vec<PredictedTrajectory>,
    /// The AV's own controls in this future, as the predictor sees it: [`PLAN_STEPS`] or none.
    pub controls: Vec<Control>,
}

/// A prediction as it came in. [`UncheckedPrediction::check`] makes a [`Prediction`] of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UncheckedPrediction {
    /// The step of the observation that it answers.
    pub step: u32,
    /// The futures.
    pub futures: Vec<Future>,
    /// Controls that a planner may start its search from, [`PLAN_STEPS`] or none.
    pub initial_controls: Vec<Control>,
    /// Weights of the planner's cost terms, or none.
    pub cost_weights: Vec<f64>,
}

/// A prediction that is whole: every trajectory has [`PLAN_STEPS`] poses, every future as many controls or none, of numbers up to
/// [`LARGEST_NUMBER`]; probabilities sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction(UncheckedPrediction);

impl UncheckedPrediction {
    /// One future for certain, of these; none where there is nobody.
    #[must_use]
    pub fn certain(step: u32, trajectories: Vec<PredictedTrajectory>) -> Self {
        let future = Future { probability: 1.0, trajectories, controls: vec![] };
        let futures = if future.trajectories.is_empty() { vec![] } else { vec![future] };
        Self { step, futures, ..Self::default() }
    }

    /// The prediction, if it answers `step` and is whole. No future at all is allowed: nobody to predict.
    ///
    /// # Errors
    /// [`AnswerError`] names the first thing that is wrong.
    pub fn check(self, step: u32) -> Result<Prediction, AnswerError> {
        check_step(step, self.step)?;
        for future in &self.futures {
            for trajectory in &future.trajectories {
                check_length("poses", PLAN_STEPS, trajectory.poses.len())?;
                check_range("pose", &trajectory.poses, |p| [p.x, p.y, p.heading])?;
            }
            if !future.controls.is_empty() {
                check_length("controls of a future", PLAN_STEPS, future.controls.len())?;
            }
            check_range("a future's control", &future.controls, |c| [c.acceleration, c.steering])?;
        }
        if !self.futures.is_empty() {
            let sum: f64 = self.futures.iter().map(|future| future.probability).sum();
            let in_range = |future: &Future| (0.0..=1.0).contains(&future.probability);
            // Networks answer in f32: their softmax misses 1 by a few of its digits.
            if !self.futures.iter().all(in_range) || (sum - 1.0).abs() > 1e-3 {
                return Err(AnswerError::Probabilities { sum: sum.to_string() });
            }
        }
        if !self.initial_controls.is_empty() {
            check_length("initial controls", PLAN_STEPS, self.initial_controls.len())?;
        }
        check_range("initial control", &self.initial_controls, |c| [c.acceleration, c.steering])?;
        check_range("cost weight", &self.cost_weights, |w| [*w])?;
        Ok(Prediction(self))
    }
}

impl Prediction {
    /// The step that it answers.
    #[must_use]
    pub fn step(&self) -> u32 {
        self.0.step
    }

    /// The futures.
    #[must_use]
    pub fn futures(&self) -> &[Future] {
        &self.0.futures
    }

    /// The future with the highest probability; the first of equals.
    #[must_use]
    pub fn most_likely(&self) -> Option<&Future> {
        let mut futures = self.0.futures.iter();
        let first = futures.next()?;
        Some(futures.fold(first, |best, f| if f.probability > best.probability { f } else { best }))
    }

    /// Controls that a planner may start its search from.
    #[must_use]
    pub fn initial_controls(&self) -> Option<&[Control]> {
        (!self.0.initial_controls.is_empty()).then_some(&self.0.initial_controls)
    }

    /// Weights of the planner's cost terms.
    #[must_use]
    pub fn cost_weights(&self) -> Option<&[f64]> {
        (!self.0.cost_weights.is_empty()).then_some(&self.0.cost_weights)
    }

    /// The prediction without its guarantee, to be sent or changed.
    #[must_use]
    pub fn into_unchecked(self) -> UncheckedPrediction {
        self.0
    }
}

fn check_step(expected: u32, got: u32) -> Result<(), AnswerError> {
    if expected == got { Ok(()) } else { Err(AnswerError::WrongStep { expected, got }) }
}

fn check_length(what: &'static str, expected: usize, got: usize) -> Result<(), AnswerError> {
    if expected == got { Ok(()) } else { Err(AnswerError::WrongLength { what, expected, got }) }
}

fn check_range<T, const N: usize>(
    what: &'static str,
    items: &[T],
    numbers: impl Fn(&T) -> [f64; N],
) -> Result<(), AnswerError> {
    match items.iter().position(|item| !numbers(item).into_iter().all(is_in_range)) {
        Some(index) => Err(AnswerError::OutOfRange { what, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> UncheckedPlan {
        UncheckedPlan { step: 7, states: vec![PlanState::default(); PLAN_STEPS], ..UncheckedPlan::default() }
    }

    fn prediction(probabilities: &[f64]) -> UncheckedPrediction {
        let trajectories = vec![PredictedTrajectory { track: TrackId(1), poses: vec![Pose::default(); PLAN_STEPS] }];
        let future = |probability: &f64| Future {
            probability: *probability,
            trajectories: trajectories.clone(),
            controls: vec![Control::default(); PLAN_STEPS],
        };
        UncheckedPrediction { futures: probabilities.iter().map(future).collect(), ..UncheckedPrediction::default() }
    }

    #[test]
    fn a_whole_plan_comes_through_as_it_was() {
        let with_controls = UncheckedPlan { controls: vec![Control::default(); PLAN_STEPS], ..plan() };
        assert_eq!(plan().check(7).unwrap().controls(), None);
        let checked = with_controls.clone().check(7).unwrap();
        assert_eq!((checked.step(), checked.controls().unwrap().len()), (7, PLAN_STEPS));
        assert_eq!(checked.into_unchecked(), with_controls);
    }

    #[test]
    fn a_plan_for_another_step_is_refused() {
        assert_eq!(plan().check(8), Err(AnswerError::WrongStep { expected: 8, got: 7 }));
    }

    #[test]
    fn a_plan_of_the_wrong_length_is_refused() {
        let wrong = |what, got| Err(AnswerError::WrongLength { what, expected: PLAN_STEPS, got });
        assert_eq!(UncheckedPlan { states: Vec::new(), ..plan() }.check(7), wrong("states", 0));
        assert_eq!(UncheckedPlan { states: vec![PlanState::default(); 51], ..plan() }.check(7), wrong("states", 51));
        assert_eq!(UncheckedPlan { controls: vec![Control::default(); 49], ..plan() }.check(7), wrong("controls", 49));
    }

    #[test]
    fn a_plan_with_a_number_that_is_none_is_refused() {
        let mut bad = plan();
        bad.states[3].speed = f64::NAN;
        assert_eq!(bad.check(7), Err(AnswerError::OutOfRange { what: "state", index: 3 }));
        let mut bad = plan();
        bad.states[9].x = -1e8;
        assert_eq!(bad.check(7), Err(AnswerError::OutOfRange { what: "state", index: 9 }));
        let mut bad = UncheckedPlan { controls: vec![Control::default(); PLAN_STEPS], ..plan() };
        bad.controls[49].steering = f64::INFINITY;
        assert_eq!(bad.check(7), Err(AnswerError::OutOfRange { what: "control", index: 49 }));
    }

    #[test]
    fn the_likeliest_future_is_the_first_of_equals() {
        let mut prediction = prediction(&[0.2, 0.4, 0.4]);
        prediction.futures[1].trajectories.clear();
        let checked = prediction.check(0).unwrap();
        assert_eq!(checked.most_likely(), Some(&checked.futures()[1]));
        assert_eq!(UncheckedPrediction::default().check(0).unwrap().most_likely(), None);
    }

    #[test]
    fn probabilities_must_be_a_distribution_to_within_a_networks_rounding() {
        assert!(prediction(&[0.3, 0.700_5]).check(0).is_ok());
        for wrong in [&[0.3, 0.6][..], &[1.5, -0.5], &[f64::NAN, 1.0]] {
            assert!(matches!(prediction(wrong).check(0), Err(AnswerError::Probabilities { .. })), "{wrong:?}");
        }
    }

    #[test]
    fn a_future_may_say_what_the_av_does_in_it_or_not() {
        let mut one_of_two = prediction(&[0.5, 0.5]);
        one_of_two.futures[0].controls.clear();
        let checked = one_of_two.clone().check(0).unwrap();
        assert_eq!(checked.into_unchecked(), one_of_two);
    }

    #[test]
    fn a_prediction_that_is_not_whole_is_refused() {
        assert_eq!(prediction(&[1.0]).check(1), Err(AnswerError::WrongStep { expected: 1, got: 0 }));
        let mut short = prediction(&[1.0]);
        short.futures[0].trajectories[0].poses.pop();
        assert_eq!(short.check(0), Err(AnswerError::WrongLength { what: "poses", expected: PLAN_STEPS, got: 49 }));
        let mut bad = prediction(&[1.0]);
        bad.futures[0].trajectories[0].poses[5].heading = f64::NAN;
        assert_eq!(bad.check(0), Err(AnswerError::OutOfRange { what: "pose", index: 5 }));
        let mut short = prediction(&[0.5, 0.5]);
        short.futures[1].controls.pop();
        let expected = AnswerError::WrongLength { what: "controls of a future", expected: PLAN_STEPS, got: 49 };
        assert_eq!(short.check(0), Err(expected));
        let mut bad = prediction(&[0.5, 0.5]);
        bad.futures[1].controls[7].steering = f64::NEG_INFINITY;
        assert_eq!(bad.check(0), Err(AnswerError::OutOfRange { what: "a future's control", index: 7 }));
        let short = UncheckedPrediction { initial_controls: vec![Control::default()], ..prediction(&[1.0]) };
        let expected = AnswerError::WrongLength { what: "initial controls", expected: PLAN_STEPS, got: 1 };
        assert_eq!(short.check(0), Err(expected));
        let wild = Control { acceleration: f64::NAN, steering: 0.0 };
        let bad = UncheckedPrediction { initial_controls: vec![wild; PLAN_STEPS], ..prediction(&[1.0]) };
        assert_eq!(bad.check(0), Err(AnswerError::OutOfRange { what: "initial control", index: 0 }));
        let bad = UncheckedPrediction { cost_weights: vec![1.0, f64::INFINITY], ..prediction(&[1.0]) };
        assert_eq!(bad.check(0), Err(AnswerError::OutOfRange { what: "cost weight", index: 1 }));
    }
}
