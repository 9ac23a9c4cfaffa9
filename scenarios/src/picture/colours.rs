//! The palette. Road users differ in lightness too, so that they are told apart in grey, and by those who see few colours.

use world::scene::AgentKind;
use world::signal::SignalState;

/// Behind captions, and the rim of road users.
pub const PAPER: &str = "#ffffff";
/// Text.
pub const INK: &str = "#23272e";
/// Text beside.
pub const PALE_INK: &str = "#6d7480";
/// Lines around.
pub const FRAME: &str = "#c9ccd2";

/// Beside the road.
pub const GROUND: &str = "#f2f0ea";
/// The road.
pub const ASPHALT: &str = "#cdd1d7";
/// Lanes of bicycles.
pub const BIKE_LANE: &str = "#c0d9c8";
/// Driveways.
pub const DRIVEWAY: &str = "#e0e1e1";
/// Middle lines of lanes.
pub const CENTERLINE: &str = "#b2b8c1";
/// White paint.
pub const WHITE_LINE: &str = "#ffffff";
/// Yellow paint.
pub const YELLOW_LINE: &str = "#e5a50a";
/// Paint of no known colour.
pub const UNKNOWN_LINE: &str = "#e9e4d4";
/// Where the road ends.
pub const CURB: &str = "#7b828d";
/// Edges of medians.
pub const MEDIAN: &str = "#98897a";
/// Bars of crosswalks.
pub const STRIPE: &str = "#ffffff";
/// Speed bumps.
pub const BUMP: &str = "#c98f2b";
/// Stop signs.
pub const STOP_SIGN: &str = "#c8202f";

/// The AV.
pub const AV: &str = "#ef5b25";
/// Vehicles that stand all the time.
pub const STATIONARY: &str = "#94a6bf";
/// The mark at a front.
pub const NOSE: &str = "#ffffff";
/// Around those of interest.
pub const INTEREST: &str = "#1d1f24";

/// A road user of that kind.
#[must_use]
pub fn agent(kind: AgentKind) -> &'static str {
    match kind {
        AgentKind::Vehicle => "#3c6ea8",
        AgentKind::Pedestrian => "#a3298f",
        AgentKind::Cyclist => "#128a63",
        AgentKind::Other => "#767c85",
    }
}

/// What a signal shows.
#[must_use]
pub fn signal(state: SignalState) -> &'static str {
    match state {
        SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => "#e01b2e",
        SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => "#f7b500",
        SignalState::Go | SignalState::ArrowGo => "#1eb455",
        SignalState::Unknown => "#8d939c",
    }
}
