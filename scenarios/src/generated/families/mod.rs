//! The families: where each takes place, and what happens there.

mod along;
mod joining;
mod lights;
mod people;
mod signs;
mod town;

use super::Family;

/// All families, in the order of the demo set.
pub const FAMILIES: &[Family] = &[
    along::CRUISE,
    along::CURVE,
    along::FOLLOWING,
    along::HARD_BRAKING,
    along::CUT_IN,
    along::PARKED_CARS,
    lights::RED_LIGHT,
    lights::GREEN_LIGHT,
    lights::LEFT_TURN,
    lights::PROTECTED_TURN,
    signs::RIGHT_TURN,
    signs::STOP_SIGN,
    signs::ALL_WAY_STOP,
    joining::MERGE,
    joining::ROUNDABOUT,
    people::CROSSWALK,
    people::JAYWALKER,
    people::CYCLIST,
    town::URBAN,
    town::PARKING_LOT,
];
