//! Drives along a straight road of two lanes, each of whose figures has a closed form.

// Lane 1 along +x at y = 0, lane 2 the other way at y = 3.5, edges at y = -2.5 and 6; cars of 5 m by 2 m.
#[path = "../../../episode/tests/straight_road/mod.rs"]
mod straight_road;

use std::sync::Arc;

use episode::driver::drive;
use episode::protocol::StrictSettings;
use episode::{Episode, Outcome};
use straight_road::{START, StraightRoad, car, to_lateral};
use wire::proto;
use world::geometry::Point;
use world::plan::{PlanState, STEP_SECONDS};
use world::scene::{AgentKind, AgentState, Scene};

use super::drive::Drive;
use super::*;

/// What a score says of an AV that is at `motion` (x, y, speed; along x) at each of so many steps, at the start among them.
fn judged_by<M: Fn(f64) -> (f64, f64, f64)>(
    score: Score,
    road: &StraightRoad,
    steps: usize,
    motion: M,
) -> impl Fn(&str) -> Option<f64> + use<M> {
    let scene = road.scene();
    let begin = scene.av().states[START].unwrap();
    let state = |step: usize| {
        let (x, y, speed) = motion(step as f64 * STEP_SECONDS);
        AgentState { x, y, velocity_x: speed, velocity_y: 0.0, heading: 0.0, ..begin }
    };
    let states: Vec<AgentState> = (0..=steps).map(state).collect();
    let driven: Vec<PlanState> = states[1..].iter().map(plan_state).collect();
    let protocol = Protocol::default();
    let drive = Drive::new(&scene, &protocol, START, states, &driven);
    let judged = judge(score, &drive, &mut again::Again::default(), None);
    assert_eq!(judged.reason, None);
    let names: Vec<String> = score.figures().into_iter().map(|figure| figure.name).collect();
    assert_eq!(names.len(), judged.values.len());
    move |name| judged.values[names.iter().position(|known| known == name).unwrap()]
}

fn plan_state(state: &AgentState) -> PlanState {
    PlanState {
        x: state.x,
        y: state.y,
        heading: state.heading,
        speed: state.velocity().dot(Point::unit(state.heading)),
    }
}

/// Straight on at constant speed, so far to the left.
fn at(speed: f64, y: f64) -> impl Fn(f64) -> (f64, f64, f64) {
    move |time| (speed * time, y, speed)
}

/// A road whose logged AV is at that speed up to the drive's start, as ours is, and at 10 m/s after.
fn hurrying(speed: f64) -> StraightRoad {
    let mut av = car(0.0, 0.0, 0.0, speed);
    av.motion = Box::new(move |time| {
        let speed = if time < 0.5 * STEP_SECONDS { speed } else { 10.0 };
        Some((speed * time, 0.0, 0.0, speed))
    });
    StraightRoad { av, ..StraightRoad::new() }
}

fn close(told: Option<f64>, expected: f64) {
    let told = told.unwrap();
    assert!((told - expected).abs() < 1e-9, "{told} and not {expected}");
}

#[test]
fn waymax_tells_the_distance_to_the_log_and_the_share_of_its_way() {
    let figure = judged_by(Score::Waymax, &StraightRoad::new(), 150, at(8.0, 0.0));
    // 0.2 m more at each step.
    close(figure("waymax_log_divergence_ade_m"), 0.2 * 151.0 / 2.0);
    close(figure("waymax_log_divergence_fde_m"), 30.0);
    for flag in ["waymax_overlap", "waymax_offroad", "waymax_kinematic_infeasibility"] {
        assert_eq!(figure(flag), Some(0.0), "{flag}");
    }
    // The log goes from -19 m to 180 m; the samples of the line are as exact as its spline.
    assert!((figure("waymax_line_progression").unwrap() - 139.0 / 199.0).abs() < 1e-6);
    assert_eq!((figure("waymax_lanes_wrong_way_m"), figure("waymax_lanes_off_route_m")), (Some(0.0), Some(0.0)));
}

#[test]
fn waymax_asks_corners_and_distances_to_points() {
    let offroad = |y: f64| judged_by(Score::Waymax, &StraightRoad::new(), 50, at(10.0, y))("waymax_offroad");
    assert_eq!(
        (offroad(-1.49), offroad(-1.51), offroad(4.99), offroad(5.01)),
        (Some(0.0), Some(1.0), Some(0.0), Some(1.0))
    );
    let off = |y: f64| {
        let figure = judged_by(Score::Waymax, &StraightRoad::new(), 50, at(10.0, y));
        ["waymax_lanes_wrong_way_m", "waymax_lanes_off_route_m"].map(|name| figure(name).unwrap())
    };
    let near = |told: [f64; 2], expected: [f64; 2]| {
        assert!(told.iter().zip(expected).all(|(told, expected)| (told - expected).abs() < 1e-6), "{told:?}");
    };
    // No path leads to the oncoming lane.
    near(off(3.4), [0.0, 0.0]);
    near(off(4.5), [4.5, 0.0]);
    near(off(-5.5), [5.5, 5.5]);
}

#[test]
fn waymax_asks_whether_boxes_overlap_and_a_car_could_have_driven_so() {
    let road = StraightRoad::new().with(car(50.0, 0.0, 0.0, 0.0));
    let overlap = |speed: f64| judged_by(Score::Waymax, &road, 90, at(speed, 0.0))("waymax_overlap");
    assert_eq!((overlap(4.99), overlap(5.01)), (Some(0.0), Some(1.0)), "boxes that touch do not overlap");
    let infeasible = |jump: f64| {
        let jumps = move |time: f64| (10.0 * time, 0.0, if time < 1.0 { 10.0 } else { 10.0 + jump });
        judged_by(Score::Waymax, &StraightRoad::new(), 50, jumps)("waymax_kinematic_infeasibility")
    };
    assert_eq!((infeasible(1.04), infeasible(1.05)), (Some(0.0), Some(1.0)));
}

#[test]
fn navsim_measures_progress_by_the_humans() {
    let figure = judged_by(Score::Navsim, &hurrying(8.0), 150, at(8.0, 0.0));
    close(figure("navsim_progress_m"), 120.0);
    close(figure("navsim_progress_denominator_m"), 150.0);
    close(figure("navsim_progress_by_human"), 0.8);
    close(figure("navsim_pdms_by_human"), 11.0 / 12.0);
    close(figure("navsim_epdms_by_human"), 13.0 / 14.0);
    assert_eq!((figure("navsim_pdms_terms"), figure("navsim_epdms_terms")), (Some(5.0), Some(8.0)));
    assert_eq!((figure("navsim_extended_comfort"), figure("navsim_human_filtered")), (None, Some(0.0)));
}

#[test]
fn navsim_has_no_tolerance_at_the_roads_edge() {
    let kept =
        |y: f64| judged_by(Score::Navsim, &StraightRoad::new(), 50, at(10.0, y))("navsim_drivable_area_compliance");
    assert_eq!((kept(-1.49), kept(-1.51)), (Some(1.0), Some(0.0)));
}

#[test]
fn navsim_counts_metres_off_the_routes_lanes_in_a_second_of_eleven_steps() {
    let kept = |speed: f64| {
        judged_by(Score::Navsim, &StraightRoad::new(), 50, at(speed, 3.5))("navsim_driving_direction_compliance")
    };
    // 11 steps of 0.1 s: 2 m at 1.82 m/s, 6 m at 5.45 m/s.
    assert_eq!([1.81, 1.83, 5.45, 5.46].map(kept), [Some(1.0), Some(0.5), Some(0.5), Some(0.0)]);
}

#[test]
fn navsim_allows_two_seconds_off_the_line() {
    let kept = |seconds: f64| {
        let aside = move |time: f64| (10.0 * time, if time >= 1.0 && time < 1.0 + seconds { 0.51 } else { 0.0 }, 10.0);
        judged_by(Score::Navsim, &StraightRoad::new(), 80, aside)("navsim_lane_keeping")
    };
    assert_eq!((kept(1.85), kept(1.95)), (Some(1.0), Some(0.0)), "19 samples, and 20");
    let always = |y: f64| judged_by(Score::Navsim, &StraightRoad::new(), 80, at(10.0, y))("navsim_lane_keeping");
    assert_eq!((always(0.49), always(0.51)), (Some(1.0), Some(0.0)));
}

#[test]
fn navsim_projects_nine_tenths_of_a_second_and_v2_not_beyond_the_end() {
    let road = StraightRoad::new().with(car(50.0, 0.0, 0.0, 0.0));
    let times = |steps: usize| {
        let figure = judged_by(Score::Navsim, &road, steps, at(10.0, 0.0));
        ["navsim_time_to_collision_v1", "navsim_time_to_collision", "navsim_no_at_fault_collisions"]
            .map(|name| figure(name).unwrap())
    };
    // 45 m between the bumpers: 0.9 s more meet them from 36 m on, at step 37.
    assert_eq!(times(36), [1.0, 1.0, 1.0]);
    assert_eq!(times(37), [0.0, 1.0, 1.0]);
    assert_eq!(times(45), [0.0, 1.0, 1.0]);
    assert_eq!(times(46), [0.0, 0.0, 0.0]);
}

#[test]
fn navsim_halves_for_an_object_and_forgives_what_the_human_hits_too() {
    let mut cone = car(50.0, 0.0, 0.0, 0.0);
    cone.kind = AgentKind::Other;
    let road = StraightRoad::new().with(cone);
    let figure = judged_by(Score::Navsim, &road, 60, at(10.0, 0.0));
    assert_eq!(figure("navsim_no_at_fault_collisions"), Some(0.5));
    // The human drives through it as well: a half is no zero, its time to collision is.
    assert_eq!(figure("navsim_human_filtered"), Some(1.0));
    close(figure("navsim_epdms_by_human"), 0.5);
}

#[test]
fn navsim_asks_whether_the_box_is_on_a_red_lane_from_its_stop_point_on() {
    let road = StraightRoad { red_at: Some(60.0), ..StraightRoad::new() };
    let stops = |x: f64| {
        let until = move |time: f64| if 10.0 * time < x { (10.0 * time, 0.0, 10.0) } else { (x, 0.0, 0.0) };
        judged_by(Score::Navsim, &road, 80, until)("navsim_traffic_light_compliance")
    };
    assert_eq!((stops(57.45), stops(57.55)), (Some(1.0), Some(0.0)));
}

#[test]
fn alpasims_score_saturates_at_four_fifths_of_the_humans_way() {
    let score = |speed: f64| judged_by(Score::Alpasim, &StraightRoad::new(), 150, at(speed, 0.0));
    let figure = score(6.0);
    close(figure("alpasim_progress"), 0.6);
    close(figure("alpasim_score"), 0.75);
    close(figure("alpasim_dist_traveled_m"), 90.0);
    close(figure("alpasim_dist_to_gt_location_m"), 60.0);
    close(figure("alpasim_gt_dist_traveled_m"), 150.0);
    close(score(8.0)("alpasim_score"), 1.0);
    // Past the end of the record nothing is aside of it.
    let beyond = score(10.7);
    close(beyond("alpasim_dist_to_gt_trajectory_m"), 10.7 * 14.4 - 150.0);
    assert_eq!((beyond("alpasim_left_corridor"), beyond("alpasim_corridor_score")), (Some(0.0), Some(1.0)));
}

#[test]
fn alpasim_shrinks_boxes_and_drops_what_comes_after() {
    let road = StraightRoad::new().with(car(50.0, 0.0, 0.0, 0.0));
    let figure = judged_by(Score::Alpasim, &road, 150, at(10.0, 0.0));
    // 4.9 m from centre to centre: after 45 steps they are 5 m apart, after 46 they meet.
    assert_eq!((figure("alpasim_frames"), figure("alpasim_collision_front")), (Some(47.0), Some(1.0)));
    assert_eq!((figure("alpasim_score"), figure("alpasim_collision_at_fault")), (Some(0.0), Some(1.0)));
    close(figure("alpasim_dist_traveled_m"), 46.0);
    close(figure("alpasim_progress"), 46.0 / 150.0);
}

#[test]
fn alpasim_tells_front_rear_and_side_apart() {
    let kind = |other| {
        let figure = judged_by(Score::Alpasim, &StraightRoad::new().with(other), 60, at(10.0, 0.0));
        ["front", "rear", "lateral", "at_fault"].map(|kind| figure(&format!("alpasim_collision_{kind}")).unwrap())
    };
    assert_eq!(kind(car(-20.0, 0.0, 0.0, 20.0)), [0.0, 1.0, 0.0, 0.0], "struck from behind");
    assert_eq!(kind(car(0.0, 1.9, 0.0, 10.0)), [1.0, 0.0, 0.0, 1.0], "side by side its bumper touches as well");
    // A short one beside the doors.
    let mut crossing = car(0.0, 0.0, 0.0, 0.0);
    crossing.motion = Box::new(|time| Some((10.0 * time, 8.0 - 2.0 * time, -1.5, 1.0)));
    assert_eq!(kind(crossing), [0.0, 0.0, 1.0, 1.0], "into the side");
}

#[test]
fn alpasim_is_offroad_where_the_box_touches_the_nearest_edge() {
    let figure = |y: f64| judged_by(Score::Alpasim, &StraightRoad::new(), 50, at(10.0, y));
    // Half of 1.96 m: the edge at -2.5 m is touched from -1.52 m on.
    let offroad = |y: f64| figure(y)("alpasim_offroad");
    assert_eq!((offroad(-1.518), offroad(-1.521)), (Some(0.0), Some(1.0)));
    assert_eq!((figure(-1.6)("alpasim_score"), figure(-1.6)("alpasim_frames")), (Some(0.0), Some(1.0)));
}

#[test]
fn alpasim_counts_frames_up_to_four_metres_off_the_record() {
    let figure = judged_by(Score::Alpasim, &StraightRoad::new(), 150, |time| (10.0 * time, time, 10.0));
    assert_eq!((figure("alpasim_frames"), figure("alpasim_left_corridor")), (Some(41.0), Some(1.0)));
    close(figure("alpasim_dist_to_gt_trajectory_m"), 4.0);
    close(figure("alpasim_progress"), 40.0 / 150.0);
    close(figure("alpasim_score"), 40.0 / 150.0 / 0.8);
    assert_eq!(figure("alpasim_corridor_score"), Some(0.0));
}

#[test]
fn nuplan_of_states_alone_has_the_terms_of_the_closed_form() {
    let figure = judged_by(Score::Nuplan, &hurrying(6.0), 150, at(6.0, 0.0));
    close(figure("nuplan_progress"), 0.6);
    close(figure("nuplan_score"), (5.0 * 0.6 + 5.0 + 4.0 + 2.0) / 16.0);
    // 13.176 m/s where 11.176 m/s are allowed: 2.0 of 2.23.
    let fast = judged_by(Score::Nuplan, &StraightRoad::new(), 150, at(25.0 * 0.447_04 + 2.0, 0.0));
    close(fast("nuplan_speed_limit"), 1.0 - 2.0 / 2.23);
    // It goes on after a contact, as in nuPlan; `strict` does not.
    let road = StraightRoad::new().with(car(50.0, 0.0, 0.0, 0.0));
    assert_eq!(judged_by(Score::Strict, &road, 150, at(8.0, 0.0))("strict_collision"), Some(0.0), "the log's does too");
}

/// A drive of ours, beside what it was told to be worth.
fn driven(road: &StraightRoad, protocol: &Protocol) -> (Arc<Scene>, Outcome) {
    let scene = road.scene();
    let outcome = drive(Episode::new(Arc::clone(&scene), protocol).unwrap(), &mut to_lateral(1.5));
    (scene, outcome)
}

fn again_is_the_same(protocol: &Protocol, score: Score, prefix: &str) {
    let slow = StraightRoad::new().with(car(30.0, 0.0, 0.0, 7.0));
    let (scene, outcome) = driven(&slow, protocol);
    let state = |record: &proto::StepRecord| {
        let av = record.av.unwrap();
        let (velocity_x, velocity_y) = (av.velocity_x, av.velocity_y);
        AgentState {
            x: av.x,
            y: av.y,
            z: av.z,
            heading: av.heading,
            velocity_x,
            velocity_y,
            ..scene.av().states[START].unwrap()
        }
    };
    let states: Vec<AgentState> =
        std::iter::once(scene.av().states[START].unwrap()).chain(outcome.records.iter().map(state)).collect();
    let plan: Vec<PlanState> = states[1..].iter().map(plan_state).collect();
    let drive = Drive::new(&scene, protocol, START, states, &plan);
    let judged = judge(score, &drive, &mut again::Again::default(), None);
    for (figure, value) in score.figures().iter().zip(judged.values) {
        let name = figure.name.strip_prefix(prefix).unwrap();
        let told = outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value;
        let same = match (told, value) {
            (Some(told), Some(value)) => (told - value).abs() < 1e-9,
            (told, value) => told == value,
        };
        assert!(same, "{name}: {told:?} in the drive, {value:?} again");
    }
}

#[test]
fn a_drive_judged_again_by_its_own_rules_has_its_own_figures() {
    again_is_the_same(&Protocol::default(), Score::Strict, "strict_");
    again_is_the_same(&Protocol::default(), Score::Nuplan, "");
    again_is_the_same(&Protocol::Paper, Score::Paper, "paper_");
}

#[test]
fn what_another_setting_judged_is_judged_again() {
    let with = |change: &str| Protocol::Strict(StrictSettings::default().with_changes(&[change.to_owned()]).unwrap());
    assert!(strict::is_as_driven(&Protocol::default()) && strict::is_as_driven(&with("horizon=80")));
    assert!(
        !strict::is_as_driven(&with("ending-collision=none")) && !strict::is_as_driven(&with("off-route-distance=8"))
    );
    assert!(nuplan::is_as_driven(&with("ending-collision=none")) && !nuplan::is_as_driven(&Protocol::Paper));
    assert!(paper::is_as_driven(&Protocol::Paper) && !paper::is_as_driven(&Protocol::default()));
}

#[test]
fn figures_have_names_of_their_own_and_their_pages_define_them() {
    let mut names: Vec<String> = Score::ALL.into_iter().flat_map(Score::figures).map(|figure| figure.name).collect();
    names.sort();
    let all = names.len();
    names.dedup();
    assert_eq!(names.len(), all);
    let pages = [
        (Score::Navsim, include_str!("../../../docs/scores/navsim.md")),
        (Score::Waymax, include_str!("../../../docs/scores/waymax.md")),
        (Score::Alpasim, include_str!("../../../docs/scores/alpasim.md")),
    ];
    for (score, page) in pages {
        for figure in score.figures() {
            assert!(page.contains(&format!("`{}`", figure.name)), "docs/scores does not define {}", figure.name);
        }
    }
}
