//! Which lanes the logged AV drove on: dynamic programming over its poses, the likeliest sequence along the lane graph.

use crate::geometry::{Pose, angle_difference};
use crate::lane_graph::LaneGraph;
use crate::map_matching::{LaneMatch, LanePoints};
use crate::scene::AgentState;

/// The AV must have moved this far (m) for its pose to count anew: where it stands, it says nothing.
pub(crate) const POSE_SPACING: f64 = 1.0;

/// A lane within this distance (m) and heading (rad) may be the one driven on.
const SEARCH_RADIUS: f64 = 5.0;
const SEARCH_HEADING: f64 = std::f64::consts::FRAC_PI_3;

/// Costs of the search: squares of offsets in these units. A pose is off the lanes where all are 3.5 m away or worse.
const DISTANCE_UNIT: f64 = 1.0;
const HEADING_UNIT: f64 = 0.3;
const HEIGHT_UNIT: f64 = 2.0;
const OFF_LANES: f64 = 12.0;

/// Points of a lane that are farther apart along it than this (m), and both near a pose, are of two passes: a ramp that winds up, a
/// circle that is driven round more than once.
const PASS: f64 = 10.0;

/// Who moved so far (m) from one place to the next got no farther along its lane than twice that and [`BEND`] (m): it may have been
/// unseen in a bend. What lies farther ahead is another pass.
const BEND: f64 = 15.0;

/// Candidates of a pose at most: no street has more, and a hostile map may.
const MOST_CANDIDATES: usize = 32;

/// What it costs to change to a neighbour, to leave or join the lanes, and to jump.
const CHANGE: f64 = 5.0;
const LEAVE: f64 = 10.0;
const JUMP: f64 = 30.0;

/// A pose of the drive and the lane chosen for it.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) pose: Pose,
    /// Height of the ground under it (m).
    pub(crate) ground: f64,
    /// Distance driven since the first place (m).
    pub(crate) driven: f64,
    /// None off the lanes.
    pub(crate) lane: Option<LaneMatch>,
}

/// How one place of a drive leads to the next.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Link {
    /// Along the lane graph, or off the lanes throughout.
    On,
    /// To a neighbouring lane.
    Change,
    /// Onto the lanes, or off them.
    Leave,
    /// To a lane that nothing links with this one, or backwards.
    Jump,
}

impl Link {
    fn cost(self) -> f64 {
        match self {
            Self::On => 0.0,
            Self::Change => CHANGE,
            Self::Leave => LEAVE,
            Self::Jump => JUMP,
        }
    }
}

struct Candidate {
    lane: Option<LaneMatch>,
    cost: f64,
}

/// The drive as places at least [`POSE_SPACING`] apart, each with the lane that the likeliest sequence has there.
pub(crate) fn drive(states: &[Option<AgentState>], graph: &LaneGraph, points: &LanePoints) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for state in states.iter().flatten() {
        let moved = places.last().map_or(0.0, |last| last.pose.position().distance(state.position()));
        if places.is_empty() || moved >= POSE_SPACING {
            let driven = places.last().map_or(0.0, |last| last.driven) + moved;
            places.push(Place { pose: state.pose(), ground: state.z - 0.5 * state.height, driven, lane: None });
        }
    }
    choose_lanes(&mut places, graph, points);
    places
}

/// Dynamic programming: the lanes with the least sum of offsets and changes. Of equals the first in the map's order.
fn choose_lanes(places: &mut [Place], graph: &LaneGraph, points: &LanePoints) {
    let candidates: Vec<Vec<Candidate>> = places.iter().map(|place| candidates(place, points)).collect();
    let Some(first) = candidates.first() else { return };
    let mut costs: Vec<f64> = first.iter().map(|candidate| candidate.cost).collect();
    let mut came_from: Vec<Vec<usize>> = Vec::with_capacity(places.len());
    for (pair, places) in candidates.windows(2).zip(places.windows(2)) {
        let moved = places[1].driven - places[0].driven;
        let reach = |to: &Candidate| {
            let total =
                |(from, cost): (&Candidate, &f64)| cost + link(&from.lane, &to.lane, moved, graph, points).cost();
            let totals: Vec<f64> = pair[0].iter().zip(&costs).map(total).collect();
            let best = cheapest(&totals);
            (best, totals[best] + to.cost)
        };
        let (from, reached) = pair[1].iter().map(reach).unzip();
        costs = reached;
        came_from.push(from);
    }
    let mut chosen = cheapest(&costs);
    for (step, place) in places.iter_mut().enumerate().rev() {
        place.lane = candidates[step][chosen].lane;
        if step > 0 {
            chosen = came_from[step - 1][chosen];
        }
    }
}

fn cheapest(costs: &[f64]) -> usize {
    (1..costs.len()).fold(0, |best, index| if costs[index] < costs[best] { index } else { best })
}

/// For each lane nearby, and each time that it passes, its nearest point, with what it costs to be there; and to be on none. Lanes in
/// the map's order, passes in the lane's.
fn candidates(place: &Place, points: &LanePoints) -> Vec<Candidate> {
    let turn = |near: &LaneMatch| angle_difference(place.pose.heading, points.heading(near));
    let mut found: Vec<LaneMatch> = Vec::new();
    points.for_each_near(place.pose.position(), SEARCH_RADIUS, |near| {
        if turn(&near).abs() <= SEARCH_HEADING {
            found.push(near);
        }
    });
    found.sort_by_key(|near| (near.lane, near.point));
    let is_one_pass = |a: &LaneMatch, b: &LaneMatch| a.lane == b.lane && points.station(b) - points.station(a) <= PASS;
    let nearest = |pass: &[LaneMatch]| pass.iter().copied().min_by(|a, b| a.distance.total_cmp(&b.distance));
    let found = found.chunk_by(is_one_pass).filter_map(nearest);
    let on = |near: LaneMatch| {
        let offsets = [
            near.distance / DISTANCE_UNIT,
            turn(&near) / HEADING_UNIT,
            (points.point(&near).z - place.ground) / HEIGHT_UNIT,
        ];
        Candidate { lane: Some(near), cost: offsets.iter().map(|offset| offset * offset).sum() }
    };
    let mut candidates: Vec<Candidate> = found.map(on).collect();
    if candidates.len() > MOST_CANDIDATES {
        candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        candidates.truncate(MOST_CANDIDATES);
    }
    candidates.push(Candidate { lane: None, cost: OFF_LANES });
    candidates
}

/// How one lane point leads to the next, for who `moved` so far (m) between them. On the same lane a step back by a point is none:
/// the nearest one flickers; nor is the step over the ends of a lane that is closed.
/// A lane so short that no pose fell on it may lie between two.
pub(super) fn link(
    from: &Option<LaneMatch>,
    to: &Option<LaneMatch>,
    moved: f64,
    graph: &LaneGraph,
    points: &LanePoints,
) -> Link {
    let (from, to) = match (from, to) {
        (None, None) => return Link::On,
        (Some(from), Some(to)) => (from, to),
        _ => return Link::Leave,
    };
    let next = graph.successors(from.lane);
    let leads_on = if from.lane == to.lane {
        let along = points.station(to) - points.station(from);
        let reach = 2.0 * moved + BEND;
        let is_beside = to.point.abs_diff(from.point) <= 1;
        let comes_round =
            points.closed_length(from.lane).is_some_and(|length| along.abs() > reach && along + length <= reach);
        is_beside || (0.0..=reach).contains(&along) || comes_round
    } else {
        next.contains(&to.lane) || next.iter().any(|lane| graph.successors(*lane).contains(&to.lane))
    };
    if leads_on {
        Link::On
    } else if graph.neighbors(from.lane).contains(&to.lane) {
        Link::Change
    } else {
        Link::Jump
    }
}
