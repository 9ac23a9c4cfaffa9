//! Angles on the circle.

use std::f64::consts::{PI, TAU};

/// `angle` (rad) brought into [-pi, pi).
#[must_use]
#[inline]
pub fn wrap_angle(angle: f64) -> f64 {
    if (-PI..PI).contains(&angle) {
        return angle; // keeps the bits of what is already in range
    }
    let wrapped = (angle + PI).rem_euclid(TAU) - PI;
    // rem_euclid may round up to TAU itself.
    if wrapped >= PI { wrapped - TAU } else { wrapped }
}

/// The same in single precision, rounded where NumPy rounds: what reproduces the paper's code needs its last bits.
#[must_use]
pub fn wrap_angle_single(angle: f32) -> f32 {
    use std::f32::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

/// The turn (rad, in [-pi, pi)) that leads from heading `from` to heading `to`.
#[must_use]
#[inline]
pub fn angle_difference(from: f64, to: f64) -> f64 {
    wrap_angle(to - from)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn half_a_turn_is_always_written_as_minus_pi() {
        assert_eq!((wrap_angle(PI), wrap_angle(-PI), wrap_angle(3.0 * PI)), (-PI, -PI, -PI));
    }

    #[test]
    fn single_precision_wraps_as_numpy_does() {
        // (np.float32(a) + np.float32(np.pi)) % np.float32(2 * np.pi) - np.float32(np.pi)
        let wrapped = [0.1_f32, 3.5, -7.25, -std::f32::consts::PI].map(wrap_angle_single);
        assert_eq!(wrapped, [0.099_999_905, -2.783_185_2, -0.966_814_3, -std::f32::consts::PI]);
    }

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction_and_is_idempotent(angle in -1e3..1e3) {
            let wrapped = wrap_angle(angle);
            prop_assert!((-PI..PI).contains(&wrapped));
            prop_assert_eq!(wrap_angle(wrapped), wrapped);
            prop_assert!((libm::sin(wrapped) - libm::sin(angle)).abs() < 1e-9);
            prop_assert!((libm::cos(wrapped) - libm::cos(angle)).abs() < 1e-9);
        }

        #[test]
        fn the_turn_between_two_headings_leads_from_one_to_the_other(from in -20.0..20.0, to in -20.0..20.0) {
            let turned: f64 = from + angle_difference(from, to);
            prop_assert!((libm::sin(turned) - libm::sin(to)).abs() < 1e-9 && (libm::cos(turned) - libm::cos(to)).abs() < 1e-9);
        }
    }
}
