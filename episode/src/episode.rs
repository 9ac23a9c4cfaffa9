//! One drive through one scene: what is seen at a step, what a plan makes of it, what the judges say.

use std::sync::Arc;

use wire::proto::{self, EndReason};
use world::geometry::{Pose, angle_difference};
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, PLAN_STEPS, Plan, PlanState, STEP_SECONDS};
use world::reference_line::ReferenceWindow;
use world::route::{Route, RouteError};
use world::scene::bridged::Bridged;
use world::scene::bridged::{SeenAgent, SeenSignal};
use world::scene::{AgentState, Scene};
use world::signal::Signal;
use world::traffic::{MoveError, Taken, UncheckedMoves};
use world::vehicle::WHEELBASE;

use crate::advance::{Advance, Undrivable, named};
use crate::detail::detail;
use crate::guidance::Guidance;
use crate::metrics::{self, Counted};
use crate::paper::{self, Paper};
use crate::protocol::{Protocol, SettingError, StrictSettings};
use crate::strict::Strict;
use crate::traffic::TrafficSettings;
use crate::traffic::company::Company;

/// A finished episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How it ended, with all metrics. The counts of observations, plans and predictions are the caller's to fill in.
    pub end: proto::EpisodeEnd,
    /// A record a step.
    pub records: Vec<proto::StepRecord>,
    /// Everything that happened.
    pub events: Vec<proto::Event>,
    /// Where those were that reacted, step by step; nothing in replay.
    pub moved: Vec<proto::TrafficMoves>,
    /// How many agents of the log did not appear, because the AV or somebody who reacts was in their place.
    pub without_room: u32,
}

/// One drive through one scene.
#[derive(Clone, Debug)]
pub struct Episode {
    scene: Arc<Scene>,
    /// The scene with its gaps filled in; under `paper` it is taken as it lies.
    bridged: Option<Arc<Bridged>>,
    protocol: Protocol,
    /// Log index of step 0.
    start: u32,
    /// Log index of the first step of the history.
    known_from: usize,
    /// Steps that the protocol drives at most.
    most_steps: u32,
    /// As many, or fewer where the log ends before.
    horizon: u32,
    rules: Rules,
    step: u32,
    records: Vec<proto::StepRecord>,
    events: Vec<proto::Event>,
    /// Who reacts; none in replay.
    company: Option<Box<Company>>,
    /// Where they were, step by step.
    moved: Vec<proto::TrafficMoves>,
    advance: Advance,
    detail: String,
}

/// What differs between the protocols, with the AV as each of them has it.
#[derive(Clone, Debug)]
enum Rules {
    Strict(Box<Strict>),
    Paper(Box<Paper>),
}

impl Rules {
    fn wheelbase(&self) -> f64 {
        match self {
            Self::Strict(rules) => rules.wheelbase(),
            Self::Paper(_) => WHEELBASE,
        }
    }

    fn route(&self) -> &Route {
        match self {
            Self::Strict(rules) => rules.route(),
            Self::Paper(rules) => rules.route(),
        }
    }

    fn av(&self) -> &AgentState {
        match self {
            Self::Strict(rules) => rules.av(),
            Self::Paper(rules) => rules.av(),
        }
    }

    /// What brought the AV here; zero, or how the wheels stand, at the start.
    fn control(&self) -> Control {
        match self {
            Self::Strict(rules) => rules.control(),
            Self::Paper(rules) => rules.control(),
        }
    }

    fn window(&self, signals: &[Signal]) -> ReferenceWindow {
        match self {
            Self::Strict(rules) => rules.window(signals),
            Self::Paper(rules) => rules.sight().window.clone(),
        }
    }

    /// Moves the AV by one step.
    fn drive(&mut self, guidance: &Guidance<'_>) {
        match self {
            Self::Strict(rules) => rules.drive(guidance),
            Self::Paper(rules) => rules.drive(guidance),
        }
    }

    /// Puts the AV on a state a step later.
    fn put(&mut self, state: &PlanState, control: Option<Control>) {
        match self {
            Self::Strict(rules) => rules.put(state, control),
            Self::Paper(rules) => rules.put(state),
        }
    }

    /// Judges the AV where it is now, and says whether that ends the episode.
    fn judge(&mut self, scene: &Scene, log_index: usize, advance: &mut Advance) -> Option<EndReason> {
        match self {
            Self::Strict(rules) => rules.judge(log_index, advance),
            Self::Paper(rules) => rules.judge(scene, log_index, advance),
        }
    }
}

impl Episode {
    /// The episode of `scene` under `protocol`, before its first step.
    ///
    /// # Errors
    /// [`Undrivable`] says why there is nothing to drive.
    pub fn new(scene: Arc<Scene>, protocol: &Protocol) -> Result<Self, Undrivable> {
        match protocol {
            Protocol::Strict(settings) => Self::begin(scene, protocol, settings.start, settings.horizon),
            Protocol::Paper => Self::begin(scene, protocol, paper::START, paper::MOST_STEPS),
        }
    }

    /// The episode of a single plan, made at `log_index` of the log: the AV is where it was logged, as at the start of any other
    /// episode, and as much of the time before is told as before one that starts as usual.
    ///
    /// # Errors
    /// As [`Episode::new`].
    pub fn of_frame(scene: Arc<Scene>, protocol: &Protocol, log_index: u32) -> Result<Self, Undrivable> {
        let steps = PLAN_STEPS as u32;
        let protocol = match protocol {
            Protocol::Strict(settings) => {
                Protocol::Strict(StrictSettings { start: log_index, horizon: steps, ..settings.clone() })
            }
            Protocol::Paper => Protocol::Paper,
        };
        let mut episode = Self::begin(scene, &protocol, log_index, steps)?;
        episode.known_from = (log_index as usize).saturating_sub(paper::START as usize);
        Ok(episode)
    }

    /// The episode that begins `steps` later than it would, where the logged AV is then, and ends when it would.
    ///
    /// # Errors
    /// As [`Episode::new`]; also where nothing is left to drive.
    pub fn begun_later(scene: Arc<Scene>, protocol: &Protocol, steps: u32) -> Result<Self, Undrivable> {
        match protocol {
            Protocol::Strict(settings) => {
                let start = settings.start.saturating_add(steps);
                let horizon = settings.horizon.saturating_sub(steps);
                let later = Protocol::Strict(StrictSettings { start, horizon, ..settings.clone() });
                Self::begin(scene, &later, start, horizon)
            }
            Protocol::Paper => {
                let start = paper::START.saturating_add(steps);
                Self::begin(scene, protocol, start, paper::MOST_STEPS.saturating_sub(steps))
            }
        }
    }

    fn begin(scene: Arc<Scene>, protocol: &Protocol, first: u32, most_steps: u32) -> Result<Self, Undrivable> {
        protocol.check()?;
        let start = first as usize;
        let end = scene.steps().min(start.saturating_add(most_steps as usize).saturating_add(1));
        if end < start + 2 {
            return Err(Undrivable::TooShort { steps: scene.steps(), needed: start + 1 });
        }
        let missing = Undrivable::AvMissing { start };
        let (rules, bridged) = match protocol {
            Protocol::Strict(settings) => {
                let bridged = Arc::new(Bridged::of(&scene));
                let state = bridged.observed(scene.av_index(), start).filter(|seen| seen.unseen == 0).ok_or(missing)?;
                let strict = Strict::new(&bridged, settings.clone(), state.state, end)?;
                (Rules::Strict(Box::new(strict)), Some(bridged))
            }
            Protocol::Paper => {
                let state = scene.av().states[start].ok_or(missing)?;
                (Rules::Paper(Box::new(Paper::new(&scene, state, start)?)), None)
            }
        };
        let horizon = (end - 1 - start) as u32;
        Ok(Self {
            protocol: protocol.clone(),
            records: Vec::with_capacity(horizon as usize),
            events: Vec::new(),
            company: None,
            moved: Vec::new(),
            advance: Advance::default(),
            detail: String::new(),
            step: 0,
            start: first,
            known_from: 0,
            most_steps,
            horizon,
            rules,
            scene,
            bridged,
        })
    }

    /// The same episode with agents that react. They are taken over as [`crate::traffic`] says, and from then on somebody has to say where they
    /// are: [`Episode::move_traffic`] before each step for which [`Episode::taken`] names anybody.
    ///
    /// # Errors
    /// [`SettingError`] under `paper`, and of a setting that makes no sense.
    pub fn with_traffic(mut self, settings: &TrafficSettings) -> Result<Self, SettingError> {
        settings.check()?;
        let bridged = self.bridged.as_ref().ok_or(SettingError::ReactivePaper)?;
        self.company = Some(Box::new(Company::new(bridged, settings.clone())));
        self.hand_over();
        Ok(self)
    }

    /// Whether agents may react, be it that nobody is taken over yet.
    #[must_use]
    pub fn reacts(&self) -> bool {
        self.company.is_some()
    }

    /// The agents that are taken over for the coming step, in the log's order; nobody in replay.
    #[must_use]
    pub fn taken(&self) -> &[Taken] {
        self.company.as_ref().map_or(&[], |company| company.taken())
    }

    /// Says where the agents that are taken over are after the coming step.
    ///
    /// # Errors
    /// [`MoveError`] where that is not one move for each of them that a body could make; nothing is changed then.
    pub fn move_traffic(&mut self, moves: UncheckedMoves) -> Result<(), MoveError> {
        match &mut self.company {
            Some(company) => company.tell(self.step, moves),
            None => moves.check(self.step, &[]).map(drop),
        }
    }

    /// The scene as it was driven up to now: who reacted was where he was moved to, and from when he left, or was not let in, he is nowhere. The
    /// scene itself in replay.
    #[must_use]
    pub fn driven_scene(&self) -> Arc<Scene> {
        match &self.company {
            Some(company) => Arc::new(company.driven_scene()),
            None => Arc::clone(&self.scene),
        }
    }

    /// Takes over from the log who is due for the coming step.
    fn hand_over(&mut self) {
        let log_index = self.log_index();
        if let (Some(company), Rules::Strict(rules)) = (&mut self.company, &self.rules) {
            company.hand_over(&rules.sight(self.step, log_index));
        }
    }

    fn log_index(&self) -> usize {
        (self.start + self.step) as usize
    }

    fn agents_at(&self, log_index: usize) -> Vec<ObservedAgent> {
        let others = self.scene.tracks().iter().enumerate().filter(|(index, _)| *index != self.scene.av_index());
        let seen = others.filter_map(|(index, track)| {
            let reacting = self.company.as_ref().filter(|_| log_index == self.log_index());
            let SeenAgent { state, unseen } = match (reacting.and_then(|company| company.seen(index)), &self.bridged) {
                (Some(reacting), _) => reacting?,
                (None, Some(bridged)) => bridged.observed(index, log_index)?,
                (None, None) => SeenAgent { state: track.states[log_index]?, unseen: 0 },
            };
            Some(ObservedAgent { track: track.id, kind: track.kind, state, unseen })
        });
        seen.collect()
    }

    /// What a driver is told before the first step.
    #[must_use]
    pub fn briefing(&self) -> Briefing {
        let history = (self.known_from..self.start as usize).filter_map(|log_index| {
            let av = self.scene.av().states[log_index]?;
            Some(HistoryStep { log_index: log_index as u32, av, agents: self.agents_at(log_index) })
        });
        Briefing {
            scene: self.scene.id().clone(),
            protocol: self.protocol.name().to_owned(),
            start: self.start,
            horizon: self.horizon,
            wheelbase: self.rules.wheelbase(),
            map: Arc::clone(self.judged_scene().map()),
            route: self.rules.route().lanes.clone(),
            reference_line: Arc::clone(&self.rules.route().line),
            history: history.collect(),
        }
    }

    /// What is to be seen now.
    #[must_use]
    pub fn observe(&self) -> Observation {
        let log_index = self.log_index();
        let signals: Vec<SeenSignal> = match &self.bridged {
            Some(bridged) => bridged.observed_signals(log_index).to_vec(),
            None => self.scene.signals(log_index).iter().map(|&signal| SeenSignal { signal, unseen: 0 }).collect(),
        };
        let shown: Vec<Signal> = signals.iter().map(|seen| seen.signal).collect();
        Observation {
            step: self.step,
            log_index: log_index as u32,
            av: *self.rules.av(),
            control: self.rules.control(),
            agents: self.agents_at(log_index),
            window: self.rules.window(&shown),
            signals,
        }
    }

    /// The AV now.
    #[must_use]
    pub fn av(&self) -> &AgentState {
        self.rules.av()
    }

    /// Why the episode is over, if it is.
    #[must_use]
    pub fn ended(&self) -> Option<EndReason> {
        self.advance.ended
    }

    /// Drives one step of `plan`. After the end nothing more happens.
    pub fn advance(&mut self, plan: &Plan) -> &Advance {
        if self.advance.ended.is_some() {
            return &self.advance;
        }
        let heading = self.rules.av().heading;
        self.rules.drive(&Guidance::at_once(plan));
        self.settle(heading, None)
    }

    /// Drives one step under a latency: of plans that were asked for some steps ago, and the record says when. After the end nothing more
    /// happens.
    pub fn follow(&mut self, guidance: &Guidance<'_>) -> &Advance {
        if self.advance.ended.is_some() {
            return &self.advance;
        }
        let heading = self.rules.av().heading;
        self.rules.drive(guidance);
        self.settle(heading, Some(guidance))
    }

    /// Puts the AV on a state a step later, as if it could do what that says, and judges it there: a drive that was driven before is
    /// judged again. It ends as any other; after the end nothing more happens.
    pub fn put(&mut self, state: &PlanState) -> &Advance {
        if self.advance.ended.is_some() {
            return &self.advance;
        }
        let heading = self.rules.av().heading;
        self.rules.put(state, None);
        self.settle(heading, None)
    }

    /// Plays a plan out as if the AV could do what it says: the AV is put on each of its states in turn and judged there. Nothing ends
    /// that but the log.
    pub fn play_out(&mut self, states: &[PlanState]) -> Outcome {
        self.retrace(states.iter().map(|state| (*state, None)));
        self.finish()
    }

    /// Judges again what was driven: the AV is put on each state, with the control that brought it there where that is known. Nothing ends
    /// that but the log.
    pub fn retrace(&mut self, drive: impl IntoIterator<Item = (PlanState, Option<Control>)>) {
        let left = self.scene.steps().saturating_sub(self.log_index() + 1);
        for (state, control) in drive.into_iter().take(left) {
            let heading = self.rules.av().heading;
            self.rules.put(&state, control);
            self.settle(heading, None);
        }
    }

    /// Judges the AV, which headed to `heading` a step before. The record tells of the plans that were followed, under a latency.
    fn settle(&mut self, heading: f64, guidance: Option<&Guidance<'_>>) -> &Advance {
        let log_index = self.log_index() + 1;
        let av = self.rules.av();
        let human = self.scene.av().states[log_index];
        self.advance.events.clear();
        self.advance.record = proto::StepRecord {
            step: self.step,
            log_index: log_index as u32,
            av: Some(av.into()),
            control: Some(self.rules.control().into()),
            yaw_rate: angle_difference(heading, av.heading) / STEP_SECONDS,
            position_error: human.map(|human| human.position().distance(av.position())),
            plan_age: guidance.map(|guidance| guidance.now.map_or(-1, |plan| plan.age as i32)),
            plan_taken_up_us: guidance.map_or(0, |guidance| guidance.since_us),
            ..proto::StepRecord::default()
        };
        if let (Some(company), Rules::Strict(rules)) = (&mut self.company, &mut self.rules) {
            match company.arrive(self.step, log_index, rules.traffic_mut()) {
                Ok(moved) => {
                    self.advance.record.reactive = moved.agents.len() as u32;
                    self.moved.push(moved.clone());
                    self.advance.moved = moved;
                }
                Err(agents) => {
                    let step = self.step;
                    return self
                        .fail(format!("nobody said where the {agents} agents that react are after step {step}"));
                }
            }
        }
        let ended = self.rules.judge(&self.scene, log_index, &mut self.advance);
        if ended == Some(EndReason::RouteLost) {
            self.detail = RouteError::NoLane { log_index }.to_string();
        }
        self.step += 1;
        self.hand_over();
        self.advance.ended = ended.or_else(|| self.end_of_time());
        if self.detail.is_empty() {
            self.detail = detail(&self.advance, self.step, self.most_steps);
        }
        self.advance.record.events = self.advance.events.len() as u32;
        self.records.push(self.advance.record);
        self.events.extend_from_slice(&self.advance.events);
        &self.advance
    }

    fn end_of_time(&self) -> Option<EndReason> {
        if self.step == self.most_steps {
            Some(EndReason::Horizon)
        } else if self.step == self.horizon {
            Some(EndReason::LogEnd)
        } else {
            None
        }
    }

    /// The scene as its judges take it: under `strict` with its gaps filled in.
    #[must_use]
    pub fn judged_scene(&self) -> &Arc<Scene> {
        self.bridged.as_ref().map_or(&self.scene, |bridged| bridged.judged())
    }

    /// What the authors' simulator sees now; none under another protocol.
    #[must_use]
    pub fn paper_sight(&self) -> Option<&paper::Sight> {
        match &self.rules {
            Rules::Strict(_) => None,
            Rules::Paper(rules) => Some(rules.sight()),
        }
    }

    /// Ends the episode: the driver failed for `reason`, be it after the last step. The first reason stands.
    pub fn fail(&mut self, reason: String) -> &Advance {
        if self.advance.ended != Some(EndReason::DriverFailed) {
            self.advance.ended = Some(EndReason::DriverFailed);
            self.advance.events.clear();
            self.advance.events.push(proto::Event {
                step: self.step,
                kind: proto::event::Kind::DriverFailed.into(),
                text: format!("the driver failed: {reason}"),
                ..proto::Event::default()
            });
            self.events.extend_from_slice(&self.advance.events);
            self.detail = reason;
        }
        &self.advance
    }

    /// The metrics of what was driven, in the order of [`metrics::METRICS`], as far as its steps count.
    #[must_use]
    pub fn measure(&self, counted: Counted<'_>) -> Vec<Option<f64>> {
        let human: Vec<Option<Pose>> =
            self.scene.av().states.iter().map(|state| state.map(|state| state.pose())).collect();
        let first = self.start as usize + 1;
        match &self.rules {
            Rules::Strict(rules) => {
                let human = &human[first..first + self.records.len()];
                rules.measure(&self.records, &self.events, human, counted)
            }
            Rules::Paper(_) => metrics::authors::measure(&self.records, &human, counted),
        }
    }

    /// The outcome of what was driven.
    #[must_use]
    pub fn finish(&self) -> Outcome {
        let end = proto::EpisodeEnd {
            scene: self.scene.id().to_string(),
            protocol: self.protocol.name().to_owned(),
            reason: self.advance.ended.unwrap_or_default().into(),
            detail: self.detail.clone(),
            steps: self.step,
            metrics: named(self.measure(Counted::ALL)),
            records: self.records.len() as u32,
            events: self.events.len() as u32,
            ..proto::EpisodeEnd::default()
        };
        let without_room = self.company.as_ref().map_or(0, |company| company.without_room());
        let (records, events, moved) = (self.records.clone(), self.events.clone(), self.moved.clone());
        Outcome { end, records, events, moved, without_room }
    }
}
