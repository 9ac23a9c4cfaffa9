//! What holds in generated scenes, whoever drives.

use std::sync::Arc;

use scenarios::generated::{FAMILIES, Parameters};
use traffic_node::{Cast, Heed};
use world::scene::Scene;

use crate::stage::{Av, Who, drive_all, everybody};

fn scenes(seeds: std::ops::Range<u64>) -> Vec<Arc<Scene>> {
    let of = |seed: u64| {
        FAMILIES.iter().filter_map(move |family| {
            let payload = family.payload(&family.scene_id(seed, 0), seed, 0, &Parameters::default()).ok()?;
            Some(Arc::new(scenarios::womd::read(&payload).unwrap().0))
        })
    };
    seeds.flat_map(of).collect()
}

#[test]
fn an_av_that_does_what_the_human_did_takes_nobody_over() {
    let count = drive_all(&scenes(0..1), Who::Cast(Cast::Idm), Av::Human);
    assert_eq!((count.taken, count.at_fault, count.from_behind), (0, 0, 0));
}

fn hold_in(scenes: &[Arc<Scene>], all: impl Iterator<Item = Who>) {
    let counts: Vec<_> = all.map(|who| (who, drive_all(scenes, who, Av::BrakesEarly))).collect();
    for (who, count) in counts {
        assert!(count.taken > 2 * scenes.len(), "{}", count.taken);
        count.check(who);
    }
}

#[test]
fn nobody_drives_through_anybody_jumps_or_runs_a_red_light() {
    hold_in(&scenes(0..2), everybody().filter(|who| *who != Who::Network));
}

#[test]
fn nobody_does_who_follows_a_future() {
    let few: Vec<_> = scenes(0..1).into_iter().step_by(4).collect();
    hold_in(&few, [Who::Network].into_iter());
}

#[test]
#[ignore = "minutes: the network in 40 scenes"]
fn nobody_does_who_follows_a_future_in_40_scenes() {
    hold_in(&scenes(0..2), [Who::Network].into_iter());
}

#[test]
#[ignore = "minutes: 200 scenes"]
fn nobody_does_in_200_scenes() {
    hold_in(&scenes(2..12), everybody());
}

#[test]
#[ignore = "a measure: what futures come to whose drivers heed nobody, and who is in their way alone"]
fn futures_as_they_are() {
    for heed in [Heed::Nobody, Heed::LastResort, Heed::Everybody] {
        drive_all(&scenes(0..2), Who::Heeding(heed), Av::BrakesEarly);
    }
}
