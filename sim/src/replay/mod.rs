//! `sim replay`: the recorded episodes of a run, driven again.
//!
//! | module | what |
//! | --- | --- |
//! | here | in process, by their recorded plans |
//! | [`live`] | by the nodes that drove them |
//! | [`fork`] | by their plans up to a step, and then by somebody else |
//! | [`cast`] | what has to be there so that a run can be driven again |

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use evaluation::replay::{Recorded, Verdict, replay};
use rayon::prelude::*;
use results::folder::{FolderError, read_run_file, recording_of};
use results::parquet::{ParquetError, Table};
use results::settings::RunFile;
use scenarios::{SceneSet, SetError};
use thiserror::Error;

use crate::cli::ReplayArgs;

pub mod cast;
pub mod fork;
pub mod live;

/// A run that cannot be replayed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ReplayRunError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Results(#[from] ParquetError),
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error("{} holds no run: there is no run.toml in it", .0.display())]
    NoRun(PathBuf),
    #[error("{} has no recording of any episode asked for\nhint: `sim run --record all` keeps them", .0.display())]
    NothingRecorded(PathBuf),
    #[error("{} has no episode {id}\nhint: `sim table --scenes` lists them", run.display())]
    NoEpisode { run: PathBuf, id: String },
}

/// What came of a run.
#[derive(Debug)]
pub struct Replayed {
    /// A line an episode that is not the same, then one on all.
    pub text: String,
    /// Whether all is the same.
    pub is_same: bool,
}

/// How an episode came out.
#[derive(Debug)]
enum Outcome {
    Same(u32),
    Differs(String),
    Unrecorded,
}

/// Replays the run in `folder` on all cores. The text is the same for any number of them.
///
/// # Errors
/// [`ReplayRunError`] where it has nothing to replay.
pub fn run(folder: &Path, arguments: &ReplayArgs) -> Result<Replayed, ReplayRunError> {
    let Asked { file, episodes } = asked(folder, arguments)?;
    let from = if arguments.scenarios.is_empty() { &file.machine.scenarios } else { &arguments.scenarios };
    let scenes = SceneSet::open(from)?;
    let run = Run { folder, results: Results::read(folder)?, file, scenes };
    let outcomes: Vec<(usize, Outcome)> = episodes.into_par_iter().map(|index| (index, run.episode(index))).collect();
    told(folder, &run.file, &outcomes, "are the same to the byte")
}

/// A run, and which of its episodes are meant.
struct Asked {
    file: RunFile,
    /// Their places among its scenes.
    episodes: Vec<usize>,
}

fn asked(folder: &Path, arguments: &ReplayArgs) -> Result<Asked, ReplayRunError> {
    let file = read_run_file(folder)?.ok_or_else(|| ReplayRunError::NoRun(folder.to_owned()))?;
    let known = |id: &String| file.scenes.iter().any(|scene| scene.id == *id);
    if let Some(id) = arguments.episodes.iter().find(|id| !known(id)) {
        return Err(ReplayRunError::NoEpisode { run: folder.to_owned(), id: id.clone() });
    }
    let is_asked = |id: &String| arguments.episodes.is_empty() || arguments.episodes.contains(id);
    let episodes = (0..file.scenes.len()).filter(|index| is_asked(&file.scenes[*index].id)).collect();
    Ok(Asked { file, episodes })
}

/// A run, and where its scenes are.
struct Run<'a> {
    folder: &'a Path,
    file: RunFile,
    scenes: SceneSet,
    results: Results,
}

impl Run<'_> {
    fn episode(&self, index: usize) -> Outcome {
        let line = &self.file.scenes[index];
        let path = recording_of(self.folder, &line.id);
        if !path.exists() {
            return Outcome::Unrecorded;
        }
        self.compare(&path, &line.id, &line.sha256).map_or_else(Outcome::Differs, Outcome::Same)
    }

    fn compare(&self, path: &Path, id: &str, sha256: &str) -> Result<u32, String> {
        let bytes = recording::load(path).map_err(|error| error.to_string())?;
        let recorded = Recorded::read(&bytes).map_err(|error| format!("{}: {error}", path.display()))?;
        let place = self.scenes.entries().iter().position(|entry| entry.id.as_str() == id);
        let place = place.ok_or("its scene is not among those given")?;
        let (scene, _) = self.scenes.load_hashed(place).map_err(|error| error.to_string())?;
        if self.scenes.known_sha256(place).as_deref() != Some(sha256) {
            return Err("its scene is another one than was driven: the SHA-256 differs".to_owned());
        }
        let settings = &self.file.settings;
        let traffic = settings.traffic.as_ref().map(|traffic| &traffic.hand_over);
        let verdict = replay(Arc::clone(&scene), &settings.protocol, traffic, &recorded);
        match verdict.map_err(|error| error.to_string())? {
            Verdict::Differs(difference) => Err(difference.to_string()),
            Verdict::Same(steps) => self.results.hold(id, &recorded).map(|()| steps),
        }
    }
}

/// A line for each episode that differs, then one on all, which says of those that do not that they `are_the_same`.
fn told(
    folder: &Path,
    file: &RunFile,
    outcomes: &[(usize, Outcome)],
    are_the_same: &str,
) -> Result<Replayed, ReplayRunError> {
    let (mut text, mut same, mut steps, mut differ, mut unrecorded) = (String::new(), 0, 0_u64, 0, 0);
    for (index, outcome) in outcomes {
        match outcome {
            Outcome::Unrecorded => unrecorded += 1,
            Outcome::Same(driven) => {
                same += 1;
                steps += u64::from(*driven);
            }
            Outcome::Differs(why) => {
                differ += 1;
                // A String takes whatever is written.
                let _ = writeln!(text, "{}: {why}", file.scenes[*index].id);
            }
        }
    }
    if same + differ == 0 {
        return Err(ReplayRunError::NothingRecorded(folder.to_owned()));
    }
    let without = if unrecorded > 0 { format!(", {unrecorded} without a recording") } else { String::new() };
    let folder = folder.display();
    let _ = writeln!(text, "{folder}: {same} episodes of {steps} steps {are_the_same}, {differ} differ{without}");
    Ok(Replayed { text, is_same: differ == 0 })
}

/// The figures of `results.parquet`, by scene.
struct Results {
    rows: BTreeMap<String, usize>,
    numbers: BTreeMap<String, Vec<Option<f64>>>,
}

impl Results {
    fn read(folder: &Path) -> Result<Self, ParquetError> {
        let table = Table::read(&folder.join("results.parquet"))?;
        let rows = table.text("scene")?.into_iter().enumerate().map(|(row, scene)| (scene, row)).collect();
        Ok(Self { rows, numbers: table.numbers()? })
    }

    /// Whether they are those of the episode that is recorded.
    fn hold(&self, scene: &str, recorded: &Recorded) -> Result<(), String> {
        let row = self.rows.get(scene).ok_or("results.parquet has no row of it")?;
        for (name, value) in recorded.metrics() {
            let stored = self.numbers.get(name).and_then(|column| column.get(*row)).copied().flatten();
            if self.numbers.contains_key(name) && stored.map(f64::to_bits) != value.map(f64::to_bits) {
                let said = |value: Option<f64>| value.map_or_else(|| "null".to_owned(), |value| value.to_string());
                return Err(format!("{name}: {} in results.parquet, {} now", said(stored), said(value)));
            }
        }
        Ok(())
    }
}
