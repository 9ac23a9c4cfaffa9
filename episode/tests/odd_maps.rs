//! Maps that no city has: each gives an episode that ends, or a reason why there is none, under either protocol.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod straight_road;

use std::sync::Arc;

use episode::driver::drive;
use episode::protocol::Protocol;
use episode::{Episode, Undrivable};
use straight_road::{LogReplay, StraightRoad};
use wire::proto::EndReason;
use world::map::{Lane, Map, MapId};
use world::route::RouteError;
use world::scene::Scene;

/// The straight road with another map.
fn scene_with(change: impl FnOnce(&mut Map)) -> Arc<Scene> {
    let mut parts = Arc::unwrap_or_clone(StraightRoad::new().scene()).into_parts();
    change(&mut parts.map);
    Arc::new(parts.check().unwrap().0)
}

/// How the log replayed ends under each protocol, `strict` first, or why it cannot be driven.
fn outcomes(change: impl FnOnce(&mut Map)) -> [Result<EndReason, Undrivable>; 2] {
    let scene = scene_with(change);
    [Protocol::default(), Protocol::Paper].map(|protocol| {
        let episode = Episode::new(Arc::clone(&scene), &protocol)?;
        Ok(drive(episode, &mut LogReplay(Arc::clone(&scene))).end.reason())
    })
}

/// Cuts lane 1 into pieces of so many points, each leading to the next and the last to the first.
fn ring(map: &mut Map, points: usize) {
    let whole = map.lanes.remove(0);
    let pieces = whole.centerline.chunks(points).count() as i64;
    let id = |index: i64| MapId(100 + index.rem_euclid(pieces));
    for (index, piece) in whole.centerline.chunks(points).enumerate() {
        let index = index as i64;
        map.lanes.push(Lane {
            id: id(index),
            centerline: piece.to_vec(),
            entries: vec![id(index - 1)],
            exits: vec![id(index + 1)],
            ..whole.clone()
        });
    }
}

#[test]
fn a_ring_of_lanes_is_driven_to_the_end() {
    for points in [10, 39, 400] {
        let [strict, paper] = outcomes(|map| ring(map, points));
        assert_eq!(strict.unwrap(), EndReason::Horizon);
        assert_eq!(paper.unwrap(), EndReason::Horizon);
    }
}

#[test]
fn a_lane_that_leads_to_itself_is_driven_to_the_end() {
    let [strict, paper] = outcomes(|map| {
        let lane = &mut map.lanes[0];
        (lane.entries, lane.exits) = (vec![lane.id], vec![lane.id]);
    });
    assert_eq!((strict.unwrap(), paper.unwrap()), (EndReason::Horizon, EndReason::Horizon));
}

#[test]
fn lanes_that_all_lead_to_each_other_are_driven_to_the_end() {
    let [strict, paper] = outcomes(|map| {
        ring(map, 40);
        let ids: Vec<MapId> = map.lanes.iter().map(|lane| lane.id).collect();
        for lane in &mut map.lanes {
            (lane.entries, lane.exits) = (ids.clone(), ids.clone());
        }
    });
    assert_eq!(strict.unwrap(), EndReason::Horizon);
    // The authors take the first entry lane for what lies behind: here one ahead.
    assert!(matches!(paper.unwrap(), EndReason::Horizon | EndReason::OffRoute));
}

#[test]
fn without_any_lane_there_is_no_route_to_the_authors_and_the_logs_own_to_us() {
    let [strict, paper] = outcomes(|map| map.lanes.clear());
    assert_eq!(strict.unwrap(), EndReason::Horizon);
    assert!(matches!(paper.unwrap_err(), Undrivable::Route(RouteError::NoLane { log_index: 0 })));
}

#[test]
fn a_lane_of_one_point_is_no_harm_beside_others_and_no_route_alone() {
    let one_point = |lane: &Lane| Lane { id: MapId(9), centerline: vec![lane.centerline[400]], ..lane.clone() };
    let [strict, paper] = outcomes(|map| map.lanes.push(one_point(&map.lanes[0])));
    assert_eq!((strict.unwrap(), paper.unwrap()), (EndReason::Horizon, EndReason::Horizon));
    let [strict, paper] = outcomes(|map| map.lanes = vec![one_point(&map.lanes[0])]);
    assert!(strict.is_ok());
    // It looks east, as the AV does, so every pose matches it; but nothing lies behind its first point.
    assert!(matches!(paper.unwrap_err(), Undrivable::Route(RouteError::NothingBehind)));
}

#[test]
fn lanes_without_a_number_above_0_match_nothing_in_the_authors_code() {
    let [strict, paper] = outcomes(|map| {
        for (index, lane) in map.lanes.iter_mut().enumerate() {
            lane.id = MapId(-(index as i64));
        }
    });
    assert!(strict.is_ok());
    assert!(matches!(paper.unwrap_err(), Undrivable::Route(RouteError::NoLane { .. })));
}

#[test]
fn an_undrivable_scene_ends_with_its_reason_and_no_metrics() {
    let scene = scene_with(|map| map.lanes.clear());
    let end = Episode::new(Arc::clone(&scene), &Protocol::Paper).unwrap_err().end(&scene, &Protocol::Paper);
    assert_eq!((end.reason(), end.protocol.as_str(), end.steps), (EndReason::Undrivable, "paper", 0));
    assert!(end.detail.starts_with("no lane matches the AV at log index 0"), "{}", end.detail);
    assert!(end.metrics.iter().all(|metric| metric.value.is_none()));
}
