//! What the policy of `cql` is shown of a generated scene, drive by drive the same. How long that takes: `benches/picture.rs`.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fmt::Write;
use std::sync::Arc;

use episode::Episode;
use episode::protocol::{Protocol, StrictSettings};
use network::cql::{CHANNELS, Painter, SIDE};
use scenarios::generated::FAMILIES;
use world::observation::HistoryStep;
use world::scene::Scene;
use world::signal::Signal;

/// Places to a side of a square that is shown by one letter.
const SQUARE: usize = 8;

/// A letter for each square of a channel, by its mean brightness: from nothing to `9`.
fn letters(picture: &[u8], channel: usize) -> String {
    let mut text = String::new();
    for row in 0..SIDE / SQUARE {
        for column in 0..SIDE / SQUARE {
            let places = (0..SQUARE * SQUARE)
                .map(|place| (row * SQUARE + place / SQUARE) * SIDE + column * SQUARE + place % SQUARE);
            let sum: usize = places.map(|place| usize::from(picture[place * CHANNELS + channel])).sum();
            let level = sum.div_ceil(SQUARE * SQUARE * 26);
            let _ = write!(text, "{}", if sum == 0 { " ".to_owned() } else { level.min(9).to_string() });
        }
        let kept = text.trim_end().len();
        text.truncate(kept);
        text.push('\n');
    }
    text
}

/// All that a driver knows at the first step.
struct Beginning {
    painter: Painter,
    history: Vec<HistoryStep>,
    signals: Vec<Signal>,
}

impl Beginning {
    fn of(scene: Arc<Scene>) -> Option<Self> {
        let episode = Episode::new(scene, &Protocol::Strict(StrictSettings::default())).ok()?;
        let (briefing, now) = (episode.briefing(), episode.observe());
        let mut history = briefing.history;
        history.push(HistoryStep { log_index: now.log_index, av: now.av, agents: now.agents });
        let signals = now.signals.iter().map(|seen| seen.signal).collect();
        Some(Self { painter: Painter::new(&briefing.map, &briefing.reference_line), history, signals })
    }

    fn paint(&mut self) -> &[u8] {
        self.painter.paint(self.history.iter(), self.signals.iter().copied())
    }
}

fn generated(family: &str) -> Arc<Scene> {
    let family = FAMILIES.iter().find(|own| own.name == family).unwrap();
    let payload = family.payload("picture", 1, 0, &Default::default()).unwrap();
    Arc::new(scenarios::womd::read(&payload).unwrap().0)
}

#[test]
fn a_signalled_junction_looks_as_it_did() {
    let mut beginning = Beginning::of(generated("red-light")).unwrap();
    let picture = beginning.paint().to_vec();
    let [ground, others, av] = [0, 1, 2].map(|channel| letters(&picture, channel));
    let sum: u64 = picture.iter().zip(1..).map(|(value, place)| u64::from(*value) * place).sum();
    insta::assert_snapshot!(format!(
        "map, route and signals\n{ground}\nothers\n{others}\nthe AV\n{av}\nsum of bytes by places {sum}\n"
    ));
    assert!(beginning.paint() == picture, "nothing of the picture before is left");
}
