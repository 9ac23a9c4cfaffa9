//! Predictions scored where they mattered: those that were made in a drive, against what the agents did later in it.
//!
//! A recording has both: what was predicted at a step, and where each agent was seen in the five seconds after. So no scene is needed, and
//! an agent that is out of sight, or a step after the drive's end, counts nowhere. `docs/predictions.md` defines every figure.
//!
//! | module | what |
//! | --- | --- |
//! | here | the figures of a recording |
//! | `table` | how they are printed |

mod table;

use std::collections::BTreeMap;
use std::sync::Arc;

use prost::Message as _;
use wire::{convert, proto};
use world::geometry::Point;
use world::observation::Observation;
use world::plan::{Future, PLAN_STEPS, Prediction, UncheckedPrediction};
use world::scene::{AgentKind, TrackId};

pub use table::render;

use crate::recorded::{RecordedError, messages};

/// Seconds after which errors are told one by one.
pub const HORIZONS: [usize; 3] = [1, 3, 5];
/// An error above this is a miss (m): the end-point threshold of Argoverse and of nuScenes.
pub const MISS: f64 = 2.0;
/// Bins of probability.
pub const BINS: usize = 10;
/// Observations a second.
const RATE: usize = 10;

/// A sum over cases.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// How many.
    pub count: u64,
    /// Of the likeliest future (m).
    pub likely: f64,
    /// Of the future that came nearest, all agents together (m).
    pub best: f64,
    /// Of how many the likeliest future is farther off than [`MISS`].
    pub misses: u64,
}

impl Sum {
    fn add(&mut self, likely: f64, best: f64) {
        self.count += 1;
        self.likely += likely;
        self.best += best;
        self.misses += u64::from(likely > MISS);
    }

    /// Means of the likeliest and of the best future (m), and the share of misses.
    #[must_use]
    pub fn means(&self) -> Option<[f64; 3]> {
        let count = self.count as f64;
        (self.count > 0).then(|| [self.likely / count, self.best / count, self.misses as f64 / count])
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.likely += other.likely;
        self.best += other.best;
        self.misses += other.misses;
    }
}

/// Errors of the predictions of one kind of agent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Average displacement over the steps at which the agent was seen.
    pub average: Sum,
    /// Displacement after each of [`HORIZONS`].
    pub at: [Sum; HORIZONS.len()],
}

/// Futures of a probability, and how often they came true.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Futures.
    pub count: u64,
    /// The sum of their probabilities.
    pub probability: f64,
    /// How many came nearest of all at their step.
    pub came: u64,
}

/// What the predictions of some drives were worth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    /// Steps with a prediction of somebody who was seen later.
    pub steps: u64,
    /// By kind of agent.
    pub kinds: BTreeMap<AgentKind, Errors>,
    /// By probability: tenths.
    pub bins: [Bin; BINS],
}

impl Figures {
    /// Those of a recording, an MCAP file.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn of_recording(bytes: &[u8]) -> Result<Self, RecordedError> {
        let (mut seen, mut predictions) = (BTreeMap::new(), Vec::new());
        let mut line = Arc::default();
        messages(bytes, |channel, data| {
            match channel {
                "scene" => {
                    let told = proto::Scene::decode(data).map_err(|error| error.to_string())?;
                    line = Arc::new(convert::reference_line(told).map_err(|error| error.to_string())?);
                }
                "observation" => {
                    let told = proto::Observation::decode(data).map_err(|error| error.to_string())?;
                    let told = convert::observation(told, &line).map_err(|error| error.to_string())?;
                    seen.insert(told.step, whereabouts(&told));
                }
                "prediction" => {
                    let told = proto::Prediction::decode(data).map_err(|error| error.to_string())?;
                    let told = UncheckedPrediction::try_from(told).map_err(|error| error.to_string())?;
                    let step = told.step;
                    predictions.push(told.check(step).map_err(|error| error.to_string())?);
                }
                _ => {}
            }
            Ok(())
        })?;
        let mut figures = Self::default();
        predictions.iter().for_each(|prediction| figures.add(prediction, &seen));
        Ok(figures)
    }

    /// Adds those of other drives.
    pub fn merge(&mut self, other: &Self) {
        self.steps += other.steps;
        for (kind, errors) in &other.kinds {
            let own = self.kinds.entry(*kind).or_default();
            own.average.merge(&errors.average);
            own.at.iter_mut().zip(&errors.at).for_each(|(own, other)| own.merge(other));
        }
        for (own, other) in self.bins.iter_mut().zip(&other.bins) {
            own.count += other.count;
            own.probability += other.probability;
            own.came += other.came;
        }
    }

    fn add(&mut self, prediction: &Prediction, seen: &BTreeMap<u32, Whereabouts>) {
        let Some(likely) = prediction.most_likely() else { return };
        let futures: Vec<BTreeMap<TrackId, Track>> =
            prediction.futures().iter().map(|future| tracks(future, prediction.step(), seen)).collect();
        let joint = |tracks: &BTreeMap<TrackId, Track>| {
            let sum: f64 = tracks.values().map(|track| track.average).sum();
            (!tracks.is_empty()).then(|| sum / tracks.len() as f64)
        };
        // The first of equals; a future that says nothing of anybody is none.
        let Some((best, _)) = futures
            .iter()
            .enumerate()
            .filter_map(|(index, tracks)| Some((index, joint(tracks)?)))
            .reduce(|best, next| if next.1 < best.1 { next } else { best })
        else {
            return;
        };
        self.steps += 1;
        for (index, future) in prediction.futures().iter().enumerate() {
            let bin = &mut self.bins[((future.probability * BINS as f64) as usize).min(BINS - 1)];
            bin.count += 1;
            bin.probability += future.probability;
            bin.came += u64::from(index == best);
        }
        let Some(likely) = prediction.futures().iter().position(|future| std::ptr::eq(future, likely)) else { return };
        for (track, own) in &futures[likely] {
            let nearest = futures[best].get(track).unwrap_or(own);
            let errors = self.kinds.entry(own.kind).or_default();
            errors.average.add(own.average, nearest.average);
            for ((sum, own), nearest) in errors.at.iter_mut().zip(own.at).zip(nearest.at) {
                if let (Some(own), Some(nearest)) = (own, nearest) {
                    sum.add(own, nearest);
                }
            }
        }
    }

    /// Those of all kinds together.
    #[must_use]
    pub fn all(&self) -> Errors {
        let mut all = Errors::default();
        for errors in self.kinds.values() {
            all.average.merge(&errors.average);
            all.at.iter_mut().zip(&errors.at).for_each(|(all, one)| all.merge(one));
        }
        all
    }
}

/// Where everybody is who is seen at a step; not those who are supposed to be somewhere.
type Whereabouts = BTreeMap<TrackId, (AgentKind, Point)>;

fn whereabouts(observation: &Observation) -> Whereabouts {
    let seen = observation.agents.iter().filter(|agent| agent.unseen == 0);
    seen.map(|agent| (agent.track, (agent.kind, agent.state.position()))).collect()
}

/// How far off a trajectory is (m).
struct Track {
    kind: AgentKind,
    average: f64,
    at: [Option<f64>; HORIZONS.len()],
}

/// Of everybody who is seen at the step, and later.
fn tracks(future: &Future, step: u32, seen: &BTreeMap<u32, Whereabouts>) -> BTreeMap<TrackId, Track> {
    let Some(now) = seen.get(&step) else { return BTreeMap::new() };
    let track = |trajectory: &world::plan::PredictedTrajectory| {
        let (kind, _) = now.get(&trajectory.track)?;
        let error = |k: usize| {
            let (_, there) = seen.get(&(step.checked_add(1 + k as u32)?))?.get(&trajectory.track)?;
            Some(there.distance(trajectory.poses[k].position()))
        };
        let errors: Vec<f64> = (0..PLAN_STEPS).filter_map(error).collect();
        let average = errors.iter().sum::<f64>() / errors.len() as f64;
        let at = HORIZONS.map(|seconds| error(RATE * seconds - 1));
        (!errors.is_empty()).then_some((trajectory.track, Track { kind: *kind, average, at }))
    };
    future.trajectories.iter().filter_map(track).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use world::geometry::Pose;
    use world::plan::PredictedTrajectory;

    use super::*;

    /// An agent at 10 m/s along x, seen for so many steps.
    fn seen(steps: u32) -> BTreeMap<u32, Whereabouts> {
        let at = |step: u32| BTreeMap::from([(TrackId(7), (AgentKind::Vehicle, Point::new(f64::from(step), 0.0)))]);
        (0..steps).map(|step| (step, at(step))).collect()
    }

    /// From step 0: the agent goes on as it does, so many metres aside at the end of the five seconds.
    fn prediction(futures: &[(f64, f64)]) -> Prediction {
        let pose = |k: usize, aside: f64| Pose::new((k + 1) as f64, aside * (k + 1) as f64 / PLAN_STEPS as f64, 0.0);
        let future = |(probability, aside): &(f64, f64)| Future {
            probability: *probability,
            trajectories: vec![PredictedTrajectory {
                track: TrackId(7),
                poses: (0..PLAN_STEPS).map(|k| pose(k, *aside)).collect(),
            }],
            controls: vec![],
        };
        let futures = futures.iter().map(future).collect();
        UncheckedPrediction { futures, ..UncheckedPrediction::default() }.check(0).unwrap()
    }

    #[test]
    fn errors_are_those_of_the_closed_form() {
        let mut figures = Figures::default();
        figures.add(&prediction(&[(0.75, 5.0), (0.25, -1.0)]), &seen(51));
        let errors = figures.all();
        let near = |sum: &Sum, likely: f64, best: f64| {
            let [l, b, _] = sum.means().unwrap();
            assert!((l - likely).abs() < 1e-12 && (b - best).abs() < 1e-12, "{sum:?}");
        };
        // Aside grows evenly: the mean over 50 steps is 51/100 of the end's.
        near(&errors.average, 2.55, 0.51);
        near(&errors.at[0], 1.0, 0.2);
        near(&errors.at[1], 3.0, 0.6);
        near(&errors.at[2], 5.0, 1.0);
        assert_eq!(errors.at.map(|sum| sum.misses), [0, 1, 1]);
        assert_eq!((figures.bins[7].count, figures.bins[7].came), (1, 0));
        assert_eq!((figures.bins[2].count, figures.bins[2].came), (1, 1));
    }

    #[test]
    fn what_is_not_seen_counts_nowhere() {
        let mut figures = Figures::default();
        // Seen for 2 s, then the drive is over.
        figures.add(&prediction(&[(1.0, 5.0)]), &seen(21));
        let errors = figures.all();
        assert_eq!(errors.at.map(|sum| sum.count), [1, 0, 0]);
        assert!((errors.average.means().unwrap()[0] - 5.0 * 10.5 / 50.0).abs() < 1e-12);
        // Nobody is seen, or nobody is predicted.
        figures.add(&prediction(&[(1.0, 5.0)]), &seen(1));
        figures.add(&prediction(&[(1.0, 5.0)]), &BTreeMap::new());
        figures.add(&UncheckedPrediction::default().check(0).unwrap(), &seen(51));
        assert_eq!(figures.steps, 1);
    }

    #[test]
    fn together_is_one_after_the_other() {
        let one = |futures: &[(f64, f64)], steps: u32| {
            let mut figures = Figures::default();
            figures.add(&prediction(futures), &seen(steps));
            figures
        };
        let (a, b) = (one(&[(0.5, 1.0), (0.5, 2.0)], 51), one(&[(1.0, 3.0)], 31));
        let mut both = a.clone();
        both.merge(&b);
        assert_eq!((both.steps, both.all().at[1].count, both.all().at[2].count), (2, 2, 1));
        assert_eq!(both.bins.iter().map(|bin| bin.count).sum::<u64>(), 3);
    }
}
