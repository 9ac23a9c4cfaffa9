//! Polylines of the map as they go onto paper: cut to what is seen, thinned to what can be seen, moved aside where wanted.

use world::geometry::{Point, Point3};

use super::frame::Frame;

/// Points nearer than this to the line that is drawn without them are left out (pixels).
const FINEST: f64 = 0.08;
/// Lines are thinned in parts of so many points: that bounds the work and the depth, however long a line is.
const PART: usize = 256;

/// The runs of a polyline that are seen, in pixels; a line of `reach` pixels to its sides still shows.
pub fn runs(frame: &Frame, points: impl Iterator<Item = Point>, reach: f64) -> Vec<Vec<Point>> {
    let (mut runs, mut run) = (Vec::new(), Vec::new());
    let mut before: Option<Point> = None;
    for pixel in points.map(|point| frame.pixel(point)) {
        let Some(last) = before.replace(pixel) else { continue };
        if frame.sees(last, pixel, reach) {
            if run.is_empty() {
                run.push(last);
            }
            run.push(pixel);
        } else if !run.is_empty() {
            runs.push(thinned(std::mem::take(&mut run)));
        }
    }
    if !run.is_empty() {
        runs.push(thinned(run));
    }
    runs
}

/// The same, of points of the map.
pub fn map_runs(frame: &Frame, points: &[Point3], reach: f64) -> Vec<Vec<Point>> {
    runs(frame, points.iter().map(|point| point.xy()), reach)
}

/// The run without the points that nobody could tell are missing.
fn thinned(run: Vec<Point>) -> Vec<Point> {
    let Some(first) = run.first().copied() else { return run };
    let mut kept = vec![first];
    for part in run.chunks(PART) {
        let mut line = vec![kept[kept.len() - 1]]; // `kept` begins with the first point
        line.extend_from_slice(part);
        keep_bends(&line, &mut kept);
    }
    kept
}

/// Adds the points of `line` after its first, but those that lie on the way between others (Douglas and Peucker's method).
fn keep_bends(line: &[Point], kept: &mut Vec<Point>) {
    let [first, between @ .., last] = line else { return };
    let way = *last - *first;
    let off = |point: &Point| {
        let offset = *point - *first;
        if way.norm() > FINEST { way.cross(offset).abs() / way.norm() } else { offset.norm() }
    };
    let farthest = between.iter().map(off).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    match farthest {
        Some((index, distance)) if distance > FINEST => {
            keep_bends(&line[..index + 2], kept);
            keep_bends(&line[index + 1..], kept);
        }
        _ if first.distance(*last) > 0.0 => kept.push(*last),
        _ => {}
    }
}

/// A run moved to its left by `aside` pixels; to its right where that is negative.
pub fn beside(run: &[Point], aside: f64) -> Vec<Point> {
    let lefts: Vec<Point> = run.windows(2).map(|pair| left(pair[0], pair[1])).collect();
    let moved = |(index, point): (usize, &Point)| {
        let before = index.checked_sub(1).and_then(|index| lefts.get(index)).copied();
        let after = lefts.get(index).copied();
        let both = before.or(after).unwrap_or_default() + after.or(before).unwrap_or_default();
        *point + both * (aside / both.norm().max(0.1))
    };
    run.iter().enumerate().map(moved).collect()
}

/// What lies within `reach` pixels on a run's left, or on its right where that is negative: areas that all turn the same way, so that
/// they are one area when they are filled together.
pub fn band(run: &[Point], reach: f64) -> Vec<Vec<Point>> {
    let mut areas: Vec<Vec<Point>> = Vec::new();
    let mut before: Option<Point> = None;
    for pair in run.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let out = left(from, to) * reach;
        // On the outer side of a bend there is a wedge between the two sides.
        if let Some(last) = before.replace(out)
            && last.cross(out) * reach > 0.0
        {
            let half = last + out;
            let half = half * (reach.abs() / half.norm().max(0.1));
            areas.push(vec![from, from + out, from + half, from + last]);
        }
        areas.push(vec![from, to, to + out, from + out]);
    }
    areas
}

/// Unit vector to the left of a way. Pixels count downwards: left of (x, y) is (y, -x).
fn left(from: Point, to: Point) -> Point {
    let way = to - from;
    let length = way.norm();
    if length > 0.0 { Point::new(way.y, -way.x) * (1.0 / length) } else { Point::default() }
}

/// Bars across an area, as on a crosswalk: `share` of each `period` pixels along its longest side is a bar. Each bar is the line along its
/// middle, from side to side.
pub fn bars(corners: &[Point], period: f64) -> Vec<[Point; 2]> {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| (*a, *b));
    let Some((from, to)) = sides.clone().max_by(|a, b| a.0.distance(a.1).total_cmp(&b.0.distance(b.1))) else {
        return Vec::new();
    };
    let length = from.distance(to);
    if length <= 0.0 {
        return Vec::new();
    }
    let along = (to - from) * (1.0 / length);
    let across = Point::new(-along.y, along.x);
    let stations = corners.iter().map(|corner| along.dot(*corner));
    let (low, high) = stations.fold((f64::MAX, f64::MIN), |(low, high), s| (low.min(s), high.max(s)));
    let number = ((high - low) / period).round().clamp(1.0, 500.0);
    let mut bars = Vec::new();
    for bar in 0..number as usize {
        let station = low + (high - low) * (bar as f64 + 0.5) / number;
        let mut crossings: Vec<f64> =
            sides.clone().filter_map(|(a, b)| crossing(a, b, along, across, station)).collect();
        crossings.sort_by(f64::total_cmp);
        let at = |height: f64| along * station + across * height;
        bars.extend(crossings.chunks_exact(2).map(|pair| [at(pair[0]), at(pair[1])]));
    }
    bars
}

/// How far across the side from `a` to `b` passes the station, if it does.
fn crossing(a: Point, b: Point, along: Point, across: Point, station: f64) -> Option<f64> {
    let (start, end) = (along.dot(a), along.dot(b));
    if (start <= station) == (end <= station) {
        return None;
    }
    let share = (station - start) / (end - start);
    Some(across.dot(a) + share * (across.dot(b) - across.dot(a)))
}
