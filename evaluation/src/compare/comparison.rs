//! All that a comparison says. [`Comparison::of`] is pure; what flipped is then looked up in the steps.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use results::parquet::ParquetError;
use serde::Serialize;

use super::figures::{self, Figure};
use super::outcome::Fault;
use super::pairs::{CompareError, LeftOut, Pair, pair};
use super::run::{Episode, Run};
use super::statistics::Interval;
use super::statistics::proportion::{flips_needed, mcnemar, wilson};
use super::steps::Steps;
use crate::table::latency_name;

/// Two runs, compared; as `--format json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The baseline.
    pub a: Side,
    /// The candidate.
    pub b: Side,
    /// The rules of both.
    pub protocol: &'static str,
    /// Which of them are not as usual.
    pub settings: Vec<String>,
    /// Scenes that both drove: n.
    pub pairs: usize,
    /// Of those, drives that are the same in every number.
    pub alike: usize,
    /// Of those, scenes in which both fail.
    pub both_fail: usize,
    /// Pass to fail, in A's order.
    pub new_failures: Vec<Flip>,
    /// Fail to pass, in A's order.
    pub mended: Vec<Flip>,
    /// McNemar's exact test of the flips, two-sided.
    pub mcnemar_p: f64,
    /// How many flips one way it would take beside those the other way (the fewer) for p < 0.05.
    pub flips_needed: usize,
    /// The figures.
    pub figures: Vec<Figure>,
    /// Scenes that are left out.
    pub left_out: LeftOut,
    /// What drew the resamples.
    pub seed: u64,
    /// The paired scenes, in A's order.
    pub scenes: Vec<Scene>,
}

/// One of the runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Side {
    /// Its folder, as it was given.
    pub folder: String,
    /// What tables call the driver.
    pub driver: String,
    /// How the AV followed its plans.
    pub motion: &'static str,
    /// When its plans took effect.
    pub latency: String,
    /// Who drove the agents that react; none: all were replayed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traffic: Option<String>,
    /// Version and revision of the build that drove.
    pub build: String,
    /// How long an answer might take (s).
    pub deadline_s: f64,
    /// Paired scenes that it passed.
    pub passed: usize,
    /// Their share.
    pub pass_rate: f64,
    /// Its 95 % interval (Wilson).
    pub pass_interval: Option<Interval>,
    /// Paired scenes in which the driver failed, and why: they count as failures, and have no other figure.
    pub driver_failed: BTreeMap<String, String>,
}

/// A scene that one run passes and the other does not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flip {
    /// The scene.
    pub scene: String,
    /// What went wrong in the run that fails.
    pub faults: Vec<Happened>,
    /// The first step after which the AVs are more than half a metre apart.
    pub part_at_step: Option<u32>,
}

/// A fault, and the sentence on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Happened {
    /// What.
    pub fault: Fault,
    /// When, with whom; empty where nothing tells.
    pub detail: String,
}

/// A paired scene: its faults in each run; none where it passed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// The scene.
    pub scene: String,
    /// In A.
    pub a: Vec<Fault>,
    /// In B.
    pub b: Vec<Fault>,
}

impl Comparison {
    /// `b` compared with `a`, by their results alone.
    ///
    /// # Errors
    /// [`CompareError`] where they cannot be compared.
    pub fn of(a: &Run, b: &Run, seed: u64) -> Result<Self, CompareError> {
        let (pairs, left_out) = pair(a, b)?;
        let flips = |passes: fn(&Pair<'_>) -> bool, failing: fn(&Pair<'_>) -> Flip| {
            pairs.iter().filter(|pair| passes(pair)).map(failing).collect::<Vec<_>>()
        };
        let new_failures = flips(|(a, b)| a.faults.is_empty() && !b.faults.is_empty(), |(_, b)| flip(b));
        let mended = flips(|(a, b)| !a.faults.is_empty() && b.faults.is_empty(), |(a, _)| flip(a));
        let values: Vec<_> = pairs.iter().map(|(a, b)| (&*a.values, &*b.values)).collect();
        let scene = |(a, b): &Pair<'_>| Scene { scene: a.scene.clone(), a: a.faults.clone(), b: b.faults.clone() };
        let count = |is: fn(&Pair<'_>) -> bool| pairs.iter().filter(|pair| is(pair)).count();
        Ok(Self {
            a: Side::of(a, pairs.iter().map(|pair| pair.0)),
            b: Side::of(b, pairs.iter().map(|pair| pair.1)),
            protocol: a.protocol.name(),
            settings: a.protocol.changes(),
            pairs: pairs.len(),
            alike: count(|(a, b)| a.is_same_drive(b)),
            both_fail: count(|(a, b)| !a.faults.is_empty() && !b.faults.is_empty()),
            mcnemar_p: mcnemar(new_failures.len(), mended.len()),
            flips_needed: flips_needed(new_failures.len().min(mended.len())),
            figures: figures::compare(a.protocol.name(), &values, seed),
            new_failures,
            mended,
            left_out,
            seed,
            scenes: pairs.iter().map(scene).collect(),
        })
    }

    /// The figure of this name.
    #[must_use]
    pub fn figure(&self, name: &str) -> Option<&Figure> {
        self.figures.iter().find(|figure| figure.name == name)
    }

    /// Looks up in the steps of both runs when the faults of flipped scenes began, and where the drives part.
    pub(crate) fn look_into_flips(&mut self, a: &Path, b: &Path) -> Result<(), ParquetError> {
        let flipped = self.new_failures.iter().chain(&self.mended);
        let scenes: BTreeSet<String> = flipped.map(|flip| flip.scene.clone()).collect();
        if scenes.is_empty() {
            return Ok(());
        }
        let names = scenes.iter().map(String::as_str).collect();
        let (a, b) = (Steps::read(a, self.protocol, &names)?, Steps::read(b, self.protocol, &names)?);
        for (flips, failing) in [(&mut self.new_failures, &b), (&mut self.mended, &a)] {
            for flip in flips {
                flip.part_at_step = a.parting(&b, &flip.scene);
                for happened in flip.faults.iter_mut().filter(|happened| happened.detail.is_empty()) {
                    happened.detail = failing.begin(&flip.scene, happened.fault).unwrap_or_default();
                }
            }
        }
        Ok(())
    }
}

/// What went wrong in an episode; the end has its sentence, for the others the steps are asked.
fn flip(failing: &Episode) -> Flip {
    let detail = |fault: Fault| {
        let ended_it = fault.name() == failing.end || fault == Fault::DriverFailed;
        if ended_it { failing.detail.clone() } else { String::new() }
    };
    let faults = failing.faults.iter().map(|fault| Happened { fault: *fault, detail: detail(*fault) });
    Flip { scene: failing.scene.clone(), faults: faults.collect(), part_at_step: None }
}

impl Side {
    fn of<'a>(run: &Run, paired: impl Iterator<Item = &'a Episode> + Clone) -> Self {
        let (pairs, passed) =
            (paired.clone().count(), paired.clone().filter(|episode| episode.faults.is_empty()).count());
        let failed = paired.filter(|episode| episode.driver_failed());
        Self {
            folder: run.folder.to_string_lossy().into_owned(),
            driver: run.driver.clone(),
            motion: run.protocol.motion_name(),
            latency: latency_name(run.latency.as_ref()),
            traffic: run.traffic.clone(),
            build: format!("{} ({})", run.build.version, run.build.git_revision),
            deadline_s: run.deadline_s,
            passed,
            pass_rate: passed as f64 / pairs.max(1) as f64,
            pass_interval: wilson(passed, pairs),
            driver_failed: failed.map(|episode| (episode.scene.clone(), episode.detail.clone())).collect(),
        }
    }
}
