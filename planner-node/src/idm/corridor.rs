//! The stretch of the reference line around the AV as stations, and where things lie beside it.

use std::sync::Arc;

use world::geometry::{OrientedBox, Point, angle_difference};
use world::reference_line::{ReferenceLine, ReferenceWindow, SAMPLES_BEHIND};
use world::scene::AgentState;

use super::measured_line::MeasuredLine;

/// Curvature is averaged over so many metres to either side: the line's own has kinks.
const CURVATURE_WINDOW: f64 = 1.5;

/// Samples between those that a search looks at first (about 1 m).
const COARSE: usize = 10;

/// How far [`Corridor::project`] looks from its hint, in samples to either side (4 m).
const NEAR: usize = 4 * COARSE;

/// Samples farther apart than these (20 m) may be of different passes of one place.
const PASS: usize = 200;

/// Where the line passes a place more than once, a pass may be this much farther away (m) than the nearest.
const OTHER_PASS: f64 = 2.0;

/// Farther from where its window says that the AV is (m) it is looked for in all of it.
const ASTRAY: f64 = 5.0;

/// A window of the reference line, with the distance along it. Samples count from the window's first.
pub struct Corridor {
    whole: MeasuredLine,
    /// Number of the window's first sample in the whole line.
    first_sample: usize,
    /// Distance of each sample from the window's first (m).
    stations: Vec<f64>,
    /// Curvature of each sample (1/m), averaged.
    curvature: Vec<f64>,
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
    /// First and last station (m).
    pub stations: (f64, f64),
    /// Rightmost and leftmost offset from the line (m).
    pub laterals: (f64, f64),
}

impl Footprint {
    /// The same, so many metres further along and to the left.
    pub fn moved(&self, along: f64, left: f64) -> Self {
        Self {
            stations: (self.stations.0 + along, self.stations.1 + along),
            laterals: (self.laterals.0 + left, self.laterals.1 + left),
        }
    }
}

impl Corridor {
    /// The corridor of a line, around nobody yet.
    pub fn new(line: &Arc<ReferenceLine>) -> Self {
        Self { whole: MeasuredLine::new(line), first_sample: 0, stations: Vec::new(), curvature: Vec::new() }
    }

    /// Moves it to a window of its line; `None` where that has less than two samples.
    pub fn move_to(&mut self, window: &ReferenceWindow) -> Option<()> {
        let told = window.samples.min(window.line.len().saturating_sub(window.start));
        let samples = told.min(self.whole.line.len().saturating_sub(window.first_sample));
        if samples < 2 {
            return None;
        }
        if (self.first_sample, self.len()) == (window.first_sample, samples) {
            return Some(()); // the AV stands
        }
        self.first_sample = window.first_sample;
        self.stations.clear();
        let mut station = 0.0;
        let steps = &self.whole.steps[self.first_sample..][..samples];
        self.stations.extend(steps.iter().enumerate().map(|(sample, step)| {
            station += if sample == 0 { 0.0 } else { *step };
            station
        }));
        self.measure_curvature();
        Some(())
    }

    /// The turn rate of the line's own heading around each sample, from headings 1.5 m before and after: the column of
    /// curvatures comes from second derivatives of a spline and jumps at its knots.
    fn measure_curvature(&mut self) {
        let (stations, heading) = (&self.stations, &self.whole.line.heading[self.first_sample..]);
        let (mut from, mut to) = (0, 0);
        self.curvature.clear();
        self.curvature.extend(stations.iter().map(|station| {
            while stations[from] < station - CURVATURE_WINDOW {
                from += 1;
            }
            while to + 1 < stations.len() && stations[to] < station + CURVATURE_WINDOW {
                to += 1;
            }
            let length = stations[to] - stations[from];
            if length <= 0.0 { 0.0 } else { angle_difference(heading[from], heading[to]) / length }
        }));
    }

    /// Whether this is the corridor of `line`.
    pub fn is_of(&self, line: &Arc<ReferenceLine>) -> bool {
        Arc::ptr_eq(&self.whole.line, line)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.stations.len()
    }

    /// Whether the line ends with the window.
    pub fn reaches_the_end(&self) -> bool {
        self.first_sample + self.len() >= self.whole.line.len()
    }

    /// Distance of each sample along the line (m).
    pub fn stations(&self) -> &[f64] {
        &self.stations
    }

    /// Curvature at each sample (1/m), averaged over three metres.
    pub fn curvatures(&self) -> &[f64] {
        &self.curvature
    }

    /// Distance of `sample` along the line (m).
    pub fn station(&self, sample: usize) -> f64 {
        self.stations[self.inside(sample)]
    }

    /// Curvature at `sample` (1/m), averaged over three metres.
    pub fn curvature(&self, sample: usize) -> f64 {
        self.curvature[self.inside(sample)]
    }

    /// Heading at `sample` (rad).
    pub fn heading(&self, sample: usize) -> f64 {
        self.whole.line.heading[self.first_sample + self.inside(sample)]
    }

    /// Unit vector along the line at `sample`.
    pub fn direction(&self, sample: usize) -> Point {
        self.whole.directions[self.first_sample + self.inside(sample)]
    }

    /// Height of the ground at `sample` (m).
    pub fn height(&self, sample: usize) -> f64 {
        self.whole.line.z[self.first_sample + self.inside(sample)]
    }

    fn inside(&self, sample: usize) -> usize {
        sample.min(self.len() - 1)
    }

    /// First sample at or after `station` (m); the last one past the end.
    pub fn sample_at(&self, station: f64) -> usize {
        self.inside(self.stations.partition_point(|s| *s < station))
    }

    /// The sample nearest to the AV. A window begins [`SAMPLES_BEHIND`] before the AV or where the line does: so it is known of
    /// which pass the AV is, where the line passes a place more than once.
    pub fn own(&self, av: Point) -> usize {
        let first = if self.first_sample > 0 { SAMPLES_BEHIND - 2 * COARSE } else { 0 };
        let own = self.nearest_in(self.inside(first), SAMPLES_BEHIND + 2 * COARSE, av);
        let distance = |sample: usize| self.distance(sample, av).sqrt();
        if distance(own) <= ASTRAY {
            return own;
        }
        let nearest = self.nearest(av);
        if distance(own) > distance(nearest) + ASTRAY { nearest } else { own }
    }

    /// The sample nearest to `place`; where the line passes it more than once, of the pass that is nearest along the line to
    /// sample `own`.
    pub fn nearest_pass(&self, place: Point, own: usize) -> usize {
        let best = self.nearest(place);
        let along = |sample: usize| sample.abs_diff(own);
        let nearer = own.saturating_sub(along(best))..(own + along(best)).min(self.len());
        let reach = self.distance(best, place).sqrt() + OTHER_PASS;
        let other = (nearer.start.next_multiple_of(COARSE)..nearer.end).step_by(COARSE).filter(|sample| {
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
        let near = self.first_of_nearest((0..self.len()).step_by(COARSE), place);
        self.nearest_in(near.saturating_sub(COARSE), near + COARSE, place)
    }

    fn nearest_in(&self, from: usize, to: usize, place: Point) -> usize {
        self.first_of_nearest(from..self.inside(to) + 1, place)
    }

    fn first_of_nearest(&self, samples: impl Iterator<Item = usize>, place: Point) -> usize {
        let mut best = (f64::INFINITY, 0);
        for sample in samples {
            let distance = self.distance(sample, place);
            if distance < best.0 {
                best = (distance, sample);
            }
        }
        best.1
    }

    fn distance(&self, sample: usize, place: Point) -> f64 {
        self.whole.line.point(self.first_sample + sample).distance_squared(place)
    }

    /// Where `place` lies, looked for near the sample `hint` (4 m to either side).
    pub fn project(&self, place: Point, hint: usize) -> Place {
        self.place(self.nearest_in(hint.saturating_sub(NEAR), hint + NEAR, place), place)
    }

    /// Where `place` lies as told by a sample.
    fn place(&self, sample: usize, place: Point) -> Place {
        let forward = self.direction(sample);
        let offset = place - self.whole.line.point(self.first_sample + sample);
        Place { sample, station: self.station(sample) + forward.dot(offset), lateral: forward.cross(offset) }
    }

    /// The stretch that `body` takes, whose centre lies at `sample`.
    pub fn footprint(&self, body: &OrientedBox, sample: usize) -> Footprint {
        let mut stations = (f64::INFINITY, f64::NEG_INFINITY);
        let mut laterals = stations;
        let reach = corner_reach(body.radius());
        for corner in body.corners() {
            let nearest = self.nearest_in(sample.saturating_sub(reach), sample + reach, corner);
            let place = self.project(corner, nearest);
            stations = (stations.0.min(place.station), stations.1.max(place.station));
            laterals = (laterals.0.min(place.lateral), laterals.1.max(place.lateral));
        }
        Footprint { stations, laterals }
    }

    /// Whether the footprint of whoever's centre lies at `sample` is surely all on one side, farther from the line than `reach` (m).
    pub fn is_beside(&self, state: &AgentState, sample: usize, reach: f64) -> bool {
        let radius = 0.5 * (state.length * state.length + state.width * state.width).sqrt();
        let around = corner_reach(radius) + NEAR + COARSE;
        let (from, to) = (sample.saturating_sub(around), self.inside(sample + around));
        let (least, greatest) =
            self.whole.laterals(state.position(), radius, self.first_sample + from, self.first_sample + to);
        least > reach || greatest < -reach
    }
}

/// How far along the line from its centre the corners of a box of this radius (m) are looked for, in samples: some metres further
/// where the line has turned.
fn corner_reach(radius: f64) -> usize {
    COARSE * (1 + radius as usize)
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

    fn corridor(window: &ReferenceWindow) -> Corridor {
        let mut corridor = Corridor::new(&window.line);
        corridor.move_to(window).unwrap();
        corridor
    }

    #[test]
    fn in_the_second_round_the_av_is_in_the_second_round() {
        let line = rounds(0.0);
        for at in [0, 60, 199, 200, 300, ROUND, ROUND + 300, 2 * ROUND - 1, 2 * ROUND + 200] {
            let window = window(&line, at);
            let corridor = corridor(&window);
            assert_eq!(window.start + corridor.own(line.point(at)), at);
            // Beside the line as well.
            assert_eq!(window.start + corridor.own(line.point(at) * 1.2), at);
        }
    }

    #[test]
    fn an_av_that_is_not_where_its_window_says_is_looked_for_in_all_of_it() {
        let line = rounds(0.0);
        let window = window(&line, 300);
        let corridor = corridor(&window);
        let astray = 300 + ROUND / 2;
        assert_eq!(window.start + corridor.own(line.point(astray)), astray);
    }

    #[test]
    fn who_is_ahead_in_this_round_is_not_taken_for_one_a_round_ahead() {
        for (wider, at) in [(0.0, 300), (0.0, ROUND + 300), (1.5, 300), (1.5, ROUND - 300)] {
            let line = rounds(wider);
            let window = window(&line, at);
            let corridor = corridor(&window);
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
        let corridor = corridor(&window);
        let found = window.start + corridor.nearest_pass(line.point(ROUND + 350), corridor.own(line.point(300)));
        assert_eq!(found, ROUND + 350);
    }
}
