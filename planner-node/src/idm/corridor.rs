//! The stretch of the reference line around the AV as stations, and where things lie beside it.

use std::ops::Range;
use std::sync::Arc;

use world::geometry::{OrientedBox, Point, angle_difference};
use world::reference_line::{ReferenceLine, ReferenceWindow, SAMPLE_SPACING, SAMPLES_BEHIND};
use world::scene::AgentState;

use super::measured_line::MeasuredLine;

/// Curvature is averaged over so many metres to either side: the line's own has kinks.
const CURVATURE_WINDOW: f64 = 1.5;

/// As many samples.
const CURVATURE_SAMPLES: usize = 15;

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
    /// Where every [`COARSE`]th sample lies.
    coarse_x: Vec<f64>,
    coarse_y: Vec<f64>,
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
        Self {
            whole: MeasuredLine::new(line),
            first_sample: 0,
            stations: Vec::new(),
            coarse_x: Vec::new(),
            coarse_y: Vec::new(),
        }
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
        let all = self.first_sample..self.first_sample + samples;
        let line = &self.whole.line;
        for (coarse, column) in [(&mut self.coarse_x, &line.x), (&mut self.coarse_y, &line.y)] {
            coarse.clear();
            coarse.extend(column[all.clone()].iter().step_by(COARSE));
        }
        let mut station = 0.0;
        self.stations.clear();
        self.stations.push(station);
        self.stations.extend(self.whole.steps[all].iter().skip(1).map(|step| {
            station += step;
            station
        }));
        Some(())
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

    /// Distance of `sample` along the line (m).
    pub fn station(&self, sample: usize) -> f64 {
        self.stations[self.inside(sample)]
    }

    /// Curvature at `sample` (1/m): the turn rate of the line's own heading around it, from headings 1.5 m before and after. The column
    /// of curvatures comes from second derivatives of a spline and jumps at its knots.
    pub fn curvature(&self, sample: usize) -> f64 {
        let sample = self.inside(sample);
        let station = self.stations[sample];
        let from = self.walk_to(station - CURVATURE_WINDOW, sample.saturating_sub(CURVATURE_SAMPLES));
        let to = self.walk_to(station + CURVATURE_WINDOW, self.inside(sample + CURVATURE_SAMPLES));
        let length = self.stations[to] - self.stations[from];
        if length <= 0.0 { 0.0 } else { angle_difference(self.heading(from), self.heading(to)) / length }
    }

    /// A bound of [`Corridor::curvature`] at `sample` (1/m), either way, where one is at hand.
    pub fn curvature_bound(&self, sample: usize) -> f64 {
        /// More samples than lie within 1.5 m, and less metres than twice that, by more than a tenth.
        const REACH: usize = 18;
        const LENGTH: f64 = 2.6;
        if !self.whole.even || sample < REACH || sample + REACH >= self.len() {
            return f64::INFINITY;
        }
        let sample = self.first_sample + sample;
        (self.whole.turned[sample + REACH] - self.whole.turned[sample - REACH]) / LENGTH
    }

    /// [`Corridor::sample_at`], from a sample that is near.
    fn walk_to(&self, station: f64, near: usize) -> usize {
        let mut sample = near;
        while sample > 0 && self.stations[sample - 1] >= station {
            sample -= 1;
        }
        while sample + 1 < self.len() && self.stations[sample] < station {
            sample += 1;
        }
        sample
    }

    /// Heading at `sample` (rad).
    pub fn heading(&self, sample: usize) -> f64 {
        self.whole.line.heading[self.first_sample + self.inside(sample)]
    }

    /// Where `sample` lies.
    pub fn point(&self, sample: usize) -> Point {
        self.whole.line.point(self.first_sample + self.inside(sample))
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
        let own = self.nearest_in(self.inside(first)..SAMPLES_BEHIND + 2 * COARSE + 1, av).sample;
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
        // Those that are nearer along the line, and more than a pass away.
        let nearer = if best > own {
            (2 * own + 1).saturating_sub(best)..best.saturating_sub(PASS)
        } else {
            best + PASS + 1..(2 * own - best).min(self.len())
        };
        if nearer.is_empty() {
            return best;
        }
        let reach = self.distance(best, place).sqrt() + OTHER_PASS;
        let coarse = nearer.start.div_ceil(COARSE)..nearer.end.div_ceil(COARSE);
        let points = self.coarse_x[coarse.clone()].iter().zip(&self.coarse_y[coarse.clone()]);
        let within = |(x, y): (&f64, &f64)| Point::new(*x, *y).distance_squared(place) <= reach * reach;
        let other = points.zip(coarse).filter(|(point, _)| within(*point)).map(|(_, coarse)| COARSE * coarse);
        other.min_by_key(|sample| sample.abs_diff(own)).map_or(best, |sample| self.downhill(sample, place))
    }

    fn downhill(&self, from: usize, place: Point) -> usize {
        let mut sample = from;
        loop {
            let next = self.nearest_in(around(sample, COARSE), place).sample;
            if self.distance(next, place) >= self.distance(sample, place) {
                return sample;
            }
            sample = next;
        }
    }

    /// The sample of the whole window nearest to `place`.
    fn nearest(&self, place: Point) -> usize {
        let near = first_of_nearest(&self.coarse_x, &self.coarse_y, place).sample;
        self.nearest_in(around(COARSE * near, COARSE), place).sample
    }

    /// The first of the nearest of these samples, as far as the window has them.
    fn nearest_in(&self, samples: Range<usize>, place: Point) -> Nearest {
        let end = self.first_sample + samples.end.min(self.len());
        let all = (self.first_sample + samples.start).min(end)..end;
        let line = &self.whole.line;
        let Nearest { distance, sample } = first_of_nearest(&line.x[all.clone()], &line.y[all], place);
        Nearest { distance, sample: samples.start + sample }
    }

    fn distance(&self, sample: usize, place: Point) -> f64 {
        self.whole.line.point(self.first_sample + sample).distance_squared(place)
    }

    /// Where `place` lies, looked for near the sample `hint` (4 m to either side).
    pub fn project(&self, place: Point, hint: usize) -> Place {
        self.place(self.nearest_in(around(hint, NEAR), place).sample, place)
    }

    /// Where `place` lies, some metres on from the sample `from`: downhill from where the line's direction there leads. The same as
    /// [`project`](Self::project) where there is but one place nearest to it, at a tenth of the cost.
    pub fn follow(&self, place: Point, from: usize) -> Place {
        let offset = place - self.whole.line.point(self.first_sample + from);
        let last = self.len() - 1;
        // `as` holds it within the integers.
        let mut sample =
            (from as f64 + offset.dot(self.direction(from)) / SAMPLE_SPACING).round().clamp(0.0, last as f64) as usize;
        let mut distance = self.distance(sample, place);
        let mut walk = |forwards: bool| {
            loop {
                let next = if forwards { (sample < last).then_some(sample + 1) } else { sample.checked_sub(1) };
                let Some(next) = next else { return };
                let there = self.distance(next, place);
                // Of equals the first.
                if there > distance || forwards && there == distance {
                    return;
                }
                (sample, distance) = (next, there);
            }
        };
        walk(true);
        walk(false);
        self.place(sample, place)
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
        let samples = around(sample, corner_reach(body.radius()));
        for corner in body.corners() {
            let nearest = self.nearest_in(samples.clone(), corner);
            // And near that one: what was looked at already is no nearer.
            let near = around(nearest.sample, NEAR);
            let before = self.nearest_in(near.start..samples.start.max(near.start), corner);
            let after = self.nearest_in(samples.end.min(near.end)..near.end, corner);
            let nearest = before.or_if_nearer(nearest).or_if_nearer(after);
            let place = self.place(nearest.sample, corner);
            stations = (stations.0.min(place.station), stations.1.max(place.station));
            laterals = (laterals.0.min(place.lateral), laterals.1.max(place.lateral));
        }
        Footprint { stations, laterals }
    }

    /// Whether the footprint of whoever's centre lies at `sample` is surely all on one side and farther from the line than `reach` (m).
    pub fn is_beside(&self, state: &AgentState, sample: usize, reach: f64) -> bool {
        let radius = 0.5 * (state.length * state.length + state.width * state.width).sqrt();
        // All that footprint() looks at, and a little more: its radius is rounded otherwise.
        let samples = around(sample, corner_reach(radius) + NEAR + COARSE);
        let samples = self.first_sample + samples.start..self.first_sample + samples.end.min(self.len());
        let (least, greatest) = self.whole.laterals(state.position(), radius, samples);
        least > reach || greatest < -reach
    }
}

/// The sample that is nearest to something, and its squared distance (m^2).
#[derive(Clone, Copy)]
struct Nearest {
    distance: f64,
    sample: usize,
}

impl Nearest {
    fn or_if_nearer(self, later: Self) -> Self {
        if later.distance < self.distance { later } else { self }
    }
}

/// The first of the points nearest to `place`; infinitely far away where there is none.
fn first_of_nearest(x: &[f64], y: &[f64], place: Point) -> Nearest {
    /// So many at once, by vector instructions.
    const LANES: usize = 8;
    let distance = |(x, y): (&f64, &f64)| Point::new(*x, *y).distance_squared(place);
    let less = |a: f64, b: f64| if b < a { b } else { a };
    let ((x_lanes, x_rest), (y_lanes, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    let mut least = [f64::INFINITY; LANES];
    for (x, y) in x_lanes.iter().zip(y_lanes) {
        for lane in 0..LANES {
            least[lane] = less(least[lane], distance((&x[lane], &y[lane])));
        }
    }
    let least = least.into_iter().chain(x_rest.iter().zip(y_rest).map(distance)).fold(f64::INFINITY, less);
    let sample = x.iter().zip(y).position(|point| distance(point) == least);
    Nearest { distance: least, sample: sample.unwrap_or(0) }
}

/// The samples up to `reach` away from one.
fn around(sample: usize, reach: usize) -> Range<usize> {
    sample.saturating_sub(reach)..sample + reach + 1
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
    fn no_curvature_is_above_its_bound() {
        for (wider, at) in [(0.0, 0), (0.0, 300), (1.5, ROUND - 300), (1.5, 2 * ROUND)] {
            let line = rounds(wider);
            let corridor = corridor(&window(&line, at));
            let bounds = (0..corridor.len()).map(|sample| corridor.curvature_bound(sample));
            let bounds: Vec<_> = bounds.enumerate().filter(|(_, bound)| bound.is_finite()).collect();
            assert_eq!(bounds.is_empty(), wider > 0.0, "a jump in the line is no step");
            for (sample, bound) in bounds {
                let curvature = corridor.curvature(sample);
                assert!(curvature > 0.08 && curvature < bound && bound < 0.12, "{sample}: {curvature} {bound}");
            }
        }
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
    fn who_is_followed_is_where_a_search_finds_it() {
        let line = rounds(4.0);
        let window = window(&line, 300);
        let corridor = corridor(&window);
        for from in [0, 1, 150, 600, corridor.len() - 2, corridor.len() - 1] {
            for along in [-12_isize, -1, 0, 3, 25] {
                let Some(at) = from.checked_add_signed(along).filter(|at| *at < corridor.len()) else { continue };
                for wide in [0.7, 0.95, 1.0, 1.1] {
                    let place = line.point(window.start + at) * wide;
                    let (followed, found) = (corridor.follow(place, from), corridor.project(place, from));
                    assert_eq!((followed.sample, followed.station), (found.sample, found.station), "{at} from {from}");
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
