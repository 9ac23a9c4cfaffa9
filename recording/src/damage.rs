//! What can be wrong with a recording, and where.

use thiserror::Error;

use crate::records;

/// Something that is not as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("byte {at}: {fault}")]
pub struct Damage {
    /// The byte of the file at which the record begins that is damaged, or that holds what is damaged.
    pub at: u64,
    /// What is wrong.
    pub fault: Fault,
}

/// What is wrong with a record.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Fault {
    #[error("the file ends in the midst of what was written")]
    CutOff,
    #[error("a file does not begin like this")]
    Beginning,
    #[error("a file does not end like this")]
    End,
    #[error("{} does not fit into what is left of the file", records::name(*opcode))]
    Length { opcode: u8 },
    #[error("{} does not belong here", records::name(*opcode))]
    Stray { opcode: u8 },
    #[error("{} has fields that cannot be read", records::name(*opcode))]
    Fields { opcode: u8 },
    #[error("a chunk is compressed by {0:?}, which is not known here")]
    Compression(String),
    #[error("a chunk says that it holds {bytes} bytes; at most {limit} are taken")]
    ChunkSize { bytes: u64, limit: u64 },
    #[error("a chunk cannot be unpacked ({0})")]
    Unpacking(String),
    #[error("a chunk's bytes have the checksum {found:08x}, where {told:08x} is told")]
    Chunk { told: u32, found: u32 },
    #[error("the data before it has the checksum {found:08x}, where {told:08x} is told")]
    Data { told: u32, found: u32 },
    #[error("the summary has the checksum {found:08x}, where {told:08x} is told")]
    Summary { told: u32, found: u32 },
    #[error("a message of {topic} cannot be read: {why}")]
    Message { topic: String, why: String },
    #[error("channel {0} is described in two ways")]
    TwoChannels(u16),
    #[error("messages of channel {0}, which nothing describes")]
    NoChannel(u16),
    #[error("there is more than any recording has ({0}); the rest is not read")]
    TooMuch(&'static str),
}
