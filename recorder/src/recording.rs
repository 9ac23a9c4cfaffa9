//! One episode on its way into its files.

use std::path::PathBuf;
use std::sync::Arc;

use thiserror::Error;
use wire::digest::Digest;
use wire::keys::Channel;
use wire::proto;
use world::scene::SceneId;

use crate::mcap::EpisodeWriter;
use crate::message::{Body, Message};
use crate::partial_file::{FileError, PartialFile};
use crate::rrd::{Drawing, RrdError};
use crate::sequence::{Answers, Counts, Sequence, SequenceError};

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Format {
    /// MCAP: everything, to be read back, by Foxglove and Lichtblick too.
    Mcap,
    /// Rerun: the drawing.
    Rrd,
}

/// What all recordings of a run share.
#[derive(Clone, Debug)]
pub struct RunSettings {
    /// Where the files go.
    pub folder: PathBuf,
    /// Which files.
    pub formats: Vec<Format>,
    /// The run's name.
    pub run: String,
    /// The run's settings (TOML).
    pub settings: String,
    /// What there is of each step beside a plan.
    pub answers: Answers,
}

/// Why an episode has no recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// A file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// MCAP could not be encoded.
    #[error("cannot encode MCAP: {0}")]
    Mcap(#[from] ::mcap::McapError),
    /// Rerun's file could not be encoded.
    #[error("cannot encode the Rerun file: {0}")]
    Rrd(#[from] RrdError),
    /// The messages were no episode.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// Something is missing.
    #[error("not whole: {what} {arrived} of {expected} arrived")]
    NotWhole {
        /// Of what.
        what: &'static str,
        /// As many as arrived.
        arrived: u32,
        /// As many as there were.
        expected: u32,
    },
    /// All came that is counted, but something else than what was told.
    #[error("not what was told: the digest of what arrived is another")]
    OtherDigest,
    /// No scene or no end came.
    #[error("not whole: no {0} arrived")]
    Missing(&'static str),
}

/// An open recording. Its files appear with the scene; dropped or cut off, they stay `.partial`.
pub struct Recording {
    scene: SceneId,
    run: Arc<RunSettings>,
    sequence: Sequence,
    files: Option<Files>,
    /// Of what is written.
    digest: Digest,
    /// Whether the end came, and found the digest that it tells.
    as_told: bool,
    /// The first failure; nothing is written after it.
    failure: Option<RecordingError>,
    /// The end came: from here on the simulator waits for the answer, and not before.
    ended: bool,
}

struct Files {
    mcap: Option<(EpisodeWriter, PartialFile)>,
    drawing: Option<(Drawing, PartialFile)>,
}

impl Files {
    fn create(scene: &SceneId, run: &RunSettings) -> Result<Self, RecordingError> {
        let path = |extension: &str| run.folder.join(format!("{scene}.{extension}"));
        let mcap = run.formats.contains(&Format::Mcap).then(|| -> Result<_, RecordingError> {
            Ok((EpisodeWriter::new(&run.run, &run.settings)?, PartialFile::create(&path("mcap"))?))
        });
        let drawing = run
            .formats
            .contains(&Format::Rrd)
            .then(|| -> Result<_, RecordingError> { Ok((Drawing::default(), PartialFile::create(&path("rrd"))?)) });
        Ok(Self { mcap: mcap.transpose()?, drawing: drawing.transpose()? })
    }

    fn write(&mut self, message: &Message) -> Result<(), RecordingError> {
        if let Some((writer, file)) = &mut self.mcap {
            writer.write(message)?;
            append(file, &writer.take())?;
        }
        if let Some((drawing, _)) = &mut self.drawing {
            drawing.push(message);
        }
        Ok(())
    }

    fn finish(self, run: &RunSettings) -> Result<(), RecordingError> {
        if let Some((writer, mut file)) = self.mcap {
            file.append(&writer.finish()?)?;
            file.commit()?;
        }
        if let Some((drawing, mut file)) = self.drawing {
            file.append(&drawing.finish(&run.run, &run.settings)?)?;
            file.commit()?;
        }
        Ok(())
    }

    /// Leaves what there is readable.
    fn leave(self) -> Result<(), RecordingError> {
        if let Some((mut writer, mut file)) = self.mcap {
            writer.close_chunk()?;
            append(&mut file, &writer.take())?;
        }
        Ok(())
    }
}

fn append(file: &mut PartialFile, bytes: &[u8]) -> Result<(), FileError> {
    if bytes.is_empty() { Ok(()) } else { file.append(bytes) }
}

impl Recording {
    /// The recording of `scene`; no file yet.
    #[must_use]
    pub fn new(scene: SceneId, run: Arc<RunSettings>) -> Self {
        let sequence = Sequence::new(run.answers);
        Self {
            scene,
            run,
            sequence,
            files: None,
            digest: Digest::default(),
            as_told: false,
            failure: None,
            ended: false,
        }
    }

    /// Takes a message, and writes what is in order now.
    pub fn take(&mut self, message: Message) {
        self.ended |= message.channel() == Channel::End;
        if self.failure.is_none() {
            self.failure = self.try_take(message).err();
        }
    }

    fn try_take(&mut self, message: Message) -> Result<(), RecordingError> {
        self.sequence.push(message)?;
        self.write_ready()
    }

    fn write_ready(&mut self) -> Result<(), RecordingError> {
        while let Some(message) = self.sequence.pop() {
            let files = match &mut self.files {
                Some(files) => files,
                None => self.files.insert(Files::create(&self.scene, &self.run)?),
            };
            if let Body::End(end) = &message.body {
                self.as_told = end.digest == self.digest.to_bytes();
            }
            self.digest.add(message.channel(), &message.payload);
            files.write(&message)?;
        }
        Ok(())
    }

    /// Whether the episode is over, whole or not.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Whether nothing more can change: it is whole, or failed.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.failure.is_some() || self.sequence.is_whole()
    }

    /// Closes the files, under their names if they are whole, and says what they hold.
    #[must_use]
    pub fn finish(mut self) -> proto::Recorded {
        let counts = self.sequence.counts();
        let result = match self.failure.take() {
            Some(failure) => Err(failure),
            None => self.close(&counts),
        };
        if self.sequence.ignored() > 0 {
            tracing::debug!("episode {}: {} messages that nobody waited for", self.scene, self.sequence.ignored());
        }
        proto::Recorded {
            scene: self.scene.to_string(),
            observations: counts.observations,
            plans: counts.plans,
            predictions: counts.predictions,
            records: counts.records,
            events: counts.events,
            moves: counts.moves,
            digest: self.digest.to_bytes(),
            error: result.err().map_or_else(String::new, |error| error.to_string()),
        }
    }

    fn close(&mut self, counts: &Counts) -> Result<(), RecordingError> {
        let end = self.sequence.end().ok_or(RecordingError::Missing("end")).map(Counts::of_end);
        self.sequence.close();
        let has_scene = self.sequence.has_scene();
        self.write_ready()?;
        let files = self.files.take().ok_or(RecordingError::Missing("scene"))?;
        let verdict = end.and_then(|end| match counts.first_difference(&end) {
            // The counts do not tell: a recorder that comes late may have missed the scene alone.
            None if !has_scene => Err(RecordingError::Missing("scene")),
            None if !self.as_told => Err(RecordingError::OtherDigest),
            None => Ok(()),
            Some((what, arrived, expected)) => Err(RecordingError::NotWhole { what, arrived, expected }),
        });
        match verdict {
            Ok(()) => files.finish(&self.run),
            Err(error) => files.leave().and(Err(error)),
        }
    }
}
