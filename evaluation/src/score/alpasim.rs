//! AlpaSim's rollout score (`NVlabs/alpasim`, `src/eval`, commit 3032e0c) and its parts, frame by frame: collisions of shrunken boxes with
//! round corners, the nearest road edge, progress along the recorded drive. `docs/scores/alpasim.md` defines each.

use world::geometry::{Point, Point3, Polyline};
use world::scene::{AgentState, Judgement};

use super::Judged;
use super::convex::RoundedBox;
use super::drive::Drive;
use super::edges::EdgePoints;
use super::figure::Figure;
use super::ground::Ground;

/// Share by which boxes are shrunk (`base_config.yaml`, `vehicle_shrink_factor`).
const SHRINK: f64 = 0.02;
/// Radius of the corners as a share of half the shorter side (`vehicle_corner_roundness`).
const ROUNDNESS: f64 = 0.5;
/// Nearer than this (m) a box is at the road's edge (`offroad.py`).
const AT_EDGE: f64 = 1e-3;
/// From this distance (m) to the recorded drive on, frames count no more (`max_dist_to_gt_trajectory`).
const TOO_FAR: f64 = 4.0;
/// Progress that makes the whole score (`progress_saturation_threshold`).
const SATURATION: f64 = 0.8;
/// Where the human moved less (m), there is no progress to ask for (`min_gt_distance_for_full_score_m`).
const LEAST_WAY: f64 = 5.0;
/// Frames at the begin of which the distance to the record is not asked (`ground_truth.py`).
const SKIPPED: usize = 2;

/// The figures of an episode.
#[must_use]
pub fn figures() -> Vec<Figure> {
    let distance = "alpasim_dist_traveled_m";
    vec![
        Figure::new("alpasim_score", "", "0 after a collision at fault or off the road, else min(progress / 0.8, 1)")
            .mean(&["score", "", ""], 3),
        Figure::new("alpasim_terms", "", "of how many of the three terms the score is made: those that can be judged"),
        Figure::new("alpasim_progress", "", "progress along the human's way at the last frame that counts")
            .mean(&["pro-", "gress", ""], 3),
        Figure::new("alpasim_collision_any", "0/1", "the boxes met").percent(&["colli-", "sion", "%"]),
        Figure::new("alpasim_collision_at_fault", "0/1", "they met at the front or at the side")
            .percent(&["at", "fault", "%"]),
        Figure::new("alpasim_collision_front", "0/1", "they met at the AV's front"),
        Figure::new("alpasim_collision_rear", "0/1", "they met at the AV's rear, and not at its front"),
        Figure::new("alpasim_collision_lateral", "0/1", "they met elsewhere"),
        Figure::new("alpasim_offroad", "0/1", "the box was at the nearest road edge, and not within lanes")
            .percent(&["off", "road", "%"]),
        Figure::new("alpasim_offroad_or_collision", "0/1", "an incident"),
        Figure::new("alpasim_offroad_or_collision_at_fault", "0/1", "an incident at fault"),
        Figure::new("alpasim_dist_to_gt_trajectory_m", "m", "greatest distance to the human's way")
            .mean(&["to", "way", "m"], 2),
        Figure::new("alpasim_dist_to_gt_location_m", "m", "greatest distance to where the human was at the time")
            .mean(&["to", "human", "m"], 2),
        Figure::new(distance, "m", "metres driven up to the last frame that counts"),
        Figure::new("alpasim_gt_dist_traveled_m", "m", "length of the human's way"),
        Figure::new(
            "alpasim_frames",
            "",
            "frames that count: up to the first incident, and to the first one 4 m off the human's way",
        ),
        Figure::new("alpasim_left_corridor", "0/1", "the AV was 4 m beside the human's way (AlpaSim since 6f1029c)"),
        Figure::new(
            "alpasim_corridor_score",
            "",
            "the score as since 6f1029c: leaving that corridor sideways fails too",
        ),
        Figure::new("alpasim_km_between_incidents", "km", "kilometres driven for each incident; none without one")
            .per(distance, "alpasim_offroad_or_collision")
            .mean(&["km per", "inci-", "dent"], 2),
        Figure::new("alpasim_km_between_incidents_at_fault", "km", "the same of those at fault")
            .per(distance, "alpasim_offroad_or_collision_at_fault")
            .mean(&["km per", "at", "fault"], 2),
    ]
}

/// A frame.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    front: bool,
    rear: bool,
    lateral: bool,
    offroad: bool,
    /// Progress along the whole of the human's way; none where it has no length.
    progress: Option<f64>,
    to_way: f64,
    /// The same, straight on beyond the way's end.
    beside_way: f64,
    to_human: Option<f64>,
    travelled: f64,
}

impl Frame {
    fn at_fault(&self) -> bool {
        self.front || self.lateral
    }

    fn any(&self) -> bool {
        self.front || self.rear || self.lateral
    }
}

/// The figures of a drive.
pub fn judge(drive: &Drive<'_>) -> Judged {
    let recorded = &drive.scene.av().states[drive.start..drive.end];
    let way: Vec<Point> = recorded.iter().flatten().map(AgentState::position).collect();
    let Some(way) = Polyline::new(way) else {
        return Judged::none(figures().len(), "the log has no state of the AV".to_owned());
    };
    let (ground, reason) = match drive.ground() {
        Ok(ground) => (Some(ground), None),
        Err(reason) => (None, Some(reason)),
    };
    let frames = frames(drive, ground, &way);
    // What the last frame of the drive would have been for the human: progress is told of what can be reached.
    let reachable =
        recorded.get(drive.states.len() - 1).copied().flatten().map(|state| way.project(state.position()).station);
    Judged { values: of_rollout(drive, &frames, &way, reachable, ground.is_some()), reason }
}

fn frames(drive: &Drive<'_>, ground: Option<&Ground>, way: &Polyline) -> Vec<Frame> {
    let edges = EdgePoints::of(drive.scene.map());
    let mut travelled = 0.0;
    let mut frames: Vec<Frame> = Vec::with_capacity(drive.states.len());
    for (index, state) in drive.states.iter().enumerate() {
        let place = state.position();
        if let Some(before) = index.checked_sub(1) {
            travelled += drive.states[before].position().distance(place);
        }
        let body = RoundedBox::of(&state.oriented_box(), SHRINK, ROUNDNESS);
        let mut frame = Frame { offroad: is_offroad(&edges, ground, state, &body), ..Frame::default() };
        meet(drive, index, &body, &mut frame);
        if index >= SKIPPED {
            let nearest = way.project(place);
            frame.progress = (way.length() > 0.0).then(|| nearest.station / way.length());
            frame.to_way = nearest.distance;
            frame.beside_way = beside(way, place, nearest.station, nearest.distance);
            let human = drive.scene.av().states.get(drive.start + index).copied().flatten();
            frame.to_human = human.map(|human| human.position().distance(place));
            frame.travelled = travelled;
        }
        frames.push(frame);
    }
    // Of the first two the progress is filled in between.
    if let Some(third) = frames.get(SKIPPED).and_then(|frame| frame.progress) {
        (frames[0].progress, frames[1].progress) = (Some(0.0), Some(0.5 * third));
    }
    frames
}

/// Which contacts there are with others.
fn meet(drive: &Drive<'_>, index: usize, body: &RoundedBox, frame: &mut Frame) {
    let center = drive.states[index].position();
    for (_, other) in drive.others(index) {
        let outline = other.oriented_box();
        if outline.center.distance(center) > body.reach() + outline.radius() {
            continue;
        }
        let other = RoundedBox::of(&outline, SHRINK, ROUNDNESS);
        if !body.meets(&other) {
        } else if other.meets_polygon(&body.bumper(1.0)) {
            frame.front = true;
        } else if other.meets_polygon(&body.bumper(-1.0)) {
            frame.rear = true;
        } else {
            frame.lateral = true;
        }
    }
}

/// Whether a box is at the edge that is nearest to its centre, and not within lanes.
fn is_offroad(edges: &EdgePoints, ground: Option<&Ground>, state: &AgentState, body: &RoundedBox) -> bool {
    let Some(nearest) = edges.nearest(Point3::new(state.x, state.y, state.z), 1.0) else { return false };
    let at_edge = edges.pieces(nearest).any(|piece| {
        piece.nearest_to(state.position()).distance_squared <= (body.reach() + AT_EDGE) * (body.reach() + AT_EDGE)
            && body.distance_to(&piece) < AT_EDGE
    });
    let floor = Ground::below(state);
    let in_lanes =
        |ground: &Ground| body.rim().into_iter().all(|point| !ground.surface().lanes.at(point, floor).is_empty());
    at_edge && !ground.is_some_and(in_lanes)
}

/// The distance to the way; of what lies beyond its end, that to the line on which it ends.
fn beside(way: &Polyline, place: Point, station: f64, distance: f64) -> f64 {
    let points = way.points();
    let Some(before) = points.len().checked_sub(2) else { return distance };
    let end = points[points.len() - 1];
    let along = end - points[before];
    let length = along.norm();
    if length == 0.0 || station < way.length() - 1e-9 {
        return distance;
    }
    ((place - end).cross(along) / length).abs()
}

/// The frames up to the first that is so, that one among them.
fn up_to(frames: &[Frame], is_so: impl Fn(&Frame) -> bool) -> &[Frame] {
    let last = frames.iter().position(is_so).map_or(frames.len(), |index| index + 1);
    &frames[..last]
}

fn of_rollout(
    drive: &Drive<'_>,
    frames: &[Frame],
    way: &Polyline,
    reachable: Option<f64>,
    has_route: bool,
) -> Vec<Option<f64>> {
    let knows_edges = has_route && drive.is_judged(Judgement::OffRoad);
    let knows_sizes = drive.is_judged(Judgement::Collision);
    let off = |frame: &Frame| knows_edges && frame.offroad;
    let incident = |frame: &Frame| frame.any() || off(frame);
    let counted = up_to(up_to(frames, incident), |frame| frame.to_way >= TOO_FAR);
    let any = |is_so: &dyn Fn(&Frame) -> bool| counted.iter().any(is_so);
    let flag = |is_so: bool| f64::from(u8::from(is_so));
    // One that there was is told, whatever else cannot be judged.
    let met = |is_so: bool| Some(flag(is_so)).filter(|_| is_so || knows_sizes);
    let at_fault = met(any(&Frame::at_fault));
    let offroad = Some(flag(any(&off))).filter(|_| knows_edges);
    let progress = counted.last().and_then(|frame| frame.progress);
    let judged = |progress: Option<f64>| {
        if way.length() < LEAST_WAY { Some(1.0) } else { progress.map(progress_score) }
    };
    let failed = |more: bool| at_fault == Some(1.0) || offroad == Some(1.0) || more;
    let score = |more: bool, progress: Option<f64>| if failed(more) { Some(0.0) } else { judged(progress) };
    let terms = [at_fault, offroad, judged(progress)].into_iter().flatten().count() as f64;
    let left = any(&|frame| frame.beside_way >= TOO_FAR);
    let reached = progress.map(|progress| match reachable {
        Some(reachable) if reachable > 0.0 => progress * way.length() / reachable,
        _ => progress,
    });
    let most = |of: &dyn Fn(&Frame) -> Option<f64>| {
        counted.iter().filter_map(of).reduce(|most, next| if next > most { next } else { most })
    };
    vec![
        score(false, progress),
        Some(terms),
        progress,
        met(any(&Frame::any)),
        at_fault,
        met(any(&|frame| frame.front)),
        met(any(&|frame| frame.rear)),
        met(any(&|frame| frame.lateral)),
        offroad,
        met(any(&incident)),
        met(any(&|frame| frame.at_fault() || off(frame))),
        most(&|frame| Some(frame.to_way)),
        most(&|frame| frame.to_human),
        counted.last().map(|frame| frame.travelled),
        Some(way.length()),
        Some(counted.len() as f64),
        Some(flag(left)),
        score(left, reached),
        None,
        None,
    ]
}

/// Progress as it counts.
fn progress_score(progress: f64) -> f64 {
    let share = progress.clamp(0.0, 1.0) / SATURATION;
    if share < 1.0 { share } else { 1.0 }
}
