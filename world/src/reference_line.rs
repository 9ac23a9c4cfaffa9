//! The reference line: the smooth line along the route that the AV is to follow, sampled every 0.1 m, and the window of it
//! that a step sees.

use std::sync::Arc;

use crate::authors_frame::single;
use crate::geometry::{Point, Pose};

/// Distance between two samples along the line (m).
pub const SAMPLE_SPACING: f64 = 0.1;

/// Samples of a window: 20 m behind the AV and 100 m ahead.
pub const WINDOW_SAMPLES: usize = 1200;

/// Samples of a window that lie behind the AV.
pub const SAMPLES_BEHIND: usize = 200;

/// The line, a column for each quantity, all of the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceLine {
    /// x (m).
    pub x: Vec<f64>,
    /// y (m).
    pub y: Vec<f64>,
    /// Height of the ground (m), from the lanes.
    pub z: Vec<f64>,
    /// Heading (rad).
    pub heading: Vec<f64>,
    /// Curvature (1/m), positive to the left.
    pub curvature: Vec<f64>,
    /// Speed limit (m/s); 0 where it is not known.
    pub speed_limit: Vec<f64>,
    /// Whether the sample lies on a crosswalk.
    pub crosswalk: Vec<bool>,
}

impl ReferenceLine {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Where sample `index` lies.
    #[must_use]
    pub fn point(&self, index: usize) -> Point {
        Point::new(self.x[index], self.y[index])
    }

    /// Place and heading of sample `index`.
    #[must_use]
    pub fn pose(&self, index: usize) -> Pose {
        Pose::new(self.x[index], self.y[index], self.heading[index])
    }
}

/// A line's stretch around the AV at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceWindow {
    /// The line, or on a node's side the stretch of it that was sent.
    pub line: Arc<ReferenceLine>,
    /// First sample of the window in `line`.
    pub start: usize,
    /// Samples from `start` on; at most [`WINDOW_SAMPLES`], fewer near the end of the line.
    pub samples: usize,
    /// Number of the first sample in the whole line, for the station: equal to `start` in the simulator.
    pub first_sample: usize,
    /// Samples (counted from the window's first) at which a red signal's stop point lies on the line at this step, ascending.
    pub red_stops: Vec<u32>,
    /// The one limit of all samples (m/s), where it does not follow the line's own; 0 where it is not known. The authors
    /// take that of the lane under the AV for the whole line.
    pub speed_limit: Option<f64>,
}

impl ReferenceWindow {
    /// The speed limit at sample `index` of the line (m/s); 0 where it is not known.
    #[must_use]
    pub fn speed_limit_at(&self, index: usize) -> f64 {
        self.speed_limit.unwrap_or_else(|| self.line.speed_limit[index])
    }

    /// The sample of the window that is nearest to a place, by its index in the line, and how far away it is (m); none where the window is empty.
    #[must_use]
    pub fn nearest(&self, place: Point) -> Option<(usize, f64)> {
        let samples = self.start..(self.start + self.samples).min(self.line.len());
        let away = samples.map(|index| (index, self.line.point(index).distance(place)));
        away.min_by(|(_, one), (_, other)| one.total_cmp(other))
    }

    /// The authors' fifth column of the line, a number a sample: 0 at a red stop point, else 1 on a crosswalk, else the speed
    /// limit, in their single precision. So a limit that is not known reads as red, and one of 1 m/s as a crosswalk.
    #[must_use]
    pub fn authors_info(&self) -> Vec<f64> {
        let samples = self.start..(self.start + self.samples).min(self.line.len());
        let info = |k: usize| if self.line.crosswalk[k] { 1.0 } else { single(self.speed_limit_at(k)) };
        let mut info: Vec<f64> = samples.map(info).collect();
        for red in &self.red_stops {
            if let Some(entry) = info.get_mut(*red as usize) {
                *entry = 0.0;
            }
        }
        info
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_sample_is_one_of_the_window() {
        let columns = || (0..9).map(f64::from).collect();
        let line = ReferenceLine { x: columns(), y: vec![0.0; 9], ..ReferenceLine::default() };
        let (red_stops, speed_limit) = (Vec::new(), None);
        let mut window =
            ReferenceWindow { line: Arc::new(line), start: 3, samples: 4, first_sample: 3, red_stops, speed_limit };
        assert_eq!(window.nearest(Point::new(4.2, 3.0)).map(|(index, _)| index), Some(4));
        assert_eq!(window.nearest(Point::new(0.0, 4.0)), Some((3, 5.0)));
        assert_eq!(window.nearest(Point::new(99.0, 0.0)), Some((6, 93.0)));
        window.samples = 0;
        assert_eq!(window.nearest(Point::new(0.0, 0.0)), None);
    }

    #[test]
    fn the_authors_column_is_red_before_crosswalk_before_limit() {
        let line = ReferenceLine {
            x: vec![0.0; 6],
            speed_limit: vec![10.1; 6],
            crosswalk: vec![false, false, false, true, true, false],
            ..ReferenceLine::default()
        };
        let mut window = ReferenceWindow {
            line: Arc::new(line),
            start: 1,
            samples: 5,
            first_sample: 1,
            red_stops: vec![1, 2],
            speed_limit: None,
        };
        let limit = f64::from(10.1_f32);
        assert_eq!(window.authors_info(), [limit, 0.0, 0.0, 1.0, limit]);
        window.speed_limit = Some(7.0);
        assert_eq!(window.authors_info(), [7.0, 0.0, 0.0, 1.0, 7.0]);
    }
}
