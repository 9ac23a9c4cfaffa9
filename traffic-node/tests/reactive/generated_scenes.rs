//! What holds in generated scenes, whoever drives.

use std::sync::Arc;

use episode::traffic::TrafficSettings;
use scenarios::generated::{FAMILIES, Parameters};
use traffic_node::Cast;
use traffic_node::character::CASTS;
use world::scene::Scene;

use crate::stage::{Av, Count, drive};

fn scenes(seeds: std::ops::Range<u64>) -> Vec<Arc<Scene>> {
    let of = |seed: u64| {
        FAMILIES.iter().filter_map(move |family| {
            let payload = family.payload(&family.scene_id(seed, 0), seed, 0, &Parameters::default()).ok()?;
            Some(Arc::new(scenarios::womd::read(&payload).unwrap().0))
        })
    };
    seeds.flat_map(of).collect()
}

fn counted(scenes: &[Arc<Scene>], cast: Cast, av: Av) -> Count {
    let mut all = Count::default();
    for scene in scenes {
        let Some((_, count)) = drive(scene, &TrafficSettings::default(), cast, av) else { continue };
        for ((a, b), step) in &count.overlapping {
            println!("    {} {cast}: {a} and {b} overlap at step {step}", scene.id());
        }
        all.add(&count);
    }
    println!("{cast:10} {av:?}: {}", all.line());
    all
}

#[test]
fn an_av_that_does_what_the_human_did_takes_nobody_over() {
    let count = counted(&scenes(0..1), Cast::Idm, Av::Human);
    assert_eq!((count.taken, count.at_fault, count.from_behind), (0, 0, 0));
}

#[test]
fn nobody_drives_through_anybody_jumps_or_runs_a_red_light() {
    let scenes = scenes(0..2);
    let counts = CASTS.map(|(_, cast)| (cast, counted(&scenes, cast, Av::BrakesEarly)));
    for (cast, count) in counts {
        assert!(count.taken > 50, "{}", count.taken);
        assert!(count.overlaps * 1000 <= count.agent_steps, "{cast}: {}", count.line());
        let [place, heading, speed] = count.jumps;
        assert!(place <= 0.05 && heading <= 0.02 && speed <= 0.2, "{cast}: {:?}", count.jumps);
        assert_eq!(count.red, 0, "{cast}");
    }
}
