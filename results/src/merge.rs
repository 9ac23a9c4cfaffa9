//! The parts of a run, merged into its files when the last episode is done.

use std::sync::mpsc::sync_channel;
use std::thread;

use arrow_array::RecordBatch;
use rayon::prelude::*;

use crate::columns::{self, Common};
use crate::digest;
use crate::earlier::{Earlier, EarlierRows, FILES};
use crate::files::FileError;
use crate::folder::Folder;
use crate::parquet::{ParquetError, Writer};
use crate::part::Part;
use crate::settings::{RunFile, SceneLine};
use crate::trace::TraceWriter;

/// Episodes that are read side by side, while those before them are written.
const TOGETHER: usize = 8;

/// Merges the parts of a run, in the order of its scenes, into its three files, and its trace if it is under a latency, and then writes its
/// digest, which says that the run is complete; before it `run.toml`, with the scenes' SHA-256, where those were not known. An episode without a
/// part has the rows that it had in `earlier`. Each part is read once, and shown to `takes` with the place of its scene, which says whether it is one.
///
/// # Errors
/// [`ParquetError`] where the disk fails, or there is no part of a scene.
pub fn merge(
    folder: &Folder,
    file: &RunFile,
    earlier: Option<&Earlier>,
    mut takes: impl FnMut(usize, &Part) -> bool,
) -> Result<(), ParquetError> {
    let common = Common::of(&file.settings);
    let mut merged = Vec::new();
    for (name, rows) in FILES.into_iter().zip(rows(common, &[])?) {
        let writer = Writer::create(&folder.file(name), rows.schema())?;
        merged.push((writer, earlier.map(|_| EarlierRows::open(folder, name)).transpose()?));
    }
    let mut trace = match common.latency {
        true => Some(TraceWriter::create(folder, earlier.is_some())?),
        false => None,
    };
    let mut hashes = Vec::with_capacity(file.scenes.len());
    thread::scope(|scope| {
        let (read, stretches) = sync_channel(0);
        scope.spawn(move || {
            for scenes in file.scenes.chunks(TOGETHER) {
                if read.send(Stretch::read(folder, common, scenes)).is_err() {
                    return;
                }
            }
        });
        for stretch in stretches {
            let Stretch { episodes, rows, lengths } = stretch?;
            for (line, part) in &episodes {
                let part = part.as_ref().filter(|part| takes(hashes.len(), part));
                if part.is_none() && earlier.is_none_or(|earlier| earlier.standing(&line.id).is_none()) {
                    return Err(ParquetError::Part(line.id.clone()));
                }
                hashes.push(line.sha256.clone());
                trace.as_mut().map_or(Ok(()), |trace| trace.write(&line.id, part))?;
            }
            for (((writer, earlier), rows), lengths) in merged.iter_mut().zip(rows).zip(lengths) {
                let Some(earlier) = earlier else {
                    writer.write_pieces(rows, lengths)?;
                    continue;
                };
                let mut pieces = lengths.into_iter().scan(0, |end, length| {
                    *end += length;
                    Some(rows.slice(*end - length, length))
                });
                for (line, part) in &episodes {
                    let old = earlier.take(&line.id)?;
                    let new = part.as_ref().and_then(|_| pieces.next());
                    new.or(old).map_or(Ok(()), |rows| writer.write(&rows))?;
                }
            }
        }
        Ok(())
    })?;
    let mut writers = Vec::with_capacity(merged.len());
    for (writer, earlier) in merged {
        earlier.map_or(Ok(()), EarlierRows::end)?;
        writers.push(writer);
    }
    // The first is as large as it gets, and the disk slow: the others are encoded meanwhile, one after the other, for their memory.
    let others = writers.split_off(1);
    let commit = |writers: Vec<Writer>| writers.into_iter().try_for_each(Writer::commit);
    let (first, others) = rayon::join(|| commit(writers), || commit(others));
    first.and(others)?;
    trace.map_or(Ok(()), TraceWriter::commit)?;
    if !file.has_hashes() {
        folder.write_settings(&file.with_hashes(hashes))?;
    }
    Ok(digest::write(folder.path())?)
}

/// Scenes that follow each other in a run.
struct Stretch {
    /// The scenes, with their SHA-256 as far as it is known, and the parts that there are of them.
    episodes: Vec<(SceneLine, Option<Part>)>,
    /// The rows of those in each of [`FILES`].
    rows: [RecordBatch; FILES.len()],
    /// How many are of each.
    lengths: [Vec<usize>; FILES.len()],
}

impl Stretch {
    fn read(folder: &Folder, common: Common<'_>, scenes: &[SceneLine]) -> Result<Self, ParquetError> {
        let read = |scene: &SceneLine| {
            let (part, mut line) = (folder.part(&scene.id)?, scene.clone());
            if let (Some(part), Some(_)) = (&part, line.fingerprint.take()) {
                line.sha256.clone_from(&part.scene_sha256);
            }
            Ok((line, part))
        };
        let episodes: Result<Vec<_>, FileError> = scenes.par_iter().map(read).collect();
        let episodes = episodes?;
        let driven: Vec<_> = episodes.iter().filter_map(|(line, part)| Some((line, part.as_ref()?))).collect();
        let (rows, ones) = (rows(common, &driven)?, vec![1; driven.len()]);
        let steps = driven.iter().map(|(_, part)| part.records.len()).collect();
        Ok(Self { rows, lengths: [steps, ones.clone(), ones], episodes })
    }
}

fn rows(common: Common<'_>, driven: &[columns::Episode<'_>]) -> Result<[RecordBatch; FILES.len()], ParquetError> {
    Ok([columns::steps(common, driven)?, columns::timing(common, driven)?, columns::results(common, driven)?])
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::digest::digest;
    use crate::folder::Opened;
    use crate::parquet::Table;
    use crate::part;
    use crate::settings::tests::run_file;
    use wire::proto::{AgentState, EndReason, EpisodeEnd, Metric, StepRecord};

    fn part(scene: &str, steps: u32) -> Part {
        let metrics = vec![Metric { name: "progress_m".to_owned(), value: Some(f64::from(steps)) }];
        let reason = if steps > 0 { EndReason::Horizon } else { EndReason::DriverFailed };
        let end = EpisodeEnd { scene: scene.to_owned(), reason: reason.into(), metrics, ..EpisodeEnd::default() };
        let av = Some(AgentState { x: 1.0, ..AgentState::default() });
        let records = (0..steps).map(|step| StepRecord { step, av, ..StepRecord::default() }).collect();
        let logged = (0..steps).map(|step| part::LoggedState { state: (step < 2).then_some(av).flatten() }).collect();
        Part { end: Some(end), records, logged, ..Part::default() }
    }

    fn file() -> RunFile {
        let scene = |id: &str| SceneLine { id: id.to_owned(), sha256: format!("hash of {id}"), fingerprint: None };
        RunFile { scenes: vec![scene("b"), scene("a")], ..run_file() }
    }

    /// A finished run of two episodes, one of which failed.
    fn finished(root: &Path) -> Folder {
        let file = file();
        let Ok(Opened::New(folder)) = Folder::open(root, &file) else { panic!("it is new") };
        // Stored in another order than the scenes have.
        folder.store("a", &part("a", 0)).unwrap();
        folder.store("b", &part("b", 3)).unwrap();
        merge(&folder, &file, None, |_, _| true).unwrap();
        folder
    }

    #[test]
    fn rows_are_in_the_order_of_the_scenes_and_read_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = finished(root.path());
        let results = Table::read(&folder.file("results.parquet")).unwrap();
        assert_eq!(results.text("scene").unwrap(), ["b", "a"]);
        assert_eq!(results.text("scene_sha256").unwrap(), ["hash of b", "hash of a"]);
        assert_eq!(results.text("end_reason").unwrap(), ["horizon", "driver-failed"]);
        assert_eq!(results.flags("failed").unwrap(), [false, true]);
        assert_eq!(results.numbers().unwrap()["progress_m"], [Some(3.0), Some(0.0)]);
        assert_eq!(results.numbers().unwrap()["nuplan_score"], [None, None]);
        let steps = Table::read(&folder.file("steps.parquet")).unwrap();
        assert_eq!(steps.text("scene").unwrap(), ["b", "b", "b"]);
        assert_eq!(steps.numbers().unwrap()["human_x_m"], [Some(1.0), Some(1.0), None]);
        let summary = crate::summary::Summary::read(root.path()).unwrap();
        assert_eq!((summary.counted(), summary.mean("progress_m")), (1, Some((3.0, 1))));
    }

    #[test]
    fn the_same_rows_are_the_same_bytes_and_hold_no_clock() {
        let roots = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let digests = roots.each_ref().map(|root| {
            let folder = finished(root.path());
            digest(folder.path()).unwrap()
        });
        assert_eq!(digests[0], digests[1]);
        let bytes = std::fs::read(roots[0].path().join("results.parquet")).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains("reloop") && !text.contains("parquet-rs"), "the writer's version changes the bytes");
    }

    #[test]
    fn an_episode_driven_again_gives_the_files_that_it_would_have_given_at_once() {
        let roots = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let undisturbed = finished(roots[0].path());
        undisturbed.store("a", &part("a", 4)).unwrap();
        merge(&undisturbed, &file(), None, |_, _| true).unwrap();

        let healed = finished(roots[1].path());
        healed.remove_parts().unwrap();
        let earlier = Earlier::read(&healed).unwrap().unwrap();
        assert!(earlier.standing("a").unwrap().failed && !earlier.standing("b").unwrap().failed);
        healed.reopen().unwrap();
        assert!(!healed.is_finished());
        healed.store("a", &part("a", 4)).unwrap();
        merge(&healed, &file(), Some(&earlier), |_, _| true).unwrap();
        for name in ["results.parquet", "steps.parquet", "timing.parquet", "digest"] {
            assert!(
                fs::read(healed.file(name)).unwrap() == fs::read(undisturbed.file(name)).unwrap(),
                "{name} differs"
            );
        }
    }

    #[test]
    fn a_missing_part_is_named_and_leaves_no_results() {
        let root = tempfile::tempdir().unwrap();
        let scenes = vec![SceneLine { id: "a".to_owned(), ..SceneLine::default() }];
        let file = RunFile { scenes, ..run_file() };
        let Ok(Opened::New(folder)) = Folder::open(root.path(), &file) else { panic!("it is new") };
        assert_eq!(merge(&folder, &file, None, |_, _| true).unwrap_err().to_string(), "the part of a is missing");
        assert!(!folder.is_finished());
    }
}
