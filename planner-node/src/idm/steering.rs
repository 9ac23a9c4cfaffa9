//! The front wheels' angle: the line's curvature a little ahead, corrected for offset and heading.
//!
//! With e the offset and p the heading error, and distance travelled as the variable: e' = p, p' = k - k_line. The law
//! k = k_line - 2 p / l - e / l^2 makes that e'' + 2 e' / l + e / l^2 = 0: critically damped, over the length l.

use world::geometry::angle_difference;
use world::vehicle::VehicleState;

use super::corridor::{Corridor, Place};

/// The length l in seconds of driving, and at least in metres.
const SETTLING_SECONDS: f64 = 1.0;
const SETTLING_METERS: f64 = 4.0;
/// The wheels need this long to follow (s): half of a turn at the steering rate of 0.5 rad/s.
const PREVIEW: f64 = 0.2;
/// Offsets beyond this (m) are approached at this one's angle.
const LARGEST_OFFSET: f64 = 3.0;

/// The angle (rad) for a vehicle at `place`.
pub fn angle(corridor: &Corridor, place: &Place, state: &VehicleState, wheelbase: f64) -> f64 {
    let settling = (SETTLING_SECONDS * state.speed).max(SETTLING_METERS);
    let ahead = corridor.sample_at(place.station + PREVIEW * state.speed);
    let heading_error = angle_difference(corridor.heading(place.sample), state.heading);
    let offset = place.lateral.clamp(-LARGEST_OFFSET, LARGEST_OFFSET);
    let curvature = corridor.curvature(ahead) - 2.0 * heading_error / settling - offset / (settling * settling);
    libm::atan(wheelbase * curvature)
}
