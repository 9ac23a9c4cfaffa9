//! Lines that come back to where they were.

use super::*;
use crate::geometry::Point3;
use crate::map::{Lane, LaneKind, Map, MapId};
use crate::route::RouteStyle;
use crate::scene::{AgentState, Scene, SceneParts, Track};
use crate::signal::{Signal, SignalState};

/// A lane along `points`, and a drive along it from the first to the last at 8 m/s.
fn drive_along(points: Vec<Point3>, signals: &[Signal]) -> (Scene, Vec<AgentState>) {
    let length: f64 = points.windows(2).map(|pair| pair[0].xy().distance(pair[1].xy())).sum();
    let mut states = Vec::new();
    let (mut at, mut station) = (0, 0.0);
    for step in 0..(length / 0.8) as usize {
        let wanted = 0.8 * step as f64;
        while station + points[at].xy().distance(points[at + 1].xy()) < wanted {
            station += points[at].xy().distance(points[at + 1].xy());
            at += 1;
        }
        let (from, to) = (points[at], points[at + 1]);
        let part = (wanted - station) / from.xy().distance(to.xy());
        let place = from.xy() + (to.xy() - from.xy()) * part;
        let z = from.z + (to.z - from.z) * part + 0.75;
        let heading = (to.xy() - from.xy()).heading();
        states.push(AgentState {
            x: place.x,
            y: place.y,
            z,
            heading,
            length: 4.0,
            width: 2.0,
            height: 1.5,
            ..AgentState::default()
        });
    }
    let lane = Lane { id: MapId(1), kind: LaneKind::SurfaceStreet, centerline: points, ..Lane::default() };
    let parts = SceneParts {
        id: "loop".into(),
        timestamps: (0..states.len()).map(|step| step as f64 * 0.1).collect(),
        signals: states.iter().map(|_| signals.to_vec()).collect(),
        tracks: vec![Track { states: states.iter().copied().map(Some).collect(), ..Track::default() }],
        map: Map { lanes: vec![lane], ..Map::default() },
        ..SceneParts::default()
    };
    (parts.check().unwrap().0, states)
}

/// 40 m straight in, so many turns to the left around a circle, and 40 m straight out; it rises by `rise` metres a turn.
fn roundabout(radius: f64, turns: f64, rise: f64) -> Vec<Point3> {
    let at = |angle: f64| Point::new(radius * libm::sin(angle), radius * (1.0 - libm::cos(angle)));
    let whole = turns * std::f64::consts::TAU;
    let round = (whole * radius / 0.5) as usize;
    let height = |part: f64| rise * turns * part;
    let mut points: Vec<Point3> = (0..80).map(|i| Point3::new(-40.0 + 0.5 * f64::from(i), 0.0, 0.0)).collect();
    points.extend((0..=round).map(|i| {
        let part = i as f64 / round as f64;
        let place = at(whole * part);
        Point3::new(place.x, place.y, height(part))
    }));
    let (end, out) = (at(whole), Point::unit(whole));
    points.extend((1..=80).map(|i| {
        let place = end + out * (0.5 * f64::from(i));
        Point3::new(place.x, place.y, height(1.0))
    }));
    points
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
    for (radius, turns, rise) in [(12.0, 1.25, 0.0), (6.0, 1.25, 0.0), (8.0, 3.0, 3.5), (8.0, 3.0, 0.0)] {
        let (scene, states) = drive_along(roundabout(radius, turns, rise), &[]);
        let route = route(&scene);
        let followed = followed(&route, &states);
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
    let (scene, states) = drive_along(roundabout(12.0, 2.0, 0.0), &[]);
    let route_flat = route(&scene);
    let third = &states[60..];
    assert!((followed(&route_flat, third)[0].sample as f64 * SAMPLE_SPACING - 48.0).abs() < 1.0);
    let (scene, states) = drive_along(roundabout(12.0, 2.0, 5.0), &[]);
    // Half a turn on in the second round, 5 m above the first.
    let upstairs = 50 + (1.5 * std::f64::consts::TAU * 12.0 / 0.8) as usize;
    let found = followed(&route(&scene), &states[upstairs..])[0].sample as f64 * SAMPLE_SPACING;
    assert!((found - 0.8 * upstairs as f64).abs() < 1.0, "{found}");
}

#[test]
fn who_cuts_a_loop_has_left_its_stretch_and_what_is_passed_over_is_no_progress() {
    // Straight on past the roundabout's entry, from the first pass to where the road leaves it.
    let (scene, _) = drive_along(roundabout(20.0, 1.0, 0.0), &[]);
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
    let points: Vec<Point3> = (0..600).map(|i| Point3::new(0.5 * f64::from(i), 0.0, 0.0)).collect();
    let (scene, _) = drive_along(points, &[]);
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
    let signal =
        |x: f64, y: f64| Signal { lane: MapId(1), state: SignalState::Stop, stop_point: Point3::new(x, y, 0.0) };
    // On the circle, a quarter turn after the entry: a turn and a half comes by twice.
    let on_circle = signal(12.0, 12.0);
    let (scene, _) = drive_along(roundabout(12.0, 1.5, 0.0), &[on_circle]);
    let twice = route(&scene);
    let rows = twice.stops().red_rows(&on_circle).to_vec();
    assert_eq!(rows.len(), 2, "{rows:?}");
    assert!((f64::from(rows[1] - rows[0]) * SAMPLE_SPACING - std::f64::consts::TAU * 12.0).abs() < 1.0);
    let window = twice.window(rows[0] as usize, &[on_circle]);
    assert_eq!(window.red_stops.len(), 2);
    // Three quarters of a turn: the way out crosses the way in, and the stop point of the way in is not its own.
    let before_crossing = signal(-12.0, 0.0);
    let (scene, _) = drive_along(roundabout(12.0, 0.75, 0.0), &[before_crossing]);
    assert_eq!(route(&scene).stops().red_rows(&before_crossing).len(), 1);
}
