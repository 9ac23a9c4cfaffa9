//! Curves that lanes, lines and drives lie on.

use std::f64::consts::PI;

use world::geometry::{Point, Point3, Pose, wrap_angle};

/// Distance between two samples of a curve as it is laid (m).
const SAMPLE: f64 = 0.1;

/// Distance between two points of a map's polyline (m), as in WOMD.
const MAP_SPACING: f64 = 0.5;

/// A stretch whose curvature goes linearly from one value to another: a straight, an arc or a clothoid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    length: f64,
    from: f64,
    to: f64,
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

/// A curve with stations along it; headings run on without wrapping.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    stations: Vec<f64>,
    poses: Vec<Pose>,
}

impl Curve {
    /// The curve from `start` on through `pieces`.
    pub(super) fn new(start: Pose, pieces: &[Piece]) -> Self {
        let (mut station, mut pose) = (0.0, start);
        let mut curve = Self { stations: vec![0.0], poses: vec![start] };
        for piece in pieces {
            let count = (piece.length / SAMPLE).ceil().max(1.0);
            let step = piece.length / count;
            for k in 0..count as usize {
                let at = |s: f64| piece.from * s + 0.5 * (piece.to - piece.from) * s * s / piece.length.max(1e-9);
                let from = k as f64 * step;
                let turned = |s: f64| at(s) - at(from);
                let direction = Point::unit(pose.heading + turned(from + 0.5 * step));
                pose = Pose::new(
                    pose.x + direction.x * step,
                    pose.y + direction.y * step,
                    pose.heading + turned(from + step),
                );
                station += step;
                curve.stations.push(station);
                curve.poses.push(pose);
            }
        }
        curve
    }

    /// The straight from `from` to `to`.
    pub(super) fn line(from: Point, to: Point) -> Self {
        Self::new(Pose::new(from.x, from.y, (to - from).heading()), &[straight(from.distance(to))])
    }

    pub(super) fn length(&self) -> f64 {
        self.stations[self.stations.len() - 1]
    }

    pub(super) fn start(&self) -> Pose {
        self.poses[0]
    }

    pub(super) fn end(&self) -> Pose {
        self.poses[self.poses.len() - 1]
    }

    /// The pose at `station`; before and after the curve straight on.
    pub(super) fn pose(&self, station: f64) -> Pose {
        let beyond = |pose: Pose, by: f64| {
            let point = pose.position() + Point::unit(pose.heading) * by;
            Pose::new(point.x, point.y, pose.heading)
        };
        if station <= 0.0 {
            return beyond(self.start(), station);
        }
        let next = self.stations.partition_point(|s| *s < station);
        if next == self.stations.len() {
            return beyond(self.end(), station - self.length());
        }
        let (a, b) = (self.poses[next - 1], self.poses[next]);
        let part = (station - self.stations[next - 1]) / (self.stations[next] - self.stations[next - 1]);
        let mix = |from: f64, to: f64| from + part * (to - from);
        Pose::new(mix(a.x, b.x), mix(a.y, b.y), mix(a.heading, b.heading))
    }

    /// Curvature at `station` (1/m), over two metres.
    pub(super) fn curvature(&self, station: f64) -> f64 {
        let (from, to) = ((station - 1.0).max(0.0), (station + 1.0).min(self.length()));
        if to <= from { 0.0 } else { (self.pose(to).heading - self.pose(from).heading) / (to - from) }
    }

    /// The curve `offset(station)` to the left of this one.
    pub(super) fn shifted_by(&self, offset: impl Fn(f64) -> f64) -> Self {
        let points: Vec<Point> = self
            .stations
            .iter()
            .zip(&self.poses)
            .map(|(station, pose)| pose.to_world(Point::new(0.0, offset(*station))))
            .collect();
        let last = points.len() - 1;
        let (mut station, mut curve) = (0.0, Self { stations: Vec::new(), poses: Vec::new() });
        for (index, point) in points.iter().enumerate() {
            let chord = points[(index + 1).min(last)] - points[index.saturating_sub(1)];
            let along = self.poses[index].heading;
            station += if index == 0 { 0.0 } else { point.distance(points[index - 1]) };
            curve.stations.push(station);
            curve.poses.push(Pose::new(point.x, point.y, along + wrap_angle(chord.heading() - along)));
        }
        curve
    }

    /// The parallel curve, `offset` (m) to the left.
    pub(super) fn shifted(&self, offset: f64) -> Self {
        self.shifted_by(|_| offset)
    }

    /// The same curve driven backwards.
    pub(super) fn reversed(&self) -> Self {
        let length = self.length();
        Self {
            stations: self.stations.iter().rev().map(|station| length - station).collect(),
            poses: self.poses.iter().rev().map(|pose| Pose::new(pose.x, pose.y, pose.heading + PI)).collect(),
        }
    }

    /// The stretch from one station to another.
    pub(super) fn slice(&self, from: f64, to: f64) -> Self {
        let inside = |station: f64| station > from + 1e-6 && station < to - 1e-6;
        let kept = self.stations.iter().zip(&self.poses).filter(|(station, _)| inside(**station));
        let ends = [(from, self.pose(from)), (to, self.pose(to))];
        let all: Vec<(f64, Pose)> =
            std::iter::once(ends[0]).chain(kept.map(|(s, p)| (*s, *p))).chain(std::iter::once(ends[1])).collect();
        Self { stations: all.iter().map(|(s, _)| s - from).collect(), poses: all.iter().map(|(_, p)| *p).collect() }
    }

    /// This curve and `next`, which begins where this one ends; its headings are turned on by whole circles to fit.
    pub(super) fn then(mut self, next: &Self) -> Self {
        let (length, end) = (self.length(), self.end());
        let turns = end.heading + wrap_angle(next.start().heading - end.heading) - next.start().heading;
        for (station, pose) in next.stations.iter().zip(&next.poses).skip(1) {
            self.stations.push(length + station);
            self.poses.push(Pose::new(pose.x, pose.y, pose.heading + turns));
        }
        self
    }

    /// The curve as a map holds it: a point every half metre, and its last.
    pub(super) fn polyline(&self) -> Vec<Point3> {
        let count = (self.length() / MAP_SPACING - 1e-6).ceil().max(1.0) as usize;
        let mut points: Vec<Point3> = (0..count).map(|k| point3(self.pose(k as f64 * MAP_SPACING))).collect();
        points.push(point3(self.end()));
        points
    }
}

fn point3(pose: Pose) -> Point3 {
    Point3::new(pose.x, pose.y, 0.0)
}
