//! Where an agent goes: a smooth line in even steps, and the lanes under it. Nothing of it tells when: no time, no speed, and no number of
//! logged states can be read from samples that lie half a metre apart whatever was driven.

use crate::geometry::{Point, Point3, angle_difference};
use crate::map::MapId;

/// Distance between samples (m).
pub const SPACING: f64 = 0.5;

/// Headings are of chords over so many samples to either side (1 m).
const CHORD: usize = 2;

/// Curvatures are of headings so many samples to either side (1.5 m).
const BEND: usize = 3;

/// So many samples (4 m) are passed over at once where the nearest is looked for.
const STRIDE: usize = 8;

/// Samples of a way at most: 5 km.
pub const MOST_SAMPLES: usize = 10_000;

/// A lane under a way, from a station on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneStretch {
    /// Where it begins (m).
    pub from: f64,
    /// The lane; none off the lanes.
    pub lane: Option<MapId>,
}

/// Where a point lies beside a way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WayPlace {
    /// The nearest sample.
    pub sample: usize,
    /// Distance along the way (m).
    pub station: f64,
    /// Distance to the left of it (m).
    pub lateral: f64,
}

/// A line in steps of [`SPACING`], with the lanes under it.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    points: Vec<Point>,
    heights: Vec<f64>,
    headings: Vec<f64>,
    directions: Vec<Point>,
    curvatures: Vec<f64>,
    lanes: Vec<LaneStretch>,
}

impl Way {
    /// The way over samples [`SPACING`] apart; none of fewer than two, or of more than [`MOST_SAMPLES`].
    #[must_use]
    pub fn new(samples: &[Point3], lanes: Vec<LaneStretch>) -> Option<Self> {
        if !(2..=MOST_SAMPLES).contains(&samples.len()) {
            return None;
        }
        let points: Vec<Point> = samples.iter().map(|sample| sample.xy()).collect();
        let last = points.len() - 1;
        let chord = |index: usize| points[(index + CHORD).min(last)] - points[index.saturating_sub(CHORD)];
        let headings: Vec<f64> = (0..points.len()).map(|index| chord(index).heading()).collect();
        let curvature = |index: usize| {
            let (from, to) = (index.saturating_sub(BEND), (index + BEND).min(last));
            angle_difference(headings[from], headings[to]) / ((to - from) as f64 * SPACING)
        };
        Some(Self {
            heights: samples.iter().map(|sample| sample.z).collect(),
            directions: headings.iter().map(|heading| Point::unit(*heading)).collect(),
            curvatures: (0..points.len()).map(curvature).collect(),
            points,
            headings,
            lanes,
        })
    }

    /// Number of samples.
    #[inline]
    #[must_use]
    #[allow(clippy::len_without_is_empty, reason = "it never is")]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Length (m).
    #[inline]
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.points.len() - 1) as f64 * SPACING
    }

    /// All samples.
    #[inline]
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The same with their heights: what [`Way::new`] makes this way of.
    #[must_use]
    pub fn samples(&self) -> Vec<Point3> {
        self.points.iter().zip(&self.heights).map(|(point, z)| Point3::new(point.x, point.y, *z)).collect()
    }

    /// Height of the ground at `sample` (m).
    #[inline]
    #[must_use]
    pub fn height(&self, sample: usize) -> f64 {
        self.heights[self.inside(sample)]
    }

    /// Direction at `sample` (rad).
    #[inline]
    #[must_use]
    pub fn heading(&self, sample: usize) -> f64 {
        self.headings[self.inside(sample)]
    }

    /// The same as a unit vector.
    #[inline]
    #[must_use]
    pub fn direction(&self, sample: usize) -> Point {
        self.directions[self.inside(sample)]
    }

    /// Curvature at `sample` (1/m), positive to the left.
    #[inline]
    #[must_use]
    pub fn curvature(&self, sample: usize) -> f64 {
        self.curvatures[self.inside(sample)]
    }

    /// The lanes under it, in order of their stations.
    #[must_use]
    pub fn lanes(&self) -> &[LaneStretch] {
        &self.lanes
    }

    /// The lane at `station` (m).
    #[must_use]
    pub fn lane_at(&self, station: f64) -> Option<MapId> {
        let after = self.lanes.partition_point(|stretch| stretch.from <= station);
        self.lanes.get(after.checked_sub(1)?)?.lane
    }

    /// The sample at or before `station` (m).
    #[inline]
    #[must_use]
    pub fn sample_at(&self, station: f64) -> usize {
        self.inside((station * (1.0 / SPACING)) as u32 as usize)
    }

    /// The point at `station` (m), straight on past either end.
    #[inline]
    #[must_use]
    pub fn point_at(&self, station: f64) -> Point {
        let sample = self.sample_at(station);
        self.points[sample] + self.directions[sample] * (station - sample as f64 * SPACING)
    }

    /// The sample nearest to `point`, wherever it is: looked for among each eighth, and around the nearest of these.
    #[must_use]
    pub fn nearest(&self, point: Point) -> usize {
        let away = |sample: &usize| self.points[*sample].distance_squared(point);
        let nearer = |a: &usize, b: &usize| away(a).total_cmp(&away(b));
        let about = (0..self.points.len()).step_by(STRIDE).min_by(nearer).unwrap_or_default();
        (about.saturating_sub(STRIDE)..=self.inside(about + STRIDE)).min_by(nearer).unwrap_or(about)
    }

    /// Where `point` lies, looked for downhill from the sample `hint`, first to where the way's direction there leads.
    #[inline]
    #[must_use]
    pub fn follow(&self, point: Point, hint: usize) -> WayPlace {
        let (points, directions) = (&self.points[..], &self.directions[..self.points.len()]);
        let last = points.len() - 1;
        let mut sample = hint.min(last);
        // To where the direction leads, once more from there for the bend between, and downhill from there.
        for _ in 0..2 {
            let ahead = (point - points[sample]).dot(directions[sample]) * (1.0 / SPACING);
            // No way has as many samples as a u32 holds; what is less than none is none.
            let next = ((sample as f64 + ahead + 0.5) as u32 as usize).min(last);
            if next == sample {
                break;
            }
            sample = next;
        }
        let away = |sample: usize| points[sample].distance_squared(point);
        let mut distance = away(sample);
        while sample < last {
            let next = away(sample + 1);
            if next >= distance {
                break;
            }
            (sample, distance) = (sample + 1, next);
        }
        while sample > 0 {
            let next = away(sample - 1);
            if next >= distance {
                break;
            }
            (sample, distance) = (sample - 1, next);
        }
        let offset = point - points[sample];
        let direction = directions[sample];
        WayPlace { sample, station: sample as f64 * SPACING + direction.dot(offset), lateral: direction.cross(offset) }
    }

    #[inline]
    fn inside(&self, sample: usize) -> usize {
        sample.min(self.points.len() - 1)
    }
}

/// The line through `points`, smoothed over 2 m to either side and in even steps; none where it has no length.
pub(super) fn even(points: &[Point3]) -> Vec<Point3> {
    let dense = resampled(points);
    let reach = (2.0 / SPACING) as usize;
    let smoothed: Vec<Point3> = (0..dense.len())
        .map(|index| {
            let reach = reach.min(index).min(dense.len() - 1 - index);
            let window = &dense[index - reach..=index + reach];
            let mean = |of: fn(&Point3) -> f64| window.iter().map(of).sum::<f64>() / window.len() as f64;
            Point3::new(mean(|p| p.x), mean(|p| p.y), mean(|p| p.z))
        })
        .collect();
    resampled(&smoothed)
}

/// The polyline in steps of [`SPACING`]; the rest at its end, less than a step, is left out.
fn resampled(points: &[Point3]) -> Vec<Point3> {
    let mut samples: Vec<Point3> = points.first().copied().into_iter().collect();
    let mut walked = 0.0;
    for pair in points.windows(2) {
        let length = pair[0].xy().distance(pair[1].xy());
        while samples.len() as f64 * SPACING <= walked + length && samples.len() < MOST_SAMPLES {
            let share = (samples.len() as f64 * SPACING - walked) / length;
            let mix = |a: f64, b: f64| a + share * (b - a);
            samples.push(Point3::new(mix(pair[0].x, pair[1].x), mix(pair[0].y, pair[1].y), mix(pair[0].z, pair[1].z)));
        }
        walked += length;
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a circle to the left, radius 20 m, by points that lie unevenly.
    fn bend() -> Way {
        let at = |k: usize| {
            let angle = 1.57 * (k as f64 / 40.0) * (k as f64 / 40.0);
            Point3::new(20.0 * libm::sin(angle), 20.0 - 20.0 * libm::cos(angle), 0.0)
        };
        let points: Vec<Point3> = (0..=40).map(at).collect();
        Way::new(&even(&points), vec![LaneStretch { from: 0.0, lane: Some(MapId(7)) }]).unwrap()
    }

    #[test]
    fn samples_lie_evenly_however_the_log_does() {
        let way = bend();
        for pair in way.points().windows(2) {
            assert!((pair[0].distance(pair[1]) - SPACING).abs() < 0.01);
        }
        assert!((way.length() - 0.5 * std::f64::consts::PI * 20.0).abs() < 1.2, "{}", way.length());
        assert!((way.curvature(30) - 0.05).abs() < 0.003, "{}", way.curvature(30));
    }

    #[test]
    fn a_place_is_found_from_wherever_one_looks() {
        let way = bend();
        for hint in [0, 10, 30, way.len() + 5] {
            let aim = way.point_at(20.0) + Point::new(-way.direction(40).y, way.direction(40).x) * 1.5;
            let place = way.follow(aim, hint);
            assert!((place.station - 20.0).abs() < 0.1 && (place.lateral - 1.5).abs() < 0.02, "{place:?}");
        }
    }

    #[test]
    fn the_nearest_sample_is_found_without_a_hint() {
        let way = bend();
        for sample in 0..way.len() {
            let beside = way.points()[sample] + Point::new(-way.direction(sample).y, way.direction(sample).x) * 1.5;
            let all = (0..way.len()).min_by(|a, b| {
                way.points()[*a].distance_squared(beside).total_cmp(&way.points()[*b].distance_squared(beside))
            });
            assert_eq!(Some(way.nearest(beside)), all);
        }
        assert_eq!(way.nearest(Point::new(-9.0, 0.0)), 0);
        assert_eq!(way.nearest(Point::new(40.0, 90.0)), way.len() - 1);
    }

    #[test]
    fn lanes_are_told_by_station() {
        let stretch = |from, lane| LaneStretch { from, lane };
        let samples: Vec<Point3> = (0..10).map(|k| Point3::new(SPACING * f64::from(k), 0.0, 0.0)).collect();
        let way = Way::new(&samples, vec![stretch(1.0, Some(MapId(1))), stretch(3.0, None)]).unwrap();
        assert_eq!(
            [0.5, 1.0, 2.9, 3.5].map(|station| way.lane_at(station)),
            [None, Some(MapId(1)), Some(MapId(1)), None]
        );
        assert_eq!(Way::new(&samples[..1], Vec::new()), None);
    }
}
