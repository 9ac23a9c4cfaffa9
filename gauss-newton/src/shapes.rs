//! How near the AV's box comes to those of its neighbors.
//!
//! A box is a disc that slides along its longer axis. It is as wide as the box; its center stops 3/8 of the width before the box'
//! ends, so that it sticks out there by as much as it leaves of the corners: an eighth of the width. Bumper to bumper or
//! side by side, a bus has the shape that it has; three discs that cover it would be a meter too wide on either side.
//!
//! Between two discs, the difference (along, across) is taken in the frame of the line at the AV's nearest sample:
//!
//! ```text
//! share^2 = min over p, q in [-1, 1] of  (along / a)^2 + (across / b)^2 + (SLIDE / a)^2 (p^2 + q^2)
//! a, b = both radii + margin along, across + standard deviation of the neighbor's place along, across
//! row = (both radii + margin along) (1 - share)   where share < 1
//! ```
//!
//! p and q are where the discs are on their axes. They minimize, so the row's derivative by the AV's position and heading is that with p
//! and q held, and it is smooth. The line's direction, and so margins and deviations, are constants in derivatives, as nearest samples are.
//!
//! Behind another car the row is what lacks to the margin along (m), as for discs. That sliding costs a little lets the row fall towards
//! the nearer end where boxes are beside each other, and not sideways alone: else the AV would rather leave its lane than brake. Who is
//! uncertain costs no more where boxes touch, but from further off.
//!
//! Who comes up to the AV from behind in its way does not count: it is not for the AV to keep that distance. A car that was come up to
//! and driven through stays ahead: each meter past its center costs a meter more. So where a neighbor was counts at later looks
//! ([`Side`]), and is a constant, too.

#[cfg(test)]
mod tests;

use world::trigonometry::sincos_all;
use world::vehicle::VehicleState;

use super::constants::{LANE_STEPS, LATERAL_MARGIN, NEIGHBORS, SAFE_GAP, STEPS, lane_step};
use super::objective::SafetyRow;
use super::problem::{Neighbor, PlacedNeighbor, Problem};

/// How far from each other boxes are to stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Along the line (m).
    pub along: f64,
    /// Across the line (m).
    pub across: f64,
    /// So many standard deviations of the neighbor's place more.
    pub deviations: f64,
}

impl Margins {
    /// The authors' margins, along and across, and one standard deviation.
    pub const DEFAULT: Self = Self { along: SAFE_GAP, across: LATERAL_MARGIN, deviations: 1.0 };
}

/// How far (m) a disc at the end of its axis counts as further away.
const SLIDE: f64 = 1.5;

/// The disc stops this share of the box' width before its ends.
const INSET: f64 = 0.375;

/// The disc of a box: its radius (m), how far to either side of the box' center it slides (m), and whether along the box' length.
#[derive(Clone, Copy, Debug)]
struct Disc {
    radius: f64,
    slide: f64,
    lengthwise: bool,
}

impl Disc {
    #[inline(always)]
    fn of(length: f64, width: f64) -> Self {
        let lengthwise = length >= width;
        let (long, short) = if lengthwise { (length, width) } else { (width, length) };
        let slide = 0.5 * long - INSET * short;
        Self { radius: 0.5 * short, slide: if slide > 0.0 { slide } else { 0.0 }, lengthwise }
    }

    /// From the box' center to an end of the disc's way, for a box that heads along (cosine, sine).
    #[inline(always)]
    fn axis(&self, (cosine, sine): (f64, f64)) -> (f64, f64) {
        let (x, y) = if self.lengthwise { (cosine, sine) } else { (-sine, cosine) };
        (self.slide * x, self.slide * y)
    }
}

/// A neighbor's box at each look at the lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    radius: f64,
    slide: f64,
    x: [f64; LANE_STEPS],
    y: [f64; LANE_STEPS],
    /// The largest standard deviation (m).
    spread: [f64; LANE_STEPS],
    /// From the center to an end of the disc's way.
    axis: [(f64, f64); LANE_STEPS],
    /// Covariances of the position (m^2): x with x, x with y, y with y.
    covariance: [(f64, f64, f64); LANE_STEPS],
}

impl Track {
    /// Of a checked neighbor. One that does not move from the start, and has no headings, stands along `line` (cosine, sine).
    #[inline(always)]
    pub fn new(neighbor: &Neighbor<'_>, line: (f64, f64)) -> Self {
        let disc = Disc::of(neighbor.length, neighbor.width);
        let at_looks = std::array::from_fn::<_, LANE_STEPS, _>(|i| neighbor.positions[lane_step(i)]);
        let directions = if neighbor.headings.is_empty() {
            as_it_moves(neighbor.positions, line)
        } else {
            let headings: [f64; LANE_STEPS] = std::array::from_fn(|i| neighbor.headings[lane_step(i)]);
            let (mut sine, mut cosine) = ([0.0; LANE_STEPS], [0.0; LANE_STEPS]);
            sincos_all(&headings, &mut sine, &mut cosine);
            std::array::from_fn(|i| (cosine[i], sine[i]))
        };
        let (mut spread, mut covariance) = ([0.0; LANE_STEPS], [(0.0, 0.0, 0.0); LANE_STEPS]);
        if !neighbor.deviations.is_empty() {
            for i in 0..LANE_STEPS {
                let (along, across) = neighbor.deviations[lane_step(i)];
                let (cosine, sine) = directions[i];
                let (along, across) = (along * along, across * across);
                spread[i] = if along > across { along } else { across }.sqrt();
                covariance[i] = (
                    along * cosine * cosine + across * sine * sine,
                    (along - across) * cosine * sine,
                    along * sine * sine + across * cosine * cosine,
                );
            }
        }
        Self {
            radius: disc.radius,
            slide: disc.slide,
            x: at_looks.map(|(x, _)| x),
            y: at_looks.map(|(_, y)| y),
            spread,
            axis: directions.map(|direction| disc.axis(direction)),
            covariance,
        }
    }
}

/// The direction (cosine, sine) of the move to each look; where there is none, the one before.
#[inline(always)]
fn as_it_moves(positions: &[(f64, f64)], at_first: (f64, f64)) -> [(f64, f64); LANE_STEPS] {
    /// Less (m in a step) is no move.
    const STILL: f64 = 0.01;
    let mut direction = at_first;
    std::array::from_fn(|i| {
        let ((from_x, from_y), (x, y)) = (positions[lane_step(i) - 1], positions[lane_step(i)]);
        let (dx, dy) = (x - from_x, y - from_y);
        let distance = (dx * dx + dy * dy).sqrt();
        if distance > STILL && distance.is_finite() {
            direction = (dx / distance, dy / distance);
        }
        direction
    })
}

impl Margins {
    /// Hands every row that is not zero, and its value (m), to `add`, by look and neighbor: at most one for each.
    #[inline(always)]
    pub(super) fn too_near(
        &self,
        problem: &Problem,
        states: &[VehicleState; STEPS],
        samples: &[usize; LANE_STEPS],
        mut add: impl FnMut(SafetyRow, f64),
    ) {
        let own = Disc::of(problem.av.length, problem.av.width);
        let headings: [f64; LANE_STEPS] = std::array::from_fn(|i| states[lane_step(i)].heading);
        let (mut sine, mut cosine) = ([0.0; LANE_STEPS], [0.0; LANE_STEPS]);
        sincos_all(&headings, &mut sine, &mut cosine);
        let wider = if self.across > self.along { self.across } else { self.along };
        let mut sides = [Side::Clear; NEIGHBORS];
        for i in 0..LANE_STEPS {
            let step = lane_step(i);
            let state = &states[step];
            for (j, neighbor) in problem.neighbors.iter().enumerate() {
                let Some(PlacedNeighbor { track, .. }) = neighbor else { continue };
                let (dx, dy) = (state.x - track.x[i], state.y - track.y[i]);
                let reach =
                    own.radius + own.slide + track.radius + track.slide + wider + self.deviations * track.spread[i];
                let squared = dx * dx + dy * dy;
                if squared > reach * reach {
                    sides[j] = Side::Clear;
                    continue;
                }
                let av = own.axis((cosine[i], sine[i]));
                let meeting = Meeting { along: problem.line.direction(samples[i]), offset: (dx, dy), av };
                let radii = own.radius + track.radius;
                if let Some((value, away, turn)) = self.meet(&meeting, radii, track, i, &mut sides[j]) {
                    let distance = squared.sqrt();
                    let row = SafetyRow { step, key: i, neighbor: j, distance, away, turn, value_away: away };
                    add(row, value);
                }
            }
        }
    }

    /// The row's value (m), and how fast it falls with the AV's position and heading; `None` where it is zero.
    #[inline(always)]
    fn meet(
        &self,
        meeting: &Meeting,
        radii: f64,
        track: &Track,
        look: usize,
        side: &mut Side,
    ) -> Option<(f64, (f64, f64), f64)> {
        let (cosine, sine) = meeting.along;
        let to_line = |(x, y): (f64, f64)| (x * cosine + y * sine, y * cosine - x * sine);
        let (along, across) = to_line(meeting.offset);
        let (xx, xy, yy) = track.covariance[look];
        let mixed = 2.0 * cosine * sine * xy;
        let deviation = |variance: f64| if variance > 0.0 { self.deviations * variance.sqrt() } else { 0.0 };
        let a = radii + self.along + deviation(cosine * cosine * xx + mixed + sine * sine * yy);
        let b = radii + self.across + deviation(sine * sine * xx - mixed + cosine * cosine * yy);
        let scaled = |(s, l): (f64, f64)| (s / a, l / b);
        let (offset, own) = ((along / a, across / b), to_line(meeting.av));
        let (u, v) = (scaled(own), scaled(to_line(track.axis[look])));
        let slide = SLIDE / a * (SLIDE / a);
        let (p, q) = nearest_pair(offset, u, v, slide);
        let apart = (offset.0 + p * u.0 - q * v.0, offset.1 + p * u.1 - q * v.1);
        let share = (apart.0 * apart.0 + apart.1 * apart.1 + slide * (p * p + q * q)).sqrt();
        if share >= 1.0 || share.is_nan() {
            *side = Side::Clear;
            return None;
        }
        let scale = radii + self.along;
        *side = side.next(along, apart, (apart.1 * b).abs() < radii);
        match side {
            Side::Behind => return None,
            Side::Ahead if along > 0.0 => return Some((scale + along, (-cosine, -sine), 0.0)),
            _ => {}
        }
        if share == 0.0 {
            return Some((scale, (0.0, 0.0), 0.0));
        }
        let (s, l) = (scale * apart.0 / (share * a), scale * apart.1 / (share * b));
        let away = (s * cosine - l * sine, s * sine + l * cosine);
        Some((scale * (1.0 - share), away, p * (l * own.0 - s * own.1)))
    }
}

/// Where a neighbor is that is within the margins, by where it came from.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    /// It is not.
    Clear,
    /// In front of the AV: the AV came up to it.
    Ahead,
    /// In the AV's back: it came up to the AV.
    Behind,
    /// It came from the side, or one passed the other with room between them.
    Beside,
}

impl Side {
    /// The side at a look. The AV's center is `along` (m) ahead of the neighbor's, `apart` is the nearest pair's difference as a share of the
    /// margins; `through` says that they could not pass each other.
    #[inline(always)]
    fn next(self, along: f64, apart: (f64, f64), through: bool) -> Self {
        let lengthwise = apart.0.abs() > apart.1.abs();
        match self {
            Self::Clear if lengthwise && along < 0.0 => Self::Ahead,
            Self::Clear if lengthwise => Self::Behind,
            Self::Ahead if along > 0.0 && !through => Self::Beside,
            Self::Behind if along < 0.0 && !through => Self::Beside,
            Self::Clear => Self::Beside,
            _ => self,
        }
    }
}

/// The AV near a neighbor: the line's direction (cosine, sine), from the neighbor's center to the AV's, and the AV's axis.
struct Meeting {
    along: (f64, f64),
    offset: (f64, f64),
    av: (f64, f64),
}

/// The p and q in [-1, 1] that minimize `|offset + p u - q v|^2 + slide (p^2 + q^2)`.
///
/// First p for the best q there is, held to its range, then q for that p. If it was out of its range, it is at that end, and p is
/// the best one for it: two variables and a convex sum need no more.
#[inline(always)]
fn nearest_pair(offset: (f64, f64), u: (f64, f64), v: (f64, f64), slide: f64) -> (f64, f64) {
    let dot = |a: (f64, f64), b: (f64, f64)| a.0 * b.0 + a.1 * b.1;
    let (uu, vv, uv) = (dot(u, u) + slide, dot(v, v) + slide, dot(u, v));
    let (du, dv) = (dot(offset, u), dot(offset, v));
    let held = |value: f64| value.clamp(-1.0, 1.0);
    let p = held((uv * dv - du * vv) / (uu * vv - uv * uv));
    let free = (p * uv + dv) / vv;
    let q = held(free);
    (if q == free { p } else { held((q * uv - du) / uu) }, q)
}
