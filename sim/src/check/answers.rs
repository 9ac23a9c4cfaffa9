//! What a node answered, seen through, and compared.

use std::time::Duration;

use wire::keys::Role;
use world::observation::Observation;
use world::plan::{Plan, Prediction};
use world::traffic::Moves;

use super::rule::{Finding, Rule};

/// A step (s): a node that needs longer does not keep up with the world.
const STEP: Duration = Duration::from_millis(100);

/// How far from where something is its next place may begin, beyond what its speed takes it (m).
const NEAR: f64 = 1.0;

/// From here on it is another place (m).
const FAR: f64 = 5.0;

/// A whole answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Of a planner.
    Plan(Plan),
    /// Of a predictor.
    Prediction(Prediction),
    /// Of traffic.
    Moves(Moves),
}

impl Answer {
    /// Its numbers in order: of each state x, y, heading, speed, then the controls; or of each future its probability, and of each
    /// trajectory the track and x, y, heading of each pose; or of each agent the track and x, y, z, heading and velocity. Not those of
    /// [`Answer::controls_in_futures`].
    #[must_use]
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Plan(plan) => {
                let states = plan.states().iter().flat_map(|s| [s.x, s.y, s.heading, s.speed]);
                let controls = plan.controls().unwrap_or_default().iter().flat_map(|c| [c.acceleration, c.steering]);
                states.chain(controls).collect()
            }
            Self::Prediction(prediction) => {
                let mut numbers = Vec::new();
                for future in prediction.futures() {
                    numbers.push(future.probability);
                    for trajectory in &future.trajectories {
                        numbers.push(f64::from(trajectory.track.0));
                        numbers.extend(trajectory.poses.iter().flat_map(|pose| [pose.x, pose.y, pose.heading]));
                    }
                }
                numbers.extend(
                    prediction.initial_controls().unwrap_or_default().iter().flat_map(|c| [c.acceleration, c.steering]),
                );
                numbers.extend(prediction.cost_weights().unwrap_or_default());
                numbers
            }
            Self::Moves(moves) => {
                let moves = moves.moves().iter().map(|moved| (f64::from(moved.track.0), moved.state));
                moves.flat_map(|(track, s)| [track, s.x, s.y, s.z, s.heading, s.velocity_x, s.velocity_y]).collect()
            }
        }
    }

    /// What a predictor says of the AV: each control in each future. Apart from the other numbers, because files of answers that were
    /// written before futures had controls hold the others alone.
    #[must_use]
    pub fn controls_in_futures(&self) -> Vec<f64> {
        let Self::Prediction(prediction) = self else { return Vec::new() };
        let controls = prediction.futures().iter().flat_map(|future| &future.controls);
        controls.flat_map(|c| [c.acceleration, c.steering]).collect()
    }
}

/// The answers along a course, and how long each took.
#[derive(Clone, Debug, Default)]
pub struct Driven {
    /// An answer a step.
    pub answers: Vec<Answer>,
    /// The time between an observation and its answer.
    pub times: Vec<Duration>,
}

/// Where two rows of answers to one course part, as a sentence.
#[must_use]
pub fn difference(one: &[Answer], other: &[Answer]) -> Option<String> {
    if one.len() != other.len() {
        return Some(format!("{} answers, then {}", one.len(), other.len()));
    }
    let at = one.iter().zip(other).position(|(one, other)| one != other)?;
    let all = |answer: &Answer| [answer.numbers(), answer.controls_in_futures()].concat();
    let apart = one.get(at).zip(other.get(at)).and_then(|(one, other)| apart(&all(one), &all(other)));
    Some(match apart {
        Some(0.0) => format!("the answers part at step {at}, in what they say beside their numbers"),
        Some(most) => format!("the answers part at step {at}, by up to {most:.3e}"),
        None => format!("the answers part at step {at}: another number of things"),
    })
}

/// The largest difference of two rows of numbers; none where they are not equally many.
#[must_use]
pub fn apart(one: &[f64], other: &[f64]) -> Option<f64> {
    (one.len() == other.len()).then(|| one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
}

/// How long answers took.
#[must_use]
pub fn in_time(mut times: Vec<Duration>, deadline: Duration) -> Finding {
    times.sort_unstable();
    let at = |share: f64| {
        times.get(((times.len() as f64 - 1.0).max(0.0) * share).round() as usize).copied().unwrap_or_default()
    };
    let [median, late, last] = [0.5, 0.99, 1.0].map(at);
    let ms = |time: Duration| 1e3 * time.as_secs_f64();
    let seen = format!(
        "{} answers: median {:.1} ms, 99 % within {:.1} ms, the longest {:.1} ms, of {:.0} ms allowed",
        times.len(),
        ms(median),
        ms(late),
        ms(last),
        ms(deadline)
    );
    if late > STEP || 2 * last > deadline {
        Finding::doubtful(Rule::InTime, seen)
    } else {
        Finding::holds(Rule::InTime, seen)
    }
}

/// Whether answers begin where things are. `steps` are observations and their answers.
#[must_use]
pub fn in_place<'a>(role: Role, steps: impl Iterator<Item = (&'a Observation, &'a Answer)>) -> Finding {
    let (mut count, mut far, mut worst, mut unknown) = (0_usize, 0_usize, 0.0_f64, None);
    let mut look = |distance: f64| {
        count += 1;
        far += usize::from(distance > FAR);
        worst = worst.max(distance);
    };
    for (observation, answer) in steps {
        let beyond = |x: f64, y: f64, from: &world::scene::AgentState| {
            let (x, y) = (x - from.x, y - from.y);
            ((x * x + y * y).sqrt() - 0.1 * from.speed()).max(0.0)
        };
        match answer {
            Answer::Plan(plan) => {
                plan.states().first().into_iter().for_each(|first| look(beyond(first.x, first.y, &observation.av)));
            }
            Answer::Prediction(prediction) => {
                for trajectory in prediction.futures().iter().flat_map(|future| &future.trajectories) {
                    let agent = observation.agents.iter().find(|agent| agent.track == trajectory.track);
                    match (agent, trajectory.poses.first()) {
                        (Some(agent), Some(first)) => look(beyond(first.x, first.y, &agent.state)),
                        _ => unknown = unknown.or(Some((observation.step, trajectory.track.0))),
                    }
                }
            }
            // They have rules of their own.
            Answer::Moves(_) => {}
        }
    }
    let whose = if role == Role::Predictor { "trajectories" } else { "plans" };
    let who = if role == Role::Predictor { "the agent" } else { "the AV" };
    if let Some((step, track)) = unknown {
        return Finding::broken(
            Rule::InPlace,
            format!("at step {step} track {track} is predicted, and nobody observed it"),
        );
    }
    if 2 * far > count {
        let seen =
            format!("{far} of {count} {whose} begin over {FAR} m from where {who} can be, one of them {worst:.1} m");
        return Finding::broken(Rule::InPlace, seen);
    }
    let seen = format!("{count} {whose}, none begins over {worst:.2} m from where {who} can be");
    if worst > NEAR { Finding::doubtful(Rule::InPlace, seen) } else { Finding::holds(Rule::InPlace, seen) }
}

#[cfg(test)]
mod tests {
    use std::slice;

    use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan};

    use super::super::course::Course;
    use super::super::rule::Verdict;
    use super::*;

    fn moved(plan: &Plan, by: f64) -> Answer {
        let mut plan = plan.clone().into_unchecked();
        plan.states.iter_mut().for_each(|state| state.x += by);
        let step = plan.step;
        Answer::Plan(plan.check(step).unwrap())
    }

    #[test]
    fn plans_in_another_frame_are_found() {
        let course = &Course::built_in(Role::Planner).unwrap()[0];
        let verdict = |by: f64| {
            let answers: Vec<Answer> = course.steps.iter().map(|(_, plan)| moved(plan, by)).collect();
            in_place(Role::Planner, course.steps.iter().map(|(seen, _)| seen).zip(&answers)).verdict
        };
        assert_eq!([0.0, 3.0, 100.0].map(verdict), [Verdict::Holds, Verdict::Doubtful, Verdict::Broken]);
    }

    #[test]
    fn slow_answers_are_in_doubt() {
        let times = |ms: u64| vec![Duration::from_millis(ms); 200];
        let deadline = Duration::from_secs(5);
        assert_eq!(in_time(times(20), deadline).verdict, Verdict::Holds);
        assert_eq!(in_time(times(150), deadline).verdict, Verdict::Doubtful);
        let once: Vec<Duration> = times(1).into_iter().chain([Duration::from_secs(3)]).collect();
        assert_eq!(in_time(once, deadline).verdict, Verdict::Doubtful);
    }

    #[test]
    fn answers_are_compared_number_by_number() {
        let states = vec![PlanState::default(); PLAN_STEPS];
        let plan = UncheckedPlan { states, ..UncheckedPlan::default() }.check(0).unwrap();
        let (same, other) = (Answer::Plan(plan.clone()), moved(&plan, 0.5));
        assert_eq!(difference(slice::from_ref(&same), slice::from_ref(&same)), None);
        let [said] = [difference(&[same.clone(), same.clone()], &[same.clone(), other]).unwrap()];
        assert_eq!(said, "the answers part at step 1, by up to 5.000e-1");
        assert!(difference(&[same], &[]).is_some());
    }
}
