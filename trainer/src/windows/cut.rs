//! The windows of a scene.

use std::collections::BTreeMap;

use network::constants::{HISTORY, STEPS};
use network::features::{self, SceneFeatures};
use world::map_matching::LanePoints;
use world::route::RouteError;
use world::scene::{AgentKind, Scene, Track};

use super::future::future;
use super::line::Lines;
use super::recipe::Recipe;
use super::window::{Sketch, Window};

/// The first step that is now in a window: the authors begin a step later than they need to (`training.md` 5, 8).
const FIRST: usize = HISTORY;

/// Another vehicle gets at least so far (m) from where it was in its window; who stands teaches no driving.
const MOVES: f64 = 5.0;

/// Another vehicle stays so near (m) to its own line, as the paper's simulator asks of the AV: who drives where the map has no lanes is
/// matched to a street far away, and would teach to leave it.
const NEAR_LINE: f64 = 5.0;

/// What a scene gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// The windows: those of the AV by their step, then those of the other vehicles by their tracks' order.
    pub windows: Vec<Window>,
    /// How many there would have been more, by the reason why not.
    pub skipped: BTreeMap<&'static str, u32>,
}

/// Cuts a scene: windows of two seconds before and five after a step, from step 20 on (`training.md` 1).
#[must_use]
pub fn cut(scene: &Scene, recipe: &Recipe) -> Cut {
    let mut cut = Cut::default();
    if steps(scene, recipe).next().is_none() {
        cut.skip("the scene is shorter than 7.1 s", 1);
        return cut;
    }
    let ground = Ground {
        features: SceneFeatures::new(scene.map(), recipe.features.into()),
        lanes: LanePoints::new(scene.map(), |_| true),
        recipe,
    };
    let all: Vec<usize> = steps(scene, recipe).collect();
    ground.drive(scene, &all, false, &mut cut);
    if recipe.others {
        for (index, track) in scene.tracks().iter().enumerate() {
            let moving: Vec<usize> = all.iter().copied().filter(|step| drives(track, *step)).collect();
            if index == scene.av_index() || track.kind != AgentKind::Vehicle || moving.is_empty() {
                continue;
            }
            match with_av(scene, index) {
                Some(scene) => ground.drive(&scene, &moving, true, &mut cut),
                None => cut.skip("the scene cannot be seen from another vehicle", moving.len()),
            }
        }
    }
    cut
}

/// The steps that are now in some window.
fn steps(scene: &Scene, recipe: &Recipe) -> impl Iterator<Item = usize> {
    (FIRST..scene.steps().saturating_sub(STEPS)).step_by(recipe.stride.max(1) as usize)
}

/// Whether a vehicle is seen throughout the window of `step`, and moves in it.
fn drives(track: &Track, step: usize) -> bool {
    let Some(states) = track.states.get(step + 1 - HISTORY..=step + STEPS) else { return false };
    let (Some(Some(first)), true) = (states.first(), states.iter().all(Option::is_some)) else { return false };
    let has_size = first.length > 0.0 && first.height > 0.0;
    has_size && states.iter().flatten().any(|state| state.position().distance(first.position()) >= MOVES)
}

/// Whether who drives is near its line now and after.
fn keeps_to_line(window: &Window) -> bool {
    let places = std::iter::once([0.0; 5]).chain(window.future[0]);
    places.into_iter().all(|[x, y, ..]| {
        window.line.iter().any(|row| {
            let (dx, dy) = (f64::from(row[0] - x), f64::from(row[1] - y));
            dx * dx + dy * dy <= NEAR_LINE * NEAR_LINE
        })
    })
}

/// The scene with another track as its AV.
fn with_av(scene: &Scene, index: usize) -> Option<Scene> {
    let mut parts = scene.clone().into_parts();
    parts.av_index = index;
    parts.check().ok().map(|(scene, _)| scene)
}

/// What is made of a scene's map once, whoever drives.
struct Ground<'a> {
    features: SceneFeatures,
    lanes: LanePoints,
    recipe: &'a Recipe,
}

impl Ground<'_> {
    /// The windows of the scene's AV at `steps`; `is_other` says that it is another vehicle in truth.
    fn drive(&self, scene: &Scene, steps: &[usize], is_other: bool, cut: &mut Cut) {
        let lines = match Lines::new(scene) {
            Ok(lines) => lines,
            Err(error) => return cut.skip(reason(&error), steps.len()),
        };
        for step in steps {
            match self.window(scene, &lines, *step) {
                Ok(window) if is_other && !keeps_to_line(&window) => {
                    cut.skip("another vehicle is farther than 5 m from its line", 1)
                }
                Ok(window) => cut.windows.push(window),
                Err(reason) => cut.skip(reason, 1),
            }
        }
    }

    fn window(&self, scene: &Scene, lines: &Lines, step: usize) -> Result<Window, &'static str> {
        let whose = self.recipe.features;
        let known = features::Window::logged(scene, step).ok_or("the AV is not seen at the step")?;
        let line = lines.at(scene, &self.lanes, (step, &known.av), whose).map_err(|error| reason(&error))?;
        let features = self.features.at(&known);
        let (future, seen) = future(scene, step, known.av.pose(), &features.tracks, whose);
        let window = Window {
            scene: scene.id().to_string(),
            step: step as u32,
            av: scene.av().id.0,
            sketch: Sketch::of(&features.frame),
            line,
            future,
            seen,
        };
        if window.is_finite() { Ok(window) } else { Err("a number of it is none") }
    }
}

impl Cut {
    fn skip(&mut self, reason: &'static str, windows: usize) {
        *self.skipped.entry(reason).or_default() += windows as u32;
    }
}

/// Without the numbers, so that what failed alike counts together.
fn reason(error: &RouteError) -> &'static str {
    match error {
        RouteError::NoLane { .. } => "no route: no lane within 10 degrees of the AV's heading",
        RouteError::NothingBehind => "no route: no lane point lies behind the AV's first pose",
        RouteError::TooShort => "no route: it is shorter than two samples",
        RouteError::TooLong { .. } => "no route: it is too long, for the log or the map jumps",
    }
}
