//! A training to look at: `training.rrd` for the Rerun viewer. `docs/learning.md` lists what it holds.
//!
//! ```text
//! metrics.csv, steps.csv ──▶ curves ─────┐
//! windows, looks ──▶ pictures ──▶ chunks ├──▶ training.rrd, whole and anew after each epoch
//! training.rrd ──▶ chunks of before ─────┘
//! ```
//!
//! Curves are those of the tables, which know of every epoch; pictures of epochs before a start are in the file alone, and are taken over
//! from there. So the file is the same however often a training was stopped, and whole wherever it is killed.

mod curves;
mod layout;
mod pictures;

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use re_chunk::{Chunk, EntityPath};
use re_log_encoding::DecoderApp;
use re_log_types::{LogMsg, StoreKind};
use re_sdk_types::archetypes::{RecordingInfo, TextDocument};
use rrd::{RrdError, Store};
use thiserror::Error;

use crate::checkpoint::Checkpoint;
use crate::settings::Settings;
use crate::step::Look;
use crate::whole_file::{self, WriteError};
use crate::windows::Window;

/// The file's name in a training's folder.
pub const FILE: &str = "training.rrd";
/// The timeline of epochs.
const EPOCH: &str = "epoch";
/// The timeline of steps.
const STEP: &str = "step";

/// Why there is no drawing.
#[derive(Debug, Error)]
pub enum ViewError {
    /// A table of the training cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The table.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Rerun's own.
    #[error("{FILE}: {0}")]
    Rrd(#[from] RrdError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// The drawing of a training.
pub struct View {
    folder: PathBuf,
    /// The training's.
    name: String,
    settings: String,
    /// The same for the same training, another for another: viewers lay different ones side by side.
    id: String,
    /// Those that are drawn.
    windows: Vec<Window>,
    /// What was drawn of them after each epoch.
    drawn: Vec<Chunk>,
}

impl View {
    /// That of the training `name` in `folder`, which goes on from `state`.
    ///
    /// # Errors
    /// [`ViewError`].
    pub fn open(
        folder: &Path,
        name: &str,
        settings: &Settings,
        windows: Vec<Window>,
        state: &Checkpoint,
    ) -> Result<Self, ViewError> {
        let settings = settings.text();
        let hash = crc32fast::hash(format!("{settings}{}", state.windows).as_bytes());
        let id = format!("{name}.{hash:08x}");
        let drawn = drawn_before(&folder.join(FILE), state.epoch);
        let view = Self { folder: folder.to_owned(), name: name.to_owned(), settings, id, windows, drawn };
        view.write()?;
        Ok(view)
    }

    /// The windows that are drawn.
    #[must_use]
    pub fn windows(&self) -> &[Window] {
        &self.windows
    }

    /// Draws what came of the windows after `epoch`, from 1, whose last step was `step`; and the tables, which have it already.
    ///
    /// # Errors
    /// [`ViewError`].
    pub fn epoch(&mut self, epoch: usize, step: u64, looks: &[Look]) -> Result<(), ViewError> {
        for (number, (window, look)) in self.windows.iter().zip(looks).enumerate() {
            self.drawn.extend(pictures::moving(number, window, look, [epoch as i64, step as i64])?);
        }
        self.write()
    }

    fn write(&self) -> Result<(), ViewError> {
        let mut encoder = rrd::encoder()?;
        layout::write(Store::blueprint(&mut encoder, "trainer", &self.id)?, &self.windows)?;
        let mut store = Store::recording(&mut encoder, "trainer", &self.id)?;
        store.log(EntityPath::properties(), &RecordingInfo::new().with_name(self.name.clone()))?;
        store.log("settings", &TextDocument::from_markdown(format!("```toml\n{}\n```\n", self.settings.trim_end())))?;
        curves::log(&mut store, &self.folder)?;
        for (number, window) in self.windows.iter().enumerate() {
            pictures::log_still(&mut store, number, window)?;
        }
        for chunk in &self.drawn {
            store.log_chunk(chunk)?;
        }
        encoder.finish().map_err(RrdError::from)?;
        let bytes = encoder.into_inner().map_err(RrdError::from)?;
        Ok(whole_file::write(&self.folder.join(FILE), &bytes)?)
    }
}

/// What the file has of the first `epochs`. A file that is none of ours has nothing: a picture is no reason to stop.
fn drawn_before(path: &Path, epochs: usize) -> Vec<Chunk> {
    let Ok(file) = File::open(path) else { return Vec::new() };
    let is_of_them = |chunk: &Chunk| {
        let epoch = chunk.timelines().values().find(|column| column.timeline().name().as_str() == EPOCH);
        let is_past = |column: &re_chunk::TimeColumn| column.times_raw().iter().all(|epoch| *epoch <= epochs as i64);
        pictures::are_of(chunk.entity_path()) && epoch.is_some_and(is_past)
    };
    let mut drawn = Vec::new();
    for message in DecoderApp::decode_lazy(BufReader::new(file)) {
        let chunk = match message {
            Ok(LogMsg::ArrowMsg(store, message)) if store.kind() == StoreKind::Recording => {
                Chunk::from_arrow_msg(&message).map_err(|error| error.to_string())
            }
            Ok(_) => continue,
            Err(error) => Err(error.to_string()),
        };
        match chunk {
            Ok(chunk) => drawn.extend(is_of_them(&chunk).then_some(chunk)),
            Err(error) => {
                tracing::warn!("{}: drawn anew from here on: {error}", path.display());
                break;
            }
        }
    }
    drawn
}
