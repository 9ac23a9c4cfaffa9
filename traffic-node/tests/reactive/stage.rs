//! Drives an episode with agents that react, and counts what happens to them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, LazyLock};

use episode::protocol::{Motion, Protocol, StrictSettings};
use episode::traffic::TrafficSettings;
use episode::{Episode, Outcome};
use predictor_node::Network;
use traffic_node::character::CASTS;
use traffic_node::{Cast, Characters, Company, Foreseen, Heed};
use wire::proto::event::{Contact, Kind};
use world::geometry::{Point, Pose, angle_difference, boxes_overlap};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::{PLAN_STEPS, Plan, PlanState, STEP_SECONDS, UncheckedPlan};
use world::scene::{AgentState, Scene, TrackId};
use world::traffic::Taken;

/// How the AV drives. It is put where it wants to be: what is tried here is the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Av {
    /// As the log's.
    Human,
    /// Along the log's path, but from step 10 on it brakes at 2.5 m/s^2 down to a third of its speed.
    BrakesEarly,
}

/// Who drives the agents that react.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Who {
    Cast(Cast),
    /// The network's futures, as `--traffic network` has them.
    Network,
    /// The same, heeding others so.
    Heeding(Heed),
}

/// Everybody whom `--traffic` names.
pub fn everybody() -> impl Iterator<Item = Who> {
    CASTS.into_iter().map(|(_, cast)| Who::Cast(cast)).chain([Who::Network])
}

impl Who {
    pub fn company(self, seed: u64, briefing: &Briefing) -> Company {
        static FORESEEN: LazyLock<Foreseen> = LazyLock::new(|| Foreseen::new(Network::open(None, None).unwrap(), 0));
        match self {
            Self::Cast(cast) => Characters { cast, seed }.company(briefing),
            Self::Network => Foreseen { seed, ..FORESEEN.clone() }.company(briefing),
            Self::Heeding(heed) => Foreseen { seed, heed, ..FORESEEN.clone() }.company(briefing),
        }
    }
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cast(cast) => cast.fmt(f),
            Self::Network => f.pad("network"),
            Self::Heeding(heed) => f.pad(&format!("{heed:?}")),
        }
    }
}

/// What became of the agents.
#[derive(Clone, Debug, Default)]
pub struct Count {
    /// Agents that were taken over.
    pub taken: usize,
    /// Steps of all of them.
    pub agent_steps: usize,
    /// Steps at which one of them overlaps somebody whom the log keeps apart from it.
    pub overlaps: usize,
    /// Which, and how it looked when it began: for people.
    pub overlapping: BTreeMap<(i32, i32), String>,
    /// The largest jumps at hand-over: from where one would be that goes on for a step (m, rad, m/s).
    pub jumps: [f64; 3],
    /// Lines crossed at red by who could have stopped.
    pub red: usize,
    /// The AV's contacts at fault, and those from behind or while it stands.
    pub at_fault: usize,
    pub from_behind: usize,
    pub other_contacts: usize,
    /// Scenes, and steps at which somebody reacts.
    pub scenes: usize,
    pub steps: usize,
}

impl Count {
    pub fn add(&mut self, other: &Self) {
        self.taken += other.taken;
        self.agent_steps += other.agent_steps;
        self.overlaps += other.overlaps;
        self.red += other.red;
        self.at_fault += other.at_fault;
        self.from_behind += other.from_behind;
        self.other_contacts += other.other_contacts;
        self.scenes += other.scenes;
        self.steps += other.steps;
        for (jump, other) in self.jumps.iter_mut().zip(other.jumps) {
            *jump = jump.max(other);
        }
    }

    /// Holds the bounds that hold whatever the AV does.
    pub fn check(&self, who: Who) {
        assert!(self.overlaps * 1000 <= self.agent_steps, "{who}: {}", self.line());
        let [place, heading, speed] = self.jumps;
        assert!(place <= 0.05 && heading <= 0.02 && speed <= 0.2, "{who}: {}", self.line());
        assert_eq!(self.red, 0, "{who}");
    }

    /// A line of a table.
    fn line(&self) -> String {
        format!(
            "{:3} scenes {:5} taken {:7} agent-steps {:4} overlaps ({:6.2} per 1000) jumps {:.3} m {:.4} rad {:.3} m/s, red {}, at fault {}, from behind {}, other {}",
            self.scenes,
            self.taken,
            self.agent_steps,
            self.overlaps,
            1000.0 * self.overlaps as f64 / self.agent_steps.max(1) as f64,
            self.jumps[0],
            self.jumps[1],
            self.jumps[2],
            self.red,
            self.at_fault,
            self.from_behind,
            self.other_contacts,
        )
    }
}

pub fn protocol() -> Protocol {
    Protocol::Strict(StrictSettings { motion: Motion::Playback, ..StrictSettings::default() })
}

/// The AV's path with a pace of its own.
pub struct Path {
    points: Vec<(f64, AgentState)>,
    station: f64,
    speed: f64,
    least: f64,
}

impl Path {
    pub fn of(scene: &Scene, start: usize) -> Self {
        let mut station = 0.0;
        let mut points: Vec<(f64, AgentState)> = Vec::new();
        for state in scene.av().states[start..].iter().flatten() {
            station += points.last().map_or(0.0, |(_, last)| last.position().distance(state.position()));
            points.push((station, *state));
        }
        let speed = points.first().map_or(0.0, |(_, state)| state.speed());
        Self { points, station: 0.0, speed, least: speed / 3.0 }
    }

    fn at(&self, station: f64) -> (f64, f64, f64) {
        let after = self.points.partition_point(|(at, _)| *at < station).min(self.points.len() - 1);
        let before = after.saturating_sub(1);
        let ((from, a), (to, b)) = (&self.points[before], &self.points[after]);
        let share = if to > from { ((station - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        let mix = |a: f64, b: f64| a + share * (b - a);
        (mix(a.x, b.x), mix(a.y, b.y), a.heading + share * angle_difference(a.heading, b.heading))
    }

    fn next(&mut self, step: u32) -> PlanState {
        if step >= 10 {
            self.speed = (self.speed - 0.25).max(self.least);
        }
        let end = self.points.last().map_or(0.0, |(station, _)| *station);
        self.station = (self.station + STEP_SECONDS * self.speed).min(end);
        let (x, y, heading) = self.at(self.station);
        let speed = if self.station < end { self.speed } else { 0.0 };
        PlanState { x, y, heading, speed }
    }
}

pub fn plan(scene: &Scene, path: &mut Path, av: Av, observation: &Observation) -> Plan {
    let log = &scene.av().states;
    let now = observation.log_index as usize;
    let state = match av {
        Av::BrakesEarly if observation.step >= 10 => path.next(observation.step),
        _ => {
            let logged = log[now + 1].unwrap_or(observation.av);
            path.station += logged.position().distance(observation.av.position());
            path.speed = logged.speed();
            path.least = path.speed / 3.0;
            PlanState { x: logged.x, y: logged.y, heading: logged.heading, speed: logged.speed() }
        }
    };
    let states = vec![state; PLAN_STEPS];
    UncheckedPlan { step: observation.step, states, ..UncheckedPlan::default() }.check(observation.step).unwrap()
}

/// Pairs of tracks that overlap somewhere in the log.
fn entangled(scene: &Scene) -> BTreeSet<(i32, i32)> {
    let mut pairs = BTreeSet::new();
    for step in 0..scene.steps() {
        let boxes: Vec<_> = scene.tracks().iter().filter_map(|track| Some((track.id.0, track.states[step]?))).collect();
        for (index, (id, one)) in boxes.iter().enumerate() {
            for (other_id, other) in &boxes[index + 1..] {
                if one.position().distance_squared(other.position()) < 400.0
                    && boxes_overlap(&one.oriented_box(), &other.oriented_box())
                {
                    pairs.insert((*id.min(other_id), *id.max(other_id)));
                }
            }
        }
    }
    pairs
}

/// Drives `scene`; none where it cannot be driven.
pub fn drive(scene: &Arc<Scene>, settings: &TrafficSettings, who: Who, av: Av) -> Option<(Outcome, Count)> {
    let episode = Episode::new(Arc::clone(scene), &protocol()).ok()?;
    let mut episode = episode.with_traffic(settings).unwrap();
    let mut traffic = who.company(7, &episode.briefing());
    let judged = Arc::clone(episode.judged_scene());
    let entangled = entangled(&judged);
    let start = episode.observe().log_index as usize;
    let mut path = Path::of(&judged, start);
    let mut count = Count { scenes: 1, ..Count::default() };
    let mut known: BTreeSet<TrackId> = BTreeSet::new();
    while episode.ended().is_none() {
        let observation = episode.observe();
        let taken = episode.taken().to_vec();
        let moves = traffic.next(&observation, &taken);
        for agent in &taken {
            let told = moves.moves.iter().find(|told| told.track == agent.track).unwrap();
            if known.insert(agent.track) {
                count.taken += 1;
                let log = judged.tracks().iter().find(|track| track.id == agent.track).unwrap();
                jumps(&mut count.jumps, &log.states, observation.log_index as usize, &told.state);
            }
        }
        let next: BTreeMap<TrackId, AgentState> = moves.moves.iter().map(|told| (told.track, told.state)).collect();
        count.red += taken
            .iter()
            .filter(|agent| runs_red(&judged, observation.log_index as usize, observation.step, agent, &next))
            .count();
        episode.move_traffic(moves).unwrap_or_else(|error| panic!("{} {who}: {error}", scene.id()));
        episode.advance(&plan(&judged, &mut path, av, &observation));
        count.steps += usize::from(!taken.is_empty());
        count.agent_steps += taken.len();
        overlaps(&mut count, &episode, &entangled);
    }
    let outcome = episode.finish();
    for event in outcome.events.iter().filter(|event| event.kind() == Kind::Collision && !event.netted) {
        match event.contact() {
            _ if event.at_fault => count.at_fault += 1,
            Contact::Rear | Contact::Standing => count.from_behind += 1,
            _ => count.other_contacts += 1,
        }
    }
    Some((outcome, count))
}

/// Drives all of `scenes`, prints who overlapped and the sums, and says the sums.
pub fn drive_all(scenes: &[Arc<Scene>], who: Who, av: Av) -> Count {
    let mut all = Count::default();
    for scene in scenes {
        let Some((_, count)) = drive(scene, &TrafficSettings::default(), who, av) else { continue };
        for told in count.overlapping.values() {
            println!("    {} {who}: {told}", scene.id());
        }
        all.add(&count);
    }
    println!("{who:10} {av:?}: {}", all.line());
    all
}

/// From where the log would have it that goes on with the speed and turn that it had.
fn jumps(jumps: &mut [f64; 3], log: &[Option<AgentState>], now: usize, next: &AgentState) {
    let here = log[now].unwrap();
    let turn = now
        .checked_sub(1)
        .and_then(|before| log[before])
        .map_or(0.0, |before| angle_difference(before.heading, here.heading));
    let expected = here.position() + here.velocity() * STEP_SECONDS;
    let told = [
        expected.distance(next.position()),
        angle_difference(here.heading + turn, next.heading)
            .abs()
            .min(angle_difference(here.heading, next.heading).abs()),
        (next.speed() - here.speed()).abs(),
    ];
    for (jump, told) in jumps.iter_mut().zip(told) {
        *jump = jump.max(told);
    }
}

/// Whether an agent's front crosses the line of a lane of its way that has been red for 4 s, in this step.
fn runs_red(scene: &Scene, now: usize, step: u32, agent: &Taken, next: &BTreeMap<TrackId, AgentState>) -> bool {
    const SECONDS_4: usize = 40;
    let Some(next) = next.get(&agent.track) else { return false };
    if now < SECONDS_4 || step < agent.since_step + SECONDS_4 as u32 {
        return false;
    }
    let front = |state: &AgentState| {
        let front: Point = state.oriented_box().front();
        // Looked for all along the way: a way may come by twice.
        let away = |sample: &(usize, &Point)| sample.1.distance_squared(front);
        let nearest = agent.way.points().iter().enumerate().min_by(|a, b| away(a).total_cmp(&away(b)));
        agent.way.follow(front, nearest.map_or(0, |(sample, _)| sample))
    };
    let (from, to) = (front(&agent.state), front(next));
    scene.signals(now).iter().any(|signal| {
        let Some(stretch) = agent.way.lanes().iter().find(|stretch| stretch.lane == Some(signal.lane)) else {
            return false;
        };
        let line = agent.way.follow(signal.stop_point.xy(), agent.way.sample_at(stretch.from));
        let crosses = from.station < line.station && line.station <= to.station;
        let is_on = from.lateral.abs() < 2.0 && line.lateral.abs() < 3.0 && (line.station - stretch.from).abs() < 9.0;
        let has_been_red = (now - SECONDS_4..=now)
            .all(|step| scene.signals(step).iter().any(|other| other.lane == signal.lane && other.state.is_red()));
        crosses && is_on && has_been_red
    })
}

fn overlaps(count: &mut Count, episode: &Episode, entangled: &BTreeSet<(i32, i32)>) {
    let since = |agent: &ObservedAgent| {
        episode.taken().iter().find(|taken| taken.track == agent.track).map(|taken| taken.since_step)
    };
    let observation = episode.observe();
    let agents: Vec<_> = observation.agents.iter().filter(|agent| agent.unseen == 0).collect();
    for (index, one) in agents.iter().enumerate() {
        for other in &agents[index + 1..] {
            let pair = (one.track.0.min(other.track.0), one.track.0.max(other.track.0));
            if (since(one).is_some() || since(other).is_some())
                && !entangled.contains(&pair)
                && (one.state.z - other.state.z).abs() < 3.0
                && one.state.position().distance_squared(other.state.position()) < 900.0
                && boxes_overlap(&one.state.oriented_box(), &other.state.oriented_box())
            {
                count.overlaps += 1;
                let told = |agent: &ObservedAgent| {
                    let since = since(agent).map_or("replayed".to_owned(), |step| format!("reacts since step {step}"));
                    format!("{} {} ({since}, {:.1} m/s)", agent.kind, agent.track, agent.state.speed())
                };
                let Pose { x, y, heading } = one.state.pose().pose_to_body(other.state.pose());
                count.overlapping.entry(pair).or_insert_with(|| {
                    let (step, one, other) = (observation.step, told(one), told(other));
                    format!("step {step}: {one} overlaps {other} at {x:.1} m, {y:.1} m, {heading:.2} rad")
                });
            }
        }
    }
}
