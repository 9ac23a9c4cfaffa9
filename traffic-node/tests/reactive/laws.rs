//! What agents that react do and do not, one thing at a time, on a straight road.

use std::sync::Arc;

use episode::traffic::{Pedestrians, TrafficSettings};
use episode::{Episode, Outcome};
use traffic_node::{Cast, Characters};
use wire::proto::EndReason;
use wire::proto::event::Kind;
use world::plan::{PLAN_STEPS, Plan, PlanState, UncheckedPlan};
use world::scene::{AgentKind, AgentState, Scene};
use world::traffic::UncheckedMoves;

use crate::stage::{Who, protocol};
use crate::straight_road::{Mover, StraightRoad, car};

/// Where the AV is after a step: x, y and speed.
type Course = fn(u32) -> (f64, f64, f64);

/// It brakes from 10 m/s by 4 m/s^2 to a stand at x = 12.5.
fn stops(step: u32) -> (f64, f64, f64) {
    let seconds = (0.1 * f64::from(step + 1)).min(2.5);
    (10.0 * seconds - 2.0 * seconds * seconds, 0.0, 10.0 - 4.0 * seconds)
}

/// It comes to a stand so far to the right that its left side is a little in the lane.
fn stops_aside(step: u32) -> (f64, f64, f64) {
    let (x, _, speed) = stops(step);
    (x, -1.8 * (x / 12.5), speed)
}

fn at((x, y, speed): (f64, f64, f64), step: u32) -> Plan {
    let states = vec![PlanState { x, y, heading: 0.0, speed }; PLAN_STEPS];
    UncheckedPlan { step, states, ..UncheckedPlan::default() }.check(step).unwrap()
}

/// A drive, and the states of each track at each step as they are seen.
struct Told {
    outcome: Outcome,
    seen: Vec<Vec<(i32, AgentState)>>,
    taken: Vec<Vec<i32>>,
}

impl Told {
    fn of(&self, track: i32) -> impl Iterator<Item = AgentState> {
        self.seen.iter().flatten().filter(move |(seen, _)| *seen == track).map(|(_, state)| *state)
    }

    fn collisions(&self) -> usize {
        self.outcome.events.iter().filter(|event| event.kind() == Kind::Collision).count()
    }
}

fn drive_as(scene: &Arc<Scene>, settings: Option<&TrafficSettings>, cast: Cast, av: Course) -> Told {
    let mut episode = Episode::new(Arc::clone(scene), &protocol()).unwrap();
    if let Some(settings) = settings {
        episode = episode.with_traffic(settings).unwrap();
    }
    let mut traffic = Characters { cast, seed: 1 }.company(&episode.briefing());
    let (mut seen, mut taken) = (Vec::new(), Vec::new());
    while episode.ended().is_none() {
        let observation = episode.observe();
        seen.push(observation.agents.iter().map(|agent| (agent.track.0, agent.state)).collect());
        taken.push(episode.taken().iter().map(|agent| agent.track.0).collect());
        let moves = traffic.next(&observation, episode.taken());
        episode.move_traffic(moves).unwrap();
        episode.advance(&at(av(observation.step), observation.step));
    }
    Told { outcome: episode.finish(), seen, taken }
}

fn drive(scene: &Arc<Scene>, cast: Cast, av: Course) -> Told {
    drive_as(scene, Some(&TrafficSettings::default()), cast, av)
}

const ALL: [Cast; 6] = [Cast::Idm, Cast::Waymax, Cast::Cautious, Cast::Assertive, Cast::Distracted, Cast::Mixed];

/// Behind the AV, which the log has going on, somebody as fast as it.
fn followed() -> Arc<Scene> {
    StraightRoad::new().with(car(-22.0, 0.0, 0.0, 10.0)).scene()
}

/// Somebody who comes from the south and crosses the lane at `x`, 6 m/s.
fn crossed(x: f64, from: f64) -> Arc<Scene> {
    StraightRoad::new().with(car(x, from, std::f64::consts::FRAC_PI_2, 6.0)).scene()
}

#[test]
fn who_follows_an_av_that_stops_stands_behind_it() {
    assert_eq!(drive_as(&followed(), None, Cast::Idm, stops).collisions(), 1, "in replay it is struck");
    for cast in ALL {
        let told = drive(&followed(), cast, stops);
        let last = told.of(2).last().unwrap();
        assert_eq!(told.collisions(), 0, "{cast}");
        // The AV's rear is at 10.
        let gap = 10.0 - (last.x + 2.5);
        assert!(last.speed() < 0.1 && (0.3..6.0).contains(&gap), "{cast}: {gap} m, {} m/s", last.speed());
    }
}

#[test]
fn replay_goes_on_until_the_av_leaves_the_log_and_is_over_then() {
    let told = drive(&followed(), Cast::Idm, stops);
    let first = told.taken.iter().position(|taken| !taken.is_empty()).unwrap();
    // 1 m behind the log: 2 t^2 = 1 after 0.7 s and more.
    assert_eq!(first, 8);
    assert!(told.taken[first..].iter().all(|taken| *taken == [2]));
    let records = &told.outcome.records;
    assert!(records.iter().zip(&told.taken).all(|(record, taken)| record.reactive as usize == taken.len()));
    assert!(told.outcome.moved.iter().zip(&told.taken).all(|(moved, taken)| moved.agents.len() == taken.len()));
}

#[test]
fn nobody_is_taken_over_whose_way_is_another_or_who_stands() {
    let road = StraightRoad::new().with(car(60.0, 3.5, std::f64::consts::PI, 8.0)).with(car(30.0, -2.0, 0.0, 0.0));
    let told = drive(&road.scene(), Cast::Idm, stops);
    assert!(told.taken.iter().all(Vec::is_empty), "{:?}", told.taken);
}

#[test]
fn who_would_cross_lets_an_av_that_stands_there_be() {
    let scene = crossed(12.5, -26.0);
    assert!(drive_as(&scene, None, Cast::Idm, stops).collisions() > 0, "in replay it drives into it");
    for cast in ALL {
        let told = drive(&scene, cast, stops);
        assert_eq!(told.collisions(), 0, "{cast}");
        let last = told.of(2).last().unwrap();
        assert!(last.speed() < 0.3 && last.y + 2.5 < -1.0, "{cast}: {last:?}");
    }
}

#[test]
fn a_red_light_is_obeyed() {
    let mut road = StraightRoad::new().with(car(25.0, 0.0, 0.0, 9.0));
    road.red_at = Some(90.0);
    let scene = road.scene();
    for cast in ALL {
        let told = drive(&scene, cast, stops);
        assert!(told.taken.iter().any(|taken| *taken == [2]), "{cast}");
        let last = told.of(2).last().unwrap();
        assert!((85.0..90.0).contains(&(last.x + 2.5)) && last.speed() < 0.3, "{cast}: {last:?}");
    }
}

#[test]
fn an_av_that_is_partly_in_the_lane_is_passed_with_room() {
    let scene = StraightRoad::new().with(car(-55.0, 0.0, 0.0, 10.0)).scene();
    let told = drive(&scene, Cast::Idm, stops_aside);
    let last = told.of(2).last().unwrap();
    assert_eq!(told.collisions(), 0);
    assert!(last.x > 25.0 && last.speed() > 5.0, "it goes on: {last:?}");
    let aside = told.of(2).filter(|state| (state.x - 12.5).abs() < 2.0).map(|state| state.y).fold(0.0, f64::max);
    assert!((0.3..0.6).contains(&aside), "{aside}");
    assert!(last.y < 0.2, "and comes back: {last:?}");
}

#[test]
fn the_distracted_brake_later() {
    let scene = StraightRoad::new().with(car(-40.0, 0.0, 0.0, 10.0)).scene();
    let brakes = |cast| {
        let told = drive(&scene, cast, stops);
        let states: Vec<AgentState> = told.of(2).collect();
        states.windows(2).position(|pair| pair[1].speed() < pair[0].speed() - 0.02).unwrap()
    };
    let (attentive, distracted) = (brakes(Cast::Idm), brakes(Cast::Distracted));
    assert!(distracted >= attentive + 3, "{distracted} and {attentive}");
}

#[test]
fn people_on_foot_stop_for_a_car_in_their_way_if_they_are_to() {
    let walks = |time: f64| Some((12.5, -6.0 + 1.2 * time, std::f64::consts::FRAC_PI_2, 1.2));
    let walker = || Mover { kind: AgentKind::Pedestrian, z: 0.75, motion: Box::new(walks) };
    let scene = StraightRoad::new().with(walker()).scene();
    let stop = TrafficSettings { pedestrians: Pedestrians::Stop, ..TrafficSettings::default() };
    assert!(drive(&scene, Cast::Idm, stops).collisions() > 0, "replayed, he walks through it");
    let told = drive_as(&scene, Some(&stop), Cast::Idm, stops);
    assert_eq!(told.collisions(), 0);
    assert!(told.of(2).last().unwrap().speed() < 0.1);
}

#[test]
fn it_is_the_same_in_whatever_order_agents_are_told() {
    let road = (0..6).fold(StraightRoad::new(), |road, k| road.with(car(-22.0 - 14.0 * f64::from(k), 0.0, 0.0, 9.0)));
    let scene = road.scene();
    for who in [Who::Cast(Cast::Mixed), Who::Network] {
        let settings = TrafficSettings::default();
        let mut episode = Episode::new(Arc::clone(&scene), &protocol()).unwrap().with_traffic(&settings).unwrap();
        let briefing = episode.briefing();
        let (mut one, mut other) = (who.company(5, &briefing), who.company(5, &briefing));
        let mut most = 0;
        while episode.ended().is_none() {
            let observation = episode.observe();
            let taken = episode.taken().to_vec();
            most = most.max(taken.len());
            let (mut turned, mut backwards) = (observation.clone(), taken.clone());
            turned.agents.reverse();
            backwards.reverse();
            let moves = one.next(&observation, &taken);
            assert_eq!(moves, other.next(&turned, &backwards), "{who}");
            episode.move_traffic(moves).unwrap();
            episode.advance(&at(stops(observation.step), observation.step));
        }
        assert!(most >= 3, "{who}: {most}");
    }
}

#[test]
fn another_seed_draws_other_futures() {
    let scene = StraightRoad::new().with(car(-30.0, 0.0, 0.0, 9.0)).with(car(-60.0, 0.0, 0.0, 9.0)).scene();
    let moved = |seed| {
        let settings = TrafficSettings::default();
        let mut episode = Episode::new(Arc::clone(&scene), &protocol()).unwrap().with_traffic(&settings).unwrap();
        let mut traffic = Who::Network.company(seed, &episode.briefing());
        while episode.ended().is_none() {
            let observation = episode.observe();
            let moves = traffic.next(&observation, episode.taken());
            episode.move_traffic(moves).unwrap();
            episode.advance(&at(stops(observation.step), observation.step));
        }
        episode.finish().moved
    };
    let first = moved(1);
    assert_eq!(first, moved(1));
    assert!((2..8).any(|seed| moved(seed) != first));
}

#[test]
fn who_says_nothing_of_agents_that_react_fails_the_episode() {
    let settings = TrafficSettings::default();
    let mut episode = Episode::new(followed(), &protocol()).unwrap().with_traffic(&settings).unwrap();
    while episode.ended().is_none() {
        let step = episode.observe().step;
        episode.advance(&at(stops(step), step));
    }
    let end = episode.finish().end;
    assert_eq!(end.reason(), EndReason::DriverFailed);
    assert!(end.detail.contains("nobody said where the 1 agents that react are"), "{}", end.detail);
}

#[test]
fn a_drive_is_judged_again_by_its_moves_to_the_bit() {
    let scene = followed();
    let told = drive(&scene, Cast::Mixed, stops);
    let settings = TrafficSettings::default();
    let mut again = Episode::new(scene, &protocol()).unwrap().with_traffic(&settings).unwrap();
    for moved in &told.outcome.moved {
        again.move_traffic(UncheckedMoves::try_from(moved.clone()).unwrap()).unwrap();
        again.advance(&at(stops(moved.step), moved.step));
    }
    assert_eq!(again.finish(), told.outcome);
}
