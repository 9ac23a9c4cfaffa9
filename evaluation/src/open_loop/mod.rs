//! Open loop: at a frame of the log a plan is asked for and never driven; it is held against what the log says of the next five seconds
//! (the paper's Table I). `docs/open-loop.md` has every definition.
//!
//! ```text
//! Scene, frame ──▶ Moment ──▶ briefing, observation ──▶ driver ──▶ plan, prediction ──▶ Moment::judge ──▶ Row ──▶ file, table
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`authors`] | the definitions of the authors' test code, quirk for quirk |
//! | `strict` | the mended ones: the judges of the protocol `strict`, and errors over the steps that the log has |
//! | [`row`] | what a frame was worth, and the file of all frames |
//! | [`table`] | a line a driver, and the human's |

pub mod authors;
pub mod row;
mod strict;
pub mod table;

use std::sync::Arc;

use clap::ValueEnum;
use episode::protocol::{Protocol, StrictSettings};
use episode::{Episode, Undrivable};
use world::geometry::Pose;
use world::observation::{Briefing, Observation};
use world::plan::{PLAN_STEPS, Plan, PlanState, Prediction};
use world::scene::Scene;

use self::row::{Figures, PredictionFigures, Row};

/// The first frame: two seconds of history are before it.
pub const FIRST: usize = 20;

/// Steps from one frame to the next: a second.
pub const STRIDE: usize = 10;

/// By whose definitions plans are judged. The drivers are asked under the protocol that goes with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Definitions {
    /// What an evaluator should believe
    #[default]
    Strict,
    /// Those of the DIPP paper's test code, quirk for quirk
    Authors,
}

impl Definitions {
    /// Its name in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Authors => "authors",
        }
    }

    /// The protocol under which drivers are asked.
    #[must_use]
    pub fn protocol(self) -> Protocol {
        match self {
            Self::Strict => Protocol::Strict(StrictSettings::default()),
            Self::Authors => Protocol::Paper,
        }
    }
}

/// The frames of a log of so many steps: each has two seconds before it and more than five after it.
pub fn frames(steps: usize) -> impl Iterator<Item = u32> {
    (FIRST..steps.saturating_sub(PLAN_STEPS)).step_by(STRIDE).map(|frame| frame as u32)
}

/// A frame of a log, at which plans are asked for and judged.
#[derive(Clone, Debug)]
pub struct Moment {
    scene: Arc<Scene>,
    frame: u32,
    episode: Episode,
}

impl Moment {
    /// The moment of `scene` at log index `frame`.
    ///
    /// # Errors
    /// [`Undrivable`] where no plan can be asked for: the AV is not there, or no route leads on.
    pub fn new(scene: &Arc<Scene>, definitions: Definitions, frame: u32) -> Result<Self, Undrivable> {
        let episode = Episode::of_frame(Arc::clone(scene), &definitions.protocol(), frame)?;
        Ok(Self { scene: Arc::clone(scene), frame, episode })
    }

    /// What a driver is told first.
    #[must_use]
    pub fn briefing(&self) -> Briefing {
        self.episode.briefing()
    }

    /// What there is to be seen. It is step 0 of an episode: as in the authors' test, states are the logged ones.
    #[must_use]
    pub fn observation(&self) -> Observation {
        self.episode.observe()
    }

    /// What a plan, and the prediction beside it, are worth.
    #[must_use]
    pub fn judge(&self, plan: &Plan, prediction: Option<&Prediction>) -> Row {
        let judged = self.judge_as_authors(plan, prediction).map(Judged::from);
        let judged = judged.unwrap_or_else(|| {
            strict::judge(&self.scene, &self.episode, self.frame as usize, &self.observation(), plan, prediction)
        });
        let diagnostics = plan.diagnostics();
        let searched = !diagnostics.objective.is_empty();
        Row {
            plan: judged.plan,
            human: judged.human,
            position_errors: judged.position_errors,
            prediction: judged.prediction,
            mode: prediction.and_then(mode),
            iterations: searched.then_some(diagnostics.iterations),
            objective: searched.then(|| diagnostics.objective.iter().map(|(_, value)| value).sum()),
            ..Row::of(self.scene.id().as_str(), self.frame)
        }
    }

    /// The authors' figures, unrounded by a row's flags; none by other definitions.
    #[must_use]
    pub fn judge_as_authors(&self, plan: &Plan, prediction: Option<&Prediction>) -> Option<authors::OpenLoop> {
        let sight = self.episode.paper_sight()?;
        let av = self.observation().av;
        Some(authors::judge(&self.scene, self.frame as usize, &av, sight, plan, prediction))
    }

    /// The row of a driver that has no plan, for `reason`: of the human alone something is told.
    #[must_use]
    pub fn without_plan(&self, reason: String) -> Row {
        // The plan of one who stays: only what is said of the human is taken.
        let av = self.observation().av;
        let stay = PlanState { x: av.x, y: av.y, heading: av.heading, speed: 0.0 };
        let plan = world::plan::UncheckedPlan { states: vec![stay; PLAN_STEPS], ..Default::default() }.check(0);
        let human = plan.map(|plan| self.judge(&plan, None).human).unwrap_or_default();
        Row { failure: reason, human, ..Row::of(self.scene.id().as_str(), self.frame) }
    }
}

/// What the definitions say.
struct Judged {
    plan: Figures,
    human: Figures,
    position_errors: [Option<f64>; 3],
    prediction: Option<PredictionFigures>,
}

impl From<authors::OpenLoop> for Judged {
    fn from(found: authors::OpenLoop) -> Self {
        Self {
            plan: Figures {
                collision: Some(found.collision()),
                red_light: Some(found.red_light),
                off_route: Some(found.off_route()),
                comfort: found.comfort,
                ..Figures::default()
            },
            human: Figures { comfort: found.human_comfort, ..Figures::default() },
            position_errors: found.position_errors.map(Some),
            prediction: found.prediction.map(|errors| PredictionFigures {
                agents: errors.agents,
                average: errors.average,
                last: Some(errors.last),
                last_agents: errors.agents,
                ..PredictionFigures::default()
            }),
        }
    }
}

/// The place of the likeliest future, the first of equals.
fn mode(prediction: &Prediction) -> Option<u32> {
    let likeliest = prediction.most_likely()?;
    let place = prediction.futures().iter().position(|future| std::ptr::eq(future, likeliest))?;
    Some(place as u32)
}

fn pose_of(state: &PlanState) -> Pose {
    Pose::new(state.x, state.y, state.heading)
}
