//! A scene at one of its steps.

use thiserror::Error;
use world::geometry::Pose;
use world::scene::Scene;

/// The step that is shown where none is asked for and the scene names none: where drives begin, so that there is a past to show.
const USUAL_STEP: usize = 19;

/// A scene at one of its steps.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    scene: &'a Scene,
    step: usize,
}

/// A scene has no such step.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("scene {scene} has the steps 0 to {last}, so no step {step}")]
pub struct NoStep {
    /// The scene's name.
    pub scene: String,
    /// What was asked for.
    pub step: usize,
    /// The scene's last step.
    pub last: usize,
}

impl<'a> Moment<'a> {
    /// `scene` at `step`.
    ///
    /// # Errors
    /// [`NoStep`] past the end.
    pub fn new(scene: &'a Scene, step: usize) -> Result<Self, NoStep> {
        if step < scene.steps() {
            return Ok(Self { scene, step });
        }
        Err(NoStep { scene: scene.id().to_string(), step, last: scene.steps() - 1 })
    }

    /// `scene` where its prediction tasks begin, or else where drives begin.
    #[must_use]
    pub fn usual(scene: &'a Scene) -> Self {
        let step = match scene.current_time_index() {
            0 => USUAL_STEP,
            index => index,
        };
        Self { scene, step: step.min(scene.steps() - 1) }
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The step.
    #[must_use]
    pub fn step(&self) -> usize {
        self.step
    }

    /// Time of the step (s), as logged.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.scene.timestamps()[self.step]
    }

    /// Where the AV is; where it is not there at this step, its place at the step that is nearest in time.
    pub(super) fn av_pose(&self) -> Pose {
        let known = self.scene.av().states.iter().enumerate().filter_map(|(step, state)| Some((step, state.as_ref()?)));
        let nearest = known.min_by_key(|(step, _)| step.abs_diff(self.step));
        nearest.map_or_else(Pose::default, |(_, state)| state.pose()) // a checked scene has the AV at some step
    }
}
