use proptest::prelude::*;
use world::geometry::Point3;
use world::map::{BoundarySegment, LaneKind, RoadLine, RoadLineKind};

use super::*;

/// Lanes on a coarse raster, so that points are often as near to one segment as to the next, with a line on the left of some.
fn maps() -> impl Strategy<Value = Map> {
    let line = prop::collection::vec((-12_i32..12, -12_i32..12), 2..9);
    prop::collection::vec((line, any::<bool>(), any::<bool>()), 1..7).prop_map(|lanes| {
        let mut map = Map::default();
        for (index, (line, interpolating, is_bounded)) in lanes.into_iter().enumerate() {
            let (id, feature) = (MapId(index as i64 + 1), MapId(index as i64 + 101));
            let points = |aside: f64| line.iter().map(move |(x, y)| (f64::from(*x), f64::from(*y) + aside));
            let polyline = points(1.5).map(|(x, y)| Point3::new(x, y, 0.0)).collect();
            let (lane_end_index, kind) = (line.len() as i32 / 2, RoadLineKind::Unknown);
            let segment = BoundarySegment { lane_start_index: 0, lane_end_index, feature, kind };
            map.lanes.push(Lane {
                id,
                kind: LaneKind::SurfaceStreet,
                interpolating,
                centerline: points(0.0).map(|(x, y)| Point3::new(x, y, 0.0)).collect(),
                exits: vec![MapId(index as i64)],
                left_boundaries: if is_bounded { vec![segment] } else { Vec::new() },
                ..Lane::default()
            });
            map.road_lines.push(RoadLine { id: feature, kind, polyline });
        }
        map
    })
}

fn lanes(map: &Map) -> Lanes {
    Lanes::of(&Arc::new(map.clone()), &Level::along(&[Point3::default(), Point3::new(1.0, 0.0, 0.0)], 5.0))
}

/// All that is found out late, found out at once.
fn eager(map: &Map) -> Lanes {
    let lanes = lanes(map);
    for lane in (0..lanes.strips.len()).rev() {
        (0..lanes.strips[lane].points.len()).for_each(|point| {
            let _ = lanes.widths(lane, point);
        });
        let _ = lanes.is_connector(lane);
    }
    lanes
}

/// The lanes that hold a point, each segment that is near asked by itself.
fn held_by_all(lanes: &Lanes, point: Point, forward: Point) -> Held {
    let mut held = Held::default();
    lanes.grid.for_each_near(point, WIDEST, |segment| {
        let lane = lanes.grid.payload(segment) as usize;
        let nearest = lanes.downhill(lane, segment, point, |_| false).unwrap();
        let place = lanes.place_at(lane, nearest, point, forward);
        if place.outside == 0.0 && !held.contains(lane) {
            held.lanes.push((lane, place));
        }
    });
    held.sort();
    held
}

proptest! {
    #[test]
    fn lanes_answer_the_same_whatever_was_asked_before(
        map in maps(), points in prop::collection::vec((-28_i32..28, -28_i32..28, 0.0..6.3), 1..20),
    ) {
        let (late, eager, mut held) = (lanes(&map), eager(&map), Held::default());
        for (x, y, heading) in points {
            let (point, forward) = (Point::new(f64::from(x) * 0.5, f64::from(y) * 0.5), Point::unit(heading));
            late.hold(&mut held, point, 0.0, forward);
            prop_assert_eq!(&held.lanes, &held_by_all(&lanes(&map), point, forward).lanes);
            prop_assert_eq!(late.search(&held), eager.search(&held));
            prop_assert_eq!(late.at(point, 0.0), eager.at(point, 0.0));
            prop_assert_eq!(late.is_intersection(point, 0.0), eager.is_intersection(point, 0.0));
            for lane in 0..late.strips.len() {
                prop_assert_eq!(late.nearest_place(lane, point), eager.nearest_place(lane, point));
            }
        }
        let crossed = |lanes: &Lanes| (0..lanes.strips.len()).map(|lane| lanes.is_crossed(lane)).collect::<Vec<_>>();
        prop_assert_eq!(crossed(&late), crossed(&eager));
    }

    #[test]
    fn the_nearest_segment_of_a_lane_is_that_of_a_search_of_all(map in maps(), x in -30.0..30.0, y in -30.0..30.0) {
        let (lanes, point) = (lanes(&map), Point::new(x, y));
        for lane in 0..lanes.strips.len() {
            let distance = |segment: usize| lanes.grid.segment(segment).nearest_to(point).distance_squared;
            let first_of_equals = lanes.segments(lane).reduce(|best, other| if distance(other) < distance(best) { other } else { best });
            prop_assert_eq!(Some(lanes.nearest_segment(lane, point)), first_of_equals);
        }
    }

    #[test]
    fn a_lane_reaches_to_its_boundary_where_the_map_names_one(map in maps()) {
        let lanes = lanes(&map);
        for (lane, strip) in lanes.strips.iter().enumerate() {
            let at = &map.lanes[strip.lane];
            let line = &map.road_lines[strip.lane].polyline;
            for (point, place) in strip.points.iter().enumerate() {
                let named = at.left_boundaries.iter().any(|named| named.lane_end_index as usize >= strip.numbers[point]);
                let segments = line.windows(2).map(|pair| Segment { start: pair[0].xy(), end: pair[1].xy() });
                let distance = segments.map(|segment| segment.nearest_to(*place).distance_squared.sqrt());
                let left = if named { distance.fold(4.0, f64::min) } else { 1.83 };
                prop_assert_eq!(lanes.widths(lane, point), [left, 1.83]);
            }
        }
    }
}
