//! What a node is asked, always the same: observations of scenes that `idm` drives, whatever the node answers.

use std::sync::Arc;
use std::time::Duration;

use episode::protocol::Protocol;
use episode::{Episode, Undrivable};
use planner_node::Idm;
use scenarios::generated::{Family, GeneratedError, Parameters};
use scenarios::womd;
use thiserror::Error;
use wire::hub::{HereLine, Line, LineError, Minds};
use wire::proto::EpisodeEnd;
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::Plan;
use world::scene::{Scene, SceneId, TrackId};

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
    /// How it ends.
    pub end: EpisodeEnd,
}

impl Course {
    /// The built-in courses.
    ///
    /// # Errors
    /// [`CourseError`]; never with the generator of this build, as a test shows.
    pub fn built_in() -> Result<Vec<Self>, CourseError> {
        FAMILIES.iter().map(|name| Self::of(Arc::new(generated(name)?))).collect()
    }

    /// The course through a scene.
    ///
    /// # Errors
    /// [`CourseError::Scene`] where it cannot be driven.
    pub fn of(scene: Arc<Scene>) -> Result<Self, CourseError> {
        let failed =
            |what: &dyn std::fmt::Display| CourseError::Scene { scene: scene.id().to_string(), what: what.to_string() };
        let mut episode =
            Episode::new(Arc::clone(&scene), &Protocol::default()).map_err(|error: Undrivable| failed(&error))?;
        let briefing = episode.briefing();
        let mut line = HereLine::new(&Minds { planner: Arc::new(Idm), predictor: None, traffic: None }, None);
        line.announce(&briefing).map_err(|error: LineError| failed(&error))?;
        let mut steps = Vec::new();
        while steps.len() < STEPS && episode.ended().is_none() {
            let observation = episode.observe();
            let (plan, _) = line.step(&observation, Duration::ZERO).map_err(|error| failed(&error))?;
            let plan = plan.check(observation.step).map_err(|error| failed(&error))?;
            episode.advance(&plan);
            steps.push((observation, plan));
        }
        Ok(Self { name: scene.id().to_string(), briefing, steps, end: episode.finish().end })
    }

    /// The first `steps` of it.
    #[must_use]
    pub fn cut(&self, steps: usize) -> Self {
        Self { steps: self.steps.iter().take(steps).cloned().collect(), ..self.clone() }
    }

    /// Scenes that are rare, made of this one.
    #[must_use]
    pub fn odd(&self) -> Vec<Self> {
        vec![
            self.with_agents("nobody-there", |_, _| Vec::new()),
            self.with_agents("a-crowd", |_, agents| crowd(agents)),
            self.with_agents("they-come-and-go", |at, agents| {
                agents.iter().filter(|agent| (agent.track.0 as usize + at).is_multiple_of(3)).copied().collect()
            }),
            self.standing(),
        ]
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
    use super::*;

    #[test]
    fn built_in_courses_are_driven_whole_and_are_the_same_each_time() {
        let courses = Course::built_in().unwrap();
        assert_eq!(courses.len(), FAMILIES.len());
        for (course, again) in courses.iter().zip(Course::built_in().unwrap()) {
            assert_eq!(course.steps.len(), STEPS, "{}", course.name);
            assert!(course.steps.iter().any(|(observation, _)| !observation.agents.is_empty()), "{}", course.name);
            assert_eq!(course.steps, again.steps);
        }
    }

    #[test]
    fn odd_scenes_are_odd() {
        let course = &Course::built_in().unwrap()[0];
        let [nobody, crowd, flicker, standing] = &course.odd()[..] else { panic!() };
        assert!(nobody.steps.iter().all(|(observation, _)| observation.agents.is_empty()));
        assert!(crowd.steps.iter().all(|(observation, _)| observation.agents.len() >= CROWD as usize));
        let seen = |at: usize| flicker.steps[at].0.agents.len();
        assert!((0..3).any(|at| seen(at) < course.steps[at].0.agents.len()));
        assert!(standing.steps.iter().all(|(observation, _)| observation.av.speed() == 0.0));
        assert!(course.odd().iter().all(|odd| odd.briefing.scene.as_str() == odd.name && odd.end.scene == odd.name));
    }
}
