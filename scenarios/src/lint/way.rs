//! Where the logged AV goes, and would go next.

use world::geometry::{Point, Point3, PointGrid};
use world::reference_line::SAMPLE_SPACING;
use world::route::Route;
use world::scene::Scene;

/// What is higher or lower (m) is on another level of the road.
const STOREY: f64 = 4.0;

/// Places of the way are this far apart (m): one that stands has one.
const SPACING: f64 = 1.0;

/// Where the log ends, the way goes on along the route for this far (m): who stands before a standing AV is in its way.
const AHEAD: f64 = 50.0;

/// Who comes within this distance (m) of the way with its centre is in it: half a lane and a little more.
pub(super) const IN_THE_WAY: f64 = 2.5;

/// The places of the logged AV, and of its route ahead.
pub(super) struct Way {
    grid: PointGrid,
    /// The last step at which it is at each; ahead of the last of all, the log's last step.
    steps: Vec<usize>,
    heights: Vec<f64>,
}

impl Way {
    pub(super) fn of(scene: &Scene, route: Option<&Route>) -> Self {
        let (mut points, mut steps, mut heights) = (Vec::<Point>::new(), Vec::new(), Vec::new());
        for (step, state) in scene.av().states.iter().enumerate() {
            let Some(state) = state else { continue };
            match (points.last(), steps.last_mut()) {
                (Some(last), Some(until)) if last.distance(state.position()) < SPACING => *until = step,
                _ => {
                    points.push(state.position());
                    steps.push(step);
                    heights.push(state.z);
                }
            }
        }
        if let (Some(route), Some(last)) = (route, points.last()) {
            let (line, every) = (&route.line, (SPACING / SAMPLE_SPACING) as usize);
            let next = route.nearest_sample(*last).0 + every;
            for sample in (next..line.len()).step_by(every).take((AHEAD / SPACING) as usize) {
                points.push(line.point(sample));
                steps.push(scene.steps() - 1);
                heights.push(line.z[sample]);
            }
        }
        Self { grid: PointGrid::new(points, 10.0), steps, heights }
    }

    /// Whether `point` is in the way of the AV at `from` or later; `beside` (m) is how far from it that goes.
    pub(super) fn holds(&self, point: Point3, beside: f64, from: usize) -> bool {
        let counts = |index: usize| self.steps[index] >= from && (self.heights[index] - point.z).abs() <= STOREY;
        self.grid.nearest_where(point.xy(), beside, counts).is_some()
    }
}
