//! The ways of driving that are proposed.

use crate::idm::Manner;

/// What a proposal does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// As plans and `explain` name it.
    pub name: &'static str,
    /// Share of the speed that the line allows.
    pub share: f64,
    pub manner: Manner,
    /// Fastest change of the acceleration (m/s^3).
    pub jerk: f64,
    /// Where it drives, to the left of the line (m); none where it stays as far beside it as it is.
    pub offset: Option<f64>,
    /// Whom it looks at.
    pub regard: Regard,
    /// It does nothing but brake, by this (m/s^2).
    pub braking: Option<f64>,
}

/// Whom a proposal brakes for. Red lights and the line's end it minds always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regard {
    /// Who is in its way, with room beside, and who will cross it: as `idm`.
    Yields,
    /// Who is in its way when it comes there, by a hand's breadth.
    Squeezes,
    /// Nobody: whether that goes well is for the trial to say.
    Nobody,
}

const SOFT: Manner = Manner { headway: 1.3, standstill_gap: 2.0, acceleration: 1.5 };
const BRISK: Manner = Manner { headway: 0.9, standstill_gap: 2.0, acceleration: 1.9 };

/// Jerk (m/s^3) that nobody minds.
const GENTLE: f64 = 2.5;

/// Along the line.
const fn along(name: &'static str, share: f64, regard: Regard) -> Policy {
    Policy { name, share, manner: BRISK, jerk: GENTLE, offset: Some(0.0), regard, braking: None }
}

const fn aside(name: &'static str, share: f64, offset: f64, regard: Regard) -> Policy {
    Policy { offset: Some(offset), ..along(name, share, regard) }
}

/// As far beside the line as now.
const fn keep(name: &'static str, share: f64, regard: Regard) -> Policy {
    Policy { offset: None, ..along(name, share, regard) }
}

const fn brake(name: &'static str, braking: f64, jerk: f64) -> Policy {
    Policy { braking: Some(braking), jerk, ..along(name, 0.0, Regard::Nobody) }
}

use Regard::{Nobody, Squeezes, Yields};

/// All of them. Of equals the first is taken.
pub const POLICIES: &[Policy] = &[
    Policy { manner: Manner::IDM, jerk: 10.0, ..along("idm", 1.0, Yields) },
    along("brisk", 1.0, Yields),
    along("go", 1.0, Squeezes),
    Policy { manner: SOFT, jerk: 1.5, ..along("soft", 1.0, Yields) },
    Policy { manner: SOFT, jerk: 1.5, ..along("soft go", 1.0, Squeezes) },
    along("go 0.8", 0.8, Squeezes),
    along("go 0.6", 0.6, Squeezes),
    along("go 0.4", 0.4, Squeezes),
    along("go 0.2", 0.2, Squeezes),
    brake("stop", 2.0, GENTLE),
    brake("brake", 3.5, 4.0),
    brake("brake hard", 3.9, 12.0),
    brake("emergency", 5.0, 100.0),
    keep("keep", 1.0, Squeezes),
    keep("keep 0.6", 0.6, Squeezes),
    aside("left 0.5", 1.0, 0.5, Squeezes),
    aside("right 0.5", 1.0, -0.5, Squeezes),
    aside("left 1.0", 1.0, 1.0, Squeezes),
    aside("right 1.0", 1.0, -1.0, Squeezes),
    aside("left 1.5", 0.6, 1.5, Squeezes),
    aside("right 1.5", 0.6, -1.5, Squeezes),
    along("through", 1.0, Nobody),
    along("through 0.5", 0.5, Nobody),
    keep("through keep", 0.7, Nobody),
    aside("through left", 0.6, 1.5, Nobody),
    aside("through right", 0.6, -1.5, Nobody),
];

/// What is left where those ahead brake at once, or another future comes than was hoped for.
pub const FALLBACK: Policy = Policy { offset: None, ..brake("fallback", 5.0, 20.0) };

/// The same for who has time.
pub const SECOND_THOUGHTS: Policy = Policy { offset: None, ..brake("second thoughts", 3.5, 4.0) };
