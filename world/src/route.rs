//! The route: the lanes that the AV is to follow, and the reference line along them.
//!
//! It is made from the lanes that the *whole* logged AV track took: it tells where, never when. All that is static is built
//! once an episode; a step's window is a range of the line and the rows of red stop points, looked up.
//!
//! Two styles, one construction: waypoints on lanes, a cubic spline through them, samples every 0.1 m.
//! [`RouteStyle::Paper`] is the authors' (`paper.rs`). [`RouteStyle::Strict`] (`strict.rs`) mends it:
//!
//! | | paper | strict |
//! | --- | --- | --- |
//! | lane of a pose | nearest lane point within 10 degrees, however far, bike lanes too | the likeliest sequence along the lane graph; heights count, so an overpass is no match |
//! | pose off all lanes | jumps to the nearest lane | is its own waypoint |
//! | waypoints | a pose a second, repeated where the AV stands, backwards where a match jumps | at least 5 m apart, never backwards |
//! | lane change | a jump from one second to the next, a kink | none within 10 m of the change (3 m where the drive leaves the lanes): the spline leads over |
//! | behind | the first entry lane, if the AV starts on a lane's first 40 points; nothing behind: no route | 30 m along the lanes; nothing behind is fine |
//! | ahead | the first exit lane, if the AV ends on a lane's last 40 points | 120 m along the straightest exits |
//! | coefficients | over chords + 0.001 m | over chords |
//! | samples | every 0.1 m of chord length | every 0.1 m of arc: the station of sample `i` is `0.1 i` |
//! | red stop points | stop, arrow stop, flashing stop of any lane, rows within 0.2 m | stop and arrow stop of the route's lanes, of each pass the nearest row within 1.5 m; of a lane that the map lacks within 0.2 m |
//! | ends of the spline | straighten out, even inside a bend | bend on |
//!
//! Both give the speed limit and height of the lane at each place. (The authors hold one limit for the whole line, that of the
//! lane under the AV: the `paper` protocol makes it with [`LanePoints::authors_match`](crate::map_matching::LanePoints).)

mod drive;
pub mod follow;
mod line;
mod paper;
mod red_stops;
mod strict;

use std::sync::Arc;

use thiserror::Error;

use crate::frenet::{FrenetFrame, FrenetPoint};
use crate::geometry::{Point, Point3, PointGrid};
use crate::map::MapId;
use crate::reference_line::{ReferenceLine, ReferenceWindow, SAMPLES_BEHIND, WINDOW_SAMPLES};
use crate::scene::Scene;
use crate::signal::Signal;

pub(crate) use drive::{POSE_SPACING, Place, drive};
pub use red_stops::{RouteStop, RouteStops};
pub(crate) use strict::Lanes;

/// How a route is made and what stops on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RouteStyle {
    /// The authors' way, quirk for quirk.
    Paper,
    /// The same, mended.
    Strict,
}

/// Why no route can be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RouteError {
    #[error("no lane matches the AV at log index {log_index} (paper: a lane point within 10 degrees of its heading)")]
    NoLane { log_index: usize },
    #[error("no lane point lies behind the logged AV's first pose (the paper's construction needs one)")]
    NothingBehind,
    #[error("the route is shorter than two samples of 0.1 m")]
    TooShort,
    #[error("the route is {length:.0} m long, more than {limit:.0} m: the log or the map jumps")]
    TooLong { length: f64, limit: f64 },
}

/// Longest route that is built (m): 200 s at 50 m/s.
pub const MAX_LENGTH: f64 = 10_000.0;

/// A place on the way, and the lane that it lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Waypoint {
    pub(crate) point: Point3,
    /// Index in the map's lanes; none off the lanes.
    pub(crate) lane: Option<usize>,
}

/// The lanes to follow and the line along them, with what a step looks up.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The lanes in order of travel, each once in a row.
    pub lanes: Vec<MapId>,
    /// The line, whole.
    pub line: Arc<ReferenceLine>,
    style: RouteStyle,
    waypoints: Vec<Point>,
    sample_lanes: Vec<Option<MapId>>,
    samples: PointGrid,
    frame: FrenetFrame,
    stops: RouteStops,
}

impl Route {
    /// The route that the logged AV of `scene` took.
    ///
    /// # Errors
    /// [`RouteError`] where the log or the map gives none.
    pub fn of_log(scene: &Scene, style: RouteStyle) -> Result<Self, RouteError> {
        let map = scene.map();
        let (waypoints, lanes) = match style {
            RouteStyle::Paper => paper::waypoints(scene)?,
            RouteStyle::Strict => strict::waypoints(scene),
        };
        let (line, sample_lanes) = line::build(map, style, &waypoints, &lanes)?;
        let samples = PointGrid::new((0..line.len()).map(|index| line.point(index)).collect(), 2.0);
        let line = Arc::new(line);
        let frame = FrenetFrame::new(Arc::clone(&line)).ok_or(RouteError::TooShort)?;
        let id = |lane: usize| map.lanes[lane].id;
        let lanes: Vec<MapId> = lanes.into_iter().map(id).collect();
        let stops = RouteStops::new(scene, style, &lanes, &line, &samples);
        Ok(Self {
            lanes,
            line,
            style,
            waypoints: waypoints.iter().map(|waypoint| waypoint.point.xy()).collect(),
            sample_lanes: sample_lanes.into_iter().map(|lane| lane.map(id)).collect(),
            samples,
            frame,
            stops,
        })
    }

    /// How it was made.
    #[must_use]
    pub fn style(&self) -> RouteStyle {
        self.style
    }

    /// The points that the line was laid through.
    #[must_use]
    pub fn waypoints(&self) -> &[Point] {
        &self.waypoints
    }

    /// The lane that sample `index` lies on; none off the lanes.
    #[must_use]
    pub fn lane_of_sample(&self, index: usize) -> Option<MapId> {
        self.sample_lanes[index]
    }

    /// The stop points on the route.
    #[must_use]
    pub fn stops(&self) -> &RouteStops {
        &self.stops
    }

    /// The Frenet frame of the line.
    #[must_use]
    pub fn frame(&self) -> &FrenetFrame {
        &self.frame
    }

    /// Where `point` lies along and beside the line, `nearest` being the sample nearest to it.
    #[must_use]
    pub fn to_frenet(&self, point: Point, nearest: usize) -> FrenetPoint {
        self.frame.point_to_frenet(point, nearest)
    }

    /// The sample of the whole line nearest to `point`, the first of equals, and its distance (m). Where the route passes a place
    /// twice it may be of either pass: [`follow`] knows which.
    #[must_use]
    pub fn nearest_sample(&self, point: Point) -> (usize, f64) {
        self.samples.nearest(point).unwrap_or((0, f64::INFINITY)) // a point that is not finite is near nothing
    }

    /// The same as [`Route::nearest_sample`], faster where sample `hint` is nearly the nearest, as one step before.
    #[must_use]
    pub fn nearest_sample_from(&self, point: Point, hint: usize) -> (usize, f64) {
        // Downhill from the hint: the better the start, the less is looked at.
        let distance = |index: usize| point.distance_squared(self.samples.points()[index]);
        let mut start = hint.min(self.line.len() - 1);
        while start + 1 < self.line.len() && distance(start + 1) < distance(start) {
            start += 1;
        }
        while start > 0 && distance(start - 1) < distance(start) {
            start -= 1;
        }
        self.samples.nearest_from(point, start).unwrap_or((0, f64::INFINITY))
    }

    /// The window around sample `nearest`, with the rows at which a signal of `signals` is red.
    #[must_use]
    pub fn window(&self, nearest: usize, signals: &[Signal]) -> ReferenceWindow {
        let line = Arc::clone(&self.line);
        let mut window =
            ReferenceWindow { line, start: 0, samples: 0, first_sample: 0, red_stops: Vec::new(), speed_limit: None };
        self.move_window(&mut window, nearest, signals);
        window
    }

    /// Moves a window of this route's line to sample `nearest`; allocates nothing once its list of red stops has grown.
    pub fn move_window(&self, window: &mut ReferenceWindow, nearest: usize, signals: &[Signal]) {
        window.start = nearest.saturating_sub(SAMPLES_BEHIND).min(self.line.len());
        window.first_sample = window.start;
        window.samples = WINDOW_SAMPLES.min(self.line.len() - window.start);
        let range = window.start as u32..(window.start + window.samples) as u32;
        window.red_stops.clear();
        for signal in signals {
            let rows = self.stops.red_rows(signal).iter().filter(|row| range.contains(row));
            window.red_stops.extend(rows.map(|row| row - range.start));
        }
        // Several lanes share a stop point.
        window.red_stops.sort_unstable();
        window.red_stops.dedup();
    }
}

#[cfg(test)]
mod tests;
