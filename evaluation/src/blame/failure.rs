//! Where a drive that failed did so first.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use results::parquet::{ParquetError, Table};
use results::summary::SummaryError;
use serde::Serialize;
use world::geometry::{OrientedBox, Pose};

use crate::compare::outcome::Fault;
use crate::compare::run::{Episode, Run};

/// The first fault of a drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failure {
    /// The scene.
    pub scene: String,
    /// What went wrong first; of several at a step the first in the order of [`Fault::all`].
    pub fault: Fault,
    /// The step that led to it, from 0. Of a driver that failed: the one that it had no plan for.
    pub step: u32,
    /// The AV after that step, and its log index; none where the driver failed.
    #[serde(skip)]
    pub av: Option<Seen>,
}

/// The AV at a log index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// When.
    pub log_index: usize,
    /// Its box.
    pub outline: OrientedBox,
    /// Height of its centre (m).
    pub z: f64,
}

/// The rows of a scene.
#[derive(Debug, Default)]
struct Steps(Vec<Row>);

#[derive(Debug)]
struct Row {
    step: u32,
    flagged: Vec<Fault>,
    av: Option<Seen>,
}

/// The failures of the finished run in `folder`, in its order.
///
/// # Errors
/// [`SummaryError`] where there is none.
pub fn failures(folder: &Path) -> Result<Vec<Failure>, SummaryError> {
    let run = Run::read(folder)?;
    let failed: Vec<&Episode> = run.episodes.iter().filter(|episode| !episode.faults.is_empty()).collect();
    let names: BTreeSet<&str> = failed.iter().map(|episode| episode.scene.as_str()).collect();
    let steps = if names.is_empty() { BTreeMap::new() } else { read(folder, run.protocol.name(), &names)? };
    let none = Steps::default();
    Ok(failed.into_iter().filter_map(|episode| first(episode, steps.get(&episode.scene).unwrap_or(&none))).collect())
}

/// The scenes of the finished run in `folder` that nobody could drive, and why.
///
/// # Errors
/// [`SummaryError`] where there is none.
pub fn undrivable(folder: &Path) -> Result<BTreeMap<String, String>, SummaryError> {
    let episodes = Run::read(folder)?.episodes.into_iter().filter(|episode| !episode.is_drivable());
    Ok(episodes.map(|episode| (episode.scene, episode.detail)).collect())
}

fn first(episode: &Episode, steps: &Steps) -> Option<Failure> {
    let at = |fault: Fault| {
        if fault == Fault::DriverFailed {
            return (episode.steps, fault, None);
        }
        let flagged = steps.0.iter().find(|row| row.flagged.contains(&fault));
        // What ends a drive and has no flag is at its last step.
        let row = flagged.or(steps.0.last());
        row.map_or((episode.steps.saturating_sub(1), fault, None), |row| (row.step, fault, row.av))
    };
    let first = episode.faults.iter().map(|fault| at(*fault)).min_by_key(|(step, fault, _)| (*step, *fault));
    first.map(|(step, fault, av)| Failure { scene: episode.scene.clone(), fault, step, av })
}

fn read(folder: &Path, protocol: &str, scenes: &BTreeSet<&str>) -> Result<BTreeMap<String, Steps>, ParquetError> {
    const NUMBERS: [&str; 6] = ["av_x_m", "av_y_m", "av_z_m", "av_heading_rad", "av_length_m", "av_width_m"];
    let mut names = vec!["step", "log_index"];
    names.extend(NUMBERS);
    names.extend(Fault::columns(protocol));
    let table = Table::read_of(&folder.join("steps.parquet"), &names, scenes)?;
    let flags = Fault::flags(&table, protocol)?;
    let numbers = table.numbers()?;
    let (steps, log_indices) = (table.counts("step")?, table.counts("log_index")?);
    let mut all: BTreeMap<String, Steps> = BTreeMap::new();
    for (row, scene) in table.text("scene")?.into_iter().enumerate() {
        let number = |column: &str| numbers.get(column).and_then(|values| values.get(row).copied().flatten());
        let av = || {
            let [x, y, z, heading, length, width] = NUMBERS.map(number);
            let outline = OrientedBox::new(Pose::new(x?, y?, heading?), length?, width?);
            Some(Seen { log_index: log_indices[row] as usize, outline, z: z? })
        };
        all.entry(scene).or_default().0.push(Row {
            step: steps[row],
            flagged: flags.iter().filter(|(_, set)| set[row]).map(|(fault, _)| *fault).collect(),
            av: av(),
        });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(faults: &[Fault]) -> Episode {
        Episode {
            scene: "a".to_owned(),
            sha256: String::new(),
            end: String::new(),
            detail: String::new(),
            steps: 4,
            faults: faults.to_vec(),
            values: Vec::new(),
        }
    }

    fn steps(flagged: [&[Fault]; 4]) -> Steps {
        let row = |(step, flagged): (usize, &&[Fault])| Row { step: step as u32, flagged: flagged.to_vec(), av: None };
        Steps(flagged.iter().enumerate().map(row).collect())
    }

    fn first_of(faults: &[Fault], rows: [&[Fault]; 4]) -> (Fault, u32) {
        let failure = first(&episode(faults), &steps(rows)).unwrap();
        (failure.fault, failure.step)
    }

    #[test]
    fn the_first_fault_is_told_and_of_several_the_gravest() {
        use Fault::{Collision, OffRoad, RedLight};
        let rows: [&[Fault]; 4] = [&[], &[OffRoad], &[], &[OffRoad, Collision]];
        assert_eq!(first_of(&[Collision, OffRoad], rows), (OffRoad, 1));
        assert_eq!(first_of(&[Collision, RedLight], [&[], &[RedLight, Collision], &[], &[]]), (Collision, 1));
    }

    #[test]
    fn what_has_no_flag_is_at_the_end() {
        assert_eq!(first_of(&[Fault::RouteLost], [&[], &[], &[], &[]]), (Fault::RouteLost, 3));
        assert_eq!(first_of(&[Fault::DriverFailed], [&[], &[], &[], &[]]), (Fault::DriverFailed, 4));
        assert_eq!(first(&episode(&[Fault::DriverFailed]), &Steps::default()).unwrap().step, 4);
    }
}
