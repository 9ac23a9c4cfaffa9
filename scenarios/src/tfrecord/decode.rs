//! The core: bytes in, records out. No IO.

use thiserror::Error;

use super::{FOOTER_BYTES, HEADER_BYTES, MAX_PAYLOAD_BYTES, masked_crc32c};

/// The buffer grows by at least this much, and never by more than what has already arrived: a damaged length allocates nothing.
const GROWTH_BYTES: usize = 64 << 10;

/// One whole record; both of its checksums are right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// Its number in the file, from 0.
    pub index: u64,
    /// Where it begins in the file: its header's first byte.
    pub offset: u64,
    /// The masked checksum of its payload.
    pub checksum: u32,
    /// What it holds.
    pub payload: &'a [u8],
}

/// What is wrong with a file's framing, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("record {record} at byte {offset}: {problem}")]
pub struct FrameError {
    /// The record's number, from 0.
    pub record: u64,
    /// Where the record begins in the file.
    pub offset: u64,
    /// What is wrong.
    pub problem: FrameProblem,
}

/// What is wrong with a record's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum FrameProblem {
    #[error("the file ends {got} bytes into a record's header of {HEADER_BYTES}")]
    TruncatedHeader { got: usize },
    #[error("the file ends before the record does: {got} of {expected} bytes after the header are there")]
    TruncatedPayload { expected: u64, got: u64 },
    #[error("the checksum of the length is {computed:08x}, but {stored:08x} is stored")]
    HeaderChecksum { stored: u32, computed: u32 },
    #[error("the checksum of the payload is {computed:08x}, but {stored:08x} is stored")]
    PayloadChecksum { stored: u32, computed: u32 },
    #[error("the record claims {length} bytes, more than the {MAX_PAYLOAD_BYTES} that are read")]
    TooLong { length: u64 },
}

impl FrameProblem {
    /// The checksum that is stored for a payload which it does not match.
    pub(crate) fn stored_for_payload(&self) -> Option<u32> {
        match self {
            Self::PayloadChecksum { stored, .. } => Some(*stored),
            _ => None,
        }
    }

    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::TruncatedHeader { .. } | Self::TruncatedPayload { .. } => {
                "the download was cut off: fetch the file again and compare its size"
            }
            Self::HeaderChecksum { .. } | Self::PayloadChecksum { .. } | Self::TooLong { .. } => {
                "the file is damaged or no TFRecord: fetch it again and compare its checksum"
            }
        }
    }
}

/// Turns bytes into records. Put bytes at the front of [`Decoder::space`], say how many by [`Decoder::advance`]; when that
/// answers `true`, [`Decoder::record`] is whole. At the end of the bytes call [`Decoder::end`].
#[derive(Debug)]
pub struct Decoder {
    /// The record's bytes, header first; reused from record to record.
    buffer: Vec<u8>,
    /// How many of them have arrived.
    filled: usize,
    /// How many the record has, as far as is known: the header alone, then all.
    expected: usize,
    /// The record's number.
    index: u64,
    /// Where the record begins.
    offset: u64,
    /// The record in the buffer was handed out: the next byte starts another.
    whole: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::starting_at(0, 0)
    }
}

impl Decoder {
    /// A decoder whose first byte is byte `offset` of the file, where record `index` begins.
    #[must_use]
    pub fn starting_at(index: u64, offset: u64) -> Self {
        Self { buffer: Vec::new(), filled: 0, expected: HEADER_BYTES, index, offset, whole: false }
    }

    /// The record that is being read: its number and where it begins.
    #[must_use]
    pub fn position(&self) -> (u64, u64) {
        if self.whole { (self.index + 1, self.offset + self.expected as u64) } else { (self.index, self.offset) }
    }

    /// Where the next bytes go; never empty, and never past the end of the record.
    pub fn space(&mut self) -> &mut [u8] {
        if self.whole {
            (self.index, self.offset) = self.position();
            (self.filled, self.expected, self.whole) = (0, HEADER_BYTES, false);
        }
        let end = self.expected.min(self.filled + self.filled.max(GROWTH_BYTES));
        if self.buffer.len() < end {
            self.buffer.resize(end, 0);
        }
        &mut self.buffer[self.filled..end]
    }

    /// Takes in the `count` bytes that were put into [`Decoder::space`] (at most its length). Whether the record is whole.
    ///
    /// # Errors
    /// [`FrameError`]; the decoder is of no use afterwards.
    pub fn advance(&mut self, count: usize) -> Result<bool, FrameError> {
        self.filled = (self.filled + count).min(self.buffer.len()).min(self.expected);
        if self.filled < self.expected {
            return Ok(false);
        }
        if self.expected == HEADER_BYTES {
            let length =
                self.buffer.first_chunk().map_or(Ok(0), payload_length).map_err(|problem| self.error(problem))?;
            self.expected = HEADER_BYTES + FOOTER_BYTES + length as usize; // at most MAX_PAYLOAD_BYTES
            return Ok(false);
        }
        let (stored, computed) = (self.stored_checksum(), masked_crc32c(self.payload()));
        if stored != computed {
            return Err(self.error(FrameProblem::PayloadChecksum { stored, computed }));
        }
        self.whole = true;
        Ok(true)
    }

    /// The record that [`Decoder::advance`] said was whole.
    #[must_use]
    pub fn record(&self) -> Record<'_> {
        Record {
            index: self.index,
            offset: self.offset,
            checksum: if self.whole { self.stored_checksum() } else { 0 },
            payload: if self.whole { self.payload() } else { &[] },
        }
    }

    /// Call when no more bytes come.
    ///
    /// # Errors
    /// [`FrameError`] if that is in the middle of a record.
    pub fn end(&self) -> Result<(), FrameError> {
        if self.whole || self.filled == 0 {
            return Ok(());
        }
        if self.expected == HEADER_BYTES {
            return Err(self.error(FrameProblem::TruncatedHeader { got: self.filled }));
        }
        Err(self.error(FrameProblem::TruncatedPayload {
            expected: (self.expected - HEADER_BYTES) as u64,
            got: (self.filled - HEADER_BYTES) as u64,
        }))
    }

    fn payload(&self) -> &[u8] {
        &self.buffer[HEADER_BYTES..self.expected - FOOTER_BYTES]
    }

    fn stored_checksum(&self) -> u32 {
        little_endian(&self.buffer[self.expected - FOOTER_BYTES..self.expected])
    }

    fn error(&self, problem: FrameProblem) -> FrameError {
        FrameError { record: self.index, offset: self.offset, problem }
    }
}

/// The payload's length, if the header can be believed.
pub(super) fn payload_length(header: &[u8; HEADER_BYTES]) -> Result<u64, FrameProblem> {
    let mut length = [0; 8];
    length.copy_from_slice(&header[..8]);
    let (stored, computed) = (little_endian(&header[8..]), masked_crc32c(&length));
    if stored != computed {
        return Err(FrameProblem::HeaderChecksum { stored, computed });
    }
    let length = u64::from_le_bytes(length);
    if length > MAX_PAYLOAD_BYTES { Err(FrameProblem::TooLong { length }) } else { Ok(length) }
}

fn little_endian(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |sum, byte| (sum << 8) | u32::from(*byte))
}
