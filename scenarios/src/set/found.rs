//! What is found in the inputs of a set, before it is one.

use std::fmt;
use std::path::PathBuf;

use world::scene::SceneId;

use super::entry::SceneEntry;
use crate::error::{RecordError, SetError};
use crate::source::Source;

/// Scenes, records that give none, and what is to be said of both.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub entries: Vec<SceneEntry>,
    pub bad: Vec<RecordError>,
    pub notes: Vec<Note>,
}

/// Something that was done about the inputs and that a person should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Note {
    /// Files were passed over: their names say that they hold no scenes.
    PassedOver {
        /// The folder that was searched, or the glob.
        input: PathBuf,
        /// Their names.
        files: Vec<String>,
    },
    /// Records are there more than once with the same bytes, and count once.
    Repeated {
        /// How many records do not count.
        records: usize,
        /// The first of them.
        id: SceneId,
        /// Where it counts.
        first: Source,
        /// Where it does not.
        second: Source,
    },
    /// `exclude` names ids that no scene has.
    NothingExcluded {
        /// The scene-set TOML.
        path: PathBuf,
        /// The ids.
        ids: Vec<String>,
    },
    /// A database's index names files that are not there.
    NotThere {
        /// The index.
        index: PathBuf,
        /// The files, from its folder on.
        files: Vec<String>,
    },
    /// A database's index names nothing that is there: all pickles around it are taken instead.
    UselessIndex {
        /// The index.
        index: PathBuf,
    },
    /// The word `demo` means the built-in set, though there is a file or folder of that name.
    DemoIsBuiltIn,
}

/// So many names are spelled out.
const SHOWN_NAMES: usize = 3;

struct Names<'a>(&'a [String]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files = self.0;
        f.write_str(&files[..files.len().min(SHOWN_NAMES)].join(", "))?;
        match files.len().saturating_sub(SHOWN_NAMES) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PassedOver { input, files } => {
                write!(f, "{}: passed over {}", input.display(), Names(files))
            }
            Self::NotThere { index, files } => {
                write!(f, "{}: names files that are not there: {}", index.display(), Names(files))
            }
            Self::UselessIndex { index } => {
                write!(f, "{}: no file that it names is there; all pickles of its folder are taken", index.display())
            }
            Self::Repeated { records: 1, id, first, second } => {
                write!(f, "the scene {id} counts once: {second} has the same bytes as {first}")
            }
            Self::Repeated { records, id, first, second } => {
                write!(f, "{records} records count once, as {id}: {second} has the same bytes as {first}")
            }
            Self::NothingExcluded { path, ids } => {
                write!(f, "{}: `exclude` names {}, which none of its files holds", path.display(), ids.join(", "))
            }
            Self::DemoIsBuiltIn => f.write_str("demo is the built-in set; what lies here by that name is ./demo"),
        }
    }
}

impl Found {
    /// Leaves out what is there again with the same bytes. Nothing but scenes of one name is read for that, and they only where their
    /// lengths and checksums agree.
    ///
    /// # Errors
    /// [`SetError::Duplicate`] where the bytes differ; why a generated scene cannot be made.
    pub(super) fn settle(&mut self) -> Result<(), SetError> {
        let again = self.again();
        let (mut repeated, mut example) = (0, None);
        for &(first, second) in &again {
            let [one, other] = [first, second].map(|place| &self.entries[place]);
            let places = || [one.source.clone(), other.source.clone()];
            match one.is_same(other) {
                Ok(true) => {
                    repeated += 1;
                    example.get_or_insert_with(|| (one.id.clone(), places()));
                }
                Ok(false) => return Err(SetError::Duplicate { id: one.id.clone(), places: Box::new(places()) }),
                Err(SetError::Record(damaged)) => self.bad.push(damaged),
                Err(error) => return Err(error),
            }
        }
        let note =
            |(id, [first, second]): (SceneId, [Source; 2])| Note::Repeated { records: repeated, id, first, second };
        self.notes.extend(example.map(note));
        let (mut place, mut again) = (0, again.iter().map(|(_, second)| *second).peekable());
        self.entries.retain(|_| {
            place += 1;
            again.next_if_eq(&(place - 1)).is_none()
        });
        Ok(())
    }

    /// The places of scenes whose name was there before, each behind the place where it was first, in order.
    fn again(&self) -> Vec<(usize, usize)> {
        let mut by_id: Vec<usize> = (0..self.entries.len()).collect();
        by_id.sort_by_key(|place| &self.entries[*place].id);
        let of_one_name = by_id.chunk_by(|one, other| self.entries[*one].id == self.entries[*other].id);
        let mut again: Vec<_> =
            of_one_name.flat_map(|places| places[1..].iter().map(|second| (places[0], *second))).collect();
        again.sort_by_key(|(_, second)| *second);
        again
    }
}
