//! Who works in a run's folder: one sim, or several shards. Locks of the file system, so that a killed process holds nothing; across hosts they hold where the
//! shared file system has them (NFS 4, Lustre with `flock`, CephFS, BeeGFS with its setting).

use std::fs::{self, File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

use shard::Shard;

use crate::files::{FileError, at};
use crate::folder::FolderError;

/// Held by the sim that has a folder for itself, and shared by shards.
const LOCK: &str = ".lock";

/// Held by a shard for as long as it looks whether the run was begun, and begins it.
const BEGINNING: &str = ".begin";

/// Files of this module that may be in a folder before its `run.toml`.
pub(crate) const FILES: [&str; 2] = [LOCK, BEGINNING];

/// The right to work in a folder, until it is dropped.
#[derive(Debug)]
pub struct Hold {
    lock: File,
    shard: Option<File>,
}

impl Hold {
    /// Takes the whole folder.
    ///
    /// # Errors
    /// [`FolderError::Busy`] where anybody works in it.
    pub fn whole(folder: &Path) -> Result<Self, FolderError> {
        let path = folder.join(LOCK);
        let lock = open(&path)?;
        taken(lock.try_lock(), &path, || FolderError::Busy(folder.to_owned()))?;
        Ok(Self { lock, shard: None })
    }

    /// Takes it beside others who do so too.
    ///
    /// # Errors
    /// [`FolderError::Busy`] where somebody has the whole folder.
    pub(crate) fn shared(folder: &Path) -> Result<Self, FolderError> {
        let hold = Self { lock: open(&folder.join(LOCK))?, shard: None };
        hold.share(folder).map(|()| hold)
    }

    /// Takes one shard of it, for itself.
    ///
    /// # Errors
    /// [`FolderError::BusyShard`] where somebody has it.
    pub(crate) fn take(&mut self, folder: &Path, shard: Shard) -> Result<(), FolderError> {
        let path = path_of(folder, shard);
        let own = self.shard.insert(open(&path)?);
        taken(own.try_lock(), &path, || FolderError::BusyShard { shard, path: folder.to_owned() })
    }

    /// Whether nobody else is at work there; then nobody will be as long as this is held. Where somebody is, this holds the folder no
    /// longer: the system may take a lock away that cannot be made stronger.
    pub(crate) fn is_alone(&self) -> bool {
        self.lock.try_lock().is_ok()
    }

    /// Lets other shards in again.
    pub(crate) fn share(&self, folder: &Path) -> Result<(), FolderError> {
        taken(self.lock.try_lock_shared(), &folder.join(LOCK), || FolderError::Busy(folder.to_owned()))
    }
}

/// Waits until no other shard begins a run there. While this is held none does.
pub(crate) fn begin(folder: &Path) -> Result<File, FileError> {
    let path = folder.join(BEGINNING);
    let file = open(&path)?;
    file.lock().map_err(at("lock", &path))?;
    Ok(file)
}

/// Removes what shards begin by, when there are none any more.
pub(crate) fn end_of_beginnings(folder: &Path) {
    let _ = fs::remove_file(folder.join(BEGINNING));
}

/// Whether a sim has `folder` for itself now.
#[must_use]
pub fn is_busy(folder: &Path) -> bool {
    is_held(&folder.join(LOCK))
}

/// Whether a process is at work on this shard now.
#[must_use]
pub fn is_at_work(folder: &Path, shard: Shard) -> bool {
    is_held(&path_of(folder, shard))
}

/// Removes what is left when nobody works there any more.
pub(crate) fn remove(folder: &Path) {
    for name in FILES {
        let _ = fs::remove_file(folder.join(name));
    }
}

fn path_of(folder: &Path, shard: Shard) -> PathBuf {
    folder.join("parts").join(format!("shard-{}-of-{}.lock", shard.number(), shard.of()))
}

/// Opened, not made: who looks leaves nothing.
fn is_held(path: &Path) -> bool {
    let lock = File::open(path);
    lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// For reading and writing: over NFS a shared lock wants the one, and a whole one the other.
fn open(path: &Path) -> Result<File, FileError> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).open(path).map_err(at("create", path))
}

fn taken(locked: Result<(), TryLockError>, path: &Path, busy: impl FnOnce() -> FolderError) -> Result<(), FolderError> {
    match locked {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(busy()),
        Err(TryLockError::Error(error)) => Err(at("lock", path)(error).into()),
    }
}
