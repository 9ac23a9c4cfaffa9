//! Driving an episode in one process: for tests, benches, and whoever needs no bus.

use world::observation::{Briefing, Observation};
use world::plan::Plan;

use crate::episode::{Episode, Outcome};

/// Who turns an observation into a plan.
pub trait Driver {
    /// Told once, before the first step.
    ///
    /// # Errors
    /// Why it cannot drive here; the episode fails with this.
    fn start(&mut self, _briefing: &Briefing) -> Result<(), String> {
        Ok(())
    }

    /// The plan for the next five seconds.
    ///
    /// # Errors
    /// Why there is none; the episode fails with this.
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String>;
}

/// Drives `episode` to its end.
pub fn drive(mut episode: Episode, driver: &mut impl Driver) -> Outcome {
    if let Err(reason) = driver.start(&episode.briefing()) {
        episode.fail(reason);
    }
    while episode.ended().is_none() {
        match driver.plan(&episode.observe()) {
            Ok(plan) => {
                episode.advance(&plan);
            }
            Err(reason) => {
                episode.fail(reason);
            }
        }
    }
    episode.finish()
}
