//! How the logged AV keeps to its lanes: their direction and their speed limit.

use std::collections::BTreeMap;

use world::geometry::{Point, SegmentGrid, angle_difference};
use world::plan::STEP_SECONDS;
use world::scene::{AgentState, Scene, Steps};

use super::Lint;

/// A lane whose centre is this near (m) is one that the AV is on.
const ON_LANE: f64 = 1.8;
/// A lane this far (m) above or below is of another road.
const STOREY: f64 = 4.0;
/// Who differs from a lane's direction by less than this (rad) follows it, by more than its supplement goes against it.
const ALONG: f64 = std::f64::consts::FRAC_PI_3;
/// Slower (m/s) nobody drives against a lane: it manoeuvres.
const SLOW: f64 = 1.0;
/// Against a lane for less than this (s) one crosses it.
const CROSSING: f64 = 1.0;
/// So much above the limit (m/s) is speeding: nuPlan's bound, and that of the judges of a drive.
const OVERSPEED: f64 = 2.23;

/// `grid`: the lanes around the AV, by their places in the map.
pub(super) fn lint(scene: &Scene, av: &[(usize, AgentState)], grid: &SegmentGrid, lints: &mut Vec<Lint>) {
    let lanes = &scene.map().lanes;
    let (mut against, mut speeding, mut worst) = (Steps::default(), Steps::default(), 0.0_f64);
    for (step, state) in av {
        let mut levels = BTreeMap::new();
        let on = Lanes::under(state, grid, |lane| {
            let line = &lanes[lane as usize].centerline;
            *levels.entry(lane).or_insert_with(|| line.iter().any(|point| (point.z - state.z).abs() <= STOREY))
        });
        if on.against && !on.along && state.speed() > SLOW {
            against.push(*step);
        }
        // Lanes that overlap in a junction have limits of their own: the highest is the one to keep.
        let limits = on.followed.iter().map(|lane| lanes[*lane as usize].speed_limit());
        let limit = limits.collect::<Option<Vec<f64>>>().unwrap_or_default().into_iter().reduce(f64::max);
        if let Some(over) = limit.map(|limit| state.speed() - limit).filter(|over| *over > OVERSPEED) {
            worst = worst.max(over);
            speeding.push(*step);
        }
    }
    if against.longest_run() as f64 * STEP_SECONDS >= CROSSING {
        lints.push(Lint::AvAgainstLane { steps: against });
    }
    if !speeding.is_empty() {
        lints.push(Lint::AvSpeeding { worst, steps: speeding });
    }
}

/// The lanes that the AV is on at a step.
#[derive(Default)]
struct Lanes {
    /// One of them goes its way.
    along: bool,
    /// One of them goes the other way.
    against: bool,
    /// Those that go its way.
    followed: Vec<u32>,
}

impl Lanes {
    fn under(state: &AgentState, grid: &SegmentGrid, mut on_level: impl FnMut(u32) -> bool) -> Self {
        let mut lanes = Self::default();
        // A car that backs out goes where its velocity points, not its heading.
        let way = state.velocity();
        let going = if way.norm() > SLOW { way.heading() } else { state.heading };
        let place: Point = state.position();
        grid.for_each_near(place, ON_LANE, |segment| {
            let turn = angle_difference(grid.segment(segment).vector().heading(), going).abs();
            let lane = grid.payload(segment);
            if !on_level(lane) || grid.segment(segment).length() == 0.0 {
                return;
            }
            lanes.along |= turn < std::f64::consts::FRAC_PI_2;
            lanes.against |= turn > std::f64::consts::PI - ALONG;
            if turn < ALONG {
                lanes.followed.push(lane);
            }
        });
        lanes
    }
}
