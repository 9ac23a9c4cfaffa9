//! One drive through one scene: its rules, the judges, the metrics.
//!
//! Pure: no bus, no clock, no files. The same scene, protocol and plans give the same bits. What a drive leaves is told in the
//! messages of [`wire::proto`].
//!
//! ```text
//! scene ──▶ Episode::observe ──▶ observation ──▶ driver
//!                  ▲                               │
//!            Episode::advance ◀────── plan ◀───────┘
//!                  │
//!                judges ──▶ step record, events ──▶ metrics
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`Episode`] | one drive |
//! | [`protocol`] | the rules of an episode, as settings |
//! | [`strict`] | the rules of `strict`: how the AV moves, what is judged, what ends the episode |
//! | [`paper`] | the same of `paper` |
//! | [`latency`] | when plans take effect; which is followed meanwhile |
//! | [`guidance`] | what a plan says a while after it was asked for |
//! | [`tracker`] | from a plan's states to the control that is driven |
//! | [`judges`] | what is wrong at a step: collision, route, road, signals, direction, speed |
//! | [`metrics`] | what a drive was worth, by name and unit |
//! | [`traffic`] | agents that react, instead of doing what they did in the log |
//! | [`driver`] | driving an episode in one process |

mod advance;
mod detail;
pub mod driver;
mod episode;
pub mod guidance;
pub mod judges;
pub mod latency;
pub mod metrics;
pub mod paper;
pub mod protocol;
pub mod strict;
pub mod tracker;
pub mod traffic;

pub use advance::{Advance, Undrivable};
pub use episode::{Episode, Outcome};
