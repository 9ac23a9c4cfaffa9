//! The folder that shards are written to.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use scenarios::GENERATED_TOML;
use scenarios::generated::Family;

use super::super::Failure;
use super::settings::{Settings, Written};
use super::shard::ShardFile;

/// A file of the scenes `first .. first + count` of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Shard {
    pub name: String,
    /// `None` for one of another build, in whose settings it is named.
    pub family: Option<&'static Family>,
    pub first: u32,
    pub count: u32,
}

/// A folder that holds shards of one command alone, whole ones.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    shards: Vec<Shard>,
    /// The settings' file, locked as long as it is open: nobody else generates here meanwhile.
    _lock: File,
}

impl Folder {
    /// Makes the folder where there is none, and puts the settings into it.
    ///
    /// # Errors
    /// [`Failure`] if it holds shards of other settings or unknown ones, unless `force` is given, which removes them; if
    /// somebody else generates there; if it cannot be written.
    pub fn open(path: &Path, settings: &Settings, force: bool) -> Result<Self, Failure> {
        if path.is_file() {
            return Err(Failure::NoFolder(path.into()));
        }
        let asked = settings.written()?;
        fs::create_dir_all(path).map_err(|source| Failure::write(path, source))?;
        let file_path = path.join(GENERATED_TOML);
        let failed = |source| Failure::write(&file_path, source);
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&file_path).map_err(failed)?;
        // Where locks are not to be had, two at once are the user's affair.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Failure::Busy(path.into()));
        }
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(failed)?;
        let shards = asked.shards();
        // An empty file is a new one, or one whose first command was killed before it wrote anything.
        let there = if text.is_empty() { None } else { Some(Written::parse(&text)) };
        let stale = match &there {
            None => Some(shards.clone()).filter(|_| force),
            Some(Ok(there)) => {
                let differences = there.differences(&asked);
                if !differences.is_empty() && !force {
                    return Err(Failure::OtherSettings { folder: path.into(), differences });
                }
                Some(there.shards()).filter(|_| force)
            }
            Some(Err(_)) if force => Some(shards.clone()),
            Some(Err(problem)) => return Err(Failure::BadSettings { path: file_path, problem: problem.clone() }),
        };
        stale.into_iter().flatten().try_for_each(|shard| remove(path, &shard))?;
        let unknown = shards.iter().map(|shard| path.join(&shard.name)).find(|path| there.is_none() && path.exists());
        if let Some(path) = unknown {
            return Err(Failure::Exists(path));
        }
        let asked = asked.text();
        if text != asked {
            file.rewind()
                .and_then(|()| file.set_len(0))
                .and_then(|()| file.write_all(asked.as_bytes()))
                .and_then(|()| file.sync_all())
                .map_err(failed)?;
        }
        Ok(Self { path: path.into(), shards, _lock: file })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All that there shall be.
    pub fn shards(&self) -> &[Shard] {
        &self.shards
    }

    /// Those that are not there yet.
    pub fn missing(&self) -> Vec<Shard> {
        self.shards.iter().filter(|shard| !self.path.join(&shard.name).exists()).cloned().collect()
    }

    /// The size of all shards.
    ///
    /// # Errors
    /// [`Failure`] if one is gone.
    pub fn bytes(&self) -> Result<u64, Failure> {
        let bytes = |shard: &Shard| {
            let path = self.path.join(&shard.name);
            fs::metadata(&path).map(|metadata| metadata.len()).map_err(|source| Failure::write(&path, source))
        };
        self.shards.iter().map(bytes).sum()
    }
}

/// Takes away a shard, and what a killed process may have left of it.
fn remove(folder: &Path, shard: &Shard) -> Result<(), Failure> {
    for path in [folder.join(&shard.name), ShardFile::partial(folder, &shard.name)] {
        match fs::remove_file(&path) {
            Err(source) if source.kind() != ErrorKind::NotFound => return Err(Failure::write(&path, source)),
            _ => {}
        }
    }
    Ok(())
}
