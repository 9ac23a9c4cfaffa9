//! A run's folder: begun, continued or finished; and its name.
//!
//! ```text
//! run.toml           the settings; written first
//! parts/<scene>.part one finished episode each; gone when the run is complete
//! episodes/          the recordings
//! steps.parquet, timing.parquet, results.parquet      written when all episodes are done
//! digest             of these files; written last: a run with a digest is complete
//! logs/              what the nodes said
//! .lock, .begin      held while a sim works in it, see [`crate::hold`]
//! ```

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use shard::Shard;
use thiserror::Error;

use crate::digest::DIGEST;
use crate::files::{self, FileError, at};
use crate::hold::{self, Hold};
use crate::part::Part;
use crate::settings::{RunFile, SettingsError};

/// Where runs go that have no folder given.
pub const RUNS: &str = "runs";

/// What a sim says whose folder another one holds.
pub const BUSY: &str = "another sim works in";

/// A folder that a run cannot use.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum FolderError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}: {source}", path.display())]
    RunFile { path: PathBuf, source: SettingsError },
    #[error("{} is not empty and holds no run\nhint: give another folder with --out", .0.display())]
    NotARun(PathBuf),
    #[error("{} is there and no folder, but a run is one\nhint: give another name with --out", .0.display())]
    NotAFolder(PathBuf),
    #[error("{} holds no run: there is no run.toml in it", .0.display())]
    NoRun(PathBuf),
    #[error("{busy} {}\nhint: wait for it, or give another folder with --out", .0.display(), busy = BUSY)]
    Busy(PathBuf),
    #[error("another sim drives shard {shard} of {}\nhint: wait for it, or see with `sim status` which shards nobody drives", path.display())]
    BusyShard { shard: Shard, path: PathBuf },
    #[error("{} is driven in {there} shards, not {here}\nhint: --shard I/{there}; when none of them is at work, another number can be taken",
            path.display())]
    OtherShards { path: PathBuf, there: u32, here: u32 },
    #[error("{} holds another run:\n  {}\nhint: repeat the command it was begun with, or give another folder with --out",
            path.display(), differences.join("\n  "))]
    OtherRun { path: PathBuf, differences: Vec<String> },
}

/// A run's folder, locked.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// The scenes that are driven here, if not all.
    shard: Option<Shard>,
    /// Held until the folder is dropped: two sims in one folder would take each other's parts for their own.
    hold: Arc<Hold>,
}

/// The SHA-256 of a run's scenes in their order, empty where there is none. They are read for that.
pub type Hashes<'a> = &'a dyn Fn() -> Vec<String>;

/// A folder, and how far the run in it is.
#[derive(Debug)]
pub enum Opened {
    /// Nothing was there.
    New(Folder),
    /// A run that was stopped.
    Unfinished(Folder),
    /// A complete run.
    Finished(Folder),
}

impl Folder {
    /// The folder `path` for the run `file`, whose scenes have the hashes that it says.
    ///
    /// # Errors
    /// [`FolderError`] where it holds something else.
    pub fn open(path: &Path, file: &RunFile) -> Result<Opened, FolderError> {
        Self::open_with(path, file, &|| file.scenes.iter().map(|line| line.sha256.clone()).collect())
    }

    /// The folder `path` for the run `file`. If its scenes were not read yet, but those of the run that is there were, `hashes` is asked.
    ///
    /// # Errors
    /// [`FolderError`] where it holds something else.
    pub fn open_with(path: &Path, file: &RunFile, hashes: Hashes<'_>) -> Result<Opened, FolderError> {
        create(path)?;
        refuse_other_things(path)?;
        Self { path: path.to_owned(), shard: None, hold: Arc::new(Hold::whole(path)?) }.settle(file, hashes)
    }

    /// The same for one shard of the run, beside others. A run that was begun in another number of shards, or in none, is divided anew, if
    /// nobody is at work on it.
    ///
    /// # Errors
    /// [`FolderError`] where it holds something else.
    pub fn open_shard(path: &Path, file: &RunFile, hashes: Hashes<'_>, shard: Shard) -> Result<Opened, FolderError> {
        create(path)?;
        refuse_other_things(path)?;
        let _beginning = hold::begin(path)?;
        let mut hold = Hold::shared(path)?;
        if let Some(mut there) = read_run_file(path)?
            && there.machine.shards.as_ref().map(|shards| shards.count) != Some(shard.of())
            && there.differences(file).is_empty()
        {
            if !hold.is_alone() {
                let there = there.machine.shards.map_or(1, |shards| shards.count);
                return Err(FolderError::OtherShards { path: path.to_owned(), there, here: shard.of() });
            }
            there.machine.shards.clone_from(&file.machine.shards);
            write_settings(path, &there)?;
            hold.share(path)?;
        }
        // Before anything else is there: whatever kills this now, a folder without `run.toml` is empty.
        let is_new = !path.join("run.toml").exists();
        if is_new {
            write_settings(path, file)?;
        }
        // Of a merged run no shard is at work.
        if !path.join(DIGEST).exists() {
            let parts = path.join("parts");
            fs::create_dir_all(&parts).map_err(at("create", &parts))?;
            hold.take(path, shard)?;
        }
        let folder = Self { path: path.to_owned(), shard: Some(shard), hold: Arc::new(hold) };
        Ok(match folder.settle(file, hashes)? {
            Opened::Unfinished(folder) if is_new => Opened::New(folder),
            opened => opened,
        })
    }

    /// The folder of a run that is there, and the run. Nobody works in it meanwhile.
    ///
    /// # Errors
    /// [`FolderError`] where there is no run, or somebody works in it.
    pub fn of_run(path: &Path) -> Result<(Self, RunFile), FolderError> {
        let no_run = || FolderError::NoRun(path.to_owned());
        read_run_file(path)?.ok_or_else(no_run)?;
        let folder = Self { path: path.to_owned(), shard: None, hold: Arc::new(Hold::whole(path)?) };
        let file = read_run_file(path)?.ok_or_else(no_run)?;
        Ok((folder, file))
    }

    /// Begins the run `file` in this folder, or finds how far it is.
    fn settle(self, file: &RunFile, hashes: Hashes<'_>) -> Result<Opened, FolderError> {
        let Some(there) = read_run_file(&self.path)? else {
            self.write_settings(file)?;
            self.create_subfolders()?;
            return Ok(Opened::New(self));
        };
        let differences = differences(&there, file, hashes);
        if !differences.is_empty() {
            return Err(FolderError::OtherRun { path: self.path, differences });
        }
        if self.is_finished() {
            if self.shard.is_none() {
                // Left where a merge was killed at its very end.
                self.remove_parts()?;
            }
            return Ok(Opened::Finished(self));
        }
        self.create_subfolders()?;
        Ok(Opened::Unfinished(self))
    }

    /// The folder for the run `file` among `runs`: `DRIVER-PROTOCOL-N`, the last one if it is this very run and unfinished,
    /// else the next number. With `finished`, the last one may be finished too.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn choose(runs: &Path, file: &RunFile, hashes: Hashes<'_>, finished: bool) -> Result<Opened, FolderError> {
        let stem = format!("{}-{}", file.settings.driver, file.settings.protocol.name());
        let mut number = last_number(runs, &stem)?;
        let last = runs.join(format!("{stem}-{number}"));
        if number > 0
            && (finished || !last.join(DIGEST).exists())
            && let Ok(opened) = Self::open_with(&last, file, hashes)
        {
            return Ok(opened);
        }
        loop {
            number += 1;
            let path = runs.join(format!("{stem}-{number}"));
            if path.exists() {
                continue;
            }
            match Self::open(&path, file) {
                // Another sim was faster.
                Err(FolderError::Busy(_) | FolderError::OtherRun { .. }) | Ok(Opened::Finished(_)) => {}
                opened => return opened,
            }
        }
    }

    /// The right to work there, for who holds it longer than the folder: until all of them are dropped no other sim does.
    #[must_use]
    pub fn hold(&self) -> Arc<Hold> {
        Arc::clone(&self.hold)
    }

    /// The shard that is driven here; none where all scenes are.
    #[must_use]
    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes `run.toml`: when the run is begun, and again when its scenes have all been read.
    ///
    /// # Errors
    /// [`FileError`] where the disk fails.
    pub fn write_settings(&self, file: &RunFile) -> Result<(), FileError> {
        write_settings(&self.path, file)
    }

    /// A file in it.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Where logs go: those of each shard apart.
    #[must_use]
    pub fn logs(&self) -> PathBuf {
        let logs = self.file("logs");
        self.shard.map_or_else(|| logs.clone(), |shard| logs.join(format!("shard-{}", shard.number())))
    }

    /// Where recordings go.
    #[must_use]
    pub fn episodes(&self) -> PathBuf {
        self.file("episodes")
    }

    /// Whether the run in it is complete.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.file(DIGEST).exists()
    }

    /// Makes a finished run an unfinished one, of which some episodes are to be driven again.
    ///
    /// # Errors
    /// [`FolderError`] where the disk fails.
    pub fn reopen(&self) -> Result<(), FolderError> {
        self.create_subfolders()?;
        let digest = self.file(DIGEST);
        Ok(fs::remove_file(&digest).map_err(at("remove", &digest))?)
    }

    fn create_subfolders(&self) -> Result<(), FolderError> {
        for folder in ["parts", "episodes"] {
            let folder = self.file(folder);
            fs::create_dir_all(&folder).map_err(at("create", &folder))?;
        }
        Ok(())
    }

    /// The finished episode of `scene`, if there is one. A part that cannot be read is no part.
    ///
    /// # Errors
    /// [`FileError`] where the disk fails.
    pub fn part(&self, scene: &str) -> Result<Option<Part>, FileError> {
        part_of(&self.path, scene)
    }

    /// Whether there is a part of `scene`, be it damaged.
    #[must_use]
    pub fn has_part(&self, scene: &str) -> bool {
        stored(&self.path, scene).exists()
    }

    /// Stores a finished episode.
    ///
    /// # Errors
    /// [`FileError`] where the disk fails.
    pub fn store(&self, scene: &str, part: &Part) -> Result<(), FileError> {
        let bytes = part.to_bytes();
        files::write_whole(&stored(&self.path, scene), |out| out.write_all(&bytes))
    }

    /// Removes the parts of a complete run.
    ///
    /// # Errors
    /// [`FileError`] where the disk fails.
    pub fn remove_parts(&self) -> Result<(), FileError> {
        hold::end_of_beginnings(&self.path);
        let parts = self.file("parts");
        match fs::remove_dir_all(&parts) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(at("remove", &parts)(error)),
            _ => Ok(()),
        }
    }
}

fn create(path: &Path) -> Result<(), FolderError> {
    // Also a device: whoever says /dev/null wants no folder at all, and cannot have that.
    if path.exists() && !path.is_dir() {
        return Err(FolderError::NotAFolder(path.to_owned()));
    }
    Ok(fs::create_dir_all(path).map_err(at("create", path))?)
}

fn write_settings(folder: &Path, file: &RunFile) -> Result<(), FileError> {
    let text = file.to_toml();
    files::write_whole(&folder.join("run.toml"), |out| out.write_all(text.as_bytes()))
}

/// Where the finished episode of `scene` is kept in `folder`.
pub(crate) fn stored(folder: &Path, scene: &str) -> PathBuf {
    // A suffix of its own: a scene may be called `x.partial`, as an unfinished part of the scene `x` would be.
    folder.join("parts").join(format!("{scene}.part"))
}

/// What differs between the run that is there and `file`. Scenes that were not read yet are, if nothing else does; one that could not be
/// read there may be whole by now.
fn differences(there: &RunFile, file: &RunFile, hashes: Hashes<'_>) -> Vec<String> {
    if !there.has_hashes() || file.has_hashes() || there.scenes.len() != file.scenes.len() {
        return there.differences(file);
    }
    let read = || there.scenes.iter().map(|line| line.sha256.clone());
    let beside = there.differences(&file.with_hashes(read()));
    if !beside.is_empty() {
        return beside;
    }
    let now = hashes().into_iter().zip(read()).map(|(now, then)| if then.is_empty() { then } else { now });
    there.differences(&file.with_hashes(now))
}

/// The scenes of the run in `folder` whose episodes are stored, while it is not complete.
#[must_use]
pub fn scenes_of_parts(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder.join("parts")).into_iter().flatten();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut scenes: Vec<String> = names.filter_map(|name| Some(name.strip_suffix(".part")?.to_owned())).collect();
    scenes.sort();
    scenes
}

/// The finished episode of `scene` in `folder`, while the run is not complete. A part that cannot be read is no part.
///
/// # Errors
/// [`FileError`] where the disk fails.
pub fn part_of(folder: &Path, scene: &str) -> Result<Option<Part>, FileError> {
    let bytes = files::read(&stored(folder, scene))?;
    Ok(bytes.and_then(|bytes| Part::from_bytes(&bytes, scene)))
}

/// Removes what a run left in `folder` that ended before its first episode did, unless others are at work there. Whatever else is there stays,
/// and so does the folder then.
pub fn remove_if_nothing_is_done(folder: &Path, hold: &Hold) {
    if !hold.is_alone() || !scenes_of_parts(folder).is_empty() || folder.join("results.parquet").exists() {
        return;
    }
    // Nothing of this may be there, and nothing can be done about what does not go.
    for name in ["parts", "episodes", "logs"] {
        let _ = fs::remove_dir_all(folder.join(name));
    }
    let _ = fs::remove_file(folder.join("run.toml"));
    hold::remove(folder);
    let _ = fs::remove_dir(folder);
}

/// The settings of the run in `folder`; none where there is no run.
///
/// # Errors
/// [`FolderError`] where they cannot be read.
pub fn read_run_file(folder: &Path) -> Result<Option<RunFile>, FolderError> {
    let path = folder.join("run.toml");
    let Some(bytes) = files::read(&path)? else { return Ok(None) };
    let parsed = RunFile::parse(&String::from_utf8_lossy(&bytes));
    parsed.map(Some).map_err(|source| FolderError::RunFile { path, source })
}

/// Where the run in `folder` keeps the recording of an episode, whether there is one or not.
#[must_use]
pub fn recording_of(folder: &Path, scene: &str) -> PathBuf {
    folder.join("episodes").join(format!("{scene}.mcap"))
}

/// A folder without a run must be empty, but for what a sim leaves that is killed before it has written `run.toml`.
fn refuse_other_things(path: &Path) -> Result<(), FolderError> {
    let ours = |name: &str| matches!(name, "run.toml" | "run.toml.partial") || hold::FILES.contains(&name);
    let mut entries = fs::read_dir(path).map_err(at("list", path))?;
    let other = entries.any(|entry| entry.is_ok_and(|entry| !ours(&entry.file_name().to_string_lossy())));
    if other && !path.join("run.toml").exists() { Err(FolderError::NotARun(path.to_owned())) } else { Ok(()) }
}

/// The greatest N of the folders `stem-N`; 0 where there is none.
fn last_number(runs: &Path, stem: &str) -> Result<u32, FileError> {
    let entries = match fs::read_dir(runs) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(0),
        Err(error) => return Err(at("list", runs)(error)),
    };
    let number = |name: &str| name.strip_prefix(stem)?.strip_prefix('-')?.parse().ok();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    Ok(names.filter_map(|name| number(&name)).max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::SceneLine;
    use crate::settings::Shards;
    use crate::settings::tests::run_file;
    use wire::proto::EpisodeEnd;

    fn patient(deadline_s: f64) -> RunFile {
        let mut file = run_file();
        file.settings.deadline_s = deadline_s;
        file
    }

    fn part(scene: &str) -> Part {
        Part { end: Some(EpisodeEnd { scene: scene.to_owned(), ..EpisodeEnd::default() }), ..Part::default() }
    }

    fn finish(folder: &Folder) {
        fs::write(folder.file(DIGEST), "sums").unwrap();
    }

    #[test]
    fn a_run_is_begun_continued_and_found_finished() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let file = run_file();
        let Opened::New(folder) = Folder::open(&path, &file).unwrap() else { panic!("it is new") };
        folder.store("a", &part("a")).unwrap();
        drop(folder);
        // Another number of workers is the same run.
        let mut busier = run_file();
        busier.machine.parallel = 7;
        let Opened::Unfinished(folder) = Folder::open(&path, &busier).unwrap() else { panic!("unfinished") };
        assert_eq!(folder.part("a").unwrap(), Some(part("a")));
        finish(&folder);
        drop(folder);
        let Opened::Finished(folder) = Folder::open(&path, &file).unwrap() else { panic!("it is finished") };
        assert!(!folder.file("parts").exists());
    }

    #[test]
    fn a_run_is_held_to_fingerprints_until_its_scenes_were_read_and_then_to_their_hashes() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let begun = |fingerprint: &str| {
            let mut file = run_file();
            file.scenes[0] =
                SceneLine { id: "a".to_owned(), fingerprint: Some(fingerprint.to_owned()), ..SceneLine::default() };
            file
        };
        let not_asked = || -> Vec<String> { panic!("nothing need be read for that") };
        let open = |file: &RunFile, hashes: Hashes<'_>| Folder::open_with(&path, file, hashes);
        let other_content = |opened: Result<Opened, FolderError>| {
            let Err(FolderError::OtherRun { differences, .. }) = opened else { panic!("{opened:?}") };
            assert_eq!(differences, ["scenes: a has other content"]);
        };
        assert!(matches!(open(&begun("1 byte"), &not_asked), Ok(Opened::New(_))));
        other_content(open(&begun("2 bytes"), &not_asked));
        let Ok(Opened::Unfinished(folder)) = open(&begun("1 byte"), &not_asked) else { panic!("unfinished") };
        let read = begun("1 byte").with_hashes(["00".to_owned()]);
        folder.write_settings(&read).unwrap();
        assert!(!fs::read_to_string(folder.file("run.toml")).unwrap().contains("fingerprint"));
        drop(folder);
        // All were read, and it was killed before it was finished.
        let hashes = |hash: &'static str| move || vec![hash.to_owned()];
        let Ok(Opened::Unfinished(folder)) = open(&begun("1 byte"), &hashes("00")) else { panic!("unfinished") };
        finish(&folder);
        drop(folder);
        assert!(matches!(open(&begun("2 bytes"), &hashes("00")), Ok(Opened::Finished(_))));
        other_content(open(&begun("1 byte"), &hashes("11")));
        // Where anything else differs, nothing is read.
        let mut patient = begun("1 byte");
        patient.settings.deadline_s = 9.0;
        assert!(matches!(open(&patient, &not_asked), Err(FolderError::OtherRun { .. })));
    }

    #[test]
    fn a_part_that_cannot_be_read_or_is_of_another_scene_is_no_part() {
        let root = tempfile::tempdir().unwrap();
        let Opened::New(folder) = Folder::open(root.path(), &run_file()).unwrap() else { panic!("it is new") };
        fs::write(stored(folder.path(), "a"), [0xff; 9]).unwrap();
        assert_eq!(folder.part("a").unwrap(), None);
        assert!(folder.has_part("a"));
        folder.store("a", &part("b")).unwrap();
        assert_eq!(folder.part("a").unwrap(), None);
        folder.store("a", &part("a")).unwrap();
        let mut bytes = fs::read(stored(folder.path(), "a")).unwrap();
        for at in 0..bytes.len() {
            bytes[at] ^= 0x10;
            fs::write(stored(folder.path(), "a"), &bytes).unwrap();
            assert_eq!(folder.part("a").unwrap(), None, "byte {at}");
            bytes[at] ^= 0x10;
        }
        assert_eq!(scenes_of_parts(root.path()), ["a"]);
        assert_eq!((part_of(root.path(), "a").unwrap(), part_of(root.path(), "b").unwrap()), (None, None));
        assert_eq!(folder.part("never driven").unwrap(), None);
        assert!(!folder.has_part("never driven"));
    }

    #[test]
    fn scenes_whose_names_differ_by_a_suffix_do_not_meet() {
        let root = tempfile::tempdir().unwrap();
        let Opened::New(folder) = Folder::open(root.path(), &run_file()).unwrap() else { panic!("it is new") };
        for scene in ["a.partial", "a.part.partial", "a.part", "a"] {
            folder.store(scene, &part(scene)).unwrap();
        }
        for scene in ["a.partial", "a.part.partial", "a.part", "a"] {
            assert_eq!(folder.part(scene).unwrap(), Some(part(scene)), "{scene}");
        }
    }

    #[test]
    fn a_folder_is_refused_while_another_sim_holds_it_or_if_it_holds_something_else() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let _held = Folder::open(&path, &run_file()).unwrap();
        assert!(matches!(Folder::open(&path, &run_file()), Err(FolderError::Busy(_))));
        assert!(hold::is_busy(&path));
        drop(_held);
        assert!(!hold::is_busy(&path) && !hold::is_busy(&root.path().join("nowhere")));
        assert!(matches!(Folder::open(&path, &patient(1.0)), Err(FolderError::OtherRun { .. })));
        let diary = root.path().join("diary");
        fs::create_dir(&diary).unwrap();
        fs::write(diary.join("today.txt"), "rain").unwrap();
        assert!(matches!(Folder::open(&diary, &run_file()), Err(FolderError::NotARun(_))));
        assert!(matches!(Folder::open(&diary.join("today.txt"), &run_file()), Err(FolderError::NotAFolder(_))));
        fs::write(path.join("run.toml"), "settings = 7").unwrap();
        assert!(matches!(Folder::open(&path, &run_file()), Err(FolderError::RunFile { .. })));
    }

    #[test]
    fn a_run_without_an_episode_leaves_nothing_and_nothing_else_is_touched() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let new = || match Folder::open(&path, &run_file()).unwrap() {
            Opened::New(folder) => folder,
            other => panic!("it is new: {other:?}"),
        };
        remove_if_nothing_is_done(&path, &new().hold());
        assert!(!path.exists());

        let folder = new();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        remove_if_nothing_is_done(&path, &folder.hold());
        assert!(path.join("notes.txt").exists() && !path.join("run.toml").exists());

        fs::remove_file(path.join("notes.txt")).unwrap();
        drop(folder);
        let folder = new();
        folder.store("a", &part("a")).unwrap();
        remove_if_nothing_is_done(&path, &folder.hold());
        assert_eq!(folder.part("a").unwrap(), Some(part("a")));
    }

    /// The run of three scenes, in so many shards.
    fn sharded(of: u32) -> RunFile {
        let mut file = run_file();
        file.scenes = ["a", "b", "c"].map(|id| SceneLine { id: id.to_owned(), ..SceneLine::default() }).to_vec();
        file.machine.shards = Some(Shards { count: of, sha256: file.identity(), command: Vec::new() });
        file
    }

    fn open_shard(path: &Path, shard: &str) -> Result<Opened, FolderError> {
        let shard: Shard = shard.parse().unwrap();
        Folder::open_shard(path, &sharded(shard.of()), &Vec::new, shard)
    }

    #[test]
    fn shards_are_at_work_side_by_side_each_once_and_nobody_else_is() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let Ok(Opened::New(_first)) = open_shard(&path, "1/2") else { panic!("it is new") };
        let Ok(Opened::Unfinished(second)) = open_shard(&path, "2/2") else { panic!("the first began it") };
        assert!(matches!(open_shard(&path, "2/2"), Err(FolderError::BusyShard { .. })));
        assert!(matches!(open_shard(&path, "1/3"), Err(FolderError::OtherShards { there: 2, here: 3, .. })));
        assert!(matches!(Folder::open(&path, &sharded(2)), Err(FolderError::Busy(_))));
        assert!(matches!(Folder::of_run(&path), Err(FolderError::Busy(_))));
        assert!(hold::is_at_work(&path, "2/2".parse().unwrap()));
        drop(second);
        assert!(!hold::is_at_work(&path, "2/2".parse().unwrap()));
        assert!(open_shard(&path, "2/2").is_ok());
    }

    #[test]
    fn a_shard_touches_no_folder_of_others_and_begins_where_another_was_killed_at_any_moment() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("today.txt"), "rain").unwrap();
        assert!(matches!(open_shard(root.path(), "1/2"), Err(FolderError::NotARun(_))));
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
        let path = root.path().join("run");
        fs::create_dir(&path).unwrap();
        for left in [".begin", ".lock", "run.toml.partial"] {
            fs::write(path.join(left), "").unwrap();
        }
        assert!(matches!(open_shard(&path, "1/2"), Ok(Opened::New(_))));
    }

    #[test]
    fn a_run_is_divided_anew_when_nobody_is_at_work_on_it() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        drop(Folder::open(&path, &sharded(2)).unwrap());
        drop(open_shard(&path, "1/2").unwrap());
        let _first = open_shard(&path, "1/3").unwrap();
        let _other = open_shard(&path, "3/3").unwrap();
        assert_eq!(read_run_file(&path).unwrap().unwrap().machine.shards.unwrap().count, 3);
    }

    #[test]
    fn a_shard_that_does_nothing_leaves_nothing_if_it_is_the_last() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let (Ok(Opened::New(first)), Ok(Opened::Unfinished(second))) =
            (open_shard(&path, "1/2"), open_shard(&path, "2/2"))
        else {
            panic!("both are at work")
        };
        remove_if_nothing_is_done(&path, &first.hold());
        drop(first);
        assert!(path.join("run.toml").exists());
        remove_if_nothing_is_done(&path, &second.hold());
        assert!(!path.exists());
    }

    #[test]
    fn a_run_without_a_folder_continues_its_last_one_or_takes_the_next_number() {
        let root = tempfile::tempdir().unwrap();
        let choose = |file: &RunFile| match Folder::choose(root.path(), file, &Vec::new, false).unwrap() {
            Opened::New(folder) => (folder, "new"),
            Opened::Unfinished(folder) => (folder, "unfinished"),
            Opened::Finished(folder) => (folder, "finished"),
        };
        let name = |folder: &Folder| folder.path().file_name().unwrap().to_string_lossy().into_owned();
        let mut human = run_file();
        human.settings.driver = "human".to_owned();
        let (first, state) = choose(&run_file());
        assert_eq!((&*name(&first), state), ("idm-strict-1", "new"));
        let (second, state) = choose(&run_file());
        assert_eq!((&*name(&second), state), ("idm-strict-2", "new"), "the first is at work");
        drop((first, second));
        let (again, state) = choose(&run_file());
        assert_eq!((&*name(&again), state), ("idm-strict-2", "unfinished"));
        finish(&again);
        drop(again);
        assert_eq!(name(&choose(&run_file()).0), "idm-strict-3");
        assert_eq!(name(&choose(&patient(1.0)).0), "idm-strict-4", "the third is another run");
        assert_eq!(name(&choose(&human).0), "human-strict-1");
        finish(&choose(&human).0);
        let Opened::Finished(folder) = Folder::choose(root.path(), &human, &Vec::new, true).unwrap() else {
            panic!("finished")
        };
        assert_eq!(name(&folder), "human-strict-1");
    }
}
