//! Angles on the circle.

use std::f64::consts::{PI, TAU};

/// `angle` (rad) brought into [-pi, pi).
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    if (-PI..PI).contains(&angle) {
        return angle; // keeps the bits of what is already in range
    }
    let wrapped = (angle + PI).rem_euclid(TAU) - PI;
    // rem_euclid may round up to TAU itself.
    if wrapped >= PI { wrapped - TAU } else { wrapped }
}

/// The turn (rad, in [-pi, pi)) that leads from heading `from` to heading `to`.
#[must_use]
pub fn angle_difference(from: f64, to: f64) -> f64 {
    wrap_angle(to - from)
}
