//! From waypoints to the reference line: spline, samples, and what the map says at each of them.

use super::{MAX_LENGTH, RouteError, RouteStyle, Waypoint};
use crate::geometry::{Point, Pose, polygon_contains};
use crate::map::{Area, Map};
use crate::map_matching::LanePoints;
use crate::reference_line::{ReferenceLine, SAMPLE_SPACING};
use crate::spline::{Ends, Spline};

/// What the authors add to each chord where they make the spline's coefficients (m).
const PAPER_PADDING: f64 = 0.001;

/// How far off its heading (rad) and how far away (m) a lane may lie to be the one that a sample is on.
const LANE_HEADING: f64 = std::f64::consts::FRAC_PI_4;
const LANE_DISTANCE: f64 = 5.0;

/// Heights further apart than this (m) are of different levels.
const STOREY: f64 = 3.0;

/// The line through `waypoints`, and the lane of each sample, of the route's `lanes`.
pub(super) fn build(
    map: &Map,
    style: RouteStyle,
    waypoints: &[Waypoint],
    lanes: &[usize],
) -> Result<(ReferenceLine, Vec<Option<usize>>), RouteError> {
    let points: Vec<Point> = waypoints.iter().map(|waypoint| waypoint.point.xy()).collect();
    let length: f64 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    if length.is_nan() || length > MAX_LENGTH {
        return Err(RouteError::TooLong { length, limit: MAX_LENGTH });
    }
    let (padding, ends) = match style {
        RouteStyle::Paper => (PAPER_PADDING, Ends::Natural),
        RouteStyle::Strict => (0.0, Ends::Continued),
    };
    let spline = Spline::new(&points, padding, ends).ok_or(RouteError::TooShort)?;
    let parameters = match style {
        RouteStyle::Paper => parameters_by_chord(spline.end()),
        RouteStyle::Strict => spline.parameters_by_arc(SAMPLE_SPACING),
    };
    let mut line = ReferenceLine::default();
    for s in parameters {
        let at = spline.at(s);
        line.x.push(at.position.x);
        line.y.push(at.position.y);
        line.heading.push(at.heading());
        line.curvature.push(at.curvature());
        let (piece, fraction) = spline.place(s);
        let (from, to) = (waypoints[piece].point.z, waypoints[piece + 1].point.z);
        line.z.push(from + (to - from) * fraction);
    }
    let sample_lanes = lanes_of_samples(map, style, lanes, &line);
    let limit = |lane: &Option<usize>| lane.and_then(|lane| map.lanes[lane].speed_limit()).unwrap_or(0.0);
    line.speed_limit = sample_lanes.iter().map(limit).collect();
    line.crosswalk = (0..line.len()).map(|_| false).collect();
    for area in &map.crosswalks {
        mark(&mut line, style, area);
    }
    Ok((line, sample_lanes))
}

/// 0, 0.1, 0.2, ... below `end`, multiplied rather than summed, as numpy's `arange` has them; at least one.
fn parameters_by_chord(end: f64) -> Vec<f64> {
    let count = (end / SAMPLE_SPACING).ceil().max(1.0) as usize;
    (0..count).map(|index| index as f64 * SAMPLE_SPACING).collect()
}

fn lanes_of_samples(map: &Map, style: RouteStyle, lanes: &[usize], line: &ReferenceLine) -> Vec<Option<usize>> {
    let points = LanePoints::new(map, |lane| lanes.contains(&lane));
    let lane = |index: usize| {
        let Pose { x, y, heading } = line.pose(index);
        let pose = Pose::new(x, y, heading);
        let nearest = match style {
            RouteStyle::Paper => points.nearest(pose, LANE_DISTANCE, LANE_HEADING),
            RouteStyle::Strict => points.nearest_on_level(pose, LANE_DISTANCE, LANE_HEADING, line.z[index], STOREY),
        };
        nearest.map(|matched| matched.lane)
    };
    (0..line.len()).map(lane).collect()
}

/// Marks the samples strictly inside a crosswalk; of the strict line those on its level.
fn mark(line: &mut ReferenceLine, style: RouteStyle, area: &Area) {
    let is_on_level = |z: f64| style == RouteStyle::Paper || area.polygon.iter().any(|p| (p.z - z).abs() <= STOREY);
    let corners = || area.polygon.iter().map(|corner| corner.xy());
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (left, right) = span(&mut corners().map(|corner| corner.x));
    let (bottom, top) = span(&mut corners().map(|corner| corner.y));
    for index in 0..line.len() {
        let point = line.point(index);
        let near = (left..=right).contains(&point.x) && (bottom..=top).contains(&point.y);
        if near && is_on_level(line.z[index]) && polygon_contains(corners(), point) {
            line.crosswalk[index] = true;
        }
    }
}
