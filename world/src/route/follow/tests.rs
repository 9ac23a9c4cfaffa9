//! Lines that come back to where they were.

use super::*;
use crate::geometry::Point3;
use crate::map::{Lane, LaneKind, Map, MapId};
use crate::route::RouteStyle;
use crate::scene::{AgentState, Scene, SceneParts, Track};
use crate::signal::{Signal, SignalState};

const RADIUS: f64 = 12.0;

/// A drive at 8 m/s along `lanes`, which lead into each other, in the order of `order`.
fn drive_along(lanes: Vec<Lane>, order: &[usize], signals: &[Signal]) -> (Scene, Vec<AgentState>) {
    let mut points: Vec<Point3> = order.iter().flat_map(|lane| lanes[*lane].centerline.iter().copied()).collect();
    points.dedup_by(|a, b| a.xy().distance(b.xy()) < 0.01);
    let mut states = Vec::new();
    // The way to the next state (m).
    let mut left = 0.0;
    for pair in points.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length = from.xy().distance(to.xy());
        while left < length {
            let part = left / length;
            let place = from.xy() + (to.xy() - from.xy()) * part;
            let z = from.z + (to.z - from.z) * part + 0.75;
            let heading = (to.xy() - from.xy()).heading();
            let (x, y) = (place.x, place.y);
            states.push(AgentState { x, y, z, heading, length: 4.0, width: 2.0, height: 1.5, ..AgentState::default() });
            left += 0.8;
        }
        left -= length;
    }
    let parts = SceneParts {
        id: "loop".into(),
        timestamps: (0..states.len()).map(|step| step as f64 * 0.1).collect(),
        signals: states.iter().map(|_| signals.to_vec()).collect(),
        tracks: vec![Track { states: states.iter().copied().map(Some).collect(), ..Track::default() }],
        map: Map { lanes, ..Map::default() },
        ..SceneParts::default()
    };
    (parts.check().unwrap().0, states)
}

/// A lane in so many steps.
fn lane(id: usize, entries: &[usize], exits: &[usize], steps: usize, at: impl Fn(f64) -> Point3) -> Lane {
    let ids = |ids: &[usize]| ids.iter().map(|id| MapId(*id as i64)).collect();
    let centerline = (0..=steps).map(|step| at(step as f64 / steps as f64)).collect();
    let (kind, id) = (LaneKind::SurfaceStreet, MapId(id as i64));
    Lane { id, kind, centerline, entries: ids(entries), exits: ids(exits), ..Lane::default() }
}

/// 40 m straight in, so many quarters to the left around a circle, and 40 m straight out. On the flat four lanes are the circle;
/// where it rises by so many metres a turn each quarter is a lane of its own. The lane in is number 1, the first of the circle 2.
fn roundabout(radius: f64, quarters: usize, rise: f64, signals: &[Signal]) -> (Scene, Vec<AgentState>) {
    let around = |turn: f64| {
        let angle = turn * std::f64::consts::TAU;
        Point3::new(radius * libm::sin(angle), radius * (1.0 - libm::cos(angle)), rise * turn)
    };
    let ring = if rise > 0.0 { quarters } else { 4 };
    let out = ring + 2;
    let last = (quarters - 1) % ring;
    let turns = quarters as f64 / 4.0;
    let mut lanes = vec![lane(1, &[], &[2], 80, |part| Point3::new(40.0 * (part - 1.0), 0.0, 0.0))];
    for quarter in 0..ring {
        let mut exits = Vec::new();
        if rise == 0.0 || quarter + 1 < ring {
            exits.push(2 + (quarter + 1) % ring);
        }
        if quarter == last {
            exits.push(out);
        }
        let entry = if quarter == 0 { 1 } else { 1 + quarter };
        let steps = (radius * 3.2) as usize;
        lanes.push(lane(2 + quarter, &[entry], &exits, steps, |part| around((quarter as f64 + part) / 4.0)));
    }
    if rise == 0.0 {
        lanes[1].entries.push(MapId(ring as i64 + 1));
    }
    let forward = Point::unit(turns * std::f64::consts::TAU);
    let end = around(turns);
    lanes.push(lane(out, &[2 + last], &[], 80, |part| {
        let place = end.xy() + forward * (40.0 * part);
        Point3::new(place.x, place.y, end.z)
    }));
    let order: Vec<usize> =
        std::iter::once(0).chain((0..quarters).map(|quarter| 1 + quarter % ring)).chain([ring + 1]).collect();
    drive_along(lanes, &order, signals)
}

fn route(scene: &Scene) -> Route {
    Route::of_log(scene, RouteStyle::Strict).unwrap()
}

/// Stations and distances along a drive.
fn followed(route: &Route, states: &[AgentState]) -> Vec<Followed> {
    let mut follower = Follower::default();
    states.iter().map(|state| follower.follow(route, state.pose(), state.z - 0.75, 5.0)).collect()
}

#[test]
fn a_turn_and_a_quarter_around_a_roundabout_is_driven_once_from_end_to_end() {
    for (radius, quarters, rise) in [(12.0, 5, 0.0), (6.0, 5, 0.0), (8.0, 12, 3.5), (8.0, 12, 0.0)] {
        let (scene, states) = roundabout(radius, quarters, rise, &[]);
        let route = route(&scene);
        // The line ends a little before the last lane does.
        let states = &states[..states.len() - 8];
        let followed = followed(&route, states);
        let steps: Vec<isize> =
            followed.windows(2).map(|pair| pair[1].sample as isize - pair[0].sample as isize).collect();
        assert!(steps.iter().all(|step| (5..=11).contains(step)), "radius {radius}: {steps:?}");
        let driven = (followed[followed.len() - 1].sample - followed[0].sample) as f64 * SAMPLE_SPACING;
        assert!((driven - 0.8 * (states.len() - 1) as f64).abs() < 1.0, "radius {radius}: {driven}");
        assert!(followed.iter().all(|at| at.distance < 0.6 && at.skipped == 0.0));
        if rise > 0.0 {
            assert!(
                states.iter().zip(&followed).all(|(state, at)| (route.line.z[at.sample] + 0.75 - state.z).abs() < 0.5)
            );
        }
    }
}

#[test]
fn a_log_that_begins_where_the_route_comes_by_twice_begins_at_the_first_pass_on_its_level() {
    let (scene, states) = roundabout(RADIUS, 8, 0.0, &[]);
    let route_flat = route(&scene);
    let third = &states[60..];
    assert!((followed(&route_flat, third)[0].sample as f64 * SAMPLE_SPACING - 48.0).abs() < 1.0);
    let (scene, states) = roundabout(RADIUS, 8, 5.0, &[]);
    // Half a turn on in the second round, 5 m above the first.
    let upstairs = 50 + (1.5 * std::f64::consts::TAU * RADIUS / 0.8) as usize;
    let found = followed(&route(&scene), &states[upstairs..])[0].sample as f64 * SAMPLE_SPACING;
    assert!((found - 0.8 * upstairs as f64).abs() < 1.0, "{found}");
}

#[test]
fn who_cuts_a_loop_has_left_its_stretch_and_what_is_passed_over_is_no_progress() {
    // Straight on past the roundabout's entry, from the first pass to where the road leaves it.
    let (scene, _) = roundabout(20.0, 4, 0.0, &[]);
    let route = route(&scene);
    let mut follower = Follower::default();
    let straight: Vec<Followed> =
        (0..90).map(|i| follower.follow(&route, Pose::new(-36.0 + 0.8 * f64::from(i), 0.0, 0.0), 0.0, 5.0)).collect();
    let worst = straight.iter().map(|at| at.distance).fold(0.0, f64::max);
    assert!(worst > 5.0 && worst < 6.5, "seen leaving, at once: {worst}");
    let last = straight[89];
    let progress = (last.sample as f64 - straight[0].sample as f64) * SAMPLE_SPACING - last.skipped;
    assert!((progress - 0.8 * 89.0).abs() < 2.0, "{progress}, {last:?}");
    assert!(last.distance < 0.1, "it is followed again");
}

#[test]
fn who_goes_off_and_comes_back_is_followed_again_and_loses_nothing() {
    let straight = lane(1, &[], &[], 600, |part| Point3::new(300.0 * part, 0.0, 0.0));
    let (scene, _) = drive_along(vec![straight], &[0], &[]);
    let route = route(&scene);
    let mut follower = Follower::default();
    let aside = |i: i32| if (40..120).contains(&i) { 9.0 } else { 0.0 };
    let drive: Vec<Followed> =
        (0..200).map(|i| follower.follow(&route, Pose::new(10.0 + f64::from(i), aside(i), 0.0), 0.0, 5.0)).collect();
    assert!(drive[60].distance > 8.9 && drive[150].distance < 0.1);
    assert!(drive.iter().all(|at| at.skipped == 0.0));
    assert_eq!(drive[199].sample - drive[0].sample, 1990);
}

#[test]
fn a_stop_point_that_is_passed_twice_stops_both_times_but_not_where_the_route_crosses_it() {
    let signal = |lane: i64, x: f64, y: f64| {
        let (lane, state) = (MapId(lane), SignalState::Stop);
        Signal { lane, state, stop_point: Point3::new(x, y, 0.0) }
    };
    // An eighth of a turn after the entry: a turn and a half comes by twice.
    let eighth = std::f64::consts::FRAC_PI_4;
    let on_circle = signal(2, RADIUS * libm::sin(eighth), RADIUS * (1.0 - libm::cos(eighth)));
    let twice = route(&roundabout(RADIUS, 6, 0.0, &[on_circle]).0);
    let rows = twice.stops().red_rows(&on_circle).to_vec();
    assert_eq!(rows.len(), 2, "{rows:?}");
    assert!((f64::from(rows[1] - rows[0]) * SAMPLE_SPACING - std::f64::consts::TAU * RADIUS).abs() < 1.0);
    let window = twice.window(rows[0] as usize, &[on_circle]);
    assert_eq!(window.red_stops.len(), 2);
    // Three quarters of a turn: the way out crosses the way in, and the stop point of the way in is not its own.
    let way_in = signal(1, -RADIUS, 0.0);
    let crossed = route(&roundabout(RADIUS, 3, 0.0, &[way_in]).0);
    assert_eq!(crossed.stops().red_rows(&way_in).len(), 1);
}
