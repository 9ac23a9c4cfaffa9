//! Curves that lanes, lines and drives lie on.
//!
//! A curve is held by samples at equal steps of at most [`SPACING`]: they are the points of a map's polyline, and a pose between two
//! of them is found at once, by a cubic through both that keeps their directions.

use std::f64::consts::PI;

use world::geometry::{Point, Point3, Pose, wrap_angle};

/// Largest distance between two samples (m): that of a map's polylines, as in WOMD.
const SPACING: f64 = 0.5;

/// Of a turn that [`Curve::join`] lays, each of the two clothoids takes this share.
const RAMP_SHARE: f64 = 0.25;

/// Directions that differ by less (rad) are joined by an S, not by a turn.
const NEARLY_PARALLEL: f64 = 0.08;

/// A turn sharper than this (rad) has no tangents to speak of.
const SHARPEST: f64 = 2.7;

/// A stretch whose curvature goes linearly from one value to another: a straight, an arc or a clothoid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) length: f64,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Piece {
    /// How far the heading has turned after `s` metres.
    fn turned(&self, s: f64) -> f64 {
        if self.is_straight() {
            0.0
        } else {
            self.from * s + 0.5 * (self.to - self.from) * s * s / self.length.max(1e-9)
        }
    }

    fn is_straight(&self) -> bool {
        self.from == 0.0 && self.to == 0.0
    }
}

/// A straight.
pub(super) fn straight(length: f64) -> Piece {
    Piece { length, from: 0.0, to: 0.0 }
}

/// A turn by `angle` (rad, left is positive) as roads are built: a clothoid of length `ramp` in, an arc, the same clothoid out; so
/// the front wheels never jump.
pub(super) fn turn(angle: f64, radius: f64, ramp: f64) -> [Piece; 3] {
    let curvature = angle.signum() / radius;
    let arc = angle.abs() * radius - ramp;
    debug_assert!(arc >= 0.0, "the clothoids alone turn further");
    [
        Piece { length: ramp, from: 0.0, to: curvature },
        Piece { length: arc, from: curvature, to: curvature },
        Piece { length: ramp, from: curvature, to: 0.0 },
    ]
}

/// A point of a curve. The direction is kept beside the heading to spare its sine and cosine wherever the curve is looked up.
#[derive(Clone, Copy, Debug)]
struct Sample {
    pose: Pose,
    along: Point,
}

impl Sample {
    fn new(pose: Pose) -> Self {
        Self { pose, along: Point::unit(pose.heading) }
    }

    /// The sample straight ahead by `distance`.
    fn ahead(self, distance: f64) -> Self {
        let Point { x, y } = self.pose.position() + self.along * distance;
        Self { pose: Pose::new(x, y, self.pose.heading), along: self.along }
    }

    /// The sample `offset` to the left.
    fn left(self, offset: f64) -> Self {
        let (Pose { x, y, heading }, along) = (self.pose, self.along);
        Self { pose: Pose::new(x - along.y * offset, y + along.x * offset, heading), along }
    }

    /// Between this sample and one that is `distance` further, at the share `t`, by cubics; `slopes` are how much the heading turns
    /// in one step before and after.
    fn between(&self, next: &Self, distance: f64, slopes: (f64, f64), t: f64) -> Self {
        let pose = self.pose_between(next, distance, slopes, t);
        let (a, b) = (self.pose.position(), next.pose.position());
        let t2 = t * t;
        let (d10, d01, d11) = (3.0 * t2 - 4.0 * t + 1.0, 6.0 * (t - t2), 3.0 * t2 - 2.0 * t);
        let along = (b - a) * d01 + (self.along * d10 + next.along * d11) * distance;
        let norm = along.norm();
        let along = if norm > 1e-9 { along * (1.0 / norm) } else { self.along };
        Self { pose, along }
    }

    /// The pose of [`Sample::between`] alone.
    fn pose_between(&self, next: &Self, distance: f64, slopes: (f64, f64), t: f64) -> Pose {
        let (a, b) = (self.pose.position(), next.pose.position());
        let [h10, h01, h11] = hermite(t);
        let at = a + (b - a) * h01 + (self.along * h10 + next.along * h11) * distance;
        Pose::new(at.x, at.y, self.heading_between(next, slopes, t))
    }

    /// The heading of [`Sample::between`] alone.
    fn heading_between(&self, next: &Self, slopes: (f64, f64), t: f64) -> f64 {
        let [h10, h01, h11] = hermite(t);
        let turned = next.pose.heading - self.pose.heading;
        self.pose.heading + turned * h01 + slopes.0 * h10 + slopes.1 * h11
    }
}

/// Hermite's cubics at the share `t` of a stretch: the weights of the slope at its start, of the step, and of the slope at its end.
fn hermite(t: f64) -> [f64; 3] {
    let (t2, t3) = (t * t, t * t * t);
    [t3 - 2.0 * t2 + t, 3.0 * t2 - 2.0 * t3, t3 - t2]
}

/// Where a station lies: a share of a step after a sample, or beyond the sample at an end by so many metres.
enum At {
    Within { index: usize, share: f64 },
    Beyond { end: usize, by: f64 },
}

/// A curve with stations along it; headings run on without wrapping.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    step: f64,
    /// At least two.
    samples: Vec<Sample>,
}

/// Into how many steps a length is cut.
fn steps(length: f64) -> usize {
    (length / SPACING - 1e-6).ceil().max(1.0) as usize
}

impl Curve {
    /// The curve from `start` on through `pieces`.
    pub(super) fn new(start: Pose, pieces: &[Piece]) -> Self {
        let length: f64 = pieces.iter().map(|piece| piece.length).sum();
        let count = steps(length);
        let step = length / count as f64;
        let mut walk = Walk { sample: Sample::new(start), pieces, piece: 0, into: 0.0, from: start.heading };
        let mut samples = Vec::with_capacity(count + 1);
        samples.push(walk.sample);
        for _ in 0..count {
            walk.advance(step);
            samples.push(walk.sample);
        }
        Self { step, samples }
    }

    /// The straight from `from` to `to`.
    pub(super) fn line(from: Point, to: Point) -> Self {
        Self::new(Pose::new(from.x, from.y, (to - from).heading()), &[straight(from.distance(to))])
    }

    /// A way from one pose to another, for vehicles: straights and one turn with clothoids, as large as it fits; an S where the two
    /// look nearly the same way, or where no turn leads from one to the other.
    pub(super) fn join(from: Pose, to: Pose) -> Self {
        Self::join_within(from, to, f64::INFINITY)
    }

    /// The same with a turn whose arc has at most this radius (m).
    pub(super) fn join_within(from: Pose, to: Pose, largest_radius: f64) -> Self {
        let angle = wrap_angle(to.heading - from.heading);
        let to = Pose::new(to.x, to.y, from.heading + angle);
        let (start, end) = (Point::unit(from.heading), Point::unit(to.heading));
        let gap = to.position() - from.position();
        let (sine, cosine) = (start.cross(end), start.dot(end));
        let joined = if (NEARLY_PARALLEL..SHARPEST).contains(&angle.abs()) {
            // The tangents meet `before` metres ahead of the one and `after` metres behind the other.
            let (before, after) = (gap.cross(end) / sine, start.cross(gap) / sine);
            let (extent, arc) = turn_extent(angle.abs(), sine.abs(), cosine);
            let fits = before.min(after);
            let tangent = fits.min(largest_radius / arc * extent);
            // A turn that needs more than twice the room of its straight is no turn but a lane's shift: an S bends less.
            (tangent > 0.3 && before.max(after) < 40.0 * tangent).then(|| {
                let scale = tangent / extent;
                let [ramp_in, arc, ramp_out] = turn(angle, arc * scale, RAMP_SHARE * scale);
                Self::new(from, &[straight(before - tangent), ramp_in, arc, ramp_out, straight(after - tangent)])
            })
        } else {
            None
        };
        let curve = joined.unwrap_or_else(|| Self::s_bend(from, to));
        curve.ending_at(to)
    }

    /// The same with exactly this pose at its end, from which it is no more than a rounding error away.
    pub(super) fn ending_at(mut self, pose: Pose) -> Self {
        if let Some(last) = self.samples.last_mut() {
            *last = Sample::new(pose);
        }
        self
    }

    /// A quintic from one pose to another, straight at both ends.
    fn s_bend(from: Pose, to: Pose) -> Self {
        let (a, b) = (from.position(), to.position());
        let (start, end) = (Sample::new(from), Sample::new(to));
        let reach = a.distance(b);
        let count = steps(reach).max(8);
        let mut rows = Vec::with_capacity(count + 1);
        rows.push((0.0, start));
        for k in 1..=count {
            let t = k as f64 / count as f64;
            let (t2, t3, t4, t5) = (t * t, t * t * t, t * t * t * t, t * t * t * t * t);
            let weights = |h: [f64; 4]| a * h[0] + b * h[1] + start.along * (reach * h[2]) + end.along * (reach * h[3]);
            let shift = 10.0 * t3 - 15.0 * t4 + 6.0 * t5;
            let leave = t - 6.0 * t3 + 8.0 * t4 - 3.0 * t5;
            let arrive = -4.0 * t3 + 7.0 * t4 - 3.0 * t5;
            let at = weights([1.0 - shift, shift, leave, arrive]);
            let shift = 30.0 * t2 - 60.0 * t3 + 30.0 * t4;
            let leave = 1.0 - 18.0 * t2 + 32.0 * t3 - 15.0 * t4;
            let arrive = -12.0 * t2 + 28.0 * t3 - 15.0 * t4;
            let velocity = weights([-shift, shift, leave, arrive]);
            let (before_station, before): (f64, Sample) = rows[k - 1];
            let turned =
                if velocity.norm() > 1e-9 { wrap_angle(velocity.heading() - before.pose.heading) } else { 0.0 };
            let sample = Sample::new(Pose::new(at.x, at.y, before.pose.heading + turned));
            rows.push((before_station + arc_length(&before, &sample), sample));
        }
        Self::resampled(&rows)
    }

    /// The curve through samples at any stations, which begin at 0.
    fn resampled(rows: &[(f64, Sample)]) -> Self {
        let last = rows.len() - 1;
        let length = rows[last].0;
        let count = steps(length);
        let step = length / count as f64;
        let mut samples = Vec::with_capacity(count + 1);
        samples.push(rows[0].1);
        let mut at = 0;
        for k in 1..count {
            let station = k as f64 * step;
            while at + 1 < last && rows[at + 1].0 < station {
                at += 1;
            }
            let ((from, a), (to, b)) = (&rows[at], &rows[at + 1]);
            let distance = (to - from).max(1e-12);
            let rate = |i: usize, j: usize| {
                (rows[j].1.pose.heading - rows[i].1.pose.heading) / (rows[j].0 - rows[i].0).max(1e-12) * distance
            };
            let slopes = (rate(at.saturating_sub(1), at + 1), rate(at, (at + 2).min(last)));
            samples.push(a.between(b, distance, slopes, (station - from) / distance));
        }
        samples.push(rows[last].1);
        Self { step, samples }
    }

    pub(super) fn length(&self) -> f64 {
        self.step * (self.samples.len() - 1) as f64
    }

    pub(super) fn start(&self) -> Pose {
        self.samples[0].pose
    }

    pub(super) fn end(&self) -> Pose {
        self.samples[self.samples.len() - 1].pose
    }

    /// The distance between two of its points (m).
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// Its points, [`Curve::step`] apart.
    pub(super) fn points(&self) -> impl DoubleEndedIterator<Item = Point> + ExactSizeIterator {
        self.samples.iter().map(|sample| sample.pose.position())
    }

    /// Where `station` lies among the samples.
    fn at(&self, station: f64) -> At {
        let last = self.samples.len() - 1;
        if station <= 0.0 || self.step <= 0.0 {
            return At::Beyond { end: 0, by: station };
        }
        let share = station / self.step;
        // Beyond what a number of samples can be, it is beyond the end as well.
        let index = share as usize;
        if index >= last {
            return At::Beyond { end: last, by: station - self.length() };
        }
        At::Within { index, share: share - index as f64 }
    }

    /// How much the heading turns in one step, before and after the stretch that begins at a sample.
    fn slopes(&self, index: usize) -> (f64, f64) {
        let heading = |index: usize| self.samples[index].pose.heading;
        let turned = heading(index + 1) - heading(index);
        let before = if index == 0 { turned } else { 0.5 * (heading(index + 1) - heading(index - 1)) };
        let after = if index + 2 < self.samples.len() { 0.5 * (heading(index + 2) - heading(index)) } else { turned };
        (before, after)
    }

    fn sample(&self, station: f64) -> Sample {
        match self.at(station) {
            At::Beyond { end, by } => self.samples[end].ahead(by),
            At::Within { index, share } => {
                self.samples[index].between(&self.samples[index + 1], self.step, self.slopes(index), share)
            }
        }
    }

    /// The heading at `station`.
    fn heading(&self, station: f64) -> f64 {
        match self.at(station) {
            At::Beyond { end, .. } => self.samples[end].pose.heading,
            At::Within { index, share } => {
                self.samples[index].heading_between(&self.samples[index + 1], self.slopes(index), share)
            }
        }
    }

    /// The pose at `station`; before and after the curve straight on.
    pub(super) fn pose(&self, station: f64) -> Pose {
        match self.at(station) {
            At::Beyond { end, by } => self.samples[end].ahead(by).pose,
            At::Within { index, share } => {
                self.samples[index].pose_between(&self.samples[index + 1], self.step, self.slopes(index), share)
            }
        }
    }

    /// The point `left` (m) to the left of the curve at `station`.
    pub(super) fn beside(&self, station: f64, left: f64) -> Point {
        self.sample(station).left(left).pose.position()
    }

    /// Curvature at `station` (1/m), over two metres.
    pub(super) fn curvature(&self, station: f64) -> f64 {
        let (from, to) = ((station - 1.0).max(0.0), (station + 1.0).min(self.length()));
        if to <= from { 0.0 } else { (self.heading(to) - self.heading(from)) / (to - from) }
    }

    /// A bound of the curvature (1/m): between two samples the cubics bend by no more than four times what leads from the one to the other.
    pub(super) fn sharpest(&self) -> f64 {
        let turned = self.samples.windows(2).map(|pair| (pair[1].pose.heading - pair[0].pose.heading).abs());
        4.0 * turned.fold(0.0, f64::max) / self.step.max(1e-9)
    }

    /// The curve `offset(station)` to the left of this one.
    pub(super) fn shifted_by(&self, offset: impl Fn(f64) -> f64) -> Self {
        let mut rows: Vec<(f64, Sample)> = Vec::with_capacity(self.samples.len());
        for (index, sample) in self.samples.iter().enumerate() {
            let station = index as f64 * self.step;
            let (near, far) = ((station - 0.1).max(0.0), (station + 0.1).min(self.length()));
            let slope = if far > near { (offset(far) - offset(near)) / (far - near) } else { 0.0 };
            let mut moved = sample.left(offset(station));
            if slope != 0.0 {
                let forward = 1.0 - self.curvature(station) * offset(station);
                let turned = Point::new(forward, slope).heading();
                moved = Sample::new(Pose { heading: moved.pose.heading + turned, ..moved.pose });
            }
            let station = rows.last().map_or(0.0, |(before, last)| before + arc_length(last, &moved));
            rows.push((station, moved));
        }
        Self::resampled(&rows)
    }

    /// The parallel curve, `offset` (m) to the left.
    #[cfg(test)]
    pub(super) fn shifted(&self, offset: f64) -> Self {
        self.strip(0.0, self.length(), offset)
    }

    /// The stretch of the parallel curve, `offset` (m) to the left, between two stations of this one.
    pub(super) fn strip(&self, from: f64, to: f64, offset: f64) -> Self {
        let count = steps(to - from);
        let step = (to - from) / count as f64;
        let (start, end) = (self.sample(from), self.sample(to));
        let middle = self.sample(0.5 * (from + to));
        let turns = (start.pose.heading - end.pose.heading).abs() + (start.pose.heading - middle.pose.heading).abs();
        if turns < 1e-12 {
            let first = start.left(offset);
            let mut samples: Vec<Sample> = (0..count).map(|k| first.ahead(k as f64 * step)).collect();
            samples.push(end.left(offset));
            return Self { step, samples };
        }
        let mut rows: Vec<(f64, Sample)> = Vec::with_capacity(count + 1);
        for k in 0..=count {
            let sample = if k == count { end } else { self.sample(from + k as f64 * step) };
            let moved = sample.left(offset);
            let station = rows.last().map_or(0.0, |(before, last)| before + arc_length(last, &moved));
            rows.push((station, moved));
        }
        Self::resampled(&rows)
    }

    /// The same curve driven backwards.
    pub(super) fn reversed(&self) -> Self {
        let back = |sample: &Sample| Sample {
            pose: Pose { heading: sample.pose.heading + PI, ..sample.pose },
            along: sample.along * -1.0,
        };
        Self { step: self.step, samples: self.samples.iter().rev().map(back).collect() }
    }

    /// The stretch from one station to another.
    pub(super) fn slice(&self, from: f64, to: f64) -> Self {
        let count = steps(to - from);
        let step = (to - from) / count as f64;
        Self { step, samples: (0..=count).map(|k| self.sample(from + k as f64 * step)).collect() }
    }

    /// This curve and `next`, which begins where this one ends; its headings are turned on by whole circles to fit.
    pub(super) fn then(self, next: &Self) -> Self {
        let (length, end) = (self.length(), self.end());
        let turns = end.heading + wrap_angle(next.start().heading - end.heading) - next.start().heading;
        let own = self.samples.iter().enumerate().map(|(k, sample)| (k as f64 * self.step, *sample));
        let rest = next.samples.iter().enumerate().skip(1).map(|(k, sample)| {
            let pose = Pose { heading: sample.pose.heading + turns, ..sample.pose };
            (length + k as f64 * next.step, Sample { pose, along: sample.along })
        });
        Self::resampled(&own.chain(rest).collect::<Vec<_>>())
    }

    /// The station that is nearest to `point` (m).
    pub(super) fn nearest(&self, point: Point) -> f64 {
        let near = self.points().enumerate().map(|(index, sample)| (sample.distance_squared(point), index));
        let (_, nearest) = near.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
        let station = self.step() * nearest as f64;
        let pose = self.pose(station);
        let along = (point - pose.position()).dot(Point::unit(pose.heading));
        (station + along.clamp(-self.step(), self.step())).clamp(0.0, self.length())
    }

    /// The curve as a map holds it.
    pub(super) fn polyline(&self) -> Vec<Point3> {
        self.samples.iter().map(|sample| Point3::new(sample.pose.x, sample.pose.y, 0.0)).collect()
    }
}

/// The length of the arc from one sample to the next: the chord, and what the turn adds to it.
fn arc_length(from: &Sample, to: &Sample) -> f64 {
    let turned = to.pose.heading - from.pose.heading;
    from.pose.position().distance(to.pose.position()) * (1.0 + turned * turned / 24.0)
}

/// Walks along pieces of clothoids.
struct Walk<'a> {
    sample: Sample,
    pieces: &'a [Piece],
    piece: usize,
    /// How far into the piece (m), and the heading at its beginning.
    into: f64,
    from: f64,
}

impl Walk<'_> {
    fn advance(&mut self, step: f64) {
        let mut left = step;
        while let Some(piece) = self.pieces.get(self.piece) {
            let stretch = left.min(piece.length - self.into);
            self.within(piece, stretch);
            left -= stretch;
            let is_last = self.piece + 1 == self.pieces.len();
            if left <= 1e-9 || is_last {
                return;
            }
            self.from += piece.turned(piece.length);
            (self.piece, self.into) = (self.piece + 1, 0.0);
        }
    }

    /// Goes on by `stretch` (m) within a piece: its position by Gauss' rule of two points, right to 1e-8 m.
    fn within(&mut self, piece: &Piece, stretch: f64) {
        let Pose { x, y, .. } = self.sample.pose;
        if piece.is_straight() {
            self.sample = self.sample.ahead(stretch);
        } else {
            let heading = |s: f64| self.from + piece.turned(self.into + s);
            let near = 0.5 * stretch * (1.0 - 1.0 / 3.0_f64.sqrt());
            let moved = (Point::unit(heading(near)) + Point::unit(heading(stretch - near))) * (0.5 * stretch);
            self.sample = Sample::new(Pose::new(x + moved.x, y + moved.y, heading(stretch)));
        }
        self.into += stretch;
    }
}

/// Of a turn by `angle` that is one metre long: how far from its ends the tangents meet, and the radius of its arc.
fn turn_extent(angle: f64, sine: f64, cosine: f64) -> (f64, f64) {
    let arc = (1.0 - RAMP_SHARE) / angle;
    let ramp = RAMP_SHARE;
    // Along the first clothoid the heading is s^2 / (2 ramp arc); Fresnel's integrals by their series, right to 1e-6 for ramps that
    // turn by less than half a radian.
    let turned = 0.5 * ramp / arc;
    let (t2, t3) = (turned * turned, turned * turned * turned);
    let (x, y) = (ramp * (1.0 - t2 / 10.0 + t2 * t2 / 216.0), ramp * (turned / 3.0 - t3 / 42.0 + t2 * t3 / 1320.0));
    // The circle's centre lies beside the clothoid's end; the tangents meet where its bisector crosses the first.
    let ahead = Point::unit(turned);
    let (centre_x, centre_y) = (x - arc * ahead.y, y + arc * ahead.x);
    let half_tangent = sine / (1.0 + cosine);
    (centre_x + centre_y * half_tangent, arc)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

    use proptest::prelude::*;
    use world::geometry::angle_difference;

    use super::*;

    fn is_smooth(curve: &Curve) -> Result<(), TestCaseError> {
        let mut station = 0.0;
        while station < curve.length() {
            let (a, b) = (curve.pose(station), curve.pose(station + 0.05));
            let ahead = (b.position() - a.position()).heading();
            prop_assert!((a.position().distance(b.position()) - 0.05).abs() < 1e-4, "at {station}");
            prop_assert!(angle_difference(ahead, 0.5 * (a.heading + b.heading)).abs() < 2e-3, "at {station}");
            station += 0.05;
        }
        Ok(())
    }

    #[test]
    fn a_turn_ends_in_its_direction() {
        let curve = Curve::new(Pose::new(1.0, 2.0, 0.3), &turn(FRAC_PI_2, 20.0, 8.0));
        assert!((curve.end().heading - 0.3 - FRAC_PI_2).abs() < 1e-12);
        assert!((curve.length() - 20.0 * FRAC_PI_2 - 8.0).abs() < 1e-9);
        is_smooth(&curve).unwrap();
    }

    #[test]
    fn a_right_angle_is_joined_by_the_largest_turn_that_fits() {
        let curve = Curve::join(Pose::new(0.0, 0.0, 0.0), Pose::new(10.0, 14.0, FRAC_PI_2));
        let sharpest = (0..100).map(|k| curve.curvature(0.2 * f64::from(k))).fold(0.0, f64::max);
        assert!((0.1..0.15).contains(&sharpest), "{sharpest}");
        is_smooth(&curve).unwrap();
    }

    #[test]
    fn the_parts_of_a_curve_meet() {
        let mut pieces = vec![straight(7.3)];
        pieces.extend(turn(FRAC_PI_3, 30.0, 10.0));
        let curve = Curve::new(Pose::default(), &pieces);
        let (near, far) = (curve.strip(0.0, 17.21, -5.0), curve.strip(17.21, curve.length(), -5.0));
        assert_eq!(near.end(), far.start());
        let again = near.then(&far);
        assert!((again.length() - curve.shifted(-5.0).length()).abs() < 1e-3);
        assert!(again.pose(20.0).position().distance(curve.shifted(-5.0).pose(20.0).position()) < 1e-3);
        let back = curve.reversed().reversed();
        assert!(back.end().position().distance(curve.end().position()) < 1e-12);
    }

    proptest! {
        #[test]
        fn two_poses_are_joined_smoothly(before in 12.0..40.0, after in 12.0..40.0, heading in -2.0..2.0) {
            let (start, end) = (Point::unit(1.0), Point::unit(1.0 + heading));
            let from = Pose::new(3.0, -2.0, 1.0);
            let to = from.position() + start * before + end * after;
            let to = Pose::new(to.x, to.y, 1.0 + heading);
            let curve = Curve::join(from, to);
            prop_assert_eq!(curve.start(), from);
            prop_assert!(curve.end().position().distance(to.position()) < 1e-9);
            let last = curve.samples[curve.samples.len() - 2].ahead(curve.step).pose.position();
            prop_assert!(last.distance(to.position()) < 0.05, "{}", last.distance(to.position()));
            is_smooth(&curve)?;
        }

        #[test]
        fn parallel_curves_are_parallel(offset in -9.0..9.0, radius in 15.0..60.0, share in 0.1..0.9) {
            let curve = Curve::new(Pose::default(), &turn(1.0, radius, 0.8 * radius));
            let parallel = curve.shifted(offset);
            is_smooth(&parallel)?;
            let point = parallel.pose(share * parallel.length()).position();
            let nearest = (0..20_000).map(|k| curve.pose(f64::from(k) * curve.length() / 20_000.0).position().distance(point));
            prop_assert!((nearest.fold(f64::INFINITY, f64::min) - offset.abs()).abs() < 1e-3);
        }
    }
}
