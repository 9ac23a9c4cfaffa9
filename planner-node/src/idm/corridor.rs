//! The reference line ahead as stations, and where things lie beside it.

use world::geometry::{OrientedBox, Point, angle_difference};
use world::reference_line::{ReferenceLine, ReferenceWindow, SAMPLES_BEHIND};

/// Curvature is averaged over so many metres to either side: the line's own has kinks.
const CURVATURE_WINDOW: f64 = 1.5;

/// Samples between those that a search looks at first (about 1 m).
const COARSE: usize = 10;

/// Samples farther apart than these (20 m) may be of different passes of one place.
const PASS: usize = 200;

/// Where the line passes a place more than once, a pass may be this much farther away (m) than the nearest.
const OTHER_PASS: f64 = 2.0;

/// Farther from where its window says that the AV is (m) it is looked for in all of it.
const ASTRAY: f64 = 5.0;

/// The window of the reference line, with the distance along it.
pub struct Corridor<'a> {
    window: &'a ReferenceWindow,
    line: &'a ReferenceLine,
    /// Distance of each sample from the window's first (m).
    stations: Vec<f64>,
    /// Curvature of each sample (1/m), averaged.
    curvature: Vec<f64>,
    /// Samples at which a red light's stop point lies.
    pub red_stops: &'a [u32],
    /// Number of the window's first sample in the whole line.
    pub first_sample: usize,
}

/// Where a point lies beside the line.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The nearest sample of the window.
    pub sample: usize,
    /// Distance along the line (m) from the window's first sample.
    pub station: f64,
    /// Distance to the left of the line (m).
    pub lateral: f64,
}

/// The stretch of the corridor that a box takes.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// Nearest sample to its centre.
    pub sample: usize,
    /// First and last station (m).
    pub stations: (f64, f64),
    /// Rightmost and leftmost offset from the line (m).
    pub laterals: (f64, f64),
}

impl Footprint {
    /// The same, so many metres further along and to the left.
    pub fn moved(&self, along: f64, left: f64) -> Self {
        Self {
            sample: self.sample,
            stations: (self.stations.0 + along, self.stations.1 + along),
            laterals: (self.laterals.0 + left, self.laterals.1 + left),
        }
    }
}

impl<'a> Corridor<'a> {
    /// The corridor of a window; `None` where it has less than two samples.
    pub fn new(window: &'a ReferenceWindow) -> Option<Self> {
        let line = window.line.as_ref();
        let samples = window.samples.min(line.x.len().saturating_sub(window.start));
        if samples < 2 {
            return None;
        }
        let mut stations = Vec::with_capacity(samples);
        let mut station = 0.0;
        for i in window.start..window.start + samples {
            if i > window.start {
                station += point(line, i).distance(point(line, i - 1));
            }
            stations.push(station);
        }
        let mut corridor = Self {
            window,
            line,
            stations,
            curvature: Vec::new(),
            red_stops: &window.red_stops,
            first_sample: window.first_sample,
        };
        corridor.curvature = (0..samples).map(|i| corridor.mean_curvature(i)).collect();
        Some(corridor)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.stations.len()
    }

    /// Distance of `sample` along the line (m).
    pub fn station(&self, sample: usize) -> f64 {
        self.stations[sample.min(self.len() - 1)]
    }

    /// Curvature at `sample` (1/m), averaged over three metres.
    pub fn curvature(&self, sample: usize) -> f64 {
        self.curvature[sample.min(self.len() - 1)]
    }

    /// Heading at `sample` (rad).
    pub fn heading(&self, sample: usize) -> f64 {
        self.line.heading[self.window.start + sample.min(self.len() - 1)]
    }

    /// Speed limit at `sample` (m/s); 0 where it is not known.
    pub fn speed_limit(&self, sample: usize) -> f64 {
        self.window.speed_limit_at(self.window.start + sample.min(self.len() - 1))
    }

    /// Height of the ground at `sample` (m).
    pub fn height(&self, sample: usize) -> f64 {
        self.line.z[self.window.start + sample.min(self.len() - 1)]
    }

    /// First sample at or after `station` (m); the last one past the end.
    pub fn sample_at(&self, station: f64) -> usize {
        self.stations.partition_point(|s| *s < station).min(self.len() - 1)
    }

    /// The turn rate of the line's own heading around `sample`, from headings 1.5 m before and after: the column of
    /// curvatures comes from second derivatives of a spline and jumps at its knots.
    fn mean_curvature(&self, sample: usize) -> f64 {
        let from = self.sample_at(self.stations[sample] - CURVATURE_WINDOW);
        let to = self.sample_at(self.stations[sample] + CURVATURE_WINDOW);
        let length = self.stations[to] - self.stations[from];
        if length <= 0.0 {
            return 0.0;
        }
        angle_difference(self.heading(from), self.heading(to)) / length
    }

    fn at(&self, sample: usize) -> Point {
        point(self.line, self.window.start + sample)
    }

    /// The sample nearest to the AV. A window begins [`SAMPLES_BEHIND`] before the AV or where the line does: so it is known of
    /// which pass the AV is, where the line passes a place more than once.
    pub fn own(&self, av: Point) -> usize {
        let first = if self.first_sample > 0 { SAMPLES_BEHIND - 2 * COARSE } else { 0 };
        let own = self.nearest_in(first.min(self.len() - 1), SAMPLES_BEHIND + 2 * COARSE, av);
        let nearest = self.nearest(av);
        let distance = |sample: usize| self.distance(sample, av).sqrt();
        if distance(own) > distance(nearest) + ASTRAY { nearest } else { own }
    }

    /// The sample nearest to `place`; where the line passes it more than once, of the pass that is nearest along the line to
    /// sample `own`.
    pub fn nearest_pass(&self, place: Point, own: usize) -> usize {
        let best = self.nearest(place);
        let reach = self.distance(best, place).sqrt() + OTHER_PASS;
        let along = |sample: usize| sample.abs_diff(own);
        let other = (0..self.len()).step_by(COARSE).filter(|sample| {
            sample.abs_diff(best) > PASS
                && along(*sample) < along(best)
                && self.distance(*sample, place) <= reach * reach
        });
        other.min_by_key(|sample| along(*sample)).map_or(best, |sample| self.downhill(sample, place))
    }

    fn downhill(&self, from: usize, place: Point) -> usize {
        let mut sample = from;
        loop {
            let next = self.nearest_in(sample.saturating_sub(COARSE), sample + COARSE, place);
            if self.distance(next, place) >= self.distance(sample, place) {
                return sample;
            }
            sample = next;
        }
    }

    /// The sample of the whole window nearest to `place`.
    fn nearest(&self, place: Point) -> usize {
        let coarse = (0..self.len()).step_by(COARSE);
        let near = coarse.min_by(|a, b| self.distance(*a, place).total_cmp(&self.distance(*b, place))).unwrap_or(0);
        self.nearest_in(near.saturating_sub(COARSE), near + COARSE, place)
    }

    fn nearest_in(&self, from: usize, to: usize, place: Point) -> usize {
        let samples = from..=to.min(self.len() - 1);
        samples.min_by(|a, b| self.distance(*a, place).total_cmp(&self.distance(*b, place))).unwrap_or(from)
    }

    fn distance(&self, sample: usize, place: Point) -> f64 {
        self.at(sample).distance_squared(place)
    }

    /// Where `place` lies, looked for near the sample `hint` (4 m to either side).
    pub fn project(&self, place: Point, hint: usize) -> Place {
        let sample = self.nearest_in(hint.saturating_sub(4 * COARSE), hint + 4 * COARSE, place);
        let forward = Point::unit(self.heading(sample));
        let offset = place - self.at(sample);
        Place { sample, station: self.station(sample) + forward.dot(offset), lateral: forward.cross(offset) }
    }

    /// The stretch that `body` takes, of the pass nearest along the line to the AV's sample `own`.
    pub fn footprint(&self, body: &OrientedBox, own: usize) -> Footprint {
        let sample = self.nearest_pass(body.center, own);
        let mut stations = (f64::INFINITY, f64::NEG_INFINITY);
        let mut laterals = stations;
        for corner in body.corners() {
            // A corner may lie some metres further along than the centre, where the line has turned.
            let reach = COARSE * (1 + body.radius() as usize);
            let nearest = self.nearest_in(sample.saturating_sub(reach), sample + reach, corner);
            let place = self.project(corner, nearest);
            stations = (stations.0.min(place.station), stations.1.max(place.station));
            laterals = (laterals.0.min(place.lateral), laterals.1.max(place.lateral));
        }
        Footprint { sample, stations, laterals }
    }
}

fn point(line: &ReferenceLine, sample: usize) -> Point {
    Point::new(line.x[sample], line.y[sample])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use world::reference_line::WINDOW_SAMPLES;

    use super::*;

    /// Samples of one round on a circle of 12 m.
    const ROUND: usize = 754;

    /// Two and a half rounds to the left on a circle of 12 m, the second and what follows so much (m) farther out.
    fn rounds(wider: f64) -> Arc<ReferenceLine> {
        let samples = 0..2 * ROUND + ROUND / 2;
        let angle = |k: usize| std::f64::consts::TAU * k as f64 / ROUND as f64;
        let radius = |k: usize| if k < ROUND { 12.0 } else { 12.0 + wider };
        let count = samples.len();
        Arc::new(ReferenceLine {
            x: samples.clone().map(|k| radius(k) * libm::sin(angle(k))).collect(),
            y: samples.clone().map(|k| -radius(k) * libm::cos(angle(k))).collect(),
            z: vec![0.0; count],
            heading: samples.map(angle).collect(),
            curvature: vec![1.0 / 12.0; count],
            speed_limit: vec![12.0; count],
            crosswalk: vec![false; count],
        })
    }

    /// What is told to an AV at sample `at` of the line.
    fn window(line: &Arc<ReferenceLine>, at: usize) -> ReferenceWindow {
        let start = at.saturating_sub(SAMPLES_BEHIND);
        ReferenceWindow {
            line: Arc::clone(line),
            start,
            samples: WINDOW_SAMPLES.min(line.len() - start),
            first_sample: start,
            red_stops: vec![],
            speed_limit: None,
        }
    }

    #[test]
    fn in_the_second_round_the_av_is_in_the_second_round() {
        let line = rounds(0.0);
        for at in [0, 60, 199, 200, 300, ROUND, ROUND + 300, 2 * ROUND - 1, 2 * ROUND + 200] {
            let window = window(&line, at);
            let corridor = Corridor::new(&window).unwrap();
            assert_eq!(window.start + corridor.own(line.point(at)), at);
            // Beside the line as well.
            assert_eq!(window.start + corridor.own(line.point(at) * 1.2), at);
        }
    }

    #[test]
    fn an_av_that_is_not_where_its_window_says_is_looked_for_in_all_of_it() {
        let line = rounds(0.0);
        let window = window(&line, 300);
        let corridor = Corridor::new(&window).unwrap();
        let astray = 300 + ROUND / 2;
        assert_eq!(window.start + corridor.own(line.point(astray)), astray);
    }

    #[test]
    fn who_is_ahead_in_this_round_is_not_taken_for_one_a_round_ahead() {
        for (wider, at) in [(0.0, 300), (0.0, ROUND + 300), (1.5, 300), (1.5, ROUND - 300)] {
            let line = rounds(wider);
            let window = window(&line, at);
            let corridor = Corridor::new(&window).unwrap();
            let own = corridor.own(line.point(at));
            for along in [-120_isize, -30, 0, 40, 200, 400] {
                // A metre and a half farther out it is a little nearer to the next round, or just as near.
                let place = line.point(at.saturating_add_signed(along));
                let outwards = place * (1.0 / place.norm());
                for out in [0.0, 1.5] {
                    let found = window.start + corridor.nearest_pass(place + outwards * out, own);
                    assert!(found.abs_diff(at.saturating_add_signed(along)) <= 2, "{along} from {at}: {found}");
                }
            }
        }
    }

    #[test]
    fn who_is_clearly_nearer_to_the_next_round_is_in_it() {
        let line = rounds(4.0);
        let window = window(&line, 300);
        let corridor = Corridor::new(&window).unwrap();
        let found = window.start + corridor.nearest_pass(line.point(ROUND + 350), corridor.own(line.point(300)));
        assert_eq!(found, ROUND + 350);
    }
}
