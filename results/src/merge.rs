//! The parts of a run, merged into its files when the last episode is done.

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use crate::columns::{self, Common};
use crate::digest;
use crate::earlier::{Earlier, EarlierRows, FILES};
use crate::folder::Folder;
use crate::parquet::{ParquetError, Writer};
use crate::part::Part;
use crate::settings::{RunFile, SceneLine};
use crate::trace::TraceWriter;

/// Merges the parts of a run, in the order of its scenes, into its three files, and its trace if it is under a latency, and then writes its
/// digest, which says that the run is complete. An episode without a part has the rows that it had in `earlier`. Each part is read once, and shown to `on_part` with
/// the place of its scene.
///
/// # Errors
/// [`ParquetError`] where the disk fails.
pub fn merge(
    folder: &Folder,
    file: &RunFile,
    earlier: Option<&Earlier>,
    mut on_part: impl FnMut(usize, &Part),
) -> Result<(), ParquetError> {
    let common = Common::of(&file.settings);
    let mut merged = Vec::new();
    let nothing = SceneLine::default();
    for (name, rows) in FILES.into_iter().zip(rows(common, &nothing, &Part::default())?) {
        let writer = Writer::create(&folder.file(name), rows.schema())?;
        merged.push((writer, earlier.map(|_| EarlierRows::open(folder, name)).transpose()?));
    }
    let mut trace = match common.latency {
        true => Some(TraceWriter::create(folder, earlier.is_some())?),
        false => None,
    };
    for (place, scene) in file.scenes.iter().enumerate() {
        let part = folder.part(&scene.id)?;
        if part.is_none() && earlier.is_none_or(|earlier| earlier.standing(&scene.id).is_none()) {
            return Err(ParquetError::Part(scene.id.clone()));
        }
        let new = match &part {
            Some(part) => {
                on_part(place, part);
                rows(common, scene, part)?.map(Some)
            }
            None => Default::default(),
        };
        trace.as_mut().map_or(Ok(()), |trace| trace.write(&scene.id, part.as_ref()))?;
        for ((writer, earlier), new) in merged.iter_mut().zip(new) {
            let old = earlier.as_mut().map_or(Ok(None), |earlier| earlier.take(&scene.id))?;
            new.or(old).map_or(Ok(()), |rows| writer.write(&rows))?;
        }
    }
    for (writer, earlier) in merged {
        earlier.map_or(Ok(()), EarlierRows::end)?;
        writer.commit()?;
    }
    trace.map_or(Ok(()), TraceWriter::commit)?;
    Ok(digest::write(folder.path())?)
}

/// An episode's rows in each of [`FILES`].
fn rows(common: Common<'_>, scene: &SceneLine, part: &Part) -> Result<[RecordBatch; FILES.len()], ArrowError> {
    Ok([columns::steps(common, part)?, columns::timing(scene, part)?, columns::results(common, scene, part)?])
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
        merge(&folder, &file, None, |_, _| {}).unwrap();
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
        merge(&undisturbed, &file(), None, |_, _| {}).unwrap();

        let healed = finished(roots[1].path());
        healed.remove_parts().unwrap();
        let earlier = Earlier::read(&healed).unwrap().unwrap();
        assert!(earlier.standing("a").unwrap().failed && !earlier.standing("b").unwrap().failed);
        healed.reopen().unwrap();
        assert!(!healed.is_finished());
        healed.store("a", &part("a", 4)).unwrap();
        merge(&healed, &file(), Some(&earlier), |_, _| {}).unwrap();
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
        assert_eq!(merge(&folder, &file, None, |_, _| {}).unwrap_err().to_string(), "the part of a is missing");
        assert!(!folder.is_finished());
    }
}
