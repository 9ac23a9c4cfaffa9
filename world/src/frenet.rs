//! The Frenet frame of a reference line: how far along it, and how far to its left.
//!
//! Between samples the line is a cubic that meets both with their headings, so its direction does not jump, and rates are the
//! exact derivatives of the coordinates. Before its first sample and past its last the line goes straight on. Coordinates
//! are unique nearer to the line than its radius of curvature; farther inside a bend those near the given sample are meant.

use std::sync::Arc;

use crate::geometry::{Point, wrap_angle};
use crate::reference_line::ReferenceLine;
use crate::vehicle::VehicleState;

/// A line with the station of each of its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct FrenetFrame {
    line: Arc<ReferenceLine>,
    stations: Vec<f64>,
}

/// A place along and beside a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrenetPoint {
    /// Distance along the line from its first sample (m).
    pub station: f64,
    /// Distance from the line (m), positive to the left.
    pub lateral: f64,
}

/// A vehicle along and beside a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrenetState {
    /// Where it is.
    pub at: FrenetPoint,
    /// Its heading relative to the line's (rad, in [-pi, pi)).
    pub heading: f64,
    /// Change of the station (m/s).
    pub station_rate: f64,
    /// Change of the lateral offset (m/s).
    pub lateral_rate: f64,
}

/// The line at one place: position and its derivatives by the station.
#[derive(Clone, Copy)]
struct LinePoint {
    position: Point,
    first: Point,
    second: Point,
}

impl LinePoint {
    fn forward(&self) -> Point {
        self.first * (1.0 / self.first.norm())
    }

    /// How far `point` lies ahead of the normal through this place: 0 at its foot.
    fn ahead(&self, point: Point) -> f64 {
        (point - self.position).dot(self.first)
    }

    /// What [`LinePoint::ahead`] loses per metre of station: positive nearer than the radius of curvature.
    fn descent(&self, point: Point) -> f64 {
        self.first.norm_squared() - (point - self.position).dot(self.second)
    }
}

impl FrenetFrame {
    /// The frame of `line`; `None` where it has fewer than two samples.
    #[must_use]
    pub fn new(line: Arc<ReferenceLine>) -> Option<Self> {
        if line.len() < 2 {
            return None;
        }
        let mut stations = vec![0.0];
        for index in 1..line.len() {
            stations.push(stations[index - 1] + line.point(index - 1).distance(line.point(index)));
        }
        Some(Self { line, stations })
    }

    /// The station of sample `index` (m).
    #[must_use]
    pub fn station_of(&self, index: usize) -> f64 {
        self.stations[index]
    }

    /// Length of the line (m).
    #[must_use]
    pub fn length(&self) -> f64 {
        self.stations[self.stations.len() - 1]
    }

    /// Where `point` lies along and beside the line, near sample `nearest`: the one nearest to it.
    #[must_use]
    pub fn point_to_frenet(&self, point: Point, nearest: usize) -> FrenetPoint {
        let station = self.foot(point, nearest);
        let at = self.at(station);
        FrenetPoint { station, lateral: at.forward().cross(point - at.position) }
    }

    /// The point at this station and lateral offset.
    #[must_use]
    pub fn point_to_world(&self, at: FrenetPoint) -> Point {
        let line = self.at(at.station);
        let forward = line.forward();
        line.position + Point::new(-forward.y, forward.x) * at.lateral
    }

    /// A vehicle along and beside the line, near sample `nearest`.
    #[must_use]
    pub fn state_to_frenet(&self, state: VehicleState, nearest: usize) -> FrenetState {
        let position = state.pose().position();
        let at = self.point_to_frenet(position, nearest);
        let line = self.at(at.station);
        let velocity = Point::unit(state.heading) * state.speed;
        FrenetState {
            at,
            heading: wrap_angle(state.heading - line.first.heading()),
            station_rate: velocity.dot(line.first) / line.descent(position),
            lateral_rate: line.forward().cross(velocity),
        }
    }

    /// The vehicle in the plane; the inverse of [`FrenetFrame::state_to_frenet`] for speeds that are not negative.
    #[must_use]
    pub fn state_to_world(&self, state: FrenetState) -> VehicleState {
        let Point { x, y } = self.point_to_world(state.at);
        let line = self.at(state.at.station);
        let along = state.station_rate * line.descent(Point::new(x, y)) / line.first.norm();
        let heading = wrap_angle(line.first.heading() + state.heading);
        VehicleState { x, y, heading, speed: Point::new(along, state.lateral_rate).norm() }
    }

    /// The piece between two samples that holds `station`.
    fn piece(&self, station: f64) -> usize {
        self.stations.partition_point(|s| *s <= station).saturating_sub(1).min(self.stations.len() - 2)
    }

    fn at(&self, station: f64) -> LinePoint {
        if station < 0.0 {
            return self.straight(0, station);
        }
        if station > self.length() {
            return self.straight(self.stations.len() - 1, station - self.length());
        }
        self.within(self.piece(station), station)
    }

    fn straight(&self, sample: usize, ahead: f64) -> LinePoint {
        let first = Point::unit(self.line.heading[sample]);
        LinePoint { position: self.line.point(sample) + first * ahead, first, second: Point::default() }
    }

    /// Hermite's cubic over the piece from sample `index` to the next.
    fn within(&self, index: usize, station: f64) -> LinePoint {
        let (start, end) = (self.line.point(index), self.line.point(index + 1));
        let length = self.stations[index + 1] - self.stations[index];
        if length <= 0.0 {
            return self.straight(index, 0.0);
        }
        let (leave, arrive) = (Point::unit(self.line.heading[index]), Point::unit(self.line.heading[index + 1]));
        let slope = (end - start) * (1.0 / length);
        let (square, cube) = (
            (slope * 3.0 - leave * 2.0 - arrive) * (1.0 / length),
            (leave + arrive - slope * 2.0) * (1.0 / (length * length)),
        );
        let t = station - self.stations[index];
        LinePoint {
            position: start + leave * t + square * (t * t) + cube * (t * t * t),
            first: leave + square * (2.0 * t) + cube * (3.0 * t * t),
            second: square * 2.0 + cube * (6.0 * t),
        }
    }

    /// The station at which `point` lies on the normal of the line.
    fn foot(&self, point: Point, nearest: usize) -> f64 {
        let last = self.stations.len() - 1;
        let ahead = |sample: usize| (point - self.line.point(sample)).dot(Point::unit(self.line.heading[sample]));
        // From the nearest sample to the piece over which the point passes from ahead to behind: nearly always beside it.
        let mut sample = nearest.min(last);
        while sample < last && ahead(sample) > 0.0 {
            sample += 1;
        }
        while sample > 0 && ahead(sample) < 0.0 {
            sample -= 1;
        }
        let beyond = ahead(sample);
        if (sample == 0 && beyond < 0.0) || (sample == last && beyond > 0.0) {
            return self.stations[sample] + beyond;
        }
        if sample == last {
            return self.stations[last];
        }
        self.root(point, sample)
    }

    /// Newton's steps within a piece, halved where they would leave the bracket.
    fn root(&self, point: Point, piece: usize) -> f64 {
        let (mut low, mut high) = (self.stations[piece], self.stations[piece + 1]);
        let mut station = 0.5 * (low + high);
        for _ in 0..60 {
            let at = self.within(piece, station);
            let ahead = at.ahead(point);
            if ahead > 0.0 {
                low = station
            } else {
                high = station
            }
            let step = ahead / at.descent(point);
            let next = station + step;
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            if (next - station).abs() < 1e-13 * (1.0 + station) {
                return next;
            }
            station = next;
        }
        station
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference_line::SAMPLE_SPACING;

    /// A line whose curvature swings between -0.05 and 0.05 (1/m), 60 m long.
    fn winding() -> FrenetFrame {
        let mut line = ReferenceLine::default();
        let (mut at, mut heading) = (Point::default(), 0.0);
        for index in 0..600 {
            line.x.push(at.x);
            line.y.push(at.y);
            line.heading.push(heading);
            // Fine steps, so that samples and headings belong together.
            for part in 0..100 {
                let station = SAMPLE_SPACING * (f64::from(index) + f64::from(part) * 0.01);
                heading += 0.05 * libm::sin(station * 0.2) * SAMPLE_SPACING * 0.01;
                at = at + Point::unit(heading) * (SAMPLE_SPACING * 0.01);
            }
        }
        FrenetFrame::new(Arc::new(line)).unwrap()
    }

    fn nearest(frame: &FrenetFrame, point: Point) -> usize {
        let distance = |index: &usize| frame.line.point(*index).distance(point);
        (0..frame.line.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    }

    #[test]
    fn past_both_ends_the_line_goes_straight_on() {
        let frame = winding();
        let before = frame.point_to_frenet(Point::new(-3.0, 2.0), 0);
        assert!((before.station + 3.0).abs() < 1e-12 && (before.lateral - 2.0).abs() < 1e-12);
        let at = FrenetPoint { station: frame.length() + 4.0, lateral: -1.0 };
        let beyond = frame.point_to_world(at);
        let found = frame.point_to_frenet(beyond, nearest(&frame, beyond));
        assert!((found.station - at.station).abs() < 1e-9 && (found.lateral - at.lateral).abs() < 1e-9);
    }

    #[test]
    fn a_line_of_one_sample_has_no_frame() {
        let line = ReferenceLine { x: vec![0.0], y: vec![0.0], heading: vec![0.0], ..ReferenceLine::default() };
        assert!(FrenetFrame::new(Arc::new(line)).is_none());
    }

    proptest! {
        #[test]
        fn to_the_world_and_back_is_the_identity(station in -5.0..65.0, lateral in -8.0..8.0) {
            let frame = winding();
            let point = frame.point_to_world(FrenetPoint { station, lateral });
            let found = frame.point_to_frenet(point, nearest(&frame, point));
            prop_assert!((found.station - station).abs() < 1e-9, "{} {}", found.station, station);
            prop_assert!((found.lateral - lateral).abs() < 1e-9);
        }

        #[test]
        fn a_state_goes_to_the_world_and_back(
            station in 0.0..59.0, lateral in -8.0..8.0, heading in -3.0..3.0, speed in 0.1..30.0,
        ) {
            let frame = winding();
            let Point { x, y } = frame.point_to_world(FrenetPoint { station, lateral });
            let state = VehicleState { x, y, heading, speed };
            let back = frame.state_to_world(frame.state_to_frenet(state, nearest(&frame, Point::new(x, y))));
            prop_assert!(state.pose().position().distance(back.pose().position()) < 1e-9);
            prop_assert!((back.speed - speed).abs() < 1e-9 && wrap_angle(back.heading - heading).abs() < 1e-9);
        }

        #[test]
        fn rates_are_the_derivatives_of_the_coordinates(
            piece in 10..580_usize, part in 0.01..0.99, lateral in -8.0..8.0, heading in -3.0..3.0, speed in 1.0..20.0,
        ) {
            let frame = winding();
            // Within a piece: the second derivative of the line, and so the rate of the station, steps at its samples.
            let station = frame.station_of(piece) + part * (frame.station_of(piece + 1) - frame.station_of(piece));
            let Point { x, y } = frame.point_to_world(FrenetPoint { station, lateral });
            let state = VehicleState { x, y, heading, speed };
            let found = frame.state_to_frenet(state, nearest(&frame, Point::new(x, y)));
            let dt = 1e-6;
            let at = |time: f64| {
                let point = Point::new(x, y) + Point::unit(heading) * (speed * time);
                frame.point_to_frenet(point, nearest(&frame, point))
            };
            let (before, after) = (at(-dt), at(dt));
            prop_assert!(((after.station - before.station) / (2.0 * dt) - found.station_rate).abs() < 1e-3);
            prop_assert!(((after.lateral - before.lateral) / (2.0 * dt) - found.lateral_rate).abs() < 1e-3);
        }
    }
}
