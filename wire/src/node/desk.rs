//! One worker's episodes as a node sees them, without IO: messages in, answers out.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use world::observation::{Briefing, Observation};
use world::plan::{Prediction, UncheckedPrediction};
use world::scene::SceneId;
use world::traffic::Taken;

use super::{History, StepInput};
use crate::convert::{self, KnownWays, MessageError, decode};
use crate::envelope::{Saying, Telling};
use crate::keys::{Channel, Role};
use crate::{WIRE_VERSION, proto};

/// What answers an episode's observations: a planner, a predictor, or traffic, which is told whom it drives. Its answer is already a message.
pub(super) type Mind = Box<dyn FnMut(&StepInput<'_>, &[Taken]) -> Result<Vec<u8>, String> + Send>;

/// What an answer waits for beside the observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needs {
    Nothing,
    Prediction,
    Taken,
}

/// What nodes of different roles do differently.
pub(super) trait Service: Send + Sync {
    fn role(&self) -> Role;
    fn needs(&self) -> Needs;
    fn start(&self, briefing: &Briefing) -> Result<Mind, String>;
    /// The message that says why there is no answer.
    fn refusal(&self, step: u32, error: String) -> Vec<u8>;
}

/// A worker drives its episodes one after the other, so a desk has one at a time.
pub(super) struct Desk {
    service: Arc<dyn Service>,
    episode: Option<Episode>,
}

struct Episode {
    /// Its number in this run.
    number: u64,
    /// None where the scene cannot be read.
    scene: Option<SceneId>,
    /// Or why it cannot be driven: then every observation is answered with that.
    mind: Result<(Briefing, History, Mind), String>,
    /// Whichever comes first waits for the other.
    observation: Option<Observation>,
    prediction: Option<Prediction>,
    /// Who is taken over at a step.
    taken: Option<(u32, Vec<Taken>)>,
    /// Where they go.
    ways: KnownWays,
}

impl Desk {
    pub(super) fn new(service: Arc<dyn Service>) -> Self {
        Self { service, episode: None }
    }

    /// The channel that the answers belong on.
    pub(super) fn channel(&self) -> Channel {
        match self.saying() {
            Saying::Prediction => Channel::Prediction,
            Saying::Moves => Channel::Moves,
            Saying::Plan | Saying::Done => Channel::Plan,
        }
    }

    /// Takes in what the simulator tells of episode `number`; gives the answer, where one is due.
    pub(super) fn take(&mut self, number: u64, telling: Telling, bytes: &[u8]) -> Option<(Saying, Vec<u8>)> {
        let is_on = self.episode.as_ref().is_some_and(|episode| episode.number == number);
        match telling {
            // The simulator tells it once: another is not its own.
            Telling::Scene if is_on => tracing::warn!("a second scene of episode {number} is not believed"),
            Telling::Scene => self.start(number, bytes),
            Telling::Observation => return self.observe(number, bytes),
            Telling::Prediction if is_on => return self.predicted(bytes),
            Telling::Taken if is_on => return self.taken(bytes),
            Telling::Prediction | Telling::Taken => {}
            Telling::End => {
                if is_on {
                    self.episode = None;
                }
                return Some((Saying::Done, Vec::new()));
            }
        }
        None
    }

    fn start(&mut self, number: u64, bytes: &[u8]) {
        let service = &self.service;
        let mut scene = None;
        let mind = briefing(bytes).and_then(|briefing| {
            scene = Some(briefing.scene.clone());
            let mind = guarded(|| service.start(&briefing))?;
            let history = History::new(&briefing);
            Ok((briefing, history, mind))
        });
        let episode = Episode {
            number,
            scene,
            mind,
            observation: None,
            prediction: None,
            taken: None,
            ways: KnownWays::default(),
        };
        if let Err(error) = &episode.mind {
            tracing::error!("{episode}: {error}");
        }
        self.episode = Some(episode);
    }

    fn observe(&mut self, number: u64, bytes: &[u8]) -> Option<(Saying, Vec<u8>)> {
        let unreadable = |e: MessageError| format!("the observation cannot be read: {e}");
        let message = match decode::<proto::Observation>(bytes) {
            Ok(message) => message,
            Err(e) => return Some(self.refuse(0, unreadable(e))),
        };
        let step = message.step;
        let Some(episode) = self.episode.as_mut().filter(|episode| episode.number == number) else {
            return Some(self.refuse(step, "its scene never came".to_owned()));
        };
        let (briefing, history, _) = match &mut episode.mind {
            Ok(mind) => mind,
            Err(error) => {
                let error = error.clone();
                return Some(self.refuse(step, error));
            }
        };
        match convert::observation(message, &briefing.reference_line) {
            Ok(observation) => {
                history.push(&observation);
                episode.observation = Some(observation);
                self.answer()
            }
            Err(e) => Some(self.refuse(step, unreadable(e))),
        }
    }

    fn predicted(&mut self, bytes: &[u8]) -> Option<(Saying, Vec<u8>)> {
        let episode = self.episode.as_mut()?;
        match convert::prediction(bytes).map_err(|e| e.to_string()).and_then(checked) {
            Ok(prediction) => {
                episode.prediction = Some(prediction);
                self.answer()
            }
            // The simulator judges it too, and ends the episode.
            Err(e) => {
                tracing::error!("{episode}: the prediction is refused: {e}");
                None
            }
        }
    }

    fn taken(&mut self, bytes: &[u8]) -> Option<(Saying, Vec<u8>)> {
        let episode = self.episode.as_mut()?;
        let read = decode::<proto::TakenAgents>(bytes);
        let read = read.and_then(|message| Ok((message.step, episode.ways.taken(message)?)));
        match read {
            Ok(taken) => {
                episode.taken = Some(taken);
                self.answer()
            }
            Err(e) => {
                let step = episode.observation.take()?.step;
                Some(self.refuse(step, format!("it cannot be read who is taken over: {e}")))
            }
        }
    }

    /// The answer, once all that it needs is there.
    fn answer(&mut self) -> Option<(Saying, Vec<u8>)> {
        let needs = self.service.needs();
        let episode = self.episode.as_mut()?;
        let step = episode.observation.as_ref()?.step;
        let Ok((briefing, history, mind)) = &mut episode.mind else { return None };
        let is_there = match needs {
            Needs::Nothing => true,
            Needs::Prediction => episode.prediction.as_ref().is_some_and(|prediction| prediction.step() == step),
            Needs::Taken => episode.taken.as_ref().is_some_and(|(of, _)| *of == step),
        };
        if !is_there {
            return None;
        }
        let observation = episode.observation.take()?;
        let prediction = episode.prediction.take();
        let taken = episode.taken.take().map(|(_, taken)| taken).unwrap_or_default();
        let input = StepInput { briefing, observation: &observation, history, prediction: prediction.as_ref() };
        match guarded(|| mind(&input, &taken)) {
            Ok(answer) => Some((self.saying(), answer)),
            Err(error) => {
                // What it was in the middle of is unknown: it is not asked again.
                tracing::error!("{episode} step {step}: {error}");
                episode.mind = Err(error.clone());
                Some(self.refuse(step, error))
            }
        }
    }

    fn saying(&self) -> Saying {
        match self.service.role() {
            Role::Predictor => Saying::Prediction,
            Role::Traffic => Saying::Moves,
            Role::Sim | Role::Planner | Role::Recorder => Saying::Plan,
        }
    }

    fn refuse(&self, step: u32, error: String) -> (Saying, Vec<u8>) {
        (self.saying(), self.service.refusal(step, error))
    }
}

impl fmt::Display for Episode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.scene {
            Some(scene) => scene.fmt(f),
            None => write!(f, "episode {}", self.number),
        }
    }
}

fn briefing(bytes: &[u8]) -> Result<Briefing, String> {
    let scene = decode::<proto::Scene>(bytes).map_err(|e| e.to_string())?;
    if scene.wire_version != WIRE_VERSION {
        return Err(format!(
            "the simulator speaks version {} of the messages, this node version {WIRE_VERSION}",
            scene.wire_version
        ));
    }
    Briefing::try_from(scene).map_err(|e: MessageError| e.to_string())
}

/// What `work` says, or that it panicked and with which words.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(format!("it panicked: {}", words(panic.as_ref()))))
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a word")
}

/// Whole, whatever step it is for: that is compared when both are there.
fn checked(prediction: UncheckedPrediction) -> Result<Prediction, String> {
    let step = prediction.step;
    prediction.check(step).map_err(|e| e.to_string())
}

#[cfg(test)]
pub(crate) mod tests {
    use prost::Message as _;
    use world::observation::{HistoryStep, ObservedAgent};
    use world::plan::UncheckedPlan;
    use world::reference_line::{ReferenceLine, ReferenceWindow};
    use world::scene::{AgentKind, AgentState, TrackId};

    use super::super::{Planner, PlannerFactory, Planners};
    use super::*;

    pub(crate) fn briefing() -> Briefing {
        let step = |log_index| HistoryStep { log_index, av: AgentState::default(), agents: vec![] };
        Briefing {
            scene: SceneId::new("s").unwrap(),
            protocol: "strict".to_owned(),
            start: 19,
            horizon: 150,
            wheelbase: 3.0,
            map: Arc::default(),
            route: vec![],
            reference_line: Arc::default(),
            history: (0..19).map(step).collect(),
        }
    }

    pub(crate) fn observation(step: u32) -> Observation {
        let agent =
            ObservedAgent { track: TrackId(7), kind: AgentKind::Vehicle, state: AgentState::default(), unseen: 0 };
        Observation {
            step,
            log_index: 19 + step,
            av: AgentState::default(),
            control: Default::default(),
            agents: vec![agent],
            signals: vec![],
            window: ReferenceWindow {
                line: Arc::new(ReferenceLine::default()),
                start: 0,
                samples: 0,
                first_sample: 0,
                red_stops: vec![],
                speed_limit: None,
            },
        }
    }

    /// Fails, panics or answers, as its script says for each step.
    struct Scripted {
        needs_prediction: bool,
    }

    impl PlannerFactory for Scripted {
        fn start(&self, _: &Briefing) -> Result<Box<dyn Planner>, String> {
            Ok(Box::new(Script))
        }

        fn needs_prediction(&self) -> bool {
            self.needs_prediction
        }
    }

    struct Script;

    impl Planner for Script {
        fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
            match step.observation.step {
                8 => Err("no way ahead".to_owned()),
                9 => panic!("index 3 out of range"),
                step => Ok(UncheckedPlan { step, ..Default::default() }),
            }
        }
    }

    fn desk(needs_prediction: bool) -> Desk {
        Desk::new(Arc::new(Planners(Arc::new(Scripted { needs_prediction }))))
    }

    const EPISODE: u64 = 7;

    fn tell(desk: &mut Desk, telling: Telling, message: &impl prost::Message) -> Option<proto::Plan> {
        match desk.take(EPISODE, telling, &message.encode_to_vec())? {
            (Saying::Plan, bytes) => Some(proto::Plan::decode(bytes.as_slice()).unwrap()),
            (saying, _) => panic!("{saying:?}"),
        }
    }

    fn observe(desk: &mut Desk, step: u32) -> Option<proto::Plan> {
        tell(desk, Telling::Observation, &proto::Observation::from(&observation(step)))
    }

    fn scene() -> proto::Scene {
        proto::Scene::from(&briefing())
    }

    #[test]
    fn an_observation_is_answered() {
        let mut desk = desk(false);
        assert_eq!(tell(&mut desk, Telling::Scene, &scene()), None);
        let plan = observe(&mut desk, 0).unwrap();
        assert_eq!((plan.step, plan.error.as_str()), (0, ""));
    }

    #[test]
    fn a_plan_waits_for_the_prediction_of_its_step() {
        let mut desk = desk(true);
        tell(&mut desk, Telling::Scene, &scene());
        assert_eq!(observe(&mut desk, 1), None);
        let prediction = |step| proto::Prediction { step, ..Default::default() };
        assert_eq!(tell(&mut desk, Telling::Prediction, &prediction(0)), None);
        assert_eq!(tell(&mut desk, Telling::Prediction, &prediction(1)).unwrap().step, 1);
        // The other way round.
        assert_eq!(tell(&mut desk, Telling::Prediction, &prediction(2)), None);
        assert_eq!(observe(&mut desk, 2).unwrap().step, 2);
    }

    #[test]
    fn an_error_is_told_and_the_planner_asked_no_more() {
        let mut desk = desk(false);
        tell(&mut desk, Telling::Scene, &scene());
        assert_eq!(observe(&mut desk, 8).unwrap().error, "no way ahead");
        assert_eq!(observe(&mut desk, 10).unwrap().error, "no way ahead");
    }

    #[test]
    fn a_panic_is_told_and_the_next_episode_is_planned() {
        let mut desk = desk(false);
        tell(&mut desk, Telling::Scene, &scene());
        assert_eq!(observe(&mut desk, 9).unwrap().error, "it panicked: index 3 out of range");
        assert_eq!(desk.take(EPISODE + 1, Telling::Scene, &scene().encode_to_vec()), None);
        let first = proto::Observation::from(&observation(0)).encode_to_vec();
        let (_, plan) = desk.take(EPISODE + 1, Telling::Observation, &first).unwrap();
        assert_eq!(proto::Plan::decode(plan.as_slice()).unwrap().error, "");
    }

    #[test]
    fn an_episode_is_forgotten_at_its_end() {
        let mut desk = desk(false);
        tell(&mut desk, Telling::Scene, &scene());
        let done = Some((Saying::Done, vec![]));
        assert_eq!(desk.take(EPISODE, Telling::End, &proto::EpisodeEnd::default().encode_to_vec()), done);
        assert_eq!(observe(&mut desk, 0).unwrap().error, "its scene never came");
    }

    #[test]
    fn the_first_scene_is_believed_and_the_end_of_its_own_episode() {
        let mut desk = desk(false);
        tell(&mut desk, Telling::Scene, &scene());
        tell(&mut desk, Telling::Scene, &proto::Scene { wire_version: 99, ..scene() });
        desk.take(EPISODE - 1, Telling::End, &[]);
        assert_eq!(observe(&mut desk, 0).unwrap().error, "");
    }

    #[test]
    fn a_simulator_of_another_version_is_refused_with_both_versions() {
        let mut desk = desk(false);
        tell(&mut desk, Telling::Scene, &proto::Scene { wire_version: 99, ..scene() });
        let error = observe(&mut desk, 0).unwrap().error;
        assert_eq!(error, format!("the simulator speaks version 99 of the messages, this node version {WIRE_VERSION}"));
    }
}
