//! The agents that are taken over: who, where they are, where they go, who leaves.

use std::collections::BTreeMap;
use std::sync::Arc;

use wire::proto;
use world::observation::ObservedAgent;
use world::reference_line::ReferenceLine;
use world::scene::bridged::{Bridged, SeenAgent};
use world::scene::{AgentKind, AgentState, Scene, TrackId};
use world::traffic::{MoveError, Moves, Taken, UncheckedMoves, Way, Ways};

use super::TrafficSettings;
use super::hand_over::{Departed, Replayed, Stretch, has_no_room, is_due};
use crate::judges::Body;
use crate::judges::time_to_collision::TrafficAgent;
use crate::strict::traffic::Traffic;

/// Who is farther than this many times the radius from the AV leaves.
const LEAVES: f64 = 2.5;

/// Whoever is so near to the end of his way (samples: 3 m) leaves.
const WAY_END: usize = 6;

/// Steps in which a driver reacts to what appears, as in [`Traffic`]: nobody is charged for a contact with who appeared just now.
const REACTION: usize = 10;

/// A track has been seen for so many steps before it is taken over: the speed that it appears with may be anything.
const KNOWN: usize = 3;

/// How a track is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Driven {
    #[default]
    ByTheLog,
    ByTheModel,
    /// It was taken over, and has left.
    Gone,
}

/// What is known of where a track goes.
#[derive(Clone, Debug, Default)]
enum Course {
    /// Nobody has asked yet.
    #[default]
    Unasked,
    /// It stands for the rest of the log.
    Standing,
    /// Its way, and the sample where it is.
    Along(Arc<Way>, usize),
}

/// What there is to see when hand-overs are decided.
pub(crate) struct Sight<'a> {
    /// The next step to be driven.
    pub step: u32,
    /// Its log index.
    pub log_index: usize,
    /// The AV.
    pub av: Body,
    /// Its line, and the sample where it is.
    pub line: &'a ReferenceLine,
    pub sample: usize,
    /// The others, as the judges see them.
    pub traffic: &'a Traffic,
}

/// Who reacts, in an episode.
#[derive(Clone, Debug)]
pub(crate) struct Company {
    settings: TrafficSettings,
    bridged: Arc<Bridged>,
    ways: Ways,
    /// By track.
    driven: Vec<Driven>,
    courses: Vec<Course>,
    /// In the order of the log's tracks.
    taken: Vec<Taken>,
    /// The track of each of them, and the log index until which it counts as sudden.
    tracks: Vec<(usize, usize)>,
    /// Where they are a step later, once that is told.
    next: Option<Moves>,
    /// Tracks for which there was no room to appear, until the judges know.
    barred: Vec<usize>,
    /// How many there were of these.
    without_room: u32,
    /// The states of those who have been taken over, or have left, by track: as logged until then, and none in the future.
    elsewhere: BTreeMap<usize, Vec<Option<AgentState>>>,
    /// Whether the AV has left the log.
    av_left: bool,
}

impl Company {
    pub(crate) fn new(bridged: &Arc<Bridged>, settings: TrafficSettings) -> Self {
        let tracks = bridged.judged().tracks().len();
        Self {
            ways: Ways::on(bridged.judged().map()),
            driven: vec![Driven::ByTheLog; tracks],
            courses: vec![Course::Unasked; tracks],
            taken: Vec::new(),
            tracks: Vec::new(),
            next: None,
            barred: Vec::new(),
            without_room: 0,
            elsewhere: BTreeMap::new(),
            av_left: false,
            bridged: Arc::clone(bridged),
            settings,
        }
    }

    /// Who is taken over for the coming step.
    pub(crate) fn taken(&self) -> &[Taken] {
        &self.taken
    }

    /// How many tracks do not appear, because somebody is in their place.
    pub(crate) fn without_room(&self) -> u32 {
        self.without_room
    }

    /// How track number `track` is to be seen, where it is the model that says so: nothing where it has left.
    pub(crate) fn seen(&self, track: usize) -> Option<Option<SeenAgent>> {
        match self.driven[track] {
            Driven::ByTheLog => None,
            Driven::Gone => Some(None),
            Driven::ByTheModel => {
                let place = self.tracks.binary_search_by_key(&track, |(track, _)| *track).ok();
                Some(place.map(|place| SeenAgent { state: self.taken[place].state, unseen: 0 }))
            }
        }
    }

    /// Takes in where everybody is a step later.
    pub(crate) fn tell(&mut self, step: u32, moves: UncheckedMoves) -> Result<(), MoveError> {
        self.next = Some(moves.check(step, &self.taken)?);
        Ok(())
    }

    /// Moves everybody by a step, for the judges of `log_index` too. Answers with those that were moved; with how many are not told of, where
    /// nothing was.
    pub(crate) fn arrive(
        &mut self,
        step: u32,
        log_index: usize,
        traffic: &mut Traffic,
    ) -> Result<proto::TrafficMoves, usize> {
        let moves = self.next.take().unwrap_or_default();
        if moves.moves().len() != self.taken.len() {
            return Err(self.taken.len());
        }
        for (place, told) in moves.moves().iter().enumerate() {
            self.taken[place].state = told.state;
            self.elsewhere(self.tracks[place].0, log_index)[log_index] = Some(told.state);
        }
        self.show(log_index, traffic);
        let told = |agent: &Taken| {
            let Taken { track, kind, state, .. } = *agent;
            proto::Agent::from(&ObservedAgent { track, kind, state, unseen: 0 })
        };
        Ok(proto::TrafficMoves { step, agents: self.taken.iter().map(told).collect(), error: String::new() })
    }

    fn show(&mut self, log_index: usize, traffic: &mut Traffic) {
        self.barred.drain(..).for_each(|track| traffic.leave(track));
        let agents = self.taken.iter().zip(&self.tracks);
        traffic.react(agents.map(|(agent, (track, sudden_until))| {
            TrafficAgent::of(*track, agent.kind, &agent.state, log_index < *sudden_until)
        }));
    }

    /// The scene as it was driven up to now.
    pub(crate) fn driven_scene(&self) -> Scene {
        self.bridged.logged().with_states(self.elsewhere.iter().map(|(track, states)| (*track, states.clone())))
    }

    /// The states of a track of which the log says nothing from `log_index` on.
    fn elsewhere(&mut self, track: usize, log_index: usize) -> &mut Vec<Option<AgentState>> {
        self.elsewhere.entry(track).or_insert_with(|| {
            let mut states = self.bridged.logged().tracks()[track].states.clone();
            states[log_index..].fill(None);
            states
        })
    }

    /// Lets those leave who are done, and takes over who is due.
    pub(crate) fn hand_over(&mut self, sight: &Sight<'_>) {
        self.let_leave(sight);
        let logged_av = self.bridged.judged().av().states[sight.log_index];
        let away = logged_av.map(|logged| logged.position().distance(sight.av.state.position()));
        self.av_left |= away.is_some_and(|away| away >= self.settings.left_log);
        let av = Departed { body: sight.av, logged: logged_av.map(Body::of) };
        let stretch = self.av_left.then(|| Stretch::of(sight.line, sight.sample, sight.av.state.width));
        let others = self.departed(sight.log_index);
        for agent in sight.traffic.at(sight.log_index) {
            if self.driven[agent.track] != Driven::ByTheLog || agent.kind == AgentKind::Other {
                continue;
            }
            let seen = self.bridged.observed(agent.track, sight.log_index).filter(|seen| seen.unseen == 0);
            let Some(SeenAgent { state, .. }) = seen else { continue };
            if has_no_room(agent, &others) || self.av_left && has_no_room(agent, std::slice::from_ref(&av)) {
                self.driven[agent.track] = Driven::Gone;
                self.barred.push(agent.track);
                self.without_room += 1;
                self.elsewhere(agent.track, sight.log_index + 1);
                continue;
            }
            let lately = (sight.log_index + 1).saturating_sub(KNOWN)..=sight.log_index;
            if self.bridged.judged().tracks()[agent.track].states[lately].iter().any(Option::is_none) {
                continue;
            }
            let is_near = state.position().distance(sight.av.state.position()) <= self.settings.radius;
            if !is_near && others.is_empty() {
                continue;
            }
            let wants_way = stretch.is_some() || !others.is_empty() || av.is_run_into_by(agent);
            let way = if wants_way { self.course(agent.track, sight.log_index, &state) } else { None };
            let replayed =
                Replayed { agent, state: &state, way: way.as_ref().map(|(way, sample)| (way, *sample)), is_near };
            if !is_due(&self.settings, &replayed, &av, stretch.as_ref(), &others) {
                continue;
            }
            let Some((way, _)) = way else { continue };
            let track: TrackId = self.bridged.judged().tracks()[agent.track].id;
            let taken = Taken { track, kind: agent.kind, since_step: sight.step, state, way };
            let place = self.tracks.partition_point(|(track, _)| *track < agent.track);
            let sudden_until = if agent.sudden { sight.log_index + REACTION } else { 0 };
            self.taken.insert(place, taken);
            self.tracks.insert(place, (agent.track, sudden_until));
            self.driven[agent.track] = Driven::ByTheModel;
        }
    }

    /// Those who react and are not where the log has them.
    fn departed(&self, log_index: usize) -> Vec<Departed> {
        let tracks = self.bridged.judged().tracks();
        let departed = self.taken.iter().zip(&self.tracks).filter_map(|(agent, (track, _))| {
            let logged = tracks[*track].states[log_index];
            let away = logged.map(|logged| logged.position().distance(agent.state.position()));
            let has_left = away.is_none_or(|away| away >= self.settings.left_log);
            has_left.then(|| Departed { body: Body::of(agent.state), logged: logged.map(Body::of) })
        });
        departed.collect()
    }

    /// The way of a track that is in `state`, and the sample where it is.
    fn course(&mut self, track: usize, log_index: usize, state: &AgentState) -> Option<(Arc<Way>, usize)> {
        let scene = self.bridged.judged();
        if let Course::Unasked = self.courses[track] {
            let logged = &scene.tracks()[track];
            self.courses[track] = match self.ways.of_log(&logged.states, log_index, logged.kind) {
                Some(way) => Course::Along(Arc::new(way), world::traffic::ways::BEHIND_SAMPLES),
                None => Course::Standing,
            };
        }
        let Course::Along(way, sample) = &mut self.courses[track] else { return None };
        *sample = way.follow(state.position(), *sample).sample;
        Some((Arc::clone(way), *sample))
    }

    fn let_leave(&mut self, sight: &Sight<'_>) {
        let far = LEAVES * self.settings.radius;
        let mut place = 0;
        while place < self.taken.len() {
            let (agent, (track, _)) = (&self.taken[place], self.tracks[place]);
            let mut is_done = agent.state.position().distance(sight.av.state.position()) > far;
            if let Course::Along(way, sample) = &mut self.courses[track] {
                *sample = way.follow(agent.state.position(), *sample).sample;
                is_done |= *sample + WAY_END >= way.len();
            }
            if is_done {
                self.driven[track] = Driven::Gone;
                self.taken.remove(place);
                self.tracks.remove(place);
            } else {
                place += 1;
            }
        }
    }
}
