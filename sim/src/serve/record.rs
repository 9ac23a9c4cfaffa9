//! The queue as files, `DIR/.service/runs/NAME.toml`: a file a run, from when it was asked for. Each is written whole, so that whatever ends the
//! service, it knows afterwards what was asked for, and what was over. How far a run is says its own folder.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use results::files::{self, FileError, at};
use serde::{Deserialize, Serialize};

use super::offer::is_name;

/// What a client wishes: options of `sim run`, and what it named.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Wish {
    /// Options of `sim run`.
    pub arguments: Vec<String>,
    /// Scene sets, by name.
    pub scenes: Vec<String>,
    /// Weights, by name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Episodes at a time, if it is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parallel: Option<u16>,
}

impl Wish {
    /// Whether both come to the same results.
    #[must_use]
    pub fn is_same_run(&self, other: &Self) -> bool {
        Self { parallel: None, ..self.clone() } == Self { parallel: None, ..other.clone() }
    }
}

/// What is known of a run beside its folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Record {
    /// Its place in the order in which runs were asked for.
    pub order: u64,
    /// Who asked.
    pub client: String,
    /// The name of the submission.
    pub submission: String,
    /// Whether it is over.
    pub standing: Standing,
    /// What was asked for.
    pub wish: Wish,
}

/// Whether a run is over. Of one that is not it does not matter whether it is being driven: it is to be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "state")]
pub enum Standing {
    /// To be driven to its end.
    Queued,
    /// Every scene has its episode.
    Done {
        /// How many.
        episodes: u32,
        /// How many have no result.
        failed: u32,
        /// Of the results.
        digest: String,
    },
    /// It cannot go on.
    Failed {
        /// Why.
        why: String,
    },
    /// Somebody stopped it.
    Cancelled,
}

/// All records, and their folder.
#[derive(Debug)]
pub struct Records {
    folder: PathBuf,
    by_name: BTreeMap<String, Record>,
}

impl Records {
    /// Those in `folder`.
    ///
    /// # Errors
    /// [`FileError`]; and the names of those that cannot be read, which are left as they are.
    pub fn open(folder: &Path) -> Result<(Self, Vec<String>), FileError> {
        fs::create_dir_all(folder).map_err(at("create", folder))?;
        let mut records = Self { folder: folder.to_owned(), by_name: BTreeMap::new() };
        let mut unreadable = Vec::new();
        for entry in fs::read_dir(folder).map_err(at("list", folder))? {
            let file = entry.map_err(at("list", folder))?.file_name().to_string_lossy().into_owned();
            let Some(name) = file.strip_suffix(".toml") else { continue };
            let text = files::read(&folder.join(&file))?.unwrap_or_default();
            match toml::from_str(&String::from_utf8_lossy(&text)) {
                Ok(record) if is_name(name) => drop(records.by_name.insert(name.to_owned(), record)),
                _ => unreadable.push(file),
            }
        }
        Ok((records, unreadable))
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Record> {
        self.by_name.get(name)
    }

    /// All, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&String, &Record)> {
        self.by_name.iter()
    }

    /// The run of a submission.
    #[must_use]
    pub fn of_submission(&self, submission: &str) -> Option<&String> {
        let mut with_it = self.by_name.iter().filter(|(_, record)| record.submission == submission);
        with_it.next().map(|(name, _)| name)
    }

    /// The order of the next run.
    #[must_use]
    pub fn next_order(&self) -> u64 {
        self.by_name.values().map(|record| record.order + 1).max().unwrap_or(0)
    }

    /// Keeps a record. It is on the disk when this returns.
    ///
    /// # Errors
    /// [`FileError`]; then nothing has changed.
    pub fn keep(&mut self, name: &str, record: Record) -> Result<(), FileError> {
        // Plain data with text keys: TOML holds all of it.
        let text = toml::to_string(&record).unwrap_or_default();
        files::write_whole(&self.folder.join(format!("{name}.toml")), |file| file.write_all(text.as_bytes()))?;
        self.by_name.insert(name.to_owned(), record);
        Ok(())
    }

    /// Notes whether a run is over.
    ///
    /// # Errors
    /// [`FileError`]; then nothing has changed.
    pub fn stand(&mut self, name: &str, standing: Standing) -> Result<(), FileError> {
        match self.by_name.get(name) {
            Some(record) => self.keep(name, Record { standing, ..record.clone() }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(order: u64, standing: Standing) -> Record {
        let wish = Wish {
            arguments: vec!["--driver=idm".to_owned(), "--label=a = \"b\"".to_owned()],
            scenes: vec!["demo".to_owned()],
            ..Wish::default()
        };
        Record { order, client: "me".to_owned(), submission: format!("s{order}"), standing, wish }
    }

    #[test]
    fn records_are_read_back_as_they_were_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (mut records, _) = Records::open(folder.path()).unwrap();
        let done = Standing::Done { episodes: 3, failed: 1, digest: "00".to_owned() };
        let standings = [Standing::Queued, done, Standing::Failed { why: "x\ny".to_owned() }, Standing::Cancelled];
        for (order, standing) in (0..).zip(standings) {
            records.keep(&format!("run-{order}"), record(order, standing)).unwrap();
        }
        records.stand("run-0", Standing::Cancelled).unwrap();
        let (again, unreadable) = Records::open(folder.path()).unwrap();
        assert_eq!((&again.by_name, unreadable), (&records.by_name, Vec::new()));
        assert_eq!((again.next_order(), again.of_submission("s2").map(String::as_str)), (4, Some("run-2")));
    }

    #[test]
    fn what_is_no_record_is_named_and_left() {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in
            [("a.toml", "order = 7"), ("b.toml", "\u{0}"), ("c.toml.partial", "half a rec"), ("-x.toml", "")]
        {
            fs::write(folder.path().join(file), text).unwrap();
        }
        let (records, mut unreadable) = Records::open(folder.path()).unwrap();
        unreadable.sort();
        assert_eq!(
            (records.iter().count(), unreadable),
            (0, ["-x.toml", "a.toml", "b.toml"].map(str::to_owned).to_vec())
        );
        assert!(folder.path().join("a.toml").exists());
    }
}
