//! One episode whose planner, predictor and traffic are in this process: asked as nodes are, through the same messages and the same checks, but
//! neither bytes nor a bus lie between. What they say is what nodes would have said, and whoever listens in hears the same.

use std::sync::Arc;
use std::time::Duration;

use prost::Message as _;
use world::observation::{Briefing, Observation};
use world::plan::{Plan, UncheckedPlan, UncheckedPrediction};
use world::traffic::{Taken, UncheckedMoves};
use zenoh::bytes::ZBytes;

use super::bus_line::EpisodeLine;
use super::line::{Answers, Line, counted};
use super::line_error::LineError;
use crate::convert::{self, KnownWays, MessageError};
use crate::keys::{Channel, Role};
use crate::node::desk::guarded;
use crate::node::{
    History, Planner, PlannerFactory, Predictor, PredictorFactory, StepInput, Traffic, TrafficFactory, bounded,
};
use crate::proto;

/// Who drives in this process. They may be asked for episodes by several threads at once.
#[derive(Clone)]
pub struct Minds {
    /// Makes the planner of each episode.
    pub planner: Arc<dyn PlannerFactory>,
    /// Makes its predictor, if the driver has one.
    pub predictor: Option<Arc<dyn PredictorFactory>>,
    /// Makes who drives the agents that react, if any do.
    pub traffic: Option<Arc<dyn TrafficFactory>>,
}

/// The line of an episode that is driven by minds of this process. No deadline holds for them: who waits is who thinks.
pub struct HereLine {
    minds: Minds,
    /// None before the scene is announced.
    episode: Option<Episode>,
    /// To whoever listens in, if there is a bus.
    tape: Option<EpisodeLine>,
    counts: proto::Recorded,
}

/// What is known of the episode, and who thinks about it; or why nobody does.
struct Episode {
    briefing: Briefing,
    history: History,
    planner: Result<Box<dyn Planner>, String>,
    predictor: Option<Result<Box<dyn Predictor>, String>>,
    traffic: Option<Result<Box<dyn Traffic>, String>>,
    /// Where agents go that are taken over.
    ways: KnownWays,
    /// What traffic has seen, and the others not yet.
    seen: Option<Observation>,
}

impl HereLine {
    /// A line to these. `tape` is one without nodes, see [`super::Hub::tape`].
    #[must_use]
    pub fn new(minds: &Minds, tape: Option<EpisodeLine>) -> Self {
        Self { minds: minds.clone(), episode: None, tape, counts: proto::Recorded::default() }
    }

    fn ask(&mut self, observation: &Observation, driven: Option<&Plan>) -> Result<Answers, LineError> {
        let mut told = Vec::new();
        let answers = self.exchange(observation, &mut told);
        if let Some(tape) = &mut self.tape {
            tape.tell_step(told, driven);
        }
        answers
    }

    /// Asks for the answers to an observation. All that is said goes into `told`, where there is a tape.
    fn exchange(&mut self, observation: &Observation, told: &mut Vec<(Channel, ZBytes)>) -> Result<Answers, LineError> {
        let step = observation.step;
        let has_tape = self.tape.is_some();
        let nobody = || LineError::NodeLost { role: Role::Planner };
        let Episode { briefing, history, planner, predictor, seen, .. } = self.episode.as_mut().ok_or_else(nobody)?;
        let message = proto::Observation::from(observation);
        self.counts.observations += 1;
        if has_tape {
            told.push((Channel::Observation, message.encode_to_vec().into()));
        }
        let seen = match seen.take().filter(|seen| seen.step == step) {
            Some(seen) => seen,
            None => arrived(message, briefing, history).map_err(LineError::bad(Role::Planner))?,
        };
        let input = StepInput { briefing, observation: &seen, history, prediction: None };

        let mut predicted = None;
        if let Some(predictor) = predictor {
            let said = asked(predictor, |predictor| {
                predictor.predict(&input).and_then(|said| bounded(proto::Prediction::from(&said)))
            });
            let message = said.unwrap_or_else(|error| proto::Prediction { step, error, ..Default::default() });
            self.counts.predictions += 1;
            if has_tape {
                told.push((Channel::Prediction, message.encode_to_vec().into()));
            }
            predicted = Some(UncheckedPrediction::try_from(message).map_err(LineError::bad(Role::Predictor))?);
        }
        // What is no prediction is none to a planner; what is wrong with it is for the caller to say.
        let prediction = predicted.clone().and_then(|prediction| prediction.check(step).ok());
        let input = StepInput { prediction: prediction.as_ref(), ..input };
        let said = asked(planner, |planner| planner.plan(&input).and_then(|said| bounded(proto::Plan::from(&said))));
        let message = said.unwrap_or_else(|error| proto::Plan { step, error, ..Default::default() });
        self.counts.plans += 1;
        if has_tape {
            told.push((Channel::Plan, message.encode_to_vec().into()));
        }
        let plan = UncheckedPlan::try_from(message).map_err(LineError::bad(Role::Planner))?;
        Ok((plan, predicted))
    }
}

/// An observation as it arrives elsewhere.
fn arrived(
    message: proto::Observation,
    briefing: &Briefing,
    history: &mut History,
) -> Result<Observation, MessageError> {
    let seen = convert::observation(message, &briefing.reference_line)?;
    history.push(&seen);
    Ok(seen)
}

/// What `mind` says. Who failed once is not asked again: what it was in the middle of is unknown.
fn asked<M, T>(mind: &mut Result<M, String>, ask: impl FnOnce(&mut M) -> Result<T, String>) -> Result<T, String> {
    let said = match mind {
        Ok(mind) => guarded(|| ask(mind)),
        Err(error) => return Err(error.clone()),
    };
    if let Err(error) = &said {
        *mind = Err(error.clone());
    }
    said
}

impl Line for HereLine {
    fn announce(&mut self, briefing: &Briefing) -> Result<(), LineError> {
        if let Some(tape) = &mut self.tape {
            tape.announce(briefing)?;
        }
        // As it arrives elsewhere.
        let arrived = Briefing::try_from(proto::Scene::from(briefing));
        let briefing = arrived.map_err(|error: MessageError| LineError::BadAnswer { role: Role::Planner, error })?;
        let Minds { planner, predictor, traffic } = &self.minds;
        self.episode = Some(Episode {
            history: History::new(&briefing),
            planner: guarded(|| planner.start(&briefing)),
            predictor: predictor.as_ref().map(|predictor| guarded(|| predictor.start(&briefing))),
            traffic: traffic.as_ref().map(|traffic| guarded(|| traffic.start(&briefing))),
            ways: KnownWays::default(),
            seen: None,
            briefing,
        });
        Ok(())
    }

    fn step(&mut self, observation: &Observation, _: Duration) -> Result<Answers, LineError> {
        self.ask(observation, None)
    }

    fn led_step(&mut self, observation: &Observation, driven: &Plan, _: Duration) -> Result<Answers, LineError> {
        self.ask(observation, Some(driven))
    }

    fn moves(&mut self, observation: &Observation, taken: &[Taken], _: Duration) -> Result<UncheckedMoves, LineError> {
        let (role, step) = (Role::Traffic, observation.step);
        let nobody = || LineError::NodeLost { role };
        let Episode { briefing, history, traffic, ways, seen, .. } = self.episode.as_mut().ok_or_else(nobody)?;
        let traffic = traffic.as_mut().ok_or_else(nobody)?;
        let now = arrived(observation.into(), briefing, history).map_err(LineError::bad(role))?;
        let taken = ways.taken(convert::taken_agents(step, taken)).map_err(LineError::bad(role))?;
        let input = StepInput { briefing, observation: &now, history, prediction: None };
        let said = asked(traffic, |traffic| {
            traffic.moves(&input, &taken).and_then(|said| bounded(proto::TrafficMoves::from(&said)))
        });
        *seen = Some(now);
        let message = said.unwrap_or_else(|error| proto::TrafficMoves { step, error, ..Default::default() });
        self.counts.moves += 1;
        if let Some(tape) = &mut self.tape {
            tape.tell_step(vec![(Channel::Moves, message.encode_to_vec().into())], None);
        }
        UncheckedMoves::try_from(message).map_err(LineError::bad(role))
    }

    fn dismiss(&mut self, _: &proto::EpisodeEnd, _: Duration) -> Result<(), LineError> {
        Ok(())
    }

    fn tell_end(&self, _: &proto::EpisodeEnd) -> Result<(), LineError> {
        Ok(())
    }

    fn publish_record(&mut self, record: &proto::StepRecord) {
        self.counts.records += 1;
        self.tape.iter_mut().for_each(|tape| tape.publish_record(record));
    }

    fn publish_event(&mut self, event: &proto::Event) {
        self.counts.events += 1;
        self.tape.iter_mut().for_each(|tape| tape.publish_event(event));
    }

    fn publish_end(&mut self, end: proto::EpisodeEnd) -> proto::EpisodeEnd {
        match &mut self.tape {
            Some(tape) => tape.publish_end(end),
            None => counted(end, &self.counts),
        }
    }

    fn await_recorded(&mut self, deadline: Duration) -> Result<(), LineError> {
        self.tape.as_mut().map_or(Ok(()), |tape| tape.await_recorded(deadline))
    }
}
