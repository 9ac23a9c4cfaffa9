//! The palette. Road users differ in lightness too, so that they are told apart in grey, and by those who see few colours.

use world::scene::AgentKind;
use world::signal::SignalState;

pub const PAPER: &str = "#ffffff";
pub const INK: &str = "#23272e";
pub const PALE_INK: &str = "#6d7480";
pub const FRAME: &str = "#c9ccd2";

pub const GROUND: &str = "#f2f0ea";
pub const ASPHALT: &str = "#cdd1d7";
pub const BIKE_LANE: &str = "#c0d9c8";
pub const DRIVEWAY: &str = "#e0e1e1";
pub const CENTERLINE: &str = "#b2b8c1";
pub const WHITE_LINE: &str = "#ffffff";
pub const YELLOW_LINE: &str = "#e5a50a";
pub const UNKNOWN_LINE: &str = "#e9e4d4";
pub const CURB: &str = "#7b828d";
pub const MEDIAN: &str = "#98897a";
pub const STRIPE: &str = "#ffffff";
pub const BUMP: &str = "#c98f2b";
pub const STOP_SIGN: &str = "#c8202f";

pub const AV: &str = "#ef5b25";
pub const STATIONARY: &str = "#94a6bf";
pub const NOSE: &str = "#ffffff";
pub const INTEREST: &str = "#1d1f24";

pub fn agent(kind: AgentKind) -> &'static str {
    match kind {
        AgentKind::Vehicle => "#3c6ea8",
        AgentKind::Pedestrian => "#a3298f",
        AgentKind::Cyclist => "#128a63",
        AgentKind::Other => "#767c85",
    }
}

pub fn signal(state: SignalState) -> &'static str {
    match state {
        SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => "#e01b2e",
        SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => "#f7b500",
        SignalState::Go | SignalState::ArrowGo => "#1eb455",
        SignalState::Unknown => "#8d939c",
    }
}
