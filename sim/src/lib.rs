//! The simulator: episodes, their protocol and judges, metrics, and the run over many of them.
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
//! | [`protocol`] | the rules of an episode, as settings |
//! | [`episode`] | one drive through one scene: pure, no clock, no bus, no files |
//! | [`tracker`] | from a plan's states to the control that is driven |
//! | [`judges`] | what is wrong at a step: collision, route, road, signals, direction, speed |
//! | [`metrics`] | what a drive was worth, by name and unit |
//! | [`cli`], [`request`], [`drivers`] | what can be typed, what it means, who can drive |
//! | [`settings`] | what decides a run's results, as `run.toml` holds it |
//! | [`run`] | many episodes: workers, nodes, the run's folder |
//! | [`results`] | what a run leaves |
//! | [`summary`], [`table`] | runs in a line each |
//! | [`verify`](mod@verify) | the protocol `paper` beside the authors' own numbers |

pub mod cli;
pub mod drivers;
pub mod episode;
pub mod files;
pub mod judges;
pub mod metrics;
pub mod protocol;
pub mod request;
pub mod results;
pub mod run;
pub mod settings;
pub mod summary;
pub mod table;
pub mod tracker;
pub mod verify;
pub mod version;
