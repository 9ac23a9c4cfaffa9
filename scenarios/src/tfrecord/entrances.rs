//! Where a packed file can be entered.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Packing, Restart, Unpack};

/// A packed file can be entered about every so many unpacked bytes: 4 MiB, some 10 ms of unpacking.
const APART_BYTES: u64 = 4 << 20;

/// Places from which a packed file can be unpacked, in its order: its beginning, and whatever was passed since.
pub struct Entrances {
    packing: Packing,
    /// Never empty.
    known: Mutex<Vec<Arc<Restart>>>,
}

impl Entrances {
    /// The beginning alone.
    #[must_use]
    pub fn of(packing: Packing) -> Self {
        Self { packing, known: Mutex::new(vec![Arc::new(Restart::beginning(packing))]) }
    }

    /// How the file is packed.
    #[must_use]
    pub fn packing(&self) -> Packing {
        self.packing
    }

    /// Keeps the place that `source` has been read up to, if it is far behind all that are known.
    pub fn pass<R: Read>(&self, source: &Unpack<R>) {
        let mut known = self.known();
        let last = known.last().map_or(0, |last| last.unpacked());
        if source.unpacked() >= last + APART_BYTES {
            known.push(Arc::new(source.restart()));
        }
    }

    /// The last place known from which `offset` bytes of what it unpacks to can be come to.
    #[must_use]
    pub fn before(&self, offset: u64) -> Arc<Restart> {
        let known = self.known();
        let behind = known.partition_point(|known| known.unpacked() <= offset);
        Arc::clone(&known[behind.saturating_sub(1)])
    }

    /// The file at `path` where it has unpacked to `offset` bytes, or ends before.
    ///
    /// # Errors
    /// Where it cannot be read, or is no such stream any more.
    pub fn enter(&self, path: &Path, offset: u64) -> io::Result<Unpack<File>> {
        let entrance = self.before(offset);
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(entrance.byte()))?;
        let mut source = Unpack::from(file, &entrance);
        while let left @ 1.. = offset.saturating_sub(source.unpacked()) {
            if io::copy(&mut source.by_ref().take(left.min(APART_BYTES)), &mut io::sink())? == 0 {
                break;
            }
            self.pass(&source);
        }
        Ok(source)
    }

    fn known(&self) -> MutexGuard<'_, Vec<Arc<Restart>>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Entrances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} with {} entrances", self.packing, self.known().len())
    }
}
