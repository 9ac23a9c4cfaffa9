//! The scenes that a command is about.

use std::sync::Arc;

use scenarios::{RecordError, SceneEntry, SceneSet, SetError, Source};
use world::scene::{Finding, Scene};

use super::Failure;
use crate::cli::Inputs;

/// Opened scenes, those that were asked for alone.
pub struct Scenes {
    pub set: SceneSet,
    chosen: Vec<usize>,
    bad: Vec<RecordError>,
}

/// A record of the inputs: a scene, or why there is none.
pub struct Found {
    /// The scene's name, or the record's number where it has none.
    pub name: String,
    /// Where it lies, as far as a row has room: the file's name, and the record where there may be several.
    pub origin: String,
    pub scene: Result<(Arc<Scene>, Vec<Finding>), SetError>,
}

impl Scenes {
    /// All of them, or the first thing that is wrong.
    pub fn open(inputs: &Inputs) -> Result<Self, Failure> {
        Self::chosen(SceneSet::open(&inputs.paths)?, Vec::new(), inputs)
    }

    /// As many as there are.
    pub fn survey(inputs: &Inputs) -> Result<Self, Failure> {
        let (set, bad) = SceneSet::survey(&inputs.paths)?;
        Self::chosen(set, bad, inputs)
    }

    fn chosen(set: SceneSet, mut bad: Vec<RecordError>, inputs: &Inputs) -> Result<Self, Failure> {
        for note in set.notes() {
            eprintln!("note: {note}");
        }
        let place = |id: &String| {
            let found = set.entries().iter().position(|entry| entry.id.as_str() == id);
            found.ok_or_else(|| Failure::NoScene(id.clone()))
        };
        let mut chosen = inputs.scene.iter().map(place).collect::<Result<Vec<usize>, Failure>>()?;
        if chosen.is_empty() {
            chosen = (0..set.entries().len()).collect();
        } else {
            bad.clear();
        }
        tracing::debug!("{} scenes opened, {} chosen", set.entries().len(), chosen.len());
        Ok(Self { set, chosen, bad })
    }

    /// The chosen scenes and their places in the set.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &SceneEntry)> {
        self.chosen.iter().map(|index| (*index, &self.set.entries()[*index]))
    }

    /// The chosen scenes, loaded one by one, then the records that give none.
    pub fn into_records(self, mut take: impl FnMut(Found)) {
        for (index, entry) in self.iter() {
            let (name, origin) = (entry.id.to_string(), origin(&entry.source));
            take(Found { name, origin, scene: self.set.load(index) });
        }
        for error in self.bad {
            let record = || if error.whole { "(whole file)".to_owned() } else { format!("(record {})", error.record) };
            let name = error.scene().map_or_else(record, ToString::to_string);
            take(Found { name, origin: in_file(&error.path, error.record), scene: Err(error.into()) });
        }
    }

    pub fn len(&self) -> usize {
        self.chosen.len()
    }
}

fn origin(source: &Source) -> String {
    match source {
        Source::File(place) => in_file(&place.file.path, place.record),
        Source::Pickle(file) | Source::Table { table: file, .. } => in_file(&file.path, 0),
        Source::Generated { .. } => source.to_string(),
    }
}

fn in_file(path: &std::path::Path, record: u64) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    if record == 0 { name.into_owned() } else { format!("{name} #{record}") }
}
