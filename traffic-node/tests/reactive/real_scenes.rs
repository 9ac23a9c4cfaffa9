//! The same in real scenes, where they are at hand.

use std::path::PathBuf;
use std::sync::Arc;

use episode::{Episode, driver};
use scenarios::SceneSet;
use traffic_node::Heed;
use wire::proto::event::{Contact, Kind};
use world::observation::Observation;
use world::plan::Plan;
use world::scene::Scene;

use crate::stage::{Av, Path, Who, drive_all, everybody, plan, protocol};

/// The folder of shared data, if there is one.
fn shared() -> Option<PathBuf> {
    let crate_folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let places = ["../../shared", "../../../shared"].map(|place| crate_folder.join(place));
    std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter().chain(places).find(|place| place.is_dir())
}

fn scenes(folder: &str) -> Vec<Arc<Scene>> {
    let Some(folder) = shared().map(|shared| shared.join(folder)).filter(|folder| folder.is_dir()) else {
        eprintln!("skipped: no {folder} in ../shared or RELOOP_SHARED");
        return Vec::new();
    };
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    (0..set.entries().len()).map(|index| set.load(index).unwrap().0).collect()
}

struct Alone {
    scene: Arc<Scene>,
    path: Path,
}

impl driver::Driver for Alone {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        Ok(plan(&self.scene, &mut self.path, Av::BrakesEarly, observation))
    }
}

/// Contacts from behind, or while it stands, of an AV that brakes early in replay.
fn from_behind_in_replay(scene: &Arc<Scene>) -> usize {
    let Ok(episode) = Episode::new(Arc::clone(scene), &protocol()) else { return 0 };
    let scene = Arc::clone(episode.judged_scene());
    let path = Path::of(&scene, episode.observe().log_index as usize);
    let outcome = driver::drive(episode, &mut Alone { scene, path });
    let struck = outcome.events.iter().filter(|event| event.kind() == Kind::Collision && !event.netted);
    struck.filter(|event| !event.at_fault && matches!(event.contact(), Contact::Rear | Contact::Standing)).count()
}

fn holds_in(folder: &str, all: impl Iterator<Item = Who>) {
    let scenes = scenes(folder);
    if scenes.is_empty() {
        return;
    }
    let replay: usize = scenes.iter().map(from_behind_in_replay).sum();
    println!("{folder}: {} scenes; in replay {replay} contacts from behind of an AV that brakes early", scenes.len());
    // All are driven before any is judged, so that whoever reads the output sees all.
    let both = |who| [Av::Human, Av::BrakesEarly].map(|av| drive_all(&scenes, who, av));
    let counts: Vec<_> = all.map(|who| (who, both(who))).collect();
    for (who, [human, brakes]) in counts {
        human.check(who);
        brakes.check(who);
        assert_eq!(human.at_fault, 0, "{who}");
        assert!(3 * brakes.from_behind <= replay, "{who}: {} of {replay}", brakes.from_behind);
    }
}

#[test]
fn in_scenes_of_20_s_nobody_drives_through_anybody() {
    holds_in("data/womd-derived/20s", everybody());
}

#[test]
fn in_scenes_of_9_s_nobody_drives_through_anybody() {
    holds_in("data/womd-derived/9s", everybody().filter(|who| *who != Who::Network));
}

#[test]
#[ignore = "a minute and more: the network in 39 scenes"]
fn in_scenes_of_9_s_nobody_does_who_follows_a_future() {
    holds_in("data/womd-derived/9s", [Who::Network].into_iter());
}

#[test]
#[ignore = "minutes: 419 scenes of 9 s"]
fn in_419_scenes_nobody_drives_through_anybody() {
    holds_in("data/train-9s", everybody());
}

#[test]
#[ignore = "a measure: what futures come to whose drivers heed nobody, and who is in their way alone"]
fn futures_as_they_are() {
    for folder in ["data/womd-derived/20s", "data/womd-derived/9s"] {
        for heed in [Heed::Nobody, Heed::LastResort, Heed::Everybody] {
            drive_all(&scenes(folder), Who::Heeding(heed), Av::BrakesEarly);
        }
    }
}
