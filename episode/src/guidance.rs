//! Which plans the AV follows in a step, and what a plan says a while after it was asked for.

use std::borrow::Cow;

use world::geometry::{Point, angle_difference};
use world::plan::{Control, PLAN_STEPS, Plan, PlanState, STEP_SECONDS};

use crate::tracker;

/// Length of a step (us).
pub const STEP_US: u32 = 100_000;

/// A plan, some steps after the observation that it answers.
#[derive(Clone, Copy, Debug)]
pub struct Aged<'p> {
    /// The plan.
    pub plan: &'p Plan,
    /// How many steps before this one it was asked for.
    pub age: u32,
}

/// What the AV follows in a step: one plan, and before that perhaps another one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guidance<'p> {
    /// The plan until `since_us`; none where there is none yet.
    pub before: Option<Aged<'p>>,
    /// The plan from then on; none where there is none yet.
    pub now: Option<Aged<'p>>,
    /// When in the step it takes effect (us), below [`STEP_US`].
    pub since_us: u32,
}

impl<'p> Guidance<'p> {
    /// A plan that was asked for at this very step, from its beginning on.
    #[must_use]
    pub fn at_once(plan: &'p Plan) -> Self {
        Self { now: Some(Aged { plan, age: 0 }), ..Self::default() }
    }
}

impl Aged<'_> {
    /// The control of the plan for this step, if it thinks in controls; the inner one is none where they have run out.
    pub(crate) fn control(&self) -> Option<Option<Control>> {
        self.plan.controls().map(|controls| controls.get(self.age as usize).copied())
    }

    /// The states from a moment of the step on: 0.1 s after that moment, 0.2 s, ... to the plan's end, and straight on at its last speed
    /// where less is left than the tracker looks at.
    pub(crate) fn states(&self, since_us: u32) -> Cow<'_, [PlanState]> {
        let states = self.plan.states();
        let first = self.age as usize;
        if since_us == 0 && first + tracker::LEAST_STATES <= PLAN_STEPS {
            return Cow::Borrowed(&states[first..]);
        }
        let share = f64::from(since_us) / f64::from(STEP_US);
        let left = PLAN_STEPS.saturating_sub(first + usize::from(since_us > 0));
        let ahead = 0..left.max(tracker::LEAST_STATES);
        Cow::Owned(ahead.map(|step| between(&at(states, first + step), &at(states, first + step + 1), share)).collect())
    }
}

/// State `index` of a plan; beyond its end straight on.
fn at(states: &[PlanState], index: usize) -> PlanState {
    if let Some(state) = states.get(index) {
        return *state;
    }
    let Some(last) = states.last() else { return PlanState::default() };
    let way = Point::unit(last.heading) * (last.speed * STEP_SECONDS * (index + 1 - states.len()) as f64);
    PlanState { x: last.x + way.x, y: last.y + way.y, ..*last }
}

/// The state at a share of the way from one to the next.
fn between(one: &PlanState, next: &PlanState, share: f64) -> PlanState {
    let mix = |one: f64, next: f64| one + share * (next - one);
    PlanState {
        x: mix(one.x, next.x),
        y: mix(one.y, next.y),
        heading: one.heading + share * angle_difference(one.heading, next.heading),
        speed: mix(one.speed, next.speed),
    }
}
