#![no_main]

use std::sync::{Arc, LazyLock};

use episode::protocol::{Protocol, StrictSettings};
use episode::traffic::TrafficSettings;
use evaluation::replay::{Recorded, replay};
use world::scene::Scene;

static SCENE: LazyLock<Option<Arc<Scene>>> = LazyLock::new(|| {
    let set = scenarios::SceneSet::open(&[]).ok()?;
    Some(set.load(0).ok()?.0)
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = evaluation::predictions::Figures::of_recording(bytes);
    let _ = evaluation::footage::answers(bytes);
    let (Ok(recorded), Some(scene)) = (Recorded::read(bytes), &*SCENE) else { return };
    for traffic in [None, Some(TrafficSettings::default())] {
        let _ = replay(Arc::clone(scene), &Protocol::Strict(StrictSettings::default()), traffic.as_ref(), &recorded);
    }
});
