//! Windows by number, out of one file or several.
//!
//! Read where they lie, each when it is asked for: what was read once stays in the system's page cache, which all processes share, as a
//! mapping of the file would. It is no mapping, because a mapped file that another process cuts or changes meanwhile ends the program or
//! changes memory under it, and that no checksum can catch.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::codec;
use super::error::{FileProblem, WindowsError};
use super::head::{Head, PREFIX, Place, SceneRecord};
use super::recipe::Recipe;
use super::split::Role;
use super::window::Window;

/// Examples to learn from, by number; from many threads.
#[derive(Debug)]
pub struct Windows {
    files: Vec<WindowsFile>,
    recipe: Recipe,
    training: Vec<usize>,
    validation: Vec<usize>,
}

/// What a window is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// The scene's id.
    pub scene: &'a str,
    /// The step of the log that is now.
    pub step: u32,
    /// The track that is driven here as the AV.
    pub av: i32,
    /// What the scene is for.
    pub role: Role,
}

/// One file.
#[derive(Debug)]
pub(super) struct WindowsFile {
    path: PathBuf,
    source: Source,
    pub head: Head,
    /// Number of its first piece among those of all files.
    pub first: usize,
}

#[derive(Debug)]
enum Source {
    File(File),
    Memory(Vec<u8>),
}

impl Windows {
    /// Opens a file that `trainer prepare` wrote; reads its head alone.
    ///
    /// # Errors
    /// [`WindowsError`] where it cannot be read, or its head is not whole.
    pub fn open(path: &Path) -> Result<Self, WindowsError> {
        Self::of(vec![WindowsFile::open(path)?])
    }

    /// Opens several files as one: their windows one after another.
    ///
    /// # Errors
    /// [`WindowsError`]; also where their features are not the same authors', or where a scene trains in one and validates in another.
    pub fn open_all(paths: &[PathBuf]) -> Result<Self, WindowsError> {
        let files: Result<Vec<WindowsFile>, WindowsError> = paths.iter().map(|path| WindowsFile::open(path)).collect();
        Self::of(files?)
    }

    /// The same of bytes in memory.
    ///
    /// # Errors
    /// [`WindowsError`] where the head is not whole.
    pub fn of_bytes(bytes: Vec<u8>) -> Result<Self, WindowsError> {
        let path = PathBuf::from("(memory)");
        let size = bytes.len() as u64;
        Self::of(vec![WindowsFile::new(path, Source::Memory(bytes), size)?])
    }

    fn of(mut files: Vec<WindowsFile>) -> Result<Self, WindowsError> {
        let recipes: Vec<Recipe> = files.iter().map(WindowsFile::recipe).collect::<Result<_, _>>()?;
        let Some(&recipe) = recipes.first() else { return Err(WindowsError::NoFile) };
        if let Some(other) = recipes.iter().position(|other| other.features != recipe.features) {
            let paths = Box::new([files[0].path.clone(), files[other].path.clone()]);
            return Err(WindowsError::OtherFeatures { paths });
        }
        let all = number(&mut files)?;
        let of = |role: Role| all.iter().filter(|(_, own)| *own == role).map(|(index, _)| *index).collect();
        let (training, validation) = (of(Role::Training), of(Role::Validation));
        let mut windows = Self { files, recipe, training, validation };
        // Means over batches depend on which windows share one: the order is that of the scenes' ids, wherever they came from.
        let mut validation = std::mem::take(&mut windows.validation);
        validation
            .sort_by_cached_key(|index| windows.entry(*index).map(|it| (it.scene.to_owned(), it.step, it.av)).ok());
        windows.validation = validation;
        Ok(windows)
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.training.len() + self.validation.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How they were cut; of several files the first's, whose features are those of all.
    #[must_use]
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Numbers of those to learn from, ascending.
    #[must_use]
    pub fn training(&self) -> &[usize] {
        &self.training
    }

    /// Numbers of those that tell how well was learned, by the ids of their scenes, and in each by time.
    #[must_use]
    pub fn validation(&self) -> &[usize] {
        &self.validation
    }

    /// The scenes that they were cut out of.
    pub fn scenes(&self) -> impl Iterator<Item = &SceneRecord> {
        self.files.iter().flat_map(|file| &file.head.scenes)
    }

    /// A hash (SHA-256, in hex) that tells this set from any other: of the files' heads, which have a checksum of each window.
    #[must_use]
    pub fn digest(&self) -> String {
        digest(&self.files)
    }

    /// What window `index` is of; nothing is read.
    ///
    /// # Errors
    /// [`WindowsError::Index`].
    pub fn entry(&self, index: usize) -> Result<Entry<'_>, WindowsError> {
        let (file, place) = self.place(index)?;
        let SceneRecord { id, role, .. } = &file.head.scenes[place.scene as usize];
        Ok(Entry { scene: id, step: place.step, av: place.av, role: *role })
    }

    /// Window `index`.
    ///
    /// # Errors
    /// [`WindowsError`] where there is none, it cannot be read, or is not what was written.
    pub fn get(&self, index: usize) -> Result<Window, WindowsError> {
        let (file, place) = self.place(index)?;
        let bytes = file.payload(index - file.first)?;
        let scene = &file.head.scenes[place.scene as usize].id;
        codec::decode(&bytes, scene, place.step, place.av).map_err(|problem| file.problem(index - file.first, problem))
    }

    fn place(&self, index: usize) -> Result<(&WindowsFile, &Place), WindowsError> {
        let file = self.files.partition_point(|file| file.first <= index).checked_sub(1).map(|at| &self.files[at]);
        let found = file.and_then(|file| Some((file, file.head.places.get(index - file.first)?)));
        found.ok_or(WindowsError::Index { index, windows: self.len() })
    }
}

impl WindowsFile {
    pub fn open(path: &Path) -> Result<Self, WindowsError> {
        let io = |source| WindowsError::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let size = file.metadata().map_err(io)?.len();
        Self::new(path.into(), Source::File(file), size)
    }

    fn new(path: PathBuf, source: Source, size: u64) -> Result<Self, WindowsError> {
        let problem = |problem| WindowsError::File { path: path.clone(), problem };
        let read = |offset, length| source.read(&path, offset, length);
        let start = read(0, PREFIX.min(usize::try_from(size).unwrap_or(PREFIX)))?;
        let (length, checksum) = Head::prefix(&start).map_err(problem)?;
        if ((PREFIX + length) as u64) > size {
            return Err(problem(FileProblem::CutShort));
        }
        let head = Head::parse(&read(PREFIX as u64, length)?, checksum, size).map_err(problem)?;
        Ok(Self { path, source, head, first: 0 })
    }

    /// How its pieces were cut.
    pub fn recipe<R: DeserializeOwned>(&self) -> Result<R, WindowsError> {
        let problem = |error: toml::de::Error| FileProblem::Settings(error.to_string());
        toml::from_str(&self.head.settings).map_err(|error| self.told(problem(error)))
    }

    /// What is wrong with the file.
    pub fn told(&self, problem: FileProblem) -> WindowsError {
        WindowsError::File { path: self.path.clone(), problem }
    }

    /// The bytes of its window `number`, which are those that were written.
    pub fn payload(&self, number: usize) -> Result<Vec<u8>, WindowsError> {
        let place = &self.head.places[number];
        let bytes = self.source.read(&self.path, place.offset, place.length as usize)?;
        if crc32fast::hash(&bytes) == place.checksum {
            Ok(bytes)
        } else {
            Err(self.problem(number, FileProblem::Checksum))
        }
    }

    pub fn problem(&self, number: usize, problem: FileProblem) -> WindowsError {
        let place = &self.head.places[number];
        let scene = self.head.scenes[place.scene as usize].id.clone();
        WindowsError::Window { path: self.path.clone(), index: self.first + number, scene, step: place.step, problem }
    }
}

/// Numbers the pieces of several files one after another, and tells each one's role.
///
/// # Errors
/// [`WindowsError`] where a scene trains in one file and validates in another.
pub(super) fn number(files: &mut [WindowsFile]) -> Result<Vec<(usize, Role)>, WindowsError> {
    let (mut all, mut roles) = (Vec::new(), BTreeMap::new());
    for file in files {
        for scene in &file.head.scenes {
            if *roles.entry(scene.id.clone()).or_insert(scene.role) != scene.role {
                return Err(WindowsError::BothRoles { scene: scene.id.clone(), path: file.path.clone() });
            }
        }
        file.first = all.len();
        for place in &file.head.places {
            all.push((all.len(), file.head.scenes[place.scene as usize].role));
        }
    }
    Ok(all)
}

/// A hash (SHA-256, in hex) of what the files hold: their heads have a checksum of each piece.
pub(super) fn digest(files: &[WindowsFile]) -> String {
    let mut hash = Sha256::new();
    files.iter().for_each(|file| hash.update(file.head.write()));
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Source {
    fn read(&self, path: &Path, offset: u64, length: usize) -> Result<Vec<u8>, WindowsError> {
        match self {
            Self::File(file) => {
                // Within the file's size by its head.
                let mut bytes = vec![0; length];
                let read = file.read_exact_at(&mut bytes, offset);
                read.map(|()| bytes).map_err(|source| WindowsError::Io { path: path.into(), source })
            }
            Self::Memory(bytes) => {
                let from = usize::try_from(offset).ok();
                let found = from.and_then(|from| bytes.get(from..from.checked_add(length)?));
                let cut_short = || WindowsError::File { path: path.into(), problem: FileProblem::CutShort };
                found.map(<[u8]>::to_vec).ok_or_else(cut_short)
            }
        }
    }
}
