//! Figures of a set of scenes: who is there, how large, how fast, how near to each other; how lanes, signals and crosswalks are.
//!
//! ```text
//! Scene ──▶ Samples (values by quantity) ──▶ joined in the scenes' order ──▶ Figures (percentiles)
//!                    └──▶ Summary (a row a scene)
//! ```
//!
//! | file | section |
//! | --- | --- |
//! | `agents` | how many, in the scene, at one step, near the AV |
//! | `sizes`, `parked`, `speeds`, `gaps`, `av` | how they are and move |
//! | `lanes`, `signals`, `areas` | the map |
//! | `roadway` | which lane a vehicle is on |
//! | `quantity`, `samples`, `figures`, `summary` | what is measured, the values, the table, the row of a scene |
//!
//! Moving means faster than 0.5 m/s, for pedestrians 0.2 m/s. The AV is not counted among those near it. Time is looked at every 0.2 s to
//! 1 s, so that the number of samples is not that of states.

mod agents;
mod areas;
mod av;
mod figures;
mod gaps;
mod lanes;
mod parked;
mod quantity;
mod roadway;
mod samples;
mod signals;
mod sizes;
mod speeds;
mod summary;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use rayon::prelude::*;
use world::scene::{Scene, Track};

pub use figures::{Figures, PERCENTS, ShareRow, SpreadRow};
pub use quantity::{Quantity, Section, Share};
pub use samples::{Count, Samples};
pub use summary::{COLUMNS, Summary};

use roadway::Roadway;

/// Faster (m/s) is moving.
const MOVING: f64 = 0.5;

/// Scenes that are measured before their samples are joined: enough to keep all cores busy, and few enough that none waits long.
const BATCH: usize = 64;

impl Samples {
    /// All that is measured in one scene.
    #[must_use]
    pub fn of_scene(scene: &Scene) -> Self {
        let mut samples = Self::default();
        let roadway = Roadway::new(scene.map());
        agents::measure(scene, &mut samples);
        sizes::measure(scene, &mut samples);
        parked::measure(scene, &roadway, &mut samples);
        speeds::measure(scene, &mut samples);
        gaps::measure(scene, &roadway, &mut samples);
        av::measure(scene, &mut samples);
        lanes::measure(scene, &mut samples);
        signals::measure(scene, &mut samples);
        areas::measure(scene, &mut samples);
        samples
    }
}

/// Measures scenes 0 to `number`, which `load` gives, on all cores (those of the current rayon pool): the samples of all, and a row for
/// each. The same for any number of cores. Scenes are held while they are measured and no longer.
///
/// # Errors
/// The first of `load`'s, in the order of scenes.
pub fn measure<E: Send>(
    number: usize,
    load: impl Fn(usize) -> Result<Arc<Scene>, E> + Sync,
) -> Result<(Samples, Vec<Summary>), E> {
    let (mut all, mut rows) = (Samples::default(), Vec::with_capacity(number));
    for first in (0..number).step_by(BATCH) {
        let batch: Vec<Result<(Samples, Summary), E>> = (first..(first + BATCH).min(number))
            .into_par_iter()
            .map(|index| {
                let scene = load(index)?;
                let samples = Samples::of_scene(&scene);
                let summary = Summary::new(&scene, &samples);
                Ok((samples, summary))
            })
            .collect();
        for measured in batch {
            let (samples, row) = measured?;
            all.append(&samples);
            rows.push(row);
        }
    }
    Ok((all, rows))
}

/// Every `stride`-th of so many steps, from the first.
fn every(stride: usize, steps: usize) -> impl Iterator<Item = usize> {
    (0..steps).step_by(stride)
}

/// All tracks but the AV's.
fn others(scene: &Scene) -> impl Iterator<Item = &Track> {
    let av = scene.av_index();
    scene.tracks().iter().enumerate().filter(move |(index, _)| *index != av).map(|(_, track)| track)
}
