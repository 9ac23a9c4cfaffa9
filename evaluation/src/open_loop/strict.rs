//! The mended definitions (`docs/open-loop.md`): the plan is played out before the judges of the protocol `strict`; what is missing in
//! the log counts nowhere.

use std::collections::BTreeMap;

use episode::metrics::Counted;
use episode::metrics::paper::{Comfort, comfort};
use episode::{Episode, Outcome};
use wire::proto::event::Kind;
use world::geometry::{Pose, angle_difference};
use world::observation::{Observation, ObservedAgent};
use world::plan::{PLAN_STEPS, Plan, PlanState, Prediction, STEP_SECONDS};
use world::scene::{AgentState, Scene};

use super::row::{Figures, PredictionFigures};
use super::{Judged, pose_of};

/// Places of 1, 3 and 5 s in a plan.
const ERRORS_AT: [usize; 3] = [9, 29, 49];

/// Predictions are judged on the nearest agents that are logged at the frame: as many as the paper's network predicts, so that all
/// predictors are asked for the same.
const PREDICTED: usize = 10;

/// What a plan and a prediction at `frame` are worth; `episode` is at its first step there.
pub(super) fn judge(
    scene: &Scene,
    episode: &Episode,
    frame: usize,
    observation: &Observation,
    plan: &Plan,
    prediction: Option<&Prediction>,
) -> Judged {
    let start = observation.av.pose();
    let human = human_states(episode, frame);
    let logged = |at: usize| scene.av().states.get(frame + 1 + at).copied().flatten();
    Judged {
        plan: Figures { comfort: felt(start, plan.states()), ..told(&episode.clone().play_out(plan.states())) },
        human: human.as_deref().map_or_else(Figures::default, |states| Figures {
            comfort: felt(start, states),
            ..told_of_human(&episode.clone().play_out(states))
        }),
        position_errors: ERRORS_AT.map(|at| {
            let planned = pose_of(&plan.states()[at]).position();
            Some(logged(at)?.position().distance(planned))
        }),
        prediction: prediction.and_then(|prediction| errors(scene, frame, observation, prediction)),
    }
}

/// The logged AV over the five seconds, short gaps filled in; `None` where it is not there all the time.
fn human_states(episode: &Episode, frame: usize) -> Option<Vec<PlanState>> {
    let states = episode.judged_scene().av().states.get(frame + 1..=frame + PLAN_STEPS)?;
    let state = |state: &Option<AgentState>| {
        let state = state.as_ref()?;
        Some(PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() })
    };
    states.iter().map(state).collect()
}

/// How five seconds from `start` on feel. Unlike the authors' figure it sees how the plan sets out; and the lateral acceleration is
/// that of driving round a bend, speed times yaw rate: theirs is zero for every plan of a motion model.
fn felt(start: Pose, states: &[PlanState]) -> Comfort {
    let poses: Vec<Pose> = std::iter::once(start).chain(states.iter().map(pose_of)).collect();
    let across = poses.windows(2).map(|pair| {
        let speed = pair[0].position().distance(pair[1].position()) / STEP_SECONDS;
        (speed * angle_difference(pair[0].heading, pair[1].heading) / STEP_SECONDS).abs()
    });
    let lateral_acceleration = Some(across.sum::<f64>() / (poses.len() - 1) as f64);
    Comfort { lateral_acceleration, ..comfort(&poses, Counted::ALL) }
}

/// What the judges count.
fn told(outcome: &Outcome) -> Figures {
    let metrics: BTreeMap<&str, Option<f64>> =
        outcome.end.metrics.iter().map(|metric| (metric.name.as_str(), metric.value)).collect();
    let flag = |name: &str| metrics.get(name).copied().flatten().map(|value| value > 0.0);
    Figures {
        collision: flag("collision"),
        at_fault_collision: flag("at_fault_collision"),
        red_light: flag("red_light"),
        off_route: flag("off_route"),
        off_road: flag("off_road"),
        wrong_way: flag("wrong_way"),
        speeding: flag("speeding"),
        comfort: Comfort::default(),
    }
}

/// What the judges see the logged AV do, also what they count nobody because of that.
fn told_of_human(outcome: &Outcome) -> Figures {
    let counted = told(outcome);
    let seen = |kind: Kind| outcome.events.iter().any(|event| event.kind() == kind);
    let at_fault = outcome.events.iter().any(|event| event.kind() == Kind::Collision && event.at_fault);
    // What cannot be judged in this scene stays so.
    Figures {
        collision: counted.collision.map(|_| seen(Kind::Collision)),
        at_fault_collision: counted.at_fault_collision.map(|_| at_fault),
        red_light: counted.red_light.map(|_| seen(Kind::RedLight)),
        off_route: counted.off_route.map(|_| seen(Kind::OffRoute)),
        off_road: counted.off_road.map(|_| seen(Kind::OffRoad)),
        wrong_way: counted.wrong_way.map(|_| seen(Kind::WrongWay)),
        speeding: counted.speeding.map(|_| seen(Kind::Speeding)),
        comfort: Comfort::default(),
    }
}

/// Sums of one future over the agents.
#[derive(Clone, Copy, Default)]
struct Errors {
    agents: u32,
    average: f64,
    last_agents: u32,
    last: f64,
}

/// How far off the futures are from what the log says of the agents nearest to the AV.
fn errors(
    scene: &Scene,
    frame: usize,
    observation: &Observation,
    prediction: &Prediction,
) -> Option<PredictionFigures> {
    let av = observation.av.position();
    let mut agents: Vec<&ObservedAgent> = observation.agents.iter().filter(|agent| agent.unseen == 0).collect();
    let distance = |agent: &ObservedAgent| agent.state.position().distance_squared(av);
    agents.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    agents.truncate(PREDICTED);
    let likeliest = prediction.most_likely()?;
    let of = |future: &world::plan::Future| {
        let mut sums = Errors::default();
        for agent in &agents {
            let track = scene.tracks().iter().find(|track| track.id == agent.track);
            let trajectory = future.trajectories.iter().find(|trajectory| trajectory.track == agent.track);
            let (Some(track), Some(trajectory)) = (track, trajectory) else { continue };
            let error = |k: usize| {
                let state = track.states.get(frame + 1 + k)?.as_ref()?;
                Some(state.position().distance(trajectory.poses[k].position()))
            };
            let valid: Vec<f64> = (0..PLAN_STEPS).filter_map(error).collect();
            if valid.is_empty() {
                continue;
            }
            sums.agents += 1;
            sums.average += valid.iter().sum::<f64>() / valid.len() as f64;
            if let Some(last) = error(PLAN_STEPS - 1) {
                sums.last_agents += 1;
                sums.last += last;
            }
        }
        sums
    };
    let likely = of(likeliest);
    if likely.agents == 0 {
        return None;
    }
    let mean = |sum: f64, count: u32| (count > 0).then(|| sum / f64::from(count));
    // A future is one of all agents: the best is the one that is best for all together.
    let all: Vec<Errors> = prediction.futures().iter().map(of).collect();
    let least = |values: &mut dyn Iterator<Item = Option<f64>>| values.flatten().reduce(f64::min);
    Some(PredictionFigures {
        agents: likely.agents,
        average: likely.average / f64::from(likely.agents),
        last_agents: likely.last_agents,
        last: mean(likely.last, likely.last_agents),
        best_average: least(&mut all.iter().map(|sums| mean(sums.average, sums.agents))),
        best_last: least(&mut all.iter().map(|sums| mean(sums.last, sums.last_agents))),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::sync::Arc;

    use scenarios::generated::{Family, Parameters};
    use world::plan::{Future, PredictedTrajectory, UncheckedPlan, UncheckedPrediction};

    use super::super::{Definitions, Moment, frames};
    use super::*;

    const FRAME: usize = 60;

    /// A scene of the generator whose log loses sight of agents, and its moment.
    fn moment() -> (Arc<Scene>, Moment) {
        let payload = Family::named("red-light").unwrap().payload("s", 3, 0, &Parameters::default()).unwrap();
        let scene = Arc::new(scenarios::womd::read(&payload).unwrap().0);
        assert!(frames(scene.steps()).any(|frame| frame as usize == FRAME));
        let moment = Moment::new(&scene, Definitions::Strict, FRAME as u32).unwrap();
        (scene, moment)
    }

    /// The logged drive as a plan.
    fn human(scene: &Scene) -> Plan {
        let state = |k: usize| {
            let state = scene.av().states[FRAME + 1 + k].unwrap();
            PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() }
        };
        UncheckedPlan { states: (0..PLAN_STEPS).map(state).collect(), ..UncheckedPlan::default() }.check(0).unwrap()
    }

    /// Where everybody will be, less so many metres in each future; somewhere else where the log does not say.
    fn off_by(scene: &Scene, moment: &Moment, metres: &[f64]) -> Prediction {
        let trajectory = |agent: &ObservedAgent, aside: f64| {
            let states = &scene.tracks().iter().find(|track| track.id == agent.track).unwrap().states;
            let pose = |k: usize| {
                let state = states.get(FRAME + 1 + k).copied().flatten();
                state.map_or(Pose::new(1e4, 1e4, 0.0), |state| Pose::new(state.x + aside, state.y, 0.0))
            };
            PredictedTrajectory { track: agent.track, poses: (0..PLAN_STEPS).map(pose).collect() }
        };
        let agents = moment.observation().agents;
        let future = |aside: &f64| Future {
            probability: 1.0 / metres.len() as f64,
            trajectories: agents.iter().map(|agent| trajectory(agent, *aside)).collect(),
            controls: vec![],
        };
        let futures = metres.iter().map(future).collect();
        UncheckedPrediction { futures, ..UncheckedPrediction::default() }.check(0).unwrap()
    }

    #[test]
    fn the_logged_drive_as_a_plan_is_without_fault_or_error_and_felt_as_the_human_s() {
        let (scene, moment) = moment();
        let row = moment.judge(&human(&scene), None);
        let faults = [row.plan.collision, row.plan.red_light, row.plan.off_route, row.plan.off_road];
        assert_eq!((faults, row.position_errors), ([Some(false); 4], [Some(0.0); 3]));
        assert_eq!(row.plan.comfort, row.human.comfort);
        assert_eq!((row.prediction, row.mode), (None, None));
    }

    #[test]
    fn predictions_are_judged_where_the_log_says_something_and_nowhere_else() {
        let (scene, moment) = moment();
        let row = moment.judge(&human(&scene), Some(&off_by(&scene, &moment, &[1.0, 0.25, 3.0])));
        let found = row.prediction.unwrap();
        let near = |value: Option<f64>, expected: f64| (value.unwrap() - expected).abs() < 1e-9;
        assert!(near(Some(found.average), 1.0) && near(found.last, 1.0), "{found:?}");
        assert!(near(found.best_average, 0.25) && near(found.best_last, 0.25), "{found:?}");
        assert!(found.agents > 0 && found.last_agents <= found.agents && found.agents <= PREDICTED as u32);
        assert_eq!(row.mode, Some(0));
    }

    #[test]
    fn who_is_not_predicted_is_in_no_mean() {
        let (scene, moment) = moment();
        let mut prediction = off_by(&scene, &moment, &[1.0]).into_unchecked();
        let all = moment.judge(&human(&scene), Some(&prediction.clone().check(0).unwrap())).prediction.unwrap();
        let av = moment.observation().av.position();
        let mut agents = moment.observation().agents;
        agents.sort_by(|a, b| a.state.position().distance(av).total_cmp(&b.state.position().distance(av)));
        prediction.futures[0].trajectories.retain(|trajectory| trajectory.track != agents[0].track);
        let fewer = moment.judge(&human(&scene), Some(&prediction.check(0).unwrap())).prediction.unwrap();
        assert_eq!(fewer.agents + 1, all.agents);
    }

    #[test]
    fn going_round_a_bend_is_felt() {
        // 10 m/s on a circle of 20 m: 5 m/s^2 across, where the authors' figure is 0.
        let state = |k: usize| {
            let angle = 0.05 * k as f64;
            PlanState { x: 20.0 * libm::sin(angle), y: 20.0 * (1.0 - libm::cos(angle)), heading: angle, speed: 10.0 }
        };
        let comfort = felt(Pose::default(), &(1..=PLAN_STEPS).map(state).collect::<Vec<_>>());
        assert!((comfort.lateral_acceleration.unwrap() - 5.0).abs() < 1e-3, "{comfort:?}");
        assert!(comfort.acceleration.unwrap() < 1e-9);
    }
}
