//! The numbers of the authors' planner, each at one place.
//!
//! Source: the published code of DIPP (Huang et al., "Differentiable Integrated Motion Prediction and Planning with Learnable
//! Cost Function for Autonomous Driving", section III-C), as it runs; `docs/planner.md` says where the paper differs.

pub use world::plan::{PLAN_STEPS as STEPS, STEP_SECONDS as DT};

/// Neighbors that the planner looks at.
pub const NEIGHBORS: usize = 10;

/// Steps at which safety is looked at: 0.1, 0.3, 0.6, 1, 1.5, 2, 2.5, 3, 4 and 5 s.
pub const KEY_STEPS: [usize; 10] = [0, 2, 5, 9, 14, 19, 24, 29, 39, 49];

/// Steps at which the distance to the lane is looked at: every second one, the first at 0.2 s.
pub const LANE_STEPS: usize = STEPS / 2;

/// The step of the `i`-th look at the lane.
#[must_use]
pub const fn lane_step(i: usize) -> usize {
    2 * i + 1
}

/// Distance between the vehicles' ends that is safe (m).
pub const SAFE_GAP: f64 = 5.0;

/// A neighbor matters if it is within half of both widths and this, sideways (m).
pub const LATERAL_MARGIN: f64 = 0.5;

/// The AV is to stop this far before a red light's stop point (m).
pub const STOP_MARGIN: f64 = 3.0;

/// The weights that the authors tuned by hand, in the order of [`Term::ALL`].
pub const HAND_TUNED: [f64; TERMS] = [0.1, 0.5, 0.1, 0.01, 0.5, 0.5, 5.0, 10.0, 10.0];

/// A pivot of the normal matrix below this share of its scale is rounding: the matrix is singular.
///
/// The scale is the matrix' diagonal entry where it is written out (`dense`). The sweep never sees that entry whole, and takes what the
/// control's own rows add to it: with squared weights, acceleration + 2 jerk, and steering + 2 steering change.
pub const SINGULAR: f64 = 1e-14;

/// The cost terms, in the order of their weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Term {
    /// Difference to the speed limit.
    Speed,
    /// Acceleration.
    Acceleration,
    /// Change of the acceleration.
    Jerk,
    /// Steering angle.
    Steering,
    /// Change of the steering angle.
    SteeringChange,
    /// Displacement from the reference line's nearest sample.
    LanePosition,
    /// Difference to the heading of that sample.
    LaneHeading,
    /// Distance driven past a red light's stop point.
    RedLight,
    /// What lacks to a safe distance to the neighbor ahead.
    Safety,
}

/// How many cost terms there are.
pub const TERMS: usize = 9;

impl Term {
    /// All of them, in the order of their weights.
    pub const ALL: [Self; TERMS] = [
        Self::Speed,
        Self::Acceleration,
        Self::Jerk,
        Self::Steering,
        Self::SteeringChange,
        Self::LanePosition,
        Self::LaneHeading,
        Self::RedLight,
        Self::Safety,
    ];

    /// Its name in messages and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Steering => "steering",
            Self::SteeringChange => "steering_change",
            Self::LanePosition => "lane_position",
            Self::LaneHeading => "lane_heading",
            Self::RedLight => "red_light",
            Self::Safety => "safety",
        }
    }
}
