//! From record to record of a file that can be sought in, past what they hold.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

use super::decode::{FrameError, FrameProblem, payload_length};
use super::{FOOTER_BYTES, HEADER_BYTES, StreamError};

/// What is read at a time. Most of what is wanted lies a few kilobytes after what was wanted before: more would be read for nothing.
const STRETCH_BYTES: usize = 512;

/// At least so many bytes are given, where the file has them.
const LEAST_BYTES: usize = 192;

/// Where a record is. The checksum of its length is right; that of its payload was not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The record's number in the file, from 0.
    pub index: u64,
    /// Where it begins in the file: its header's first byte.
    pub offset: u64,
    /// Length of its payload (bytes).
    pub bytes: u64,
    /// The masked checksum that is stored for its payload.
    pub checksum: u32,
}

impl Frame {
    /// Where its payload begins in the file.
    #[must_use]
    pub fn payload(&self) -> u64 {
        self.offset + HEADER_BYTES as u64
    }
}

/// The frames of a file, one after the other, and stretches of what is in them.
#[derive(Debug)]
pub struct Frames<R> {
    source: R,
    /// The file's length (bytes).
    length: u64,
    index: u64,
    offset: u64,
    buffer: Box<[u8; STRETCH_BYTES]>,
    /// The stretch of the file that is in the buffer.
    begin: u64,
    filled: usize,
}

impl<R: Read + Seek> Frames<R> {
    /// The frames of `source`, which has `length` bytes and stands at its beginning.
    pub fn new(source: R, length: u64) -> Self {
        Self { source, length, index: 0, offset: 0, buffer: Box::new([0; STRETCH_BYTES]), begin: 0, filled: 0 }
    }

    /// The next record's frame, or `None` at the end of the file.
    ///
    /// # Errors
    /// [`StreamError`]; nothing tells then where the next record begins.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, StreamError> {
        let (record, offset, length) = (self.index, self.offset, self.length);
        let io = |source| StreamError::Io { record, offset, source };
        let wrong = |problem| StreamError::Frame(FrameError { record, offset, problem });
        let header = self.at(offset).map_err(io)?;
        if header.is_empty() {
            return Ok(None);
        }
        let got = header.len();
        let header = header.first_chunk().ok_or_else(|| wrong(FrameProblem::TruncatedHeader { got }))?;
        let bytes = payload_length(header).map_err(wrong)?;
        let frame = Frame { index: record, offset, bytes, checksum: 0 };
        let (footer, expected) = (frame.payload() + bytes, bytes + FOOTER_BYTES as u64);
        let cut =
            |end: u64| wrong(FrameProblem::TruncatedPayload { expected, got: end.saturating_sub(frame.payload()) });
        if footer + FOOTER_BYTES as u64 > length {
            return Err(cut(length));
        }
        let stored = self.at(footer).map_err(io)?;
        // The file has become shorter meanwhile.
        let stored = stored.first_chunk().ok_or_else(|| cut(footer + stored.len() as u64))?;
        let frame = Frame { checksum: u32::from_le_bytes(*stored), ..frame };
        (self.index, self.offset) = (record + 1, footer + FOOTER_BYTES as u64);
        Ok(Some(frame))
    }

    /// Bytes of the file from `offset` on: 192 at least, or as many as there are.
    ///
    /// # Errors
    /// Where they cannot be read.
    pub fn at(&mut self, offset: u64) -> io::Result<&[u8]> {
        let skipped = offset.checked_sub(self.begin).and_then(|skipped| usize::try_from(skipped).ok());
        let at_end = self.begin + self.filled as u64 >= self.length;
        let kept =
            skipped.filter(|skipped| *skipped <= self.filled && (at_end || self.filled - skipped >= LEAST_BYTES));
        if let Some(skipped) = kept {
            return Ok(&self.buffer[skipped..self.filled]);
        }
        if offset != self.begin + self.filled as u64 {
            self.source.seek(SeekFrom::Start(offset))?;
        }
        (self.begin, self.filled) = (offset, 0);
        while self.filled < LEAST_BYTES {
            match self.source.read(&mut self.buffer[self.filled..]) {
                Ok(0) => break,
                Ok(count) => self.filled += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(&self.buffer[..self.filled])
    }
}
