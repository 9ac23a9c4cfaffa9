//! Which crosswalks lie before an agent.

use world::geometry::{Point, Pose, Segment, polygon_contains};

use super::map::PreparedCrosswalk;

/// What an agent looks at: ahead of it, in its own frame.
const AREA: [Point; 4] = [Point::new(0.0, -5.0), Point::new(50.0, -20.0), Point::new(50.0, 20.0), Point::new(0.0, 5.0)];

/// Numbers of the crosswalks that reach into what an agent at `pose` looks at, in the map's order.
pub(super) fn before(crosswalks: &[PreparedCrosswalk], pose: Pose) -> impl Iterator<Item = usize> {
    let (sine, cosine) = libm::sincos(pose.heading);
    let position = pose.position();
    let seen = move |point: &Point| {
        let offset = *point - position;
        Point::new(offset.x * cosine + offset.y * sine, offset.y * cosine - offset.x * sine)
    };
    let reaches = move |polygon: &[Point]| {
        let corners: Vec<Point> = polygon.iter().map(seen).collect();
        let sides = |corners: &[Point]| -> Vec<Segment> {
            let next = corners.iter().cycle().skip(1);
            corners.iter().zip(next).map(|(start, end)| Segment { start: *start, end: *end }).collect()
        };
        let near = corners.iter().any(|corner| (-60.0..110.0).contains(&corner.x) && corner.y.abs() < 80.0);
        near && (corners.iter().any(|corner| polygon_contains(AREA.into_iter(), *corner))
            || AREA.iter().any(|corner| polygon_contains(corners.iter().copied(), *corner))
            || sides(&corners).iter().any(|own| sides(&AREA).iter().any(|other| cross(own, other))))
    };
    crosswalks.iter().enumerate().filter(move |(_, crosswalk)| reaches(&crosswalk.polygon)).map(|(number, _)| number)
}

fn cross(a: &Segment, b: &Segment) -> bool {
    a.side(b.start) * a.side(b.end) <= 0.0 && b.side(a.start) * b.side(a.end) <= 0.0
}
