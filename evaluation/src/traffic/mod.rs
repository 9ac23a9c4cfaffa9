//! Whether agents that react are believable: what happened to them, whether they yielded, and how far what they did is from what they did in the log.
//!
//! ```text
//! drive of a run ─▶ retraced ─┬─▶ among whom it was driven ─┬─▶ Side: overlaps, off road, braking, features ─┐
//!                             │   the log, the same agents ─┴─▶ Side ────────────────────────────────────────┼─▶ Realism ─▶ a column of the table
//!                             └─▶ ways ─▶ who yielded ──────────────────────────────────────────────────────┘
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | a run, from its drives |
//! | `stage` | a drive, laid out: who is where, in it and in the log |
//! | [`features`] | speed, acceleration, gap and the like, after the Waymo sim agents challenge, and distances of distributions |
//! | `yielding` | who should have yielded, and did |
//! | `table` | printed |

pub mod features;
mod stage;
mod table;
mod yielding;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use episode::judges::Body;
use episode::judges::reaction::must_react;
use episode::judges::road::TOLERANCE;
use episode::judges::time_to_collision::TrafficAgent;
use episode::metrics::comfort::LONGITUDINAL_ACCELERATION;
use episode::protocol::Protocol;
use world::scene::TrackId;

use self::features::{FEATURES, Motion};
use self::stage::Stage;
use crate::drives::{Driven, DrivesError, Run};
use crate::validity;

pub use table::render;

/// What is counted of the agents that reacted, step by step: in the drive, or in the log.
#[derive(Clone, Debug, Default)]
pub struct Side {
    /// Steps of vehicles with an edge of the road within 10 m.
    pub by_the_road: usize,
    /// Those of them with a corner more than 0.3 m beyond it.
    pub off_road: usize,
    /// Steps of which the acceleration is known.
    pub accelerated: usize,
    /// Those of them below nuPlan's bound of comfort, -4.05 m/s^2.
    pub hard_braking: usize,
    /// Values of each of [`FEATURES`].
    pub features: [Vec<f64>; FEATURES.len()],
}

/// The agents of some drives.
#[derive(Clone, Debug, Default)]
pub struct Realism {
    /// Drives.
    pub episodes: usize,
    /// Their steps.
    pub steps: usize,
    /// Steps at which a replayed agent would have had to react ([`validity`]).
    pub must_react: usize,
    /// Agents that reacted.
    pub agents: usize,
    /// Steps of all of them.
    pub agent_steps: usize,
    /// Those at which one overlaps somebody else than the AV from whom the log keeps it apart.
    pub overlaps: usize,
    /// Agents that ran into the AV with their front, and not into its front.
    pub into_av: usize,
    /// Crossings at which one had to yield.
    pub due: usize,
    /// Those at which it did.
    pub yielded: usize,
    /// What they did.
    pub drive: Side,
    /// What the log has the same agents do at the same moments.
    pub log: Side,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Its folder.
    pub folder: PathBuf,
    /// What tables call the driver.
    pub driver: String,
    /// Who drives the agents that react; none in replay.
    pub traffic: Option<String>,
    /// What was found.
    pub realism: Realism,
}

impl Figures {
    /// Of the finished run in `folder`, whose scenes are where they were or in `scenarios`. The same for any number of cores.
    ///
    /// # Errors
    /// [`DrivesError`].
    pub fn of(folder: &Path, scenarios: &[String]) -> Result<Self, DrivesError> {
        let run = Run::open(folder, scenarios)?;
        let settings = &run.file.settings;
        let failed = run.results.flags("failed")?;
        let found = run.each(&[], |index, driven| {
            driven.filter(|_| !failed[index]).map(|driven| Realism::of(driven, &settings.protocol)).unwrap_or_default()
        })?;
        let mut realism = Realism::default();
        found.into_iter().for_each(|one| realism.add(one));
        Ok(Self {
            folder: folder.to_owned(),
            driver: settings.driver.clone(),
            traffic: settings.traffic.as_ref().map(ToString::to_string),
            realism,
        })
    }
}

impl Realism {
    /// The agents of a drive under `protocol`.
    #[must_use]
    pub fn of(driven: &Driven, protocol: &Protocol) -> Self {
        // A drive that could not be retraced was refused when it was read.
        let Ok(stage) = Stage::of(driven, protocol) else { return Self::default() };
        let steps = validity::steps(driven, &stage.avs);
        let must_react = steps.iter().filter(|step| !step.is_valid()).count();
        let mut found = Self { episodes: 1, steps: steps.len(), must_react, ..Self::default() };
        found.watch(&stage);
        for taken in stage.taken.values() {
            for yielded in stage.crossings(taken) {
                found.due += 1;
                found.yielded += usize::from(yielded);
            }
        }
        found
    }

    fn watch(&mut self, stage: &Stage<'_>) {
        let driven = stage.driven;
        let scenes = [&driven.scene, &driven.logged];
        let mut motions: BTreeMap<usize, [Motion; 2]> = BTreeMap::new();
        let (mut agents, mut into_av): (BTreeSet<TrackId>, BTreeSet<TrackId>) = Default::default();
        for (step, moved) in driven.moved.iter().enumerate().filter(|(_, moved)| !moved.is_empty()) {
            let log_index = driven.start as usize + step + 1;
            let members = [stage.driven_at(step), stage.logged_at(log_index)];
            let av = Body::of(stage.avs[step]);
            for agent in moved {
                let Some(&place) = stage.places.get(&agent.track) else { continue };
                let own = members.each_ref().map(|members| members.iter().find(|member| member.place == place));
                let Some(body) = own[0] else { continue };
                agents.insert(agent.track);
                self.agent_steps += 1;
                self.overlaps += usize::from(stage.overlaps(body, &members[0]));
                let seen = TrafficAgent::of(place, body.kind, &body.state, false);
                if must_react(&av, &seen) == Some(0.0) {
                    into_av.insert(agent.track);
                }
                let motion = motions.entry(place);
                let motion = motion.or_insert_with(|| scenes.map(|scene| Motion::of(&scene.tracks()[place].states)));
                for (side, from) in [&mut self.drive, &mut self.log].into_iter().zip(0..) {
                    let Some(body) = own[from] else { continue };
                    side.count(stage.beyond_the_road(body), motion[from].acceleration(log_index));
                }
                // Distributions are of the moments that both have.
                if let [Some(driven), Some(logged)] = own {
                    let told = [(driven, 0), (logged, 1)]
                        .map(|(body, from)| features::of(body, &members[from], &motion[from], log_index));
                    self.drive.take(told[0], told[1]);
                    self.log.take(told[1], told[0]);
                }
            }
        }
        self.agents = agents.len();
        self.into_av = into_av.len();
    }

    fn add(&mut self, other: Self) {
        self.episodes += other.episodes;
        self.steps += other.steps;
        self.must_react += other.must_react;
        self.agents += other.agents;
        self.agent_steps += other.agent_steps;
        self.overlaps += other.overlaps;
        self.into_av += other.into_av;
        self.due += other.due;
        self.yielded += other.yielded;
        self.drive.add(other.drive);
        self.log.add(other.log);
    }
}

impl Side {
    fn count(&mut self, beyond: Option<f64>, acceleration: Option<f64>) {
        if let Some(beyond) = beyond {
            self.by_the_road += 1;
            self.off_road += usize::from(beyond > TOLERANCE);
        }
        if let Some(acceleration) = acceleration {
            self.accelerated += 1;
            self.hard_braking += usize::from(acceleration < LONGITUDINAL_ACCELERATION.0);
        }
    }

    /// Takes the features of a moment; speed and acceleration where the other side has them too.
    fn take(&mut self, own: [Option<f64>; FEATURES.len()], other: [Option<f64>; FEATURES.len()]) {
        for (feature, (values, value)) in self.features.iter_mut().zip(own).enumerate() {
            let is_told = !FEATURES[feature].of_both || other[feature].is_some();
            values.extend(value.filter(|_| is_told));
        }
    }

    fn add(&mut self, other: Self) {
        self.by_the_road += other.by_the_road;
        self.off_road += other.off_road;
        self.accelerated += other.accelerated;
        self.hard_braking += other.hard_braking;
        for (values, more) in self.features.iter_mut().zip(other.features) {
            values.extend(more);
        }
    }
}
