//! The future that is driven: one of the joint futures of the prediction network, drawn anew every second.
//!
//! The network sees every step and runs at few: at the first at which anybody reacts, and then once a second while somebody does. A future
//! tells of everybody near the AV, whether he reacts or not, so whoever is met within that second joins it where he is.

use predictor_node::Foresight;
use world::geometry::Pose;
use world::observation::Observation;
use world::pcg::Pcg32;
use world::plan::{Future, PredictedTrajectory, UncheckedPrediction};
use world::scene::TrackId;

/// Steps for which a future is driven.
const LASTS: u32 = 10;

/// The futures of an episode.
pub(crate) struct Futures {
    foresight: Foresight,
    /// Of the run's seed and the scene's name.
    seed: u64,
    drawn: Option<Drawn>,
}

/// The one that is driven.
struct Drawn {
    /// The step at which it was foreseen.
    step: u32,
    trajectories: Vec<PredictedTrajectory>,
}

impl Futures {
    pub(crate) fn new(foresight: Foresight, seed: u64) -> Self {
        Self { foresight, seed, drawn: None }
    }

    /// Takes in a step, and draws another future if that is due; says whether it did.
    pub(crate) fn see(&mut self, observation: &Observation, anybody_reacts: bool) -> bool {
        let step = observation.step;
        let lasts = self.drawn.as_ref().is_some_and(|drawn| (drawn.step..drawn.step + LASTS).contains(&step));
        if lasts || !anybody_reacts {
            self.foresight.see(observation);
            return false;
        }
        let told = self.foresight.foresee(observation);
        let trajectories = drawn(told, self.seed, step).map_or_else(Vec::new, |future| future.trajectories);
        self.drawn = Some(Drawn { step, trajectories });
        true
    }

    /// Where `track` goes from `step` on: its poses a step later, two steps later, and so on. None of who is not in the future.
    pub(crate) fn of(&self, track: TrackId, step: u32) -> Option<&[Pose]> {
        let drawn = self.drawn.as_ref()?;
        let trajectory = drawn.trajectories.iter().find(|trajectory| trajectory.track == track)?;
        trajectory.poses.get(step.checked_sub(drawn.step)? as usize..)
    }
}

/// One of the futures, by its probability. It is the same whoever reacts: seed, scene and step say which. None where the probabilities are none.
fn drawn(told: UncheckedPrediction, seed: u64, step: u32) -> Option<Future> {
    let all: f64 = told.futures.iter().map(|future| future.probability).sum();
    let is_distribution = all.is_finite() && all > 0.0 && told.futures.iter().all(|future| future.probability >= 0.0);
    if !is_distribution {
        return None;
    }
    let mut rest = Pcg32::new(seed, u64::from(step)).between(0.0, all);
    let mut futures = told.futures;
    let at = futures.iter().position(|future| {
        rest -= future.probability;
        rest < 0.0
    });
    // What is left by rounding is the last one's.
    let at = at.or(futures.len().checked_sub(1))?;
    Some(futures.swap_remove(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(probabilities: &[f64]) -> UncheckedPrediction {
        let future = |(index, probability): (usize, &f64)| Future {
            probability: *probability,
            trajectories: vec![PredictedTrajectory { track: TrackId(index as i32), poses: Vec::new() }],
            controls: Vec::new(),
        };
        UncheckedPrediction { futures: probabilities.iter().enumerate().map(future).collect(), ..Default::default() }
    }

    #[test]
    fn futures_are_drawn_as_often_as_they_are_probable() {
        let mut counts = [0; 3];
        for step in 0..3000 {
            let future = drawn(told(&[0.6, 0.3, 0.1]), 7, step).unwrap();
            counts[future.trajectories[0].track.0 as usize] += 1;
        }
        assert!(
            counts.iter().zip([1800, 900, 300]).all(|(count, about): (&i32, i32)| (count - about).abs() < 100),
            "{counts:?}"
        );
    }

    #[test]
    fn seed_and_step_alone_say_which() {
        let which = |seed, step| drawn(told(&[0.4, 0.3, 0.3]), seed, step).unwrap().trajectories[0].track;
        let all = |seed| (0..50).map(|step| which(seed, step)).collect::<Vec<_>>();
        assert_eq!(all(1), all(1));
        assert_ne!(all(1), all(2));
    }

    #[test]
    fn of_no_distribution_none_is_drawn() {
        assert!(drawn(told(&[]), 1, 1).is_none());
        assert!(drawn(told(&[f64::NAN, 0.5, 0.5]), 1, 1).is_none());
        assert!(drawn(told(&[-1.0, 1.0, 1.0]), 1, 1).is_none());
        assert!(drawn(told(&[f64::INFINITY, 0.5, 0.5]), 1, 1).is_none());
    }
}
