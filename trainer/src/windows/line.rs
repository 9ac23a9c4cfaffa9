//! The reference line of a step: the authors' route along the whole log, and the 1,200 samples of it around the AV, in the AV's frame
//! (`planner.md` 1, `closed-loop.md` 4).

use world::authors_frame;
use world::map::USUAL_SPEED_LIMIT_MPH;
use world::map_matching::LanePoints;
use world::reference_line::WINDOW_SAMPLES;
use world::route::{Route, RouteError, RouteStyle};
use world::scene::{AgentState, Scene};

use super::recipe::Whose;

/// The authors' metres a second of a mile an hour, upside down.
const MPH_PER_METER_PER_SECOND: f64 = 2.237;

/// A scene's route, with what a step looks up.
#[derive(Debug)]
pub(super) struct Lines {
    route: Route,
}

impl Lines {
    /// The route that the scene's AV took.
    ///
    /// # Errors
    /// [`RouteError`] where there is none.
    pub fn new(scene: &Scene) -> Result<Self, RouteError> {
        Ok(Self { route: Route::of_log(scene, RouteStyle::Paper)? })
    }

    /// The samples around `av` at `step`: x, y, heading, curvature, information. Past the line's end its last sample again. `lanes` are
    /// all points of the scene's lanes.
    ///
    /// # Errors
    /// [`RouteError::NoLane`] where no lane is under the AV, whose speed limit is that of the line.
    pub fn at(
        &self,
        scene: &Scene,
        lanes: &LanePoints,
        (step, av): (usize, &AgentState),
        whose: Whose,
    ) -> Result<Vec<[f32; 5]>, RouteError> {
        // Lane numbers must be above 0 in the authors' code: 0 means none.
        let lane = lanes.authors_match(av.pose()).map(|found| &scene.map().lanes[found.lane]);
        let lane = lane.filter(|lane| lane.id.0 > 0).ok_or(RouteError::NoLane { log_index: step })?;
        let (nearest, _) = self.route.nearest_sample(av.position());
        let mut window = self.route.window(nearest, scene.signals(step));
        // To the authors a limit that is not known is 0, which reads as a wish to stand, and behind a crosswalk as red.
        let limit = match whose {
            Whose::Mended if lane.speed_limit_mph <= 0.0 => USUAL_SPEED_LIMIT_MPH,
            _ => lane.speed_limit_mph,
        };
        window.speed_limit = Some(limit / MPH_PER_METER_PER_SECOND);
        let info = window.authors_info();
        let line = &window.line;
        let row = |(nth, info): (usize, &f64)| {
            let at = window.start + nth;
            let sample = line.pose(at);
            let own = match whose {
                Whose::Authors => {
                    let state =
                        AgentState { x: sample.x, y: sample.y, heading: sample.heading, ..AgentState::default() };
                    authors_frame::pose(&state, av.pose())
                }
                Whose::Mended => av.pose().pose_to_body(sample),
            };
            [own.x as f32, own.y as f32, own.heading as f32, line.curvature[at] as f32, *info as f32]
        };
        let mut rows: Vec<[f32; 5]> = info.iter().enumerate().map(row).collect();
        // A route has two samples at least, and the nearest is one of the window.
        let last = rows.last().copied().unwrap_or_default();
        rows.resize(WINDOW_SAMPLES, last);
        Ok(rows)
    }
}
