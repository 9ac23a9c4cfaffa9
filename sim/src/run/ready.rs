//! Scenes made ready to be driven: the next one while others are driven, so that no driver waits for a file.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use scenarios::SetError;
use scenarios::lint::{self, Lint};
use world::scene::Scene;

use super::beginning::{Begun, NotBegun};
use super::clock::Clock;
use super::shared::Shared;

/// A scene, read; or why it cannot be.
pub struct Ready {
    /// The scene, and its episode.
    pub scene: Result<Prepared, SetError>,
    /// What reading it took.
    pub load: Duration,
}

/// A scene that can be driven, or of which is known why not.
pub struct Prepared {
    /// The scene as it was logged.
    pub scene: Arc<Scene>,
    /// What is odd in it.
    pub lints: Vec<Lint>,
    /// Its episode.
    pub begun: Result<Begun, NotBegun>,
    /// What making the episode took.
    pub prepare: Duration,
}

impl Ready {
    /// Reads the scene at this place of the set, and makes its episode.
    #[must_use]
    pub fn new(shared: &Shared, place: usize) -> Self {
        let begin = shared.clock.now();
        let loaded = shared.scenes.load_hashed(place);
        let load = shared.clock.now();
        let scene = loaded.map(|(scene, findings)| {
            let lints = lint::lint(&scene, &findings);
            let settings = &shared.file.settings;
            let traffic = settings.traffic.as_ref().map(|traffic| &traffic.hand_over);
            let begun = shared.beginnings.of(scene.id().as_str()).begin(&scene, &settings.protocol, traffic);
            Prepared { scene, lints, begun, prepare: shared.clock.now() - load }
        });
        Self { scene, load: load - begin }
    }
}

/// Scenes that are made ready before their workers ask for them, by their places in the set.
#[derive(Default)]
pub struct Ahead(Mutex<BTreeMap<usize, JoinHandle<Ready>>>);

impl Ahead {
    /// Begins to make a scene ready, unless that is under way.
    pub fn begin(&self, shared: &Arc<Shared>, place: usize) {
        let own = Arc::clone(shared);
        // Without a thread its worker does it.
        let start = || thread::Builder::new().spawn(move || Ready::new(&own, place)).ok();
        let mut under_way = self.under_way();
        if !under_way.contains_key(&place) {
            under_way.extend(start().map(|thread| (place, thread)));
        }
    }

    /// The scene, waited for; none where nobody began, or it panicked: then it will for the worker too, which tells.
    pub fn take(&self, place: usize) -> Option<Ready> {
        let thread = self.under_way().remove(&place)?;
        thread.join().ok()
    }

    fn under_way(&self) -> MutexGuard<'_, BTreeMap<usize, JoinHandle<Ready>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
