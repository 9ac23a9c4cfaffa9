//! Routes of hand-made scenes.

use proptest::prelude::*;

use super::*;
use crate::geometry::Pose;
use crate::map::{Area, Lane, LaneKind, Map};
use crate::scene::{AgentState, SceneParts, Track};
use crate::signal::SignalState;

/// A lane along `points`, a point every 0.5 m.
fn lane(id: i64, points: &[(f64, f64)], entries: &[i64], exits: &[i64]) -> Lane {
    let mut centerline = Vec::new();
    for pair in points.windows(2) {
        let (from, to) = (Point::new(pair[0].0, pair[0].1), Point::new(pair[1].0, pair[1].1));
        let parts = (from.distance(to) / 0.5).round() as usize;
        centerline.extend((0..parts).map(|part| from + (to - from) * (part as f64 / parts as f64)));
    }
    centerline.extend(points.last().map(|(x, y)| Point::new(*x, *y)));
    let ids = |ids: &[i64]| ids.iter().map(|id| MapId(*id)).collect();
    Lane {
        id: MapId(id),
        kind: LaneKind::SurfaceStreet,
        speed_limit_mph: 10.0 * id as f64,
        centerline: centerline.into_iter().map(|p| Point3::new(p.x, p.y, 2.0)).collect(),
        entries: ids(entries),
        exits: ids(exits),
        ..Lane::default()
    }
}

/// 300 m of road to the east in three lanes, one after the other, and a fourth that turns off to the north at 200 m.
fn road() -> Map {
    Map {
        lanes: vec![
            lane(1, &[(0.0, 0.0), (100.0, 0.0)], &[], &[2]),
            lane(2, &[(100.0, 0.0), (200.0, 0.0)], &[1], &[4, 3]),
            lane(3, &[(200.0, 0.0), (300.0, 0.0)], &[2], &[]),
            lane(4, &[(200.0, 0.0), (205.0, 5.0), (205.0, 90.0)], &[2], &[]),
        ],
        ..Map::default()
    }
}

fn state(pose: Pose) -> AgentState {
    let Pose { x, y, heading } = pose;
    AgentState { x, y, heading, z: 2.75, length: 5.0, width: 2.0, height: 1.5, ..AgentState::default() }
}

fn scene_with(map: Map, drive: impl IntoIterator<Item = Pose>, signals: &[Signal]) -> Scene {
    let states: Vec<_> = drive.into_iter().map(|pose| Some(state(pose))).collect();
    let parts = SceneParts {
        id: "hand-made".into(),
        timestamps: (0..states.len()).map(|step| step as f64 * 0.1).collect(),
        signals: states.iter().map(|_| signals.to_vec()).collect(),
        tracks: vec![Track { states, ..Track::default() }],
        map,
        ..SceneParts::default()
    };
    parts.check().unwrap().0
}

/// Straight east from `from` metres for 10 s at `speed`, `aside` metres to the left of the road.
fn east(from: f64, speed: f64, aside: f64) -> impl Iterator<Item = Pose> {
    (0..100).map(move |step| Pose::new(from + f64::from(step) * 0.1 * speed, aside, 0.0))
}

fn strict(map: Map, drive: impl IntoIterator<Item = Pose>) -> Route {
    Route::of_log(&scene_with(map, drive, &[]), RouteStyle::Strict).unwrap()
}

fn ids(route: &Route) -> Vec<i64> {
    route.lanes.iter().map(|lane| lane.0).collect()
}

#[test]
fn the_line_follows_the_lanes_and_goes_on_where_the_log_ends() {
    let route = strict(road(), east(50.0, 10.0, 0.8));
    assert_eq!(ids(&route), [1, 2, 3]);
    let line = &route.line;
    assert!(line.y.iter().all(|y| y.abs() < 1e-9) && line.heading.iter().all(|heading| heading.abs() < 1e-9));
    // 30 m behind 50 m, 120 m ahead of 149 m, to within a waypoint's spacing.
    assert!((20.0..=25.5).contains(&line.x[0]) && (264.0..=270.0).contains(&line.x[line.len() - 1]));
    assert!(line.z.iter().all(|z| (z - 2.0).abs() < 1e-9));
}

#[test]
fn the_limit_at_each_place_is_that_of_its_lane() {
    let route = strict(road(), east(50.0, 10.0, 0.0));
    let limit = |x: f64| route.line.speed_limit[route.nearest_sample(Point::new(x, 0.0)).0];
    let mph = crate::map::METERS_PER_SECOND_PER_MPH;
    assert_eq!((limit(90.0), limit(110.0), limit(210.0)), (10.0 * mph, 20.0 * mph, 30.0 * mph));
    let lane = |x: f64| route.lane_of_sample(route.nearest_sample(Point::new(x, 0.0)).0);
    assert_eq!((lane(90.0), lane(210.0)), (Some(MapId(1)), Some(MapId(3))));
}

#[test]
fn the_straightest_exit_is_followed_not_the_first() {
    assert_eq!(ids(&strict(road(), east(120.0, 2.0, 0.0))), [1, 2, 3]);
    let paper = Route::of_log(&scene_with(road(), east(185.0, 1.0, 0.0), &[]), RouteStyle::Paper).unwrap();
    assert_eq!(ids(&paper), [2, 4]);
}

#[test]
fn a_parked_av_gets_the_line_of_its_lane() {
    let parked = (0..198).map(|step| Pose::new(50.0 + 1e-4 * f64::from(step), 1.0, 0.0));
    let route = strict(road(), parked);
    let (nearest, distance) = route.nearest_sample(Point::new(50.0, 1.0));
    assert!((distance - 1.0).abs() < 0.01 && nearest > 200 && route.line.len() > nearest + 1000);
}

#[test]
fn where_the_av_stands_the_paper_repeats_its_waypoint_and_the_strict_line_does_not() {
    let drive: Vec<Pose> = east(50.0, 5.0, 0.0).chain((0..100).map(|_| Pose::new(99.5, 0.0, 0.0))).collect();
    let scene = scene_with(road(), drive, &[]);
    let repeats = |route: &Route| route.waypoints().windows(2).filter(|pair| pair[0] == pair[1]).count();
    assert_eq!(repeats(&Route::of_log(&scene, RouteStyle::Strict).unwrap()), 0);
    assert!(repeats(&Route::of_log(&scene, RouteStyle::Paper).unwrap()) >= 9);
}

#[test]
fn nothing_behind_is_no_route_for_the_paper_only() {
    let scene = scene_with(road(), east(0.0, 5.0, 0.0), &[]);
    assert_eq!(Route::of_log(&scene, RouteStyle::Paper).unwrap_err(), RouteError::NothingBehind);
    assert_eq!(Route::of_log(&scene, RouteStyle::Strict).unwrap().line.x[0], 0.0);
}

#[test]
fn without_lanes_the_strict_line_is_the_drive_itself_and_the_paper_has_none() {
    let scene = scene_with(Map::default(), east(0.0, 5.0, 3.0), &[]);
    assert_eq!(Route::of_log(&scene, RouteStyle::Paper).unwrap_err(), RouteError::NoLane { log_index: 0 });
    let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
    assert!(route.lanes.is_empty() && route.line.y.iter().all(|y| (y - 3.0).abs() < 1e-9));
    assert!(route.line.speed_limit.iter().all(|limit| *limit == 0.0));
    let parked = scene_with(Map::default(), (0..50).map(|_| Pose::new(7.0, 7.0, 1.0)), &[]);
    let route = Route::of_log(&parked, RouteStyle::Strict).unwrap();
    assert!(route.nearest_sample(Point::new(7.0, 7.0)).1 < 1e-9);
}

#[test]
fn a_ring_of_lanes_ends() {
    let ring = Map {
        lanes: vec![
            lane(1, &[(0.0, 0.0), (10.0, 0.0)], &[4], &[2]),
            lane(2, &[(10.0, 0.0), (10.0, 10.0)], &[1], &[3]),
            lane(3, &[(10.0, 10.0), (0.0, 10.0)], &[2], &[4]),
            lane(4, &[(0.0, 10.0), (0.0, 0.0)], &[3], &[1]),
        ],
        ..Map::default()
    };
    let route = strict(ring, (0..80).map(|step| Pose::new(f64::from(step) * 0.1 + 1.0, 0.0, 0.0)));
    assert!(route.line.len() > 100 && route.line.curvature.iter().all(|curvature| curvature.is_finite()));
}

/// One lane around the origin, with a radius of 12 m, that rises by so many metres a turn; not linked to itself.
fn ring(turns: f64, rise: f64) -> Lane {
    let points = 120.0 * turns;
    let at = |step: u32| {
        let turn = turns * f64::from(step) / points;
        let (y, x) = libm::sincos(turn * std::f64::consts::TAU);
        Point3::new(12.0 * x, 12.0 * y, 2.0 + rise * turn)
    };
    Lane { centerline: (0..=points as u32).map(at).collect(), ..lane(1, &[], &[], &[]) }
}

/// Poses around the origin from a quarter turn on.
fn round(turns: f64) -> impl Iterator<Item = Pose> {
    let steps = (turns * 75.4) as u32;
    (0..=steps).map(move |step| {
        let angle = (0.25 + turns * f64::from(step) / f64::from(steps)) * std::f64::consts::TAU;
        let (y, x) = libm::sincos(angle);
        Pose::new(12.0 * x, 12.0 * y, angle + std::f64::consts::FRAC_PI_2)
    })
}

/// By how much the line turns to the left in all (turns), and its longest step (m).
fn turned(route: &Route) -> (f64, f64) {
    let line = &route.line;
    let steps = || (1..line.len()).map(|at| (at - 1, at));
    let turn: f64 = steps().map(|(a, b)| crate::geometry::angle_difference(line.heading[a], line.heading[b])).sum();
    let longest = steps().map(|(a, b)| line.point(a).distance(line.point(b))).fold(0.0, f64::max);
    (turn / std::f64::consts::TAU, longest)
}

#[test]
fn a_lane_that_is_a_whole_circle_is_driven_round_as_often_as_the_log_does() {
    for turns in [0.5, 1.0, 1.4, 2.3] {
        let route = strict(Map { lanes: vec![ring(1.0, 0.0)], ..Map::default() }, round(turns));
        let (turned, longest) = turned(&route);
        // What lies ahead of the log goes round too: 200 m at most.
        assert!(
            turned >= turns && turned < turns + 3.5 && longest < 0.2,
            "{turns}: {turned} turns, steps of {longest} m"
        );
        let farthest = (0..route.line.len()).map(|at| (route.line.point(at).norm() - 12.0).abs()).fold(0.0, f64::max);
        assert!(farthest < 0.3, "{turns}: {farthest} m off the circle");
    }
}

#[test]
fn a_lane_that_winds_up_is_followed_upwards() {
    let map = Map { lanes: vec![ring(3.0, 6.0)], ..Map::default() };
    let mut scene = scene_with(map, round(1.5), &[]).into_parts();
    let count = scene.tracks[0].states.len() as f64;
    for (step, state) in scene.tracks[0].states.iter_mut().enumerate() {
        // From a quarter turn of the second storey on.
        state.iter_mut().for_each(|state| state.z = 2.75 + 6.0 * (1.25 + 1.5 * step as f64 / count));
    }
    let route = Route::of_log(&scene.check().unwrap().0, RouteStyle::Strict).unwrap();
    let rises = route.line.z.windows(2).all(|pair| pair[1] >= pair[0] - 1e-6);
    assert!(rises && turned(&route).1 < 0.2, "{:?}", turned(&route));
}

#[test]
fn what_lies_on_a_bridge_rules_nobody_below() {
    let mut map = road();
    let mut above = lane(7, &[(0.0, 0.5), (300.0, 0.5)], &[], &[]);
    above.centerline.iter_mut().for_each(|point| point.z += 8.0);
    map.lanes.insert(0, above);
    let corners = [(120.0, -5.0), (124.0, -5.0), (124.0, 5.0), (120.0, 5.0)];
    let polygon = corners.iter().map(|(x, y)| Point3::new(*x, *y, 10.0)).collect();
    map.crosswalks.push(Area { id: MapId(90), polygon });
    let route = strict(map, east(50.0, 10.0, 0.5));
    assert!(!route.line.crosswalk.contains(&true));
    assert!(route.line.speed_limit.iter().all(|limit| *limit < 31.0 * 0.447_04), "that of lane 7 is 70 mph");
}

#[test]
fn a_lane_of_one_point_on_the_way_does_no_harm() {
    let mut map = road();
    map.lanes.push(lane(5, &[(100.0, 0.0)], &[1], &[2]));
    map.lanes[0].exits = vec![MapId(5)];
    map.lanes[1].entries = vec![MapId(5)];
    assert_eq!(ids(&strict(map, east(50.0, 10.0, 0.0))), [1, 5, 2, 3]);
}

#[test]
fn a_lane_change_bends_gently() {
    let mut map = road();
    map.lanes.push(lane(6, &[(0.0, 3.5), (300.0, 3.5)], &[], &[]));
    for (own, other) in [(0, 6), (1, 6), (2, 6)] {
        map.lanes[own].left_neighbors = vec![crate::map::LaneNeighbor {
            lane: MapId(other),
            self_start_index: 0,
            self_end_index: 200,
            neighbor_start_index: 0,
            neighbor_end_index: 200,
            boundaries: Vec::new(),
        }];
    }
    let drive = (0..100).map(|step| {
        let x = f64::from(step) + 50.0;
        Pose::new(x, 3.5 / (1.0 + libm::exp((100.0 - x) / 5.0)), 0.0)
    });
    let route = strict(map, drive.clone());
    assert_eq!(ids(&route), [1, 6]);
    assert!(route.line.curvature.iter().all(|curvature| curvature.abs() < 0.05));
    assert!(drive.into_iter().all(|pose| route.nearest_sample(pose.position()).1 < 1.0));
}

#[test]
fn an_overpass_is_not_the_lane_that_is_driven_on() {
    let mut map = road();
    let mut above = lane(7, &[(0.0, 0.5), (300.0, 0.5)], &[], &[]);
    above.centerline.iter_mut().for_each(|point| point.z += 8.0);
    map.lanes.insert(0, above);
    assert_eq!(ids(&strict(map, east(50.0, 10.0, 0.5))), [1, 2, 3]);
}

#[test]
fn a_u_turn_is_followed_all_the_way() {
    let turn = (0..60).map(|step| {
        let angle = f64::from(step) / 59.0 * std::f64::consts::PI;
        Pose::new(40.0 + 6.0 * libm::sin(angle), 6.0 - 6.0 * libm::cos(angle), angle)
    });
    let drive: Vec<Pose> = east(0.0, 4.0, 0.0)
        .chain(turn)
        .chain((0..100).map(|step| Pose::new(40.0 - 0.4 * f64::from(step), 12.0, std::f64::consts::PI)))
        .collect();
    let route = strict(Map::default(), drive.clone());
    assert!(drive.iter().all(|pose| route.nearest_sample(pose.position()).1 < 1.0));
}

#[test]
fn a_log_that_jumps_across_the_country_is_refused() {
    let drive = [Pose::new(0.0, 0.0, 0.0), Pose::new(1e6, 0.0, 0.0)];
    let error = Route::of_log(&scene_with(Map::default(), drive, &[]), RouteStyle::Strict).unwrap_err();
    assert!(matches!(error, RouteError::TooLong { .. }), "{error}");
}

#[test]
fn samples_within_a_crosswalk_are_marked() {
    let mut map = road();
    let corners = [(120.0, -5.0), (124.0, -5.0), (124.0, 5.0), (120.0, 5.0)];
    let polygon = corners.iter().map(|(x, y)| Point3::new(*x, *y, 0.0)).collect();
    map.crosswalks.push(Area { id: MapId(90), polygon });
    let route = strict(map, east(50.0, 10.0, 0.0));
    for index in 0..route.line.len() {
        let x = route.line.x[index];
        // Rounding decides at the edge itself.
        if (x - 120.0).abs() > 1e-6 && (x - 124.0).abs() > 1e-6 {
            assert_eq!(route.line.crosswalk[index], (120.0..124.0).contains(&x), "x {x}");
        }
    }
}

fn signal(lane: i64, state: SignalState, x: f64, y: f64) -> Signal {
    Signal { lane: MapId(lane), state, stop_point: Point3::new(x, y, 2.0) }
}

/// Rows of the whole line at which `signal` stops the route that drives lanes 1, 2, 3.
fn rows(style: RouteStyle, signal: Signal) -> Vec<f64> {
    let route = Route::of_log(&scene_with(road(), east(50.0, 16.0, 0.0), &[signal]), style).unwrap();
    let window = route.window(route.nearest_sample(signal.stop_point.xy()).0, &[signal]);
    window.red_stops.iter().map(|row| route.line.x[window.start + *row as usize]).collect()
}

#[test]
fn a_red_signal_of_a_lane_of_the_route_stops_it() {
    for state in [SignalState::Stop, SignalState::ArrowStop] {
        let stops = rows(RouteStyle::Strict, signal(2, state, 100.0, 1.4));
        assert!(stops.len() == 1 && (stops[0] - 100.0).abs() < 0.06, "{stops:?}");
    }
    for state in [SignalState::Go, SignalState::Caution, SignalState::Unknown, SignalState::FlashingStop] {
        assert!(rows(RouteStyle::Strict, signal(2, state, 100.0, 0.0)).is_empty(), "{state:?}");
    }
    assert!(rows(RouteStyle::Strict, signal(2, SignalState::Stop, 100.0, 1.6)).is_empty());
}

#[test]
fn a_red_signal_of_another_lane_stops_the_paper_but_not_the_strict_route() {
    // The turn-off shares its stop point with the lane straight on.
    let turn_off = signal(4, SignalState::Stop, 200.0, 0.0);
    assert!(rows(RouteStyle::Strict, turn_off).is_empty());
    assert!(!rows(RouteStyle::Paper, turn_off).is_empty());
    // Of a lane that the map does not hold only the place is known.
    assert_eq!(rows(RouteStyle::Strict, signal(99, SignalState::Stop, 150.0, 0.1)).len(), 1);
    assert!(rows(RouteStyle::Strict, signal(99, SignalState::Stop, 150.0, 0.3)).is_empty());
}

#[test]
fn the_paper_stops_at_rows_strictly_within_its_reach_and_at_flashing_lights() {
    let stops = rows(RouteStyle::Paper, signal(2, SignalState::FlashingStop, 100.0, 0.0));
    assert!((3..=5).contains(&stops.len()) && stops.iter().all(|x| (x - 100.0).abs() < 0.2), "{stops:?}");
    assert!(rows(RouteStyle::Paper, signal(2, SignalState::Stop, 100.0, 0.21)).is_empty());
}

#[test]
fn a_window_begins_20_m_behind_and_ends_with_the_line() {
    let route = strict(road(), east(50.0, 10.0, 0.0));
    let at = |nearest: usize| {
        let window = route.window(nearest, &[]);
        (window.start, window.samples)
    };
    let len = route.line.len();
    assert_eq!(at(0), (0, 1200));
    assert_eq!(at(300), (100, 1200));
    assert_eq!(at(len - 1), (len - 201, 201));
}

proptest! {
    #[test]
    fn any_map_and_log_give_a_finite_line_or_an_error(
        lanes in prop::collection::vec(
            (prop::collection::vec((-30.0..30.0, -30.0..30.0), 1..5), prop::collection::vec(0_i64..8, 0..4)), 0..8,
        ),
        drive in prop::collection::vec((-40.0..40.0, -40.0..40.0, -9.0..9.0), 1..40),
    ) {
        let lanes = (0..).zip(&lanes).map(|(id, (points, exits))| lane(id, points, exits, exits)).collect();
        let drive = drive.into_iter().map(|(x, y, heading)| Pose::new(x, y, heading));
        let scene = scene_with(Map { lanes, ..Map::default() }, drive, &[]);
        for style in [RouteStyle::Strict, RouteStyle::Paper] {
            if let Ok(route) = Route::of_log(&scene, style) {
                let line = &route.line;
                prop_assert!(line.len() >= 2 && line.crosswalk.len() == line.len());
                for column in [&line.x, &line.y, &line.z, &line.heading, &line.curvature, &line.speed_limit] {
                    prop_assert!(column.len() == line.len() && column.iter().all(|value| value.is_finite()));
                }
            }
        }
    }

    #[test]
    fn a_hint_changes_no_answer(x in -20.0..320.0, y in -60.0..60.0, hint in 0_usize..4000) {
        let route = strict(road(), (0..80).map(|step| {
            let along = f64::from(step) * 2.0;
            if along < 100.0 { Pose::new(100.0 + along, 0.0, 0.0) } else { Pose::new(205.0, along - 95.0, 1.57) }
        }));
        let point = Point::new(x, y);
        prop_assert_eq!(route.nearest_sample_from(point, hint), route.nearest_sample(point));
    }
}
