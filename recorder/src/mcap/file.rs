//! MCAP bytes, chunk by chunk, and the same bytes for the same messages. No file is touched here.
//!
//! The `mcap` crate repeats schemas and channels in the summary in the order of a hash map, which differs from run to run.
//! [`sort_summary`] puts them in the order of their numbers; all lengths stay, so every offset does.

use std::io::{self, Write};
use std::sync::{Arc, Mutex, PoisonError};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions};

/// Uncompressed size at which a chunk is closed: what a killed recorder loses at most. About twelve steps of a busy scene.
const CHUNK_BYTES: u64 = 1 << 20;

/// Of drives of 20 s with predictions level 3 leaves a tenth less and takes two thirds more time; of drives without, a twentieth.
const COMPRESSION_LEVEL: u32 = 1;

const LIBRARY: &str = concat!("reloop ", env!("CARGO_PKG_VERSION"));

/// Where the `mcap` crate writes to, and we take from.
#[derive(Clone, Default)]
struct Buffer(Arc<Mutex<Vec<u8>>>);

impl Buffer {
    fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Buffer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The number of a channel in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelId(u16);

/// Turns messages into the bytes of an MCAP file.
pub struct Encoder {
    writer: mcap::Writer<NoSeek<Buffer>>,
    buffer: Buffer,
    /// Bytes taken so far: the place of the buffer's first byte in the file.
    taken: u64,
    sequence: u32,
}

impl Encoder {
    /// An empty file.
    ///
    /// # Errors
    /// None that can be named: the crate's own.
    pub fn new() -> Result<Self, McapError> {
        let buffer = Buffer::default();
        let writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(COMPRESSION_LEVEL)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .profile("")
            .library(LIBRARY)
            .create(NoSeek::new(buffer.clone()))?;
        Ok(Self { writer, buffer, taken: 0, sequence: 0 })
    }

    /// A channel of protobuf messages named `schema` and described by a serialized `FileDescriptorSet`.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn add_channel(&mut self, topic: &str, schema: &str, descriptors: &[u8]) -> Result<ChannelId, McapError> {
        let schema = self.writer.add_schema(schema, "protobuf", descriptors)?;
        self.writer.add_channel(schema, topic, "protobuf", &Default::default()).map(ChannelId)
    }

    /// A named table of texts.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn add_metadata(&mut self, name: &str, entries: &[(&str, &str)]) -> Result<(), McapError> {
        let metadata = entries.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    /// A message; `log_time` in nanoseconds of simulated time.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn write(&mut self, channel: ChannelId, log_time: u64, payload: &[u8]) -> Result<(), McapError> {
        let header = MessageHeader { channel_id: channel.0, sequence: self.sequence, log_time, publish_time: log_time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, payload)
    }

    /// Closes the open chunk, so that [`Encoder::take`] has all that was written.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn close_chunk(&mut self) -> Result<(), McapError> {
        self.writer.flush()
    }

    /// The next bytes of the file: nothing, or whole records.
    pub fn take(&mut self) -> Vec<u8> {
        let bytes = self.buffer.take();
        self.taken += bytes.len() as u64;
        bytes
    }

    /// The rest of the file, summary and all.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn finish(mut self) -> Result<Vec<u8>, McapError> {
        self.writer.finish()?;
        let mut tail = self.buffer.take();
        sort_summary(&mut tail, self.taken);
        Ok(tail)
    }
}

const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const RECORD_HEADER: usize = 9;
const FOOTER_BODY: usize = 20;
const MAGIC: usize = 8;

/// Sorts the runs of schemas and channels in the summary of a finished file by their numbers and renews its checksum. `tail`
/// is the end of the file from the byte `offset` on; the summary lies in it whole.
fn sort_summary(tail: &mut [u8], offset: u64) {
    let Some(footer) = tail.len().checked_sub(RECORD_HEADER + FOOTER_BODY + MAGIC) else { return };
    let position = |at: usize| {
        let bytes = tail.get(footer + RECORD_HEADER + at..)?.first_chunk()?;
        usize::try_from(u64::from_le_bytes(*bytes).checked_sub(offset)?).ok()
    };
    let (Some(start), Some(end)) = (position(0), position(8)) else { return };
    if start > end || end > footer {
        return;
    }
    let mut records = Vec::new();
    let mut at = start;
    while let Some(length) = tail.get(at + 1..end).and_then(|rest| rest.first_chunk()) {
        let next = at + RECORD_HEADER + u64::from_le_bytes(*length) as usize;
        let Some(record) = tail.get(at..next) else { return };
        records.push(record.to_vec());
        at = next;
    }
    // Each kind is one run, so a stable sort by (kind's place, number) moves nothing but schemas and channels.
    for run in records.chunk_by_mut(|a, b| a[0] == b[0]) {
        if matches!(run[0][0], SCHEMA | CHANNEL) {
            run.sort_by_key(|record| {
                record.get(RECORD_HEADER..).and_then(|body| body.first_chunk()).copied().map(u16::from_le_bytes)
            });
        }
    }
    let sorted = records.concat();
    tail[start..start + sorted.len()].copy_from_slice(&sorted);
    let checked = footer + RECORD_HEADER + 16;
    let checksum = crc32fast::hash(&tail[start..checked]);
    tail[checked..checked + 4].copy_from_slice(&checksum.to_le_bytes());
}
