//! The front over [`Read`].

use std::io::{self, ErrorKind, Read};

use thiserror::Error;

use super::{Decoder, FrameError, Record};

/// Why no further record could be had.
#[derive(Debug, Error)]
pub enum StreamError {
    /// The bytes could not be read.
    #[error("record {record} at byte {offset}: {source}")]
    Io {
        /// The record that was being read, from 0.
        record: u64,
        /// Where it begins.
        offset: u64,
        /// Why.
        source: io::Error,
    },
    /// The bytes are wrong.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// The records of a file, one at a time; memory is that of the largest record.
#[derive(Debug)]
pub struct Records<R> {
    source: R,
    decoder: Decoder,
}

impl<R: Read> Records<R> {
    /// The records of `source` from its beginning. Give it a buffered reader: headers are read by themselves.
    pub fn new(source: R) -> Self {
        Self { source, decoder: Decoder::default() }
    }

    /// The records of `source`, whose next byte is byte `offset` of a file, where record `index` begins.
    pub fn starting_at(source: R, index: u64, offset: u64) -> Self {
        Self { source, decoder: Decoder::starting_at(index, offset) }
    }

    /// Where the bytes come from. After a record it stands at the record's end.
    pub fn source(&self) -> &R {
        &self.source
    }

    /// The next record, or `None` at the end of the file. Borrowed until the next call.
    ///
    /// # Errors
    /// [`StreamError`]; reading cannot go on afterwards, for nothing tells where the next record begins.
    pub fn next_record(&mut self) -> Result<Option<Record<'_>>, StreamError> {
        loop {
            let count = match self.source.read(self.decoder.space()) {
                Ok(0) => {
                    self.decoder.end()?;
                    return Ok(None);
                }
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(source) => {
                    let (record, offset) = self.decoder.position();
                    return Err(StreamError::Io { record, offset, source });
                }
            };
            if self.decoder.advance(count)? {
                return Ok(Some(self.decoder.record()));
            }
        }
    }
}
