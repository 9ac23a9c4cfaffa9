//! Plans under way. Each step asks for one; it takes effect when it arrives, if no newer one has by then.
//!
//! ```text
//! step      0         1         2         3         delays: 170 ms, 30 ms, lost, 0
//! asked     P0        P1        P2        P3
//! arrives         ·      P1       P0  ·   P3        P0 is overtaken by P1: lost, as P2 is
//! followed  nothing   ┊  P1 ──────────────P3 ──▶
//! ```
//!
//! The AV takes up one plan a step at most: of those that arrive in it the newest, at the moment of its arrival. The others are lost.

use world::plan::Plan;

use super::TOO_LATE_US;
use crate::guidance::{Aged, Guidance, STEP_US};

/// The plans of an episode.
#[derive(Clone, Debug, Default)]
pub struct Pipeline {
    /// With their arrivals (us since the drive began).
    under_way: Vec<(u64, Plan)>,
    /// What was followed before `now`.
    before: Option<Plan>,
    /// What is followed.
    now: Option<Plan>,
    /// What became of plans until now.
    pub fates: Fates,
}

/// How many plans did not take effect in the step that they were asked for. Those that are still under way count as nothing yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fates {
    /// Took effect in a later step.
    pub late: u32,
    /// Never took effect: they did not arrive, a newer one was there before them or came in the same step, or they had ended.
    pub lost: u32,
}

impl Pipeline {
    /// The step for which `plan` was just asked, and what is followed in it. `delay_us` is how long the plan takes; none: it never arrives.
    pub fn step(&mut self, plan: Plan, delay_us: Option<u32>) -> Guidance<'_> {
        let step = plan.step();
        let begin = u64::from(step) * u64::from(STEP_US);
        match delay_us.filter(|delay| *delay < TOO_LATE_US) {
            Some(delay) => self.under_way.push((begin + u64::from(delay), plan)),
            None => self.fates.lost += 1,
        }
        let end = begin + u64::from(STEP_US);
        let mut arrived: Vec<(u64, Plan)> = self.under_way.extract_if(.., |(arrival, _)| *arrival < end).collect();
        arrived.sort_by_key(|(_, plan)| plan.step());
        let newest = arrived.pop();
        self.fates.lost += arrived.len() as u32;
        let mut since_us = 0;
        match newest {
            Some((arrival, plan)) if self.now.as_ref().is_none_or(|now| plan.step() > now.step()) => {
                since_us = arrival.saturating_sub(begin) as u32;
                self.fates.late += u32::from(plan.step() < step);
                self.before = self.now.replace(plan);
            }
            Some(_) => self.fates.lost += 1,
            None => {}
        }
        let before = self.before.as_ref().filter(|_| since_us > 0);
        let [before, now] =
            [before, self.now.as_ref()].map(|plan| plan.map(|plan| Aged { plan, age: step - plan.step() }));
        Guidance { before, now, since_us }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan};

    use super::*;

    fn plan(step: u32) -> Plan {
        let states = vec![PlanState::default(); PLAN_STEPS];
        UncheckedPlan { step, states, ..UncheckedPlan::default() }.check(step).unwrap()
    }

    /// Of each step: the age of the plan before, of the one that is followed then, and from when.
    type Told = Vec<(Option<u32>, Option<u32>, u32)>;

    fn told(delays_ms: &[Option<u32>]) -> (Told, Fates) {
        let mut pipeline = Pipeline::default();
        let mut told = Told::new();
        for (step, delay) in delays_ms.iter().enumerate() {
            let followed = pipeline.step(plan(step as u32), delay.map(|delay| 1_000 * delay));
            let age = |plan: Option<Aged<'_>>| plan.map(|plan| plan.age);
            told.push((age(followed.before), age(followed.now), followed.since_us / 1_000));
        }
        (told, pipeline.fates)
    }

    #[test]
    fn without_delay_every_plan_is_followed_at_once() {
        assert_eq!(told(&[Some(0); 3]), (vec![(None, Some(0), 0); 3], Fates::default()));
    }

    #[test]
    fn a_plan_takes_effect_within_the_step_in_which_it_arrives_and_the_old_one_is_followed_until_then() {
        let (steps, fates) = told(&[Some(50); 3]);
        assert_eq!(steps, [(None, Some(0), 50), (Some(1), Some(0), 50), (Some(1), Some(0), 50)]);
        assert_eq!(fates, Fates::default());
        let (steps, fates) = told(&[Some(250); 5]);
        let expected =
            [(None, None, 0), (None, None, 0), (None, Some(2), 50), (Some(3), Some(2), 50), (Some(3), Some(2), 50)];
        assert_eq!(steps, expected);
        assert_eq!(fates, Fates { late: 3, lost: 0 }, "two are still under way");
    }

    #[test]
    fn a_delay_of_a_step_is_the_next_step_from_its_beginning() {
        let (steps, fates) = told(&[Some(100); 3]);
        assert_eq!(steps, [(None, None, 0), (None, Some(1), 0), (None, Some(1), 0)]);
        assert_eq!(fates, Fates { late: 2, lost: 0 });
    }

    #[test]
    fn who_is_overtaken_or_never_arrives_is_lost() {
        // As the picture above.
        let (steps, fates) = told(&[Some(170), Some(30), None, Some(0)]);
        assert_eq!(steps, [(None, None, 0), (None, Some(0), 30), (None, Some(1), 0), (None, Some(0), 0)]);
        assert_eq!(fates, Fates { late: 0, lost: 2 });
        // An older one that arrives later.
        let (steps, fates) = told(&[Some(250), Some(0), Some(0)]);
        assert_eq!(steps[1..], [(None, Some(0), 0), (None, Some(0), 0)]);
        assert_eq!(fates, Fates { late: 0, lost: 1 });
        // One that has ended when it arrives.
        assert_eq!(told(&[Some(5_000)]), (vec![(None, None, 0)], Fates { late: 0, lost: 1 }));
    }

    proptest! {
        #[test]
        fn a_newer_plan_never_gives_way_to_an_older_and_each_has_one_fate(
            delays in prop::collection::vec(prop::option::weighted(0.9, 0..700_u32), 1..80),
        ) {
            let (steps, Fates { late, lost }) = told(&delays);
            let mut last = None;
            let mut in_time = 0;
            for (step, (before, now, since)) in steps.iter().enumerate() {
                let of = |age: &Option<u32>| age.map(|age| step as u32 - age);
                prop_assert!(of(now) >= last);
                if *since > 0 {
                    prop_assert_eq!(of(before), last);
                    prop_assert!(of(now) > last);
                }
                in_time += u32::from(of(now) > last && *now == Some(0));
                last = of(now).or(last);
                if let Some(asked) = of(now) {
                    let delay = delays[asked as usize].unwrap();
                    prop_assert!(100 * asked + delay < 100 * (step as u32 + 1));
                }
            }
            let end = 100 * delays.len() as u32;
            let arrives = |(step, delay): (usize, &Option<u32>)| delay.is_none_or(|delay| 100 * step as u32 + delay < end);
            let settled = delays.iter().enumerate().filter(|asked| arrives(*asked)).count();
            prop_assert_eq!(in_time + late + lost, settled as u32);
        }
    }
}
