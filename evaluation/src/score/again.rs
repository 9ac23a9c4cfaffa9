//! A drive judged again by our own rules: its states are played back, and the judges see them as they saw those of the drive.

use std::sync::Arc;

use episode::paper::START;
use episode::protocol::{Motion, Protocol, StrictSettings};
use episode::{Episode, Outcome, Undrivable};

use super::drive::Drive;
use super::{Judged, nuplan, paper as authors, strict};

/// A drive judged by `strict`, once for both scores that need it.
#[derive(Default)]
pub(super) struct Again(Option<Result<Pair, Undrivable>>);

/// What came of it.
struct Pair {
    /// Up to where `strict` ends it.
    strict: Outcome,
    /// Whole: in nuPlan no contact ends a drive.
    whole: Outcome,
}

impl Again {
    pub(super) fn strict(&mut self, drive: &Drive<'_>) -> Judged {
        let told = self.pair(drive).as_ref().map(|pair| &pair.strict);
        judged(told.map_err(Undrivable::to_string), strict::metrics())
    }

    pub(super) fn nuplan(&mut self, drive: &Drive<'_>) -> Judged {
        let told = self.pair(drive).as_ref().map(|pair| &pair.whole);
        judged(told.map_err(Undrivable::to_string), nuplan::metrics())
    }

    fn pair(&mut self, drive: &Drive<'_>) -> &Result<Pair, Undrivable> {
        self.0.get_or_insert_with(|| {
            let horizon = match drive.protocol {
                Protocol::Strict(settings) => settings.horizon,
                Protocol::Paper => StrictSettings::default().horizon,
            };
            let settings = StrictSettings {
                start: drive.start as u32,
                horizon,
                motion: Motion::Playback,
                ..StrictSettings::default()
            };
            let mut episode = Episode::new(Arc::clone(drive.scene), &Protocol::Strict(settings))?;
            let states = &drive.driven[..drive.driven.len().min(horizon as usize)];
            let mut played = 0;
            for state in states {
                played += 1;
                if episode.put(state).ended.is_some() {
                    break;
                }
            }
            let strict = episode.finish();
            let rest = &states[played..];
            let whole = if rest.is_empty() { strict.clone() } else { episode.play_out(rest) };
            Ok(Pair { strict, whole })
        })
    }
}

/// The drive judged by the authors' rules. They know one start.
pub(super) fn paper(drive: &Drive<'_>) -> Judged {
    let told = if drive.start == START as usize {
        Episode::new(Arc::clone(drive.scene), &Protocol::Paper).map_err(|error| error.to_string()).map(|mut episode| {
            for state in drive.driven {
                if episode.put(state).ended.is_some() {
                    break;
                }
            }
            episode.finish()
        })
    } else {
        Err(format!("the drive starts at log index {}, `paper` at {START}", drive.start))
    };
    judged(told.as_ref().map_err(Clone::clone), authors::metrics())
}

fn judged(told: Result<&Outcome, String>, metrics: impl Iterator<Item = &'static str>) -> Judged {
    let value = |outcome: &Outcome, name: &str| outcome.end.metrics.iter().find(|metric| metric.name == name)?.value;
    match told {
        Ok(outcome) => Judged { values: metrics.map(|name| value(outcome, name)).collect(), reason: None },
        Err(reason) => Judged::none(metrics.count(), reason),
    }
}
