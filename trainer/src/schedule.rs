//! What changes from epoch to epoch: how fast is learned, and whether the planner is on (`training.md` 3).

use crate::settings::{Mode, Settings};

/// What holds in an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// The learning rate.
    pub learning_rate: f64,
    /// That of the planner's weights.
    pub cost_learning_rate: f64,
    /// Whether the planner is on.
    pub planning: bool,
}

impl Schedule {
    /// What holds in epoch `epoch`, from 0.
    #[must_use]
    pub fn of(settings: &Settings, epoch: usize) -> Self {
        // One more halving would be none: the least number is reached.
        let halvings = epoch.checked_div(settings.halve_every).unwrap_or(0).min(1100);
        let halved = |rate| (0..halvings).fold(rate, |rate: f64, _| 0.5 * rate);
        Self {
            learning_rate: halved(settings.learning_rate),
            cost_learning_rate: halved(settings.cost.learning_rate.unwrap_or(settings.learning_rate)),
            planning: settings.mode == Mode::Dipp && epoch >= settings.epochs_without_planner,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_halved_every_four_epochs_and_the_planner_comes_on_in_the_sixth() {
        let settings = Settings::default();
        let at = |epoch| Schedule::of(&settings, epoch);
        assert_eq!([0, 3, 4, 7, 19].map(|epoch| at(epoch).learning_rate), [2e-4, 2e-4, 1e-4, 1e-4, 1.25e-5]);
        assert_eq!([0, 4, 5, 19].map(|epoch| at(epoch).planning), [false, false, true, true]);
        assert_eq!(at(8).cost_learning_rate, 5e-5);
    }

    #[test]
    fn other_modes_never_plan_and_zero_never_halves() {
        let settings = Settings { mode: Mode::Sep, halve_every: 0, ..Settings::default() };
        let last = Schedule::of(&settings, 19);
        assert_eq!((last.planning, last.learning_rate), (false, 2e-4));
        let mut settings = Settings::default();
        settings.cost.learning_rate = Some(1e-2);
        assert_eq!(Schedule::of(&settings, 4).cost_learning_rate, 5e-3);
        assert_eq!(Schedule::of(&settings, 1_000_000).learning_rate, 0.0);
    }
}
