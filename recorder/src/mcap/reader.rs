//! Reads recordings, whole or cut off: what is readable is read, and the rest named.

use std::collections::BTreeMap;

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use thiserror::Error;
use wire::keys::Channel;

use super::writer::{METADATA, METADATA_RUN, METADATA_SETTINGS};
use crate::message::{CHANNELS, Message, MessageError, STEP_NANOSECONDS};

/// The most bytes of one record: a chunk is about a megabyte, or as large as its largest message.
const RECORD_LIMIT: usize = 2 * wire::convert::MAX_MESSAGE_BYTES;

/// Why a file is no recording.
#[derive(Debug, Error)]
pub enum ReadError {
    /// It does not begin as one, or is damaged before its first message.
    #[error(
        "no readable MCAP: {0}\n  hint: recordings are the files <run>/episodes/<scene>.mcap, and .mcap.partial where they are not whole"
    )]
    NotMcap(McapError),
    /// An MCAP of somebody else.
    #[error("an MCAP file, but not one of reloop: it has no /reloop/scene channel")]
    Foreign,
    /// One of the product's messages does not decode.
    #[error("message {number} of the file: {source}")]
    Message {
        /// Counted from 0.
        number: u64,
        /// What is wrong.
        source: MessageError,
    },
}

/// A channel's messages, counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChannelSummary {
    /// The messages' full name.
    pub schema: String,
    /// How many.
    pub messages: u64,
    /// Their bytes, not compressed.
    pub bytes: u64,
}

/// Why reading stopped before the end.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Break {
    /// The file ends too early: its recorder was killed, or the disk was full.
    #[error("cut off")]
    CutOff,
    /// There is more, but it is not what was written.
    #[error("damaged ({0})")]
    Damaged(String),
}

/// What a recording holds.
#[derive(Debug, Default)]
pub struct Contents {
    /// The run's name on the bus; empty where the file does not tell.
    pub run: String,
    /// The run's settings (TOML).
    pub settings: String,
    /// The product's messages, in the file's order.
    pub messages: Vec<Message>,
    /// All channels by topic.
    pub channels: BTreeMap<String, ChannelSummary>,
    /// Simulated time of the last message (steps).
    pub last_step: u64,
    /// Why it is not read to its end, if it is not.
    pub broken: Option<Break>,
}

/// Reads the bytes of a recording.
///
/// # Errors
/// [`ReadError`]. A file that is cut off or damaged is none, if it begins as a recording: see [`Contents::broken`].
pub fn read(bytes: &[u8]) -> Result<Contents, ReadError> {
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let mut state = State::default();
    let mut rest = bytes;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let (next, after) = rest.split_at(wanted.min(rest.len()));
                reader.insert(next.len()).copy_from_slice(next);
                reader.notify_read(next.len());
                rest = after;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => match mcap::parse_record(opcode, data) {
                Ok(record) => state.take(record)?,
                Err(error) => return state.broken(error),
            },
            Err(error) => return state.broken(error),
        }
    }
    if state.ended { state.whole() } else { state.broken(McapError::UnexpectedEof) }
}

#[derive(Default)]
struct State {
    contents: Contents,
    schemas: BTreeMap<u16, String>,
    /// By their numbers in the file: topic, and channel if it is one of ours.
    topics: BTreeMap<u16, (String, Option<Channel>)>,
    number: u64,
    ended: bool,
}

impl State {
    fn take(&mut self, record: Record<'_>) -> Result<(), ReadError> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let own = channel
                    .topic
                    .strip_prefix("/reloop/")
                    .and_then(|name| CHANNELS.into_iter().find(|known| known.name() == name));
                self.contents.channels.entry(channel.topic.clone()).or_default().schema = schema;
                self.topics.insert(channel.id, (channel.topic, own));
            }
            Record::Metadata(metadata) if metadata.name == METADATA => {
                let entry = |name| metadata.metadata.get(name).cloned().unwrap_or_default();
                self.contents.run = entry(METADATA_RUN);
                self.contents.settings = entry(METADATA_SETTINGS);
            }
            Record::Message { header, data } => {
                let number = self.number;
                self.number += 1;
                self.contents.last_step = self.contents.last_step.max(header.log_time / STEP_NANOSECONDS);
                let Some((topic, own)) = self.topics.get(&header.channel_id) else { return Ok(()) };
                if let Some(summary) = self.contents.channels.get_mut(topic) {
                    summary.messages += 1;
                    summary.bytes += data.len() as u64;
                }
                if let Some(channel) = *own {
                    let message = Message::decode(channel, data.into_owned());
                    self.contents.messages.push(message.map_err(|source| ReadError::Message { number, source })?);
                }
            }
            Record::Footer(_) => self.ended = true,
            _ => {}
        }
        Ok(())
    }

    fn whole(self) -> Result<Contents, ReadError> {
        if self.contents.channels.contains_key("/reloop/scene") { Ok(self.contents) } else { Err(ReadError::Foreign) }
    }

    /// What there is before `error`, unless that is nothing.
    fn broken(mut self, error: McapError) -> Result<Contents, ReadError> {
        if self.contents.channels.is_empty() && self.contents.settings.is_empty() {
            return Err(ReadError::NotMcap(error));
        }
        self.contents.broken = Some(match error {
            McapError::UnexpectedEof => Break::CutOff,
            error => Break::Damaged(error.to_string()),
        });
        // A file that is cut before its first chunk has no channels, but says whose it is.
        if self.contents.channels.is_empty() { Ok(self.contents) } else { self.whole() }
    }
}
