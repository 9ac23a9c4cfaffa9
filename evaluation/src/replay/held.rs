//! A second recording of an episode held to the first, and which process made the first difference.
//!
//! Messages are compared in the order in which they follow from each other: scene; at each step observation, moves, prediction, plan, record,
//! events; end. All that a process had heard was the same until then, so the first that differs is of the process to blame.
//!
//! Left out is what may differ between two drives that are the same: a plan's `status`, which is free text and may tell a time; the end's
//! counts of messages and its digest, which also tells of the status. What is only there for pictures (`logged_av`, `other`) is no part
//! of what is read. A recording of before futures told the AV's controls holds none, and then those of now are passed over.

use std::borrow::Cow;
use std::fmt;

use wire::proto::{self, EndReason};

use super::difference::{self, Difference};
use super::recorded::{Recorded, of_the_drive};

/// Who says a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// Scene, observations, records, events, end.
    Simulator,
    /// Predictions.
    Predictor,
    /// Plans.
    Planner,
    /// Where agents are that react.
    Traffic,
}

/// The first message that is another one now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parting {
    /// Where.
    pub difference: Difference,
    /// Whose it is.
    pub process: Process,
}

impl fmt::Display for Parting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let blame = match self.process {
            Process::Simulator => "the simulator is to blame: all that it was told before is the same",
            Process::Predictor => "the predictor is to blame: scene and observations are the same up to there",
            Process::Traffic => "the traffic is to blame: scene and observations are the same up to there",
            Process::Planner => "the planner is to blame: scene, observations and predictions are the same up to there",
        };
        write!(f, "{}; {blame}", self.difference)
    }
}

/// How many steps are the same in both; all of them.
///
/// # Errors
/// [`Parting`], the first difference.
pub fn hold(then: &Recorded, now: &Recorded) -> Result<u32, Parting> {
    let simulator = |difference| Parting { difference, process: Process::Simulator };
    difference::at(None, "scene", Some(&then.scene), Some(&now.scene)).map_err(simulator)?;
    let steps = then.observations.len().max(now.observations.len());
    for index in 0..steps {
        step(then, now, index)?;
    }
    let after =
        |recorded: &Recorded| recorded.events.iter().filter(|event| event.step as usize >= steps).cloned().collect();
    events(None, after(then), after(now)).map_err(simulator)?;
    let (end, end_now) = (of_the_drive(&then.end), of_the_drive(&now.end));
    let failed = |end: &proto::EpisodeEnd| end.reason() == EndReason::DriverFailed;
    difference::at(None, "end", Some(&end), Some(&end_now)).map_err(|difference| {
        // Then it is about nodes: how one of them died, or what it said after the last step.
        let of_nodes = failed(&end) || failed(&end_now);
        let detail = if failed(&end_now) { &end_now.detail } else { &end.detail };
        let process = match (of_nodes, detail) {
            (false, _) => Process::Simulator,
            (true, detail) if detail.contains("predictor") => Process::Predictor,
            (true, detail) if detail.contains("the traffic") => Process::Traffic,
            (true, _) => Process::Planner,
        };
        Parting { difference, process }
    })?;
    Ok(now.steps())
}

fn step(then: &Recorded, now: &Recorded, index: usize) -> Result<(), Parting> {
    let step = Some(index as u32);
    let by = |process| move |difference| Parting { difference, process };
    let (observation, observation_now) = (then.observations.get(index), now.observations.get(index));
    difference::at(step, "observation", observation, observation_now).map_err(by(Process::Simulator))?;
    difference::at(step, "moves", then.moves.get(index), now.moves.get(index))
        .map_err(|difference| by(Process::Traffic)(with_reason(difference, then, now)))?;
    let prediction = then.predictions.get(index);
    let prediction_now = now.predictions.get(index).map(|now| in_the_words_of(prediction, now));
    difference::at(step, "prediction", prediction, prediction_now.as_deref())
        .map_err(|difference| by(Process::Predictor)(with_reason(difference, then, now)))?;
    let plan = |recorded: &Recorded| recorded.plans.get(index).map(repeatable);
    difference::at(step, "plan", plan(then).as_ref(), plan(now).as_ref())
        .map_err(|difference| by(Process::Planner)(with_reason(difference, then, now)))?;
    let (record, record_now) = (then.records.get(index), now.records.get(index));
    difference::at(step, "record", record, record_now).map_err(by(Process::Simulator))?;
    let at =
        |recorded: &Recorded| recorded.events.iter().filter(|event| event.step as usize == index).cloned().collect();
    events(step, at(then), at(now)).map_err(by(Process::Simulator))
}

/// A prediction without the AV's controls, where the recorded one has none in any future.
fn in_the_words_of<'a>(recorded: Option<&proto::Prediction>, now: &'a proto::Prediction) -> Cow<'a, proto::Prediction> {
    let has_controls = |said: &proto::Prediction| said.futures.iter().any(|future| !future.controls.is_empty());
    if recorded.is_none_or(has_controls) || !has_controls(now) {
        return Cow::Borrowed(now);
    }
    let mut now = now.clone();
    now.futures.iter_mut().for_each(|future| future.controls.clear());
    Cow::Owned(now)
}

/// A plan without what may tell a time.
fn repeatable(plan: &proto::Plan) -> proto::Plan {
    proto::Plan { status: String::new(), ..plan.clone() }
}

/// Where nothing was answered, the end says why.
fn with_reason(difference: Difference, then: &Recorded, now: &Recorded) -> Difference {
    let told = |said: String, recorded: &Recorded| {
        let detail = &recorded.end.detail;
        if said == "nothing" && !detail.is_empty() { format!("nothing ({detail})") } else { said }
    };
    Difference { recorded: told(difference.recorded, then), now: told(difference.now, now), ..difference }
}

/// Those of one step; recordings keep them in the order of their bytes.
fn events(step: Option<u32>, then: Vec<proto::Event>, now: Vec<proto::Event>) -> Result<(), Difference> {
    (0..then.len().max(now.len())).try_for_each(|index| difference::at(step, "event", then.get(index), now.get(index)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded() -> Recorded {
        let steps = 0..3_u32;
        Recorded {
            scene: proto::Scene { scene: "a".to_owned(), ..Default::default() },
            observations: steps.clone().map(|step| proto::Observation { step, ..Default::default() }).collect(),
            predictions: steps.clone().map(|step| proto::Prediction { step, ..Default::default() }).collect(),
            plans: steps
                .clone()
                .map(|step| proto::Plan { step, states: vec![proto::PlanState::default(); 50], ..Default::default() })
                .collect(),
            moves: Vec::new(),
            records: steps.map(|step| proto::StepRecord { step, ..Default::default() }).collect(),
            events: vec![proto::Event { step: 1, text: "bump".to_owned(), ..Default::default() }],
            end: proto::EpisodeEnd { reason: EndReason::Horizon.into(), steps: 3, ..Default::default() },
        }
    }

    fn parting(change: impl FnOnce(&mut Recorded)) -> Parting {
        let mut now = recorded();
        change(&mut now);
        hold(&recorded(), &now).unwrap_err()
    }

    #[test]
    fn the_same_is_the_same_also_if_it_took_another_time() {
        let mut now = recorded();
        now.plans[1].status = "solved in 3 ms".to_owned();
        now.end.plans = 7;
        now.end.digest = vec![1, 2, 3];
        assert_eq!(hold(&recorded(), &now), Ok(3));
    }

    #[test]
    fn controls_in_futures_count_where_the_recording_has_them() {
        let with = |controls: usize| {
            let mut recorded = recorded();
            let controls = vec![proto::Control { acceleration: 1.0, steering: 0.0 }; controls];
            recorded.predictions[1].futures = vec![proto::Future { controls, ..Default::default() }; 2];
            recorded
        };
        assert_eq!(hold(&with(0), &with(50)), Ok(3));
        assert_eq!(hold(&with(50), &with(50)), Ok(3));
        assert_eq!(hold(&with(50), &with(0)).unwrap_err().process, Process::Predictor);
        let mut other = with(50);
        other.predictions[1].futures[1].controls[7].steering = 0.5;
        let found = hold(&with(50), &other).unwrap_err();
        assert_eq!((found.process, &*found.difference.field), (Process::Predictor, "futures[1].controls[7].steering"));
        let mut other = with(50);
        other.predictions[1].futures[1].probability = 0.5;
        assert_eq!(hold(&with(0), &other).unwrap_err().difference.field, "futures[1].probability");
    }

    #[test]
    fn the_first_difference_names_the_process_that_made_it() {
        let found = parting(|now| now.observations[1].log_index = 9);
        assert_eq!((found.process, found.difference.step), (Process::Simulator, Some(1)));
        let found = parting(|now| now.predictions[2].cost_weights.push(1.0));
        assert_eq!((found.process, found.difference.step), (Process::Predictor, Some(2)));
        let found = parting(|now| {
            now.plans[1].states[7].x = 0.5;
            now.records[1].yaw_rate = 1.0;
            now.observations[2].log_index = 7;
        });
        assert_eq!(found.process, Process::Planner);
        assert_eq!(
            found.to_string(),
            "step 1, plan.states[7].x: 0.0 in the recording, 0.5 now; the planner is to blame: scene, observations and predictions are \
             the same up to there"
        );
        let found = parting(|now| now.records[0].yaw_rate = 1.0);
        assert_eq!((found.process, found.difference.message), (Process::Simulator, "record"));
        let found = parting(|now| now.events[0].text.clear());
        assert_eq!((found.process, found.difference.step), (Process::Simulator, Some(1)));
        let found = parting(|now| now.end.steps = 2);
        assert_eq!((found.process, found.difference.message), (Process::Simulator, "end"));
    }

    #[test]
    fn who_does_not_answer_any_more_is_named_with_the_reason() {
        let found = parting(|now| {
            now.plans.truncate(2);
            now.records.truncate(2);
            now.end.set_reason(EndReason::DriverFailed);
            now.end.detail = "step 2: the planner is gone".to_owned();
        });
        assert_eq!(found.process, Process::Planner);
        assert_eq!(found.difference.now, "nothing (step 2: the planner is gone)");
        let found = parting(|now| {
            now.end.set_reason(EndReason::DriverFailed);
            now.end.detail = "after the last step: more than one answer of the predictor".to_owned();
        });
        assert_eq!(found.process, Process::Predictor);
    }
}
