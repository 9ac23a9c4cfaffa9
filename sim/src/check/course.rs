//! What a node is asked, always the same: observations of scenes that `idm` drives, whatever the node answers.
//!
//! Of traffic too the AV's drive is always the same, and who is taken over when. But an agent is where the node's last answer has put it, or a node
//! that remembers where everybody is would see them jump.

use std::sync::Arc;
use std::time::Duration;

use episode::protocol::{EndingCollision, Protocol, StrictSettings};
use episode::traffic::{Pedestrians, TrafficSettings};
use episode::{Episode, Undrivable};
use planner_node::Idm;
use scenarios::generated::{Family, GeneratedError, Parameters};
use scenarios::womd;
use thiserror::Error;
use traffic_node::{Cast, Characters};
use wire::hub::{HereLine, Line, LineError, Minds};
use wire::keys::Role;
use wire::proto::EpisodeEnd;
use world::geometry::Point3;
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::Plan;
use world::scene::{Scene, SceneId, TrackId};
use world::traffic::{Taken, Way};

use super::answers::Answer;

/// Steps of a course: as far as anything is to be seen of how a node drives, and short enough to be driven a dozen times.
const STEPS: usize = 50;

/// The kinds of scenes: with someone ahead, round a bend, at a light, where people walk.
const FAMILIES: [&str; 4] = ["following", "curve", "red-light", "crosswalk"];

/// The seed of the built-in scenes.
const SEED: u64 = 11;

/// Agents of a crowd.
const CROWD: u32 = 250;

/// A course that cannot be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum CourseError {
    #[error("there is no family {0}")]
    Family(&'static str),
    #[error(transparent)]
    Generated(#[from] GeneratedError),
    #[error("scene {scene}: {what}")]
    Scene { scene: String, what: String },
}

/// A scene's observations, and the plans that are driven between them.
#[derive(Clone, Debug)]
pub struct Course {
    /// What it is called.
    pub name: String,
    /// What is told first.
    pub briefing: Briefing,
    /// What is observed, and what is driven then.
    pub steps: Vec<(Observation, Plan)>,
    /// Who is taken over from the log at each step, for traffic; and where they were among traffic of ours.
    pub taken: Vec<Vec<Taken>>,
    /// How it ends.
    pub end: EpisodeEnd,
}

impl Course {
    /// The built-in courses for nodes of a role.
    ///
    /// # Errors
    /// [`CourseError`]; never with the generator of this build, as a test shows.
    pub fn built_in(role: Role) -> Result<Vec<Self>, CourseError> {
        FAMILIES.iter().map(|name| Self::of(Arc::new(generated(name)?), role)).collect()
    }

    /// The course through a scene, for nodes of a role.
    ///
    /// # Errors
    /// [`CourseError::Scene`] where it cannot be driven.
    pub fn of(scene: Arc<Scene>, role: Role) -> Result<Self, CourseError> {
        let failed =
            |what: &dyn std::fmt::Display| CourseError::Scene { scene: scene.id().to_string(), what: what.to_string() };
        let drivable = |protocol: &Protocol| {
            Episode::new(Arc::clone(&scene), protocol).map_err(|error: Undrivable| failed(&error))
        };
        let mut minds = Minds { planner: Arc::new(Idm), predictor: None, traffic: None };
        let mut episode = if role == Role::Traffic {
            minds.traffic = Some(Arc::new(Characters { cast: Cast::Idm, seed: 0 }));
            // Nobody's collision is to end what is asked.
            let protocol = StrictSettings { ending_collision: EndingCollision::None, ..StrictSettings::default() };
            drivable(&Protocol::Strict(protocol))?.with_traffic(&many()).map_err(|error| failed(&error))?
        } else {
            drivable(&Protocol::default())?
        };
        let briefing = episode.briefing();
        let mut line = HereLine::new(&minds, None);
        line.announce(&briefing).map_err(|error: LineError| failed(&error))?;
        let (mut steps, mut all_taken) = (Vec::new(), Vec::new());
        while steps.len() < STEPS && episode.ended().is_none() {
            let observation = episode.observe();
            if episode.reacts() {
                let taken = episode.taken().to_vec();
                let moves = line.moves(&observation, &taken, Duration::ZERO).map_err(|error| failed(&error))?;
                episode.move_traffic(moves).map_err(|error| failed(&error))?;
                all_taken.push(taken);
            }
            let (plan, _) = line.step(&observation, Duration::ZERO).map_err(|error| failed(&error))?;
            let plan = plan.check(observation.step).map_err(|error| failed(&error))?;
            episode.advance(&plan);
            steps.push((observation, plan));
        }
        Ok(Self { name: scene.id().to_string(), briefing, steps, taken: all_taken, end: episode.finish().end })
    }

    /// What traffic is told at a step: what is seen and who is taken over, each where the last answer has put it.
    #[must_use]
    pub fn reacting(&self, at: usize, last: Option<&Answer>) -> Option<(Observation, Vec<Taken>)> {
        let mut observation = self.steps.get(at)?.0.clone();
        let mut taken = self.taken.get(at)?.clone();
        let moves = if let Some(Answer::Moves(moves)) = last { moves.moves() } else { &[] };
        for agent in &mut taken {
            let moved = moves.iter().find(|moved| moved.track == agent.track);
            if let Some(moved) = moved.filter(|_| agent.since_step < observation.step) {
                agent.state = moved.state;
            }
            let seen = observation.agents.iter_mut().find(|seen| seen.track == agent.track);
            seen.into_iter().for_each(|seen| seen.state = agent.state);
        }
        Some((observation, taken))
    }

    /// The first `steps` of it.
    #[must_use]
    pub fn cut(&self, steps: usize) -> Self {
        Self { steps: self.steps.iter().take(steps).cloned().collect(), ..self.clone() }
    }

    /// Scenes that are rare, made of this one.
    #[must_use]
    pub fn odd(&self) -> Vec<Self> {
        let mut nobody = self.with_agents("nobody-there", |_, _| Vec::new());
        nobody.taken.iter_mut().for_each(Vec::clear);
        // Who is taken over stays so: those who come and go are others.
        let is_taken = |agent: &ObservedAgent| self.taken.iter().flatten().any(|taken| taken.track == agent.track);
        let comes_and_goes = |at: usize, agent: &ObservedAgent| (agent.track.0 as usize + at).is_multiple_of(3);
        vec![
            nobody,
            if self.taken.is_empty() {
                self.with_agents("a-crowd", |_, agents| crowd(agents))
            } else {
                self.reacting_crowd()
            },
            self.with_agents("they-come-and-go", |at, agents| {
                agents.iter().filter(|agent| is_taken(agent) || comes_and_goes(at, agent)).copied().collect()
            }),
            self.standing(),
        ]
    }

    /// As many as make a crowd are taken over at once: each as one who is, further off.
    fn reacting_crowd(&self) -> Self {
        let mut course = self.named("a-crowd");
        let mut tracks: Vec<TrackId> = self.taken.iter().flatten().map(|taken| taken.track).collect();
        tracks.sort_unstable();
        tracks.dedup();
        let observed = self.steps.iter().flat_map(|(observation, _)| &observation.agents);
        let last = observed.map(|agent| agent.track.0).max().unwrap_or(0);
        let copies = if tracks.is_empty() { 0 } else { CROWD.div_ceil(tracks.len() as u32) };
        for (taken, (observation, _)) in course.taken.iter_mut().zip(&mut course.steps) {
            for agent in taken.clone() {
                let Ok(place) = tracks.binary_search(&agent.track) else { continue };
                for copy in 1..=copies {
                    let number = copy as usize * tracks.len() + place + 1;
                    let track = TrackId(last.saturating_add(i32::try_from(number).unwrap_or(i32::MAX)));
                    let aside = 5.0 * f64::from(copy);
                    let mut state = agent.state;
                    state.y += aside;
                    let Some(way) = beside(&agent.way, aside) else { continue };
                    observation.agents.push(ObservedAgent { track, kind: agent.kind, state, unseen: 0 });
                    taken.push(Taken { track, state, way: Arc::new(way), ..agent.clone() });
                }
            }
        }
        course
    }

    /// The same with other agents: at each step those that `change` makes of them.
    fn with_agents(&self, name: &str, change: impl Fn(usize, &[ObservedAgent]) -> Vec<ObservedAgent>) -> Self {
        let mut course = self.named(name);
        for (at, step) in course.briefing.history.iter_mut().enumerate() {
            step.agents = change(at, &step.agents);
        }
        for (at, (observation, _)) in course.steps.iter_mut().enumerate() {
            observation.agents = change(at, &observation.agents);
        }
        course
    }

    /// The AV stands where it began, and so do its wheels.
    fn standing(&self) -> Self {
        let mut course = self.named("it-stands");
        let Some(first) = course.steps.first().map(|(observation, _)| observation.clone()) else { return course };
        let mut still = first.av;
        (still.velocity_x, still.velocity_y) = (0.0, 0.0);
        course.briefing.history.iter_mut().for_each(|step| step.av = still);
        for (observation, _) in &mut course.steps {
            observation.av = still;
            observation.control = Default::default();
            observation.window = first.window.clone();
        }
        course
    }

    fn named(&self, name: &str) -> Self {
        let mut course = self.clone();
        name.clone_into(&mut course.name);
        if let Ok(scene) = SceneId::new(name) {
            course.briefing.scene = scene;
        }
        course.end.scene = name.to_owned();
        course
    }
}

/// As many are taken over as can be: the AV counts as one that has left the log from its first step on.
fn many() -> TrafficSettings {
    TrafficSettings { left_log: 0.0, pedestrians: Pedestrians::Stop, ..TrafficSettings::default() }
}

/// The same way so far (m) along y.
fn beside(way: &Way, aside: f64) -> Option<Way> {
    let samples: Vec<Point3> = way.samples().iter().map(|at| Point3::new(at.x, at.y + aside, at.z)).collect();
    Way::new(&samples, way.lanes().to_vec())
}

fn generated(name: &'static str) -> Result<Scene, CourseError> {
    let family = Family::named(name).ok_or(CourseError::Family(name))?;
    let id = format!("check-{name}");
    let payload = family.payload(&id, SEED, 0, &Parameters::default())?;
    let (scene, _) = womd::read(&payload).map_err(|error| CourseError::Scene { scene: id, what: error.to_string() })?;
    Ok(scene)
}

/// These agents, and as many more behind each other as make a crowd: each as one of them, further off.
fn crowd(agents: &[ObservedAgent]) -> Vec<ObservedAgent> {
    let mut crowd = agents.to_vec();
    let last = agents.iter().map(|agent| agent.track.0).max().unwrap_or(0);
    let copies = agents.iter().cycle().take(agents.len().min(1) * CROWD as usize);
    for (number, agent) in (1..).zip(copies) {
        let mut copy = *agent;
        copy.track = TrackId(last.saturating_add(number));
        copy.state.y += 5.0 * f64::from(number);
        crowd.push(copy);
    }
    crowd
}

#[cfg(test)]
mod tests {
    use world::traffic::{TrafficMove, UncheckedMoves};

    use super::*;

    #[test]
    fn built_in_courses_are_driven_whole_and_are_the_same_each_time() {
        for role in [Role::Planner, Role::Traffic] {
            let courses = Course::built_in(role).unwrap();
            assert_eq!(courses.len(), FAMILIES.len());
            for (course, again) in courses.iter().zip(Course::built_in(role).unwrap()) {
                assert_eq!(course.steps.len(), STEPS, "{}", course.name);
                assert!(course.steps.iter().any(|(observation, _)| !observation.agents.is_empty()), "{}", course.name);
                assert_eq!((&course.steps, &course.taken), (&again.steps, &again.taken));
                let taken = course.taken.iter().filter(|taken| !taken.is_empty()).count();
                assert!(if role == Role::Traffic { taken > STEPS / 2 } else { taken == 0 }, "{}: {taken}", course.name);
            }
        }
    }

    #[test]
    fn agents_that_react_are_where_the_last_answer_has_put_them() {
        let course = &Course::built_in(Role::Traffic).unwrap()[0];
        let at = course.taken.windows(2).position(|pair| !pair[0].is_empty() && !pair[1].is_empty()).unwrap();
        let (observation, taken) = course.reacting(at, None).unwrap();
        let straight_on = |agent: &Taken| {
            let mut state = agent.state;
            (state.x, state.y) = (state.x + 0.1 * state.velocity_x, state.y + 0.1 * state.velocity_y);
            TrafficMove { track: agent.track, state }
        };
        let moves = UncheckedMoves { step: observation.step, moves: taken.iter().map(straight_on).collect() };
        let moves = moves.check(observation.step, &taken).unwrap();
        let moved = moves.moves()[0];
        let (seen, next) = course.reacting(at + 1, Some(&Answer::Moves(moves))).unwrap();
        let agent = next.iter().find(|agent| agent.track == moved.track).unwrap();
        assert_eq!(agent.state, moved.state);
        assert_eq!(seen.agents.iter().find(|seen| seen.track == moved.track).unwrap().state, moved.state);
    }

    #[test]
    fn odd_scenes_of_traffic_are_odd() {
        let course = &Course::built_in(Role::Traffic).unwrap()[0];
        let [nobody, crowd, flicker, _] = &course.odd()[..] else { panic!() };
        assert!(nobody.taken.len() == STEPS && nobody.taken.iter().all(Vec::is_empty));
        let last = crowd.taken.last().unwrap();
        assert!(last.len() >= CROWD as usize / 2, "{}", last.len());
        let mut tracks: Vec<TrackId> = last.iter().map(|taken| taken.track).collect();
        tracks.sort_unstable();
        tracks.dedup();
        assert_eq!(tracks.len(), last.len());
        assert_eq!(flicker.taken, course.taken);
    }

    #[test]
    fn odd_scenes_are_odd() {
        let course = &Course::built_in(Role::Planner).unwrap()[0];
        let [nobody, crowd, flicker, standing] = &course.odd()[..] else { panic!() };
        assert!(nobody.steps.iter().all(|(observation, _)| observation.agents.is_empty()));
        assert!(crowd.steps.iter().all(|(observation, _)| observation.agents.len() >= CROWD as usize));
        let seen = |at: usize| flicker.steps[at].0.agents.len();
        assert!((0..3).any(|at| seen(at) < course.steps[at].0.agents.len()));
        assert!(standing.steps.iter().all(|(observation, _)| observation.av.speed() == 0.0));
        assert!(course.odd().iter().all(|odd| odd.briefing.scene.as_str() == odd.name && odd.end.scene == odd.name));
    }
}
