//! Comfort as NAVSIM asks it. v2 has nuPlan's filters and reads acceleration at the centre; v1 reads it at the rear axle, and its windows
//! on acceleration, and on jerk, are as long as its plan of 4 s.

use episode::judges::rear_axle_to_center;
use episode::metrics::Counted;
use episode::metrics::comfort::{
    Extremes, JERK_BOUND, LONGITUDINAL_ACCELERATION, LONGITUDINAL_JERK, Ride, YAW_ACCELERATION_BOUND, YAW_RATE_BOUND,
};
use episode::metrics::savitzky_golay::SavitzkyGolay;
use world::geometry::angle_difference;
use world::plan::STEP_SECONDS;
use world::scene::AgentState;
use world::vehicle::WHEELBASE;

/// Samples of a plan of 4 s, both ends among them.
const PLAN_SAMPLES: usize = 41;
/// Samples of the history before the start: 1.5 s.
const HISTORY: usize = 15;

/// Whether the drive is comfortable by v1; none where it is too short to filter.
pub(super) fn comfort(states: &[AgentState], before: Option<&AgentState>) -> Option<f64> {
    let rides = rides(before.into_iter().chain(states));
    let own = &rides[rides.len() - states.len()..];
    let accelerations: Vec<f64> = own.iter().map(|ride| ride.acceleration).collect();
    let magnitudes: Vec<f64> = accelerations.iter().map(|acceleration| acceleration.abs()).collect();
    let headings: Vec<f64> = unwrapped(states);
    let filter = |window: usize, degree: usize, derivative: usize, signal: &[f64]| {
        let filtered = SavitzkyGolay { window, degree, derivative }.apply(signal, STEP_SECONDS)?;
        Some(filtered.into_iter().map(|value| (value * 1e8).round_ties_even() / 1e8).collect::<Vec<f64>>())
    };
    let jerk = |signal: &[f64]| filter(PLAN_SAMPLES, 2, 1, &filter(8, 2, 0, signal)?);
    let within = |signal: Vec<f64>, bound: (f64, f64)| signal.iter().all(|value| *value > bound.0 && *value < bound.1);
    let around = |bound: f64| (-bound, bound);
    let is_comfortable = within(filter(PLAN_SAMPLES, 2, 0, &accelerations)?, LONGITUDINAL_ACCELERATION)
        && within(jerk(&magnitudes)?, around(JERK_BOUND))
        && within(jerk(&accelerations)?, around(LONGITUDINAL_JERK))
        && within(filter(5, 2, 1, &headings)?, around(YAW_RATE_BOUND))
        && within(filter(5, 3, 2, &headings)?, around(YAW_ACCELERATION_BOUND));
    Some(f64::from(u8::from(is_comfortable)))
}

/// Whether the drive is comfortable by v2, after what the log has of the 1.5 s before. NAVSIM drops the sample right before the start.
pub(super) fn history_comfort(states: &[AgentState], logged: &[Option<AgentState>]) -> Option<f64> {
    // What is whole up to the start; the first is there for the differences alone.
    let unbroken = logged.iter().rev().take(HISTORY + 1).take_while(|state| state.is_some()).count();
    let history: Vec<AgentState> = logged[logged.len() - unbroken..].iter().flatten().copied().collect();
    let rides = rides(history.iter().chain(states));
    let ahead = rear_axle_to_center(WHEELBASE);
    let turning = std::iter::once(0.0).chain(rides.iter().map(|ride| ride.yaw_rate));
    let mut samples: Vec<_> = rides.iter().zip(turning).map(|(ride, before)| ride.nuplan(before, ahead)).collect();
    if unbroken > 0 {
        samples.remove(unbroken - 1);
    }
    if unbroken > 1 {
        samples.remove(0);
    }
    Extremes::of(&samples, Counted::ALL).map(|extremes| f64::from(u8::from(extremes.are_comfortable())))
}

/// What each state did to the car; nothing at the first, before which nothing is known.
fn rides<'a>(states: impl Iterator<Item = &'a AgentState>) -> Vec<Ride> {
    let mut before: Option<AgentState> = None;
    let ride = |state: &AgentState| {
        let last = before.replace(*state).unwrap_or(*state);
        let yaw_rate = angle_difference(last.heading, state.heading) / STEP_SECONDS;
        let acceleration = (state.speed() - last.speed()) / STEP_SECONDS;
        Ride { acceleration, speed: state.speed(), heading: state.heading, turning: yaw_rate, yaw_rate }
    };
    states.map(ride).collect()
}

/// Headings without jumps of a whole turn.
fn unwrapped(states: &[AgentState]) -> Vec<f64> {
    let mut last: Option<f64> = None;
    let next = |state: &AgentState| {
        let heading = last.map_or(state.heading, |last| last + angle_difference(last, state.heading));
        last = Some(heading);
        heading
    };
    states.iter().map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many states, of which a function of the step tells the speed.
    fn states(count: u32, speed: impl Fn(f64) -> f64) -> Vec<AgentState> {
        let state = |step| AgentState { velocity_x: speed(f64::from(step) * STEP_SECONDS), ..AgentState::default() };
        (0..count).map(state).collect()
    }

    #[test]
    fn steady_braking_is_within_the_bounds_or_not() {
        let braking = |rate: f64| {
            let states = states(61, |time| 30.0 + rate * time);
            (comfort(&states[1..], states.first()), history_comfort(&states[20..], &logged(&states[..20])))
        };
        assert_eq!(braking(-4.0), (Some(1.0), Some(1.0)));
        assert_eq!(braking(-4.1), (Some(0.0), Some(0.0)));
        assert_eq!(braking(2.39), (Some(1.0), Some(1.0)));
        assert_eq!(braking(2.41), (Some(0.0), Some(0.0)));
    }

    fn logged(states: &[AgentState]) -> Vec<Option<AgentState>> {
        states.iter().copied().map(Some).collect()
    }

    #[test]
    fn history_counts_and_of_v1_one_short_kick_does_not() {
        // 6 m/s^2 for half a second within five: a parabola through 4 s hardly sees it.
        let kick = states(101, |time| 10.0 + 6.0 * (time - 5.0).clamp(0.0, 0.5));
        assert_eq!(history_comfort(&kick[20..], &logged(&kick[..20])), Some(0.0));
        assert_eq!(comfort(&kick[20..], Some(&kick[19])), Some(1.0));
        // Braked hard up to 0.5 s before the start.
        let before = states(101, |time| 10.0 - 6.0 * time.min(1.5));
        assert_eq!(history_comfort(&before[20..], &logged(&before[..20])), Some(0.0));
        assert_eq!(history_comfort(&before[20..], &[]), Some(1.0));
    }

    #[test]
    fn what_is_too_short_has_no_answer() {
        assert_eq!(comfort(&states(2, |_| 1.0), None), None);
        assert_eq!(history_comfort(&states(2, |_| 1.0), &[]), None);
    }
}
