//! The paper's open-loop metrics, as its published test code computes them (`dipp/metrics.md`).
//!
//! The quirks are kept, each named where it is. What the authors write as 0 for missing is `None` here.

use episode::judges::discs::Discs;
use episode::metrics::paper::{Comfort, comfort_by_ends};
use episode::paper::Sight;
use world::authors_frame::{self, single};
use world::geometry::{Point, Pose};
use world::plan::{PLAN_STEPS, Plan, Prediction};
use world::scene::{AgentState, Scene};

use super::pose_of;

/// A plan further than this (m) from the reference line is off the route.
pub const OFF_ROUTE: f64 = 5.0;

/// Places of 1, 3 and 5 s in a plan.
const ERRORS_AT: [usize; 3] = [9, 29, 49];

/// What is judged, all in one frame. Row `k` of a plan or future is 0.1 (k + 1) s after the frame.
#[derive(Clone, Copy, Debug)]
pub struct OpenLoopFrame<'a> {
    /// Where the plan puts the AV.
    pub plan: &'a [Pose; PLAN_STEPS],
    /// Where the logged AV was.
    pub human: &'a [Pose; PLAN_STEPS],
    /// The AV's length (m).
    pub length: f64,
    /// The AV's width (m).
    pub width: f64,
    /// The neighbors of the observation: the ten nearest, whatever they are.
    pub neighbors: &'a [LoggedNeighbor<'a>],
    /// The window of the reference line, row by row.
    pub line: &'a [Point],
    /// The authors' fifth column of it: 0 where a red light stops, 1 on a crosswalk, else the speed limit (m/s).
    pub info: &'a [f64],
}

/// A neighbor: its future by the log and by the predictor.
#[derive(Clone, Copy, Debug)]
pub struct LoggedNeighbor<'a> {
    /// Length (m), as it was at the frame.
    pub length: f64,
    /// Width (m), as it was at the frame.
    pub width: f64,
    /// Where the log sees it; `None` where it does not.
    pub logged: &'a [Option<Pose>; PLAN_STEPS],
    /// Where the likeliest prediction puts it; `None` where it is not predicted.
    pub predicted: Option<&'a [Point; PLAN_STEPS]>,
}

/// What a frame was worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoop {
    /// How far the plan is from touching a neighbor of the log, by discs (m); infinite where none is there.
    pub collision_margin: f64,
    /// The plan's greatest distance to the reference line (m).
    pub route_distance: f64,
    /// Whether the plan drives beyond a red stop.
    pub red_light: bool,
    /// How the plan feels. The jump from the present state to its first pose is not seen.
    pub comfort: Comfort,
    /// How the human's drive felt.
    pub human_comfort: Comfort,
    /// Distance between plan and human after 1, 3 and 5 s (m).
    pub position_errors: [f64; 3],
    /// How far off the prediction was; `None` where no neighbor that is predicted was there a step after the frame (the authors write
    /// NaN).
    pub prediction: Option<PredictionErrors>,
}

/// How far off a prediction was, a mean over the neighbors that the log sees a step after the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictionErrors {
    /// How many neighbors those are.
    pub agents: u32,
    /// Average displacement (m). The sum over the steps that the log sees is divided by all fifty: who leaves early looks better.
    pub average: f64,
    /// Final displacement (m); 0 for a neighbor that the log does not see at 5 s.
    pub last: f64,
}

impl OpenLoop {
    /// Measures a frame.
    #[must_use]
    pub fn of(frame: &OpenLoopFrame<'_>) -> Self {
        let rows: Vec<(usize, f64)> = frame.plan.iter().map(|pose| nearest(frame.line, pose.position())).collect();
        Self {
            collision_margin: collision_margin(frame),
            route_distance: rows.iter().map(|(_, distance)| *distance).fold(0.0, f64::max),
            red_light: first_red(frame.info).is_some_and(|red| rows.iter().any(|(row, _)| *row > red)),
            comfort: comfort_by_ends(frame.plan),
            human_comfort: comfort_by_ends(frame.human),
            position_errors: ERRORS_AT.map(|at| frame.plan[at].position().distance(frame.human[at].position())),
            prediction: prediction_errors(frame.neighbors),
        }
    }

    /// Whether the plan drives into a neighbor of the log. One that reacts to nothing: a plan slower than the human is charged
    /// for being hit from behind.
    #[must_use]
    pub fn collision(&self) -> bool {
        self.collision_margin < 0.0
    }

    /// Whether the plan leaves the route.
    #[must_use]
    pub fn off_route(&self) -> bool {
        self.route_distance > OFF_ROUTE
    }
}

/// The nearest row, the first of equals, and its distance; a line without rows is infinitely far.
fn nearest(line: &[Point], place: Point) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (row, point) in line.iter().enumerate() {
        let distance = point.distance_squared(place);
        if distance < best.1 {
            best = (row, distance);
        }
    }
    (best.0, best.1.sqrt())
}

/// The first red row. One at row 0 counts only where there is another. Which side of it the AV starts on is not asked: a red stop
/// that lies behind is run over by standing still; nor why it is 0: a speed limit of 0 is red everywhere.
fn first_red(info: &[f64]) -> Option<usize> {
    let mut red = info.iter().enumerate().filter(|(_, info)| **info == 0.0).map(|(row, _)| row);
    let first = red.next()?;
    (first > 0 || red.next().is_some()).then_some(first)
}

fn collision_margin(frame: &OpenLoopFrame<'_>) -> f64 {
    let mut least = f64::INFINITY;
    for (step, pose) in frame.plan.iter().enumerate() {
        let own = Discs::of(*pose, frame.length, frame.width);
        for neighbor in frame.neighbors {
            // Also those that appear only now, of which nothing was predicted.
            let Some(pose) = neighbor.logged[step] else { continue };
            least = least.min(own.margin(&Discs::of(pose, neighbor.length, neighbor.width)));
        }
    }
    least
}

fn prediction_errors(neighbors: &[LoggedNeighbor<'_>]) -> Option<PredictionErrors> {
    let present = neighbors.iter().filter(|neighbor| neighbor.logged[0].is_some());
    let (mut agents, mut average, mut last) = (0, 0.0, 0.0);
    for (neighbor, predicted) in present.filter_map(|neighbor| Some((neighbor, neighbor.predicted?))) {
        let error = |(pose, point): (&Option<Pose>, &Point)| pose.map_or(0.0, |pose| pose.position().distance(*point));
        let mut errors = neighbor.logged.iter().zip(predicted).map(error);
        agents += 1;
        average += errors.clone().sum::<f64>() / PLAN_STEPS as f64;
        last += errors.next_back().unwrap_or(0.0);
    }
    let count = f64::from(agents);
    (agents > 0).then(|| PredictionErrors { agents, average: average / count, last: last / count })
}

/// What a plan and a prediction at `frame` of the log are worth, for an AV that is and sees what it does there.
pub(super) fn judge(
    scene: &Scene,
    frame: usize,
    av: &AgentState,
    sight: &Sight,
    plan: &Plan,
    prediction: Option<&Prediction>,
) -> OpenLoop {
    let own = av.pose();
    let expected = prediction.and_then(Prediction::most_likely);
    let logged = |states: &[Option<AgentState>], k: usize| {
        let state = states.get(frame + 1 + k)?.as_ref()?;
        Some(authors_frame::pose(state, own))
    };
    let neighbors: Vec<Neighbor> = sight
        .neighbors
        .iter()
        .filter_map(|track| {
            let track = &scene.tracks()[*track];
            let state = track.states[frame]?;
            let mut trajectories = expected.map_or(&[][..], |future| &future.trajectories).iter();
            let trajectory = trajectories.find(|trajectory| trajectory.track == track.id);
            Some(Neighbor {
                length: state.length,
                width: state.width,
                logged: std::array::from_fn(|k| logged(&track.states, k)),
                predicted: trajectory.map(|t| std::array::from_fn(|k| own.to_body(t.poses[k].position()))),
            })
        })
        .collect();
    let neighbors: Vec<LoggedNeighbor<'_>> = neighbors
        .iter()
        .map(|neighbor| LoggedNeighbor {
            length: neighbor.length,
            width: neighbor.width,
            logged: &neighbor.logged,
            predicted: neighbor.predicted.as_ref(),
        })
        .collect();
    let window = &sight.window;
    let rows = window.start..(window.start + window.samples).min(window.line.len());
    OpenLoop::of(&OpenLoopFrame {
        plan: &std::array::from_fn(|k| own.pose_to_body(pose_of(&plan.states()[k]))),
        // A state that is missing is at the AV's own place to them.
        human: &std::array::from_fn(|k| logged(&scene.av().states, k).unwrap_or_default()),
        length: av.length,
        width: av.width,
        neighbors: &neighbors,
        line: &rows.map(|sample| stored(own, window.line.point(sample))).collect::<Vec<_>>(),
        info: &window.authors_info(),
    })
}

/// A neighbor, with what it lends to [`LoggedNeighbor`].
struct Neighbor {
    length: f64,
    width: f64,
    logged: [Option<Pose>; PLAN_STEPS],
    predicted: Option<[Point; PLAN_STEPS]>,
}

/// A place in the AV's frame as the authors store it: in single precision before and after.
fn stored(av: Pose, place: Point) -> Point {
    let rounded = |place: Point| Point::new(single(place.x), single(place.y));
    rounded(av.to_body(rounded(place)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The AV at 10 m/s along +x, and a straight line under it whose row k lies at x = 0.1 k - 20.
    struct Scene {
        plan: [Pose; PLAN_STEPS],
        line: Vec<Point>,
        info: Vec<f64>,
        logged: [Option<Pose>; PLAN_STEPS],
        predicted: [Point; PLAN_STEPS],
    }

    fn along(y: f64) -> [Pose; PLAN_STEPS] {
        std::array::from_fn(|k| Pose::new((k + 1) as f64, y, 0.0))
    }

    fn scene() -> Scene {
        Scene {
            plan: along(0.0),
            line: (0..1200).map(|k| Point::new(0.1 * f64::from(k) - 20.0, 0.0)).collect(),
            info: vec![13.0; 1200],
            logged: [None; PLAN_STEPS],
            predicted: along(3.5).map(Pose::position),
        }
    }

    impl Scene {
        fn measure(&self) -> OpenLoop {
            let human = along(0.0);
            let neighbor =
                LoggedNeighbor { length: 4.5, width: 2.0, logged: &self.logged, predicted: Some(&self.predicted) };
            OpenLoop::of(&OpenLoopFrame {
                plan: &self.plan,
                human: &human,
                length: 5.0,
                width: 2.0,
                neighbors: &[neighbor],
                line: &self.line,
                info: &self.info,
            })
        }
    }

    #[test]
    fn a_plan_like_the_human_on_a_free_road_is_without_fault() {
        let found = scene().measure();
        assert!(!found.collision() && !found.off_route() && !found.red_light, "{found:?}");
        assert_eq!((found.position_errors, found.prediction), ([0.0; 3], None));
        assert_eq!(found.comfort, found.human_comfort);
        assert!(found.comfort.acceleration.is_some_and(|a| a < 1e-9));
    }

    #[test]
    fn who_appears_late_counts_for_collisions_and_not_for_predictions() {
        let mut scene = scene();
        scene.logged[30] = Some(Pose::new(31.0, 1.0, 0.0));
        let found = scene.measure();
        assert!(found.collision());
        assert_eq!(found.prediction, None);
    }

    #[test]
    fn who_leaves_early_has_no_error_from_then_on_and_is_averaged_over_all_steps() {
        let mut scene = scene();
        for (k, pose) in along(5.5).into_iter().enumerate().take(20) {
            scene.logged[k] = Some(pose);
        }
        assert_eq!(
            scene.measure().prediction,
            Some(PredictionErrors { agents: 1, average: 2.0 * 20.0 / 50.0, last: 0.0 })
        );
    }

    #[test]
    fn a_red_stop_counts_once_a_pose_is_nearest_to_a_later_row_even_if_it_lay_behind_from_the_start() {
        let mut scene = scene();
        let red_at = |scene: &mut Scene, row: usize| {
            scene.info.fill(13.0);
            scene.info[row] = 0.0;
            scene.measure().red_light
        };
        // The plan ends 50 m ahead, at row 700.
        assert_eq!([699, 700, 1100].map(|row| red_at(&mut scene, row)), [true, false, false]);
        assert!(red_at(&mut scene, 100), "behind the AV");
        assert!(!red_at(&mut scene, 0), "row 0 alone is not seen");
        scene.info[1] = 0.0;
        assert!(scene.measure().red_light, "with another it is");
    }

    #[test]
    fn off_route_is_beyond_five_metres_at_any_pose() {
        let mut scene = scene();
        scene.plan[40].y = -5.0;
        assert!(!scene.measure().off_route());
        scene.plan[40].y = -5.001;
        assert!(scene.measure().off_route());
    }

    #[test]
    fn velocities_are_taken_by_the_heading_at_the_end_of_a_segment() {
        let mut scene = scene();
        // The last pose looks to the left: what it moved there was sideways, all 10 m/s of it.
        scene.plan[49].heading = std::f64::consts::FRAC_PI_2;
        let comfort = scene.measure().comfort;
        assert!((comfort.acceleration.unwrap() - 100.0 / 48.0).abs() < 1e-9, "{comfort:?}");
        assert!((comfort.lateral_acceleration.unwrap() - 100.0 / 48.0).abs() < 1e-9, "{comfort:?}");
    }
}
