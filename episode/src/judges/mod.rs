//! What is wrong at a step. One file, one rule; each is a pure function or a small state machine over the AV's body, so
//! that the log's own AV is judged by the same code, and what it breaks at the same step can be shown and not counted.
//!
//! | module | rule |
//! | --- | --- |
//! | [`collision`] | which contact, and whose fault |
//! | [`reaction`] | whether a replayed agent would have had to react to the AV |
//! | [`discs`] | contact as the paper's code tests it |
//! | [`time_to_collision`] | how soon, if all go on as they do |
//! | [`level`] | what of the map is on the level of the route, bridges left out |
//! | [`lanes`] | which lane the AV is in, whether wholly, whether against its direction |
//! | [`road`] | whether a corner is beyond the edge of the road |
//! | [`red_light`] | whether the front bumper crosses a stop point that shows red |

pub mod collision;
pub mod discs;
pub mod lanes;
pub mod level;
pub mod reaction;
pub mod red_light;
pub mod road;
pub mod time_to_collision;

use world::geometry::{OrientedBox, Point};
use world::scene::AgentState;
use world::vehicle::WHEELBASE;

/// Heights further apart than this (m) are on different levels: below the clearance of any bridge, above the noise of a
/// log and the fall of a road along a car.
pub const STOREY: f64 = 3.0;

/// Distance (m) from the rear axle to the box's centre in nuPlan's vehicle, whose wheelbase is [`WHEELBASE`].
const REAR_AXLE_TO_CENTER: f64 = 1.461;

/// The same distance in a car whose axles are `wheelbase` (m) apart, built in proportion.
#[must_use]
pub fn rear_axle_to_center(wheelbase: f64) -> f64 {
    REAR_AXLE_TO_CENTER * wheelbase / WHEELBASE
}

/// The AV at one moment, as the judges see it.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Its state.
    pub state: AgentState,
    /// Its box.
    pub outline: OrientedBox,
    /// Speed along its heading (m/s).
    pub speed: f64,
}

impl Body {
    /// The body of an AV in `state`.
    #[must_use]
    pub fn of(state: AgentState) -> Self {
        Self { state, outline: state.oriented_box(), speed: state.speed() }
    }

    /// Velocity (m/s).
    #[must_use]
    pub fn velocity(&self) -> Point {
        self.outline.forward * self.speed
    }

    /// The middle of the rear axle, if the car is built like nuPlan's.
    #[must_use]
    pub fn rear_axle(&self, wheelbase: f64) -> Point {
        self.outline.center - self.outline.forward * rear_axle_to_center(wheelbase)
    }
}
