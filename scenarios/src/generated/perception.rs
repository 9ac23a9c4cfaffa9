//! What of the traffic gets into the log: what a car with sensors sees. Tracks begin when somebody comes near or out from behind something, end when
//! they are lost, miss steps, and tremble a little.

use world::geometry::{Point, Pose};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState, Track, TrackId};

use super::STEPS;
use super::draw::Draw;

/// Somebody as they truly are.
#[derive(Clone, Debug)]
pub(super) struct Actor {
    pub(super) kind: AgentKind,
    /// Length, width, height (m).
    pub(super) size: [f64; 3],
    /// At each step; one for all of them for whoever is parked.
    pub(super) poses: Vec<Option<Pose>>,
    /// A part of what the scene is about: never lost for long.
    pub(super) matters: bool,
    pub(super) violator: bool,
}

impl Actor {
    fn pose(&self, step: usize) -> Option<Pose> {
        *self.poses.get(step).or(self.poses.last())?
    }
}

/// Sight is worked out at every so many steps.
const STRIDE: usize = 4;
const STRIDES: usize = STEPS.div_ceil(STRIDE);
/// How much the AV's own place (m) and heading (rad) tremble: such that jerk and lateral acceleration by plain differences are near those of real logs.
const AV_PLACE: f64 = 0.000_3;
const AV_HEADING: f64 = 0.000_7;
/// Whoever is in the AV's way is seen so many strides before and after as well.
const AROUND: usize = 4;
/// Somebody who is lost for longer (steps) comes back as another track.
const FORGOTTEN: usize = 24;
/// Shorter tracks (steps) are none.
const SHORTEST: usize = 4;
/// Whoever is this near to the AV's way (m) while it is near, is not lost for long: sensors are good there.
const NEAR_WAY: f64 = 7.0;
const NEAR: f64 = 70.0;

/// The tracks of `actors` as seen from the AV, whose own comes last; and the numbers of violators' tracks. `ahead` is where the AV would go on, `clarity` is 1 for usual sensors, larger for better ones.
pub(super) fn perceive(
    actors: &[Actor],
    av: &Actor,
    ahead: &[Point],
    clarity: f64,
    draw: &mut Draw,
) -> (Vec<Track>, Vec<TrackId>) {
    let way = way_of(av, ahead);
    let sight = Sight::new(actors, av, &way, clarity, draw);
    let mut tracks = Vec::new();
    let mut violators = Vec::new();
    for (index, actor) in actors.iter().enumerate() {
        let Some(seen) = sight.steps(index, actor, clarity, draw) else { continue };
        let mut from = 0;
        while let Some(first) = (from..STEPS).find(|step| seen[*step]) {
            // On to where it is lost for good.
            let mut last = first;
            while let Some(next) = (last + 1..STEPS.min(last + 2 + FORGOTTEN)).find(|step| seen[*step]) {
                last = next;
            }
            let count = (first..=last).filter(|step| seen[*step]).count();
            if count >= SHORTEST {
                let id = TrackId(tracks.len() as i32 + 1);
                if actor.violator {
                    violators.push(id);
                }
                tracks.push(Track { id, kind: actor.kind, states: states(actor, first..last + 1, &seen, 1.0, draw) });
            }
            from = last + 1;
        }
    }
    let id = TrackId(tracks.len() as i32 + 1);
    tracks.push(Track { id, kind: av.kind, states: av_states(av, draw) });
    (tracks, violators)
}

/// Where the AV drives, and would go on.
fn way_of(av: &Actor, ahead: &[Point]) -> Vec<Point> {
    let driven = av.poses.iter().step_by(5).flatten().map(|pose| pose.position());
    let mut way: Vec<Point> = driven.chain(ahead.iter().copied()).collect();
    way.dedup_by(|a, b| a.distance(*b) < 1.0);
    way
}

/// The ground within a distance of some points, as a raster.
struct Beside {
    origin: Point,
    columns: usize,
    cells: Vec<bool>,
}

impl Beside {
    /// Side of a cell (m).
    const CELL: f64 = 2.0;

    fn new(points: &[Point], distance: f64) -> Self {
        let least = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::INFINITY, f64::min) - distance;
        let most = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + distance;
        let origin = Point::new(least(|point| point.x), least(|point| point.y));
        let size = [most(|point| point.x) - origin.x, most(|point| point.y) - origin.y];
        let [columns, rows] = size.map(|length| (length / Self::CELL).max(0.0) as usize + 1);
        let mut beside = Self { origin, columns, cells: vec![false; columns * rows] };
        let reach = (distance / Self::CELL).ceil() as i64;
        for point in points {
            let centre = [(point.x - origin.x) / Self::CELL, (point.y - origin.y) / Self::CELL].map(|cell| cell as i64);
            for (across, up) in (-reach..=reach).flat_map(|across| (-reach..=reach).map(move |up| (across, up))) {
                let cell =
                    Point::new((centre[0] + across) as f64 + 0.5, (centre[1] + up) as f64 + 0.5) * Self::CELL + origin;
                if cell.distance(*point) <= distance
                    && let Some(index) = beside.index(cell)
                {
                    beside.cells[index] = true;
                }
            }
        }
        beside
    }

    fn index(&self, point: Point) -> Option<usize> {
        let (x, y) = ((point.x - self.origin.x) / Self::CELL, (point.y - self.origin.y) / Self::CELL);
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < self.columns;
        inside.then_some(y as usize * self.columns + x as usize).filter(|index| *index < self.cells.len())
    }

    fn holds(&self, point: Point) -> bool {
        self.index(point).is_some_and(|index| self.cells[index])
    }
}

/// Who is in sight at every fourth step: for each actor a bit for each of the [`STRIDES`].
struct Sight {
    seen: Vec<u64>,
    /// Near the AV's way.
    sure: Vec<u64>,
}

impl Sight {
    fn new(actors: &[Actor], av: &Actor, way: &[Point], clarity: f64, draw: &mut Draw) -> Self {
        let range: Vec<f64> = actors
            .iter()
            .map(|actor| {
                let far =
                    if actor.kind == AgentKind::Vehicle { draw.between(40.0, 78.0) } else { draw.between(20.0, 45.0) };
                far * clarity.min(1.5)
            })
            .collect();
        // How well each is seen past others: a tall one always, a low one seldom.
        let peeps: Vec<f64> =
            actors.iter().map(|actor| draw.between(0.0, 0.6) * clarity + 0.4 * (actor.size[2] - 1.6)).collect();
        let on_the_way = Beside::new(way, NEAR_WAY);
        let mut present = vec![Vec::new(); STRIDES];
        for (index, actor) in actors.iter().enumerate() {
            for (stride, row) in present.iter_mut().enumerate() {
                row.extend(actor.pose(stride * STRIDE).map(|pose| (index, pose.position())));
            }
        }
        let (mut seen, mut sure) = (vec![0; actors.len()], vec![0; actors.len()]);
        let mut around: Vec<(usize, Point, f64, f64, f64)> = Vec::new();
        for (stride, row) in present.iter().enumerate() {
            let Some(here) = av.pose(stride * STRIDE) else { continue };
            around.clear();
            for (index, at) in row {
                let away = *at - here.position();
                let distance = away.norm();
                if distance < range[*index].max(NEAR) {
                    let bearing = libm::atan2(away.y, away.x);
                    around.push((*index, *at, distance, bearing, 0.42 * actors[*index].size[0] / distance.max(2.0)));
                }
            }
            around.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
            for (place, (index, at, distance, bearing, _)) in around.iter().enumerate() {
                let is_safe = *distance < NEAR && on_the_way.holds(*at) || actors[*index].matters;
                let is_hidden = || {
                    peeps[*index] < 0.6
                        && around[..place].iter().any(|(other, _, nearer, direction, half)| {
                            let turned = (direction - bearing).abs();
                            let turned = turned.min(std::f64::consts::TAU - turned);
                            nearer + 3.0 < *distance
                                && actors[*other].size[2] > 1.4
                                && turned < *half * (1.0 - peeps[*index])
                        })
                };
                let is_seen = is_safe && *distance < 1.15 * NEAR || *distance < range[*index] && !is_hidden();
                sure[*index] |= u64::from(is_safe) << stride;
                seen[*index] |= u64::from(is_seen) << stride;
            }
        }
        for (seen, sure) in seen.iter_mut().zip(&mut sure) {
            // Nobody vanishes as soon as it is out of the way.
            *sure =
                (0..=AROUND).fold(0, |near, strides| near | *sure << strides | *sure >> strides) & ((1 << STRIDES) - 1);
            *seen |= *sure;
        }
        Self { seen, sure }
    }

    /// The steps at which the log holds the actor; `None` if it is never in sight.
    fn steps(&self, index: usize, actor: &Actor, clarity: f64, draw: &mut Draw) -> Option<[bool; STEPS]> {
        let mut steps = [false; STEPS];
        let (seen, sure) = (self.seen[index], self.sure[index]);
        // Sight changes a step or two earlier or later than at the strides.
        let shift = draw.below(STRIDE);
        let hazard = 0.006 / clarity.max(0.05);
        let mut lost_until = 0;
        for (step, holds) in steps.iter_mut().enumerate() {
            let at = 1 << ((step + shift) / STRIDE).min(STRIDES - 1);
            let is_sure = sure & at != 0;
            if step >= lost_until && draw.chance(hazard) {
                let long = !is_sure && draw.chance(0.3);
                lost_until = step + 1 + if long { 8 + draw.below(40) } else { draw.below(6) };
            }
            if is_sure {
                // Whoever matters to the AV is there when the log begins and ends, and is missed for moments alone.
                let moment = if (10..STEPS - 12).contains(&step) { 6 } else { 0 };
                lost_until = lost_until.min(step + moment);
            }
            *holds = seen & at != 0 && step >= lost_until && actor.pose(step).is_some();
        }
        (seen != 0).then_some(steps)
    }
}

/// The AV's own track: its localisation is good to a fraction of a millimetre from step to step, which is what differences of it show.
fn av_states(av: &Actor, draw: &mut Draw) -> Vec<Option<AgentState>> {
    let trembling: Vec<Option<Pose>> = av
        .poses
        .iter()
        .map(|pose| {
            let pose = (*pose)?;
            let at = pose.position() + Point::new(draw.normal(0.0, AV_PLACE), draw.normal(0.0, AV_PLACE));
            Some(Pose::new(at.x, at.y, pose.heading + draw.normal(0.0, AV_HEADING)))
        })
        .collect();
    states(&Actor { poses: trembling, ..av.clone() }, 0..STEPS, &[true; STEPS], 0.0, draw)
}

/// The states of a track: true places, trembling slowly by `noise` times a few centimetres.
fn states(
    actor: &Actor,
    steps: std::ops::Range<usize>,
    seen: &[bool; STEPS],
    noise: f64,
    draw: &mut Draw,
) -> Vec<Option<AgentState>> {
    let [length, width, height] = actor.size;
    let mut states = vec![None; STEPS];
    let mut off = [0.0, 0.0, 0.0_f64].map(|_: f64| draw.between(-0.02, 0.02) * noise);
    let size_noise = noise * draw.between(0.0, 0.012);
    for step in steps {
        off = off.map(|value| 0.96 * value + noise * draw.between(-0.004, 0.004));
        let (true, Some(pose)) = (seen[step], actor.pose(step)) else { continue };
        let swell = 1.0 + size_noise * off[2] * 20.0;
        states[step] = Some(AgentState {
            x: pose.x + off[0],
            y: pose.y + off[1],
            z: 0.5 * height,
            heading: pose.heading + 0.15 * off[2],
            length: length * swell,
            width: width * swell,
            height,
            ..AgentState::default()
        });
    }
    difference(&mut states);
    states
}

/// WOMD's velocities: backward differences of the logged places; the first state of a run repeats the second's.
fn difference(states: &mut [Option<AgentState>]) {
    for step in 1..states.len() {
        let (Some(before), Some(state)) = (states[step - 1], states[step].as_mut()) else { continue };
        let velocity = (state.position() - before.position()) * (1.0 / STEP_SECONDS);
        (state.velocity_x, state.velocity_y) = (velocity.x, velocity.y);
    }
    for step in 0..states.len() {
        let begins = step == 0 || states[step - 1].is_none();
        let next = states.get(step + 1).copied().flatten();
        if let (true, Some(next), Some(state)) = (begins, next, &mut states[step]) {
            (state.velocity_x, state.velocity_y) = (next.velocity_x, next.velocity_y);
        }
    }
}
