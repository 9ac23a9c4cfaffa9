//! What is found in the inputs of a set, before it is one.

use std::collections::BTreeMap;
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
    /// The word `demo` means the built-in set, though there is a file or folder of that name.
    DemoIsBuiltIn,
}

/// So many names are spelled out.
const SHOWN_NAMES: usize = 3;

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PassedOver { input, files } => {
                let shown = files[..files.len().min(SHOWN_NAMES)].join(", ");
                write!(f, "{}: passed over {shown}", input.display())?;
                match files.len().saturating_sub(SHOWN_NAMES) {
                    0 => Ok(()),
                    more => write!(f, " and {more} more"),
                }
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
    /// Leaves out what is there again with the same bytes.
    ///
    /// # Errors
    /// [`SetError::Duplicate`] where the bytes differ.
    pub(super) fn settle(&mut self) -> Result<(), SetError> {
        let mut first: BTreeMap<SceneId, SceneEntry> = BTreeMap::new();
        let (mut repeated, mut example) = (0, None);
        for entry in std::mem::take(&mut self.entries) {
            match first.get(&entry.id) {
                None => {
                    first.insert(entry.id.clone(), entry.clone());
                    self.entries.push(entry);
                }
                Some(same) if same.sha256 == entry.sha256 => {
                    repeated += 1;
                    example.get_or_insert((same.source.clone(), entry));
                }
                Some(other) => {
                    let places = Box::new([other.source.clone(), entry.source]);
                    return Err(SetError::Duplicate { id: entry.id, places });
                }
            }
        }
        let note =
            |(first, SceneEntry { id, source, .. })| Note::Repeated { records: repeated, id, first, second: source };
        self.notes.extend(example.map(note));
        Ok(())
    }
}
