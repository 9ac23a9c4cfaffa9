//! The colours of all pictures: a quiet map on a dark ground, one strong accent for the AV and what it plans.

use wire::proto::{AgentKind, RoadLineKind, SignalState};

/// Red, green, blue, opacity.
pub type Rgba = [u8; 4];

/// Behind everything.
pub const BACKGROUND: Rgba = [13, 16, 22, 255];
/// Centre lines of lanes.
pub const LANE: Rgba = [54, 62, 77, 255];
/// Centre lines of bicycle lanes.
pub const BIKE_LANE: Rgba = [48, 70, 62, 255];
/// Where the road ends.
pub const ROAD_EDGE: Rgba = [134, 144, 160, 255];
/// White paint.
pub const WHITE_LINE: Rgba = [102, 112, 128, 255];
/// Yellow paint.
pub const YELLOW_LINE: Rgba = [146, 122, 62, 255];
/// Crosswalks.
pub const CROSSWALK: Rgba = [104, 124, 152, 255];
/// Speed bumps and driveways.
pub const AREA: Rgba = [62, 71, 85, 255];
/// Stop signs.
pub const STOP_SIGN: Rgba = [196, 66, 66, 255];
/// The line to follow.
pub const ROUTE: Rgba = [16, 78, 96, 255];
/// The AV.
pub const AV: Rgba = [0, 205, 240, 255];
/// Where the log has the AV.
pub const GHOST: Rgba = [150, 160, 176, 120];
/// Whom the AV touched, where that counts against it.
pub const STRUCK: Rgba = [255, 72, 72, 255];
/// Whom the AV touched, where it does not.
pub const TOUCHED: Rgba = [255, 186, 48, 255];
/// What it plans.
pub const PLAN: Rgba = [120, 232, 255, 255];
/// The limit beside a speed.
pub const LIMIT: Rgba = [130, 140, 156, 255];

/// An agent of that kind.
#[must_use]
pub fn agent(kind: AgentKind) -> Rgba {
    match kind {
        AgentKind::Vehicle => [118, 140, 186, 255],
        AgentKind::Pedestrian => [242, 196, 104, 255],
        AgentKind::Cyclist => [198, 128, 240, 255],
        AgentKind::Other => [128, 132, 138, 255],
    }
}

/// The same for somebody who is not seen, but supposed to be there.
#[must_use]
pub fn supposed([red, green, blue, opacity]: Rgba) -> Rgba {
    [red, green, blue, opacity / 3]
}

/// A future of that probability: the likelier the brighter, never quite gone.
#[must_use]
pub fn prediction(probability: f64) -> Rgba {
    let probability = if probability.is_finite() { probability.clamp(0.0, 1.0) } else { 0.0 };
    let share = 0.25 + 0.75 * probability;
    let faded = |from: u8, to: u8| (f64::from(from) + share * (f64::from(to) - f64::from(from))) as u8;
    [faded(BACKGROUND[0], 168), faded(BACKGROUND[1], 186), faded(BACKGROUND[2], 232), 255]
}

/// What a signal shows.
#[must_use]
pub fn signal(state: SignalState) -> Rgba {
    match state {
        SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => [255, 72, 72, 255],
        SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => [255, 186, 48, 255],
        SignalState::Go | SignalState::ArrowGo => [64, 220, 120, 255],
        SignalState::Unknown => [110, 114, 120, 255],
    }
}

/// Paint.
#[must_use]
pub fn road_line(kind: RoadLineKind) -> Rgba {
    match kind {
        RoadLineKind::BrokenSingleYellow
        | RoadLineKind::BrokenDoubleYellow
        | RoadLineKind::SolidSingleYellow
        | RoadLineKind::SolidDoubleYellow
        | RoadLineKind::PassingDoubleYellow => YELLOW_LINE,
        _ => WHITE_LINE,
    }
}
