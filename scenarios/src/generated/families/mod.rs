//! The families, a file each.

mod bends;
mod crossing;
mod cut_in;
mod following;
mod merge;
mod red_light;

use super::Family;

/// All families, in the order of the demo set.
pub const FAMILIES: &[Family] = &[
    Family { name: "following", about: "the leader brakes, and goes on", parameters: &[], compose: following::compose },
    Family { name: "red-light", about: "a red light turns green", parameters: &[], compose: red_light::compose },
    Family { name: "curve", about: "a bend of 90 degrees", parameters: &[], compose: bends::compose_curve },
    Family {
        name: "s-curve",
        about: "a bend to the left, then one to the right",
        parameters: &[],
        compose: bends::compose_s_curve,
    },
    Family {
        name: "crossing",
        about: "a stop sign; cars and somebody on foot cross",
        parameters: &[],
        compose: crossing::compose,
    },
    Family { name: "cut-in", about: "a car moves in from the lane beside", parameters: &[], compose: cut_in::compose },
    Family { name: "merge", about: "a ramp leads into a road with traffic", parameters: &[], compose: merge::compose },
];
