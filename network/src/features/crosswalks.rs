//! Crosswalks ahead of an agent, and their outlines (`network.md` 4.1).

use world::geometry::{Point, Pose, Segment, polygon_contains};
use world::map::{Area, Map};

use super::av_frame::AvFrame;
use super::sequences::sampled;
use super::settings::Settings;
use crate::constants::{CROSSWALK_ROW, CROSSWALKS, POINTS};

/// What an agent looks out for, in its frame.
const AHEAD: [Point; 4] =
    [Point::new(0.0, -5.0), Point::new(50.0, -20.0), Point::new(50.0, 20.0), Point::new(0.0, 5.0)];

/// A crosswalk, prepared once a scene.
#[derive(Clone, Debug)]
pub(super) struct Crosswalk {
    corners: Vec<Point>,
    outline: [Pose; POINTS],
}

/// Those of a map that have an inside.
pub(super) fn prepare(map: &Map) -> Vec<(usize, Crosswalk)> {
    let crosswalks = map.crosswalks.iter().enumerate().filter(|(_, area)| area.polygon.len() > 2);
    crosswalks.map(|(index, area)| (index, Crosswalk::new(area))).collect()
}

/// The first ones, by the map's order, that reach into what the agent at `pose` looks out for.
pub(super) fn ahead(crosswalks: &[(usize, Crosswalk)], pose: Pose) -> impl Iterator<Item = &(usize, Crosswalk)> {
    let forward = Point::unit(pose.heading);
    let corners = AHEAD.map(|point| {
        let turned = Point::new(forward.x * point.x - forward.y * point.y, forward.y * point.x + forward.x * point.y);
        turned + pose.position()
    });
    crosswalks.iter().filter(move |(_, crosswalk)| overlap(&corners, &crosswalk.corners)).take(CROSSWALKS)
}

impl Crosswalk {
    fn new(area: &Area) -> Self {
        let corners: Vec<Point> = area.polygon.iter().map(|corner| corner.xy()).collect();
        let mut outline = Vec::new();
        for (index, corner) in corners.iter().enumerate() {
            let edge = corners[(index + 1) % corners.len()] - *corner;
            let count = 2.0 * edge.norm().ceil() + 1.0;
            let step = edge * (1.0 / count);
            // No more than a map can hold: edges are of 1e7 m at most, and what is drawn of one is a hundred points.
            outline.extend((0..count.min(1e6) as usize).map(|k| *corner + step * k as f64));
        }
        let heading = |index: usize| {
            let index = index.min(outline.len() - 2);
            (outline[index + 1] - outline[index]).heading()
        };
        let pose = |index: usize| Pose::new(outline[index].x, outline[index].y, heading(index));
        let outline = sampled(outline.len()).map(pose);
        Self { corners, outline }
    }

    pub fn rows(&self, frame: &AvFrame) -> [[f32; CROSSWALK_ROW]; POINTS] {
        let is_normed = frame.settings == Settings::Mended || self.outline[0].x as f32 != 0.0;
        self.outline.map(|pose| {
            if !is_normed {
                return [pose.x as f32, pose.y as f32, pose.heading as f32];
            }
            let [x, y] = frame.place(pose.position());
            [x, y, frame.heading(pose.heading)]
        })
    }
}

/// Whether two polygons have a point in common.
fn overlap(a: &[Point], b: &[Point]) -> bool {
    let touching = edges(a).any(|a| edges(b).any(|b| cross(&a, &b)));
    touching || polygon_contains(a.iter().copied(), b[0]) || polygon_contains(b.iter().copied(), a[0])
}

fn edges(corners: &[Point]) -> impl Iterator<Item = Segment> {
    corners
        .iter()
        .enumerate()
        .map(|(index, start)| Segment { start: *start, end: corners[(index + 1) % corners.len()] })
}

/// Whether two segments have a point in common.
fn cross(a: &Segment, b: &Segment) -> bool {
    let (b0, b1, a0, a1) = (a.side(b.start), a.side(b.end), b.side(a.start), b.side(a.end));
    let apart = |s: f64, t: f64| (s > 0.0 && t > 0.0) || (s < 0.0 && t < 0.0);
    if apart(b0, b1) || apart(a0, a1) {
        return false;
    }
    let within = |s: f64, t: f64, p: f64, q: f64| s.min(t) <= p.max(q) && p.min(q) <= s.max(t);
    within(a.start.x, a.end.x, b.start.x, b.end.x) && within(a.start.y, a.end.y, b.start.y, b.end.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, size: f64) -> [Point; 4] {
        [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)].map(|(dx, dy)| Point::new(x + dx, y + dy))
    }

    #[test]
    fn polygons_overlap_where_they_cross_touch_or_contain_each_other() {
        let unit = square(0.0, 0.0, 2.0);
        assert!(overlap(&unit, &square(1.0, 1.0, 2.0)));
        assert!(overlap(&unit, &square(2.0, 0.0, 2.0)), "an edge in common");
        assert!(overlap(&unit, &square(2.0, 2.0, 1.0)), "a corner in common");
        assert!(overlap(&unit, &square(0.5, 0.5, 0.5)) && overlap(&square(0.5, 0.5, 0.5), &unit));
        assert!(!overlap(&unit, &square(2.1, 0.0, 2.0)));
    }
}
