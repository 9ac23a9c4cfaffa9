//! MCAP's records as bytes: an opcode, a length, a body. <https://mcap.dev/spec>

use crate::fields::Fields;

/// What a file begins and ends with.
pub const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Opcode and length before a record's body.
pub const HEADER_BYTES: usize = 9;

/// The most bytes of a chunk. Ours are closed at about a megabyte; a message may be larger, 16 MiB at most.
pub const CHUNK_LIMIT: u64 = 32 << 20;

/// The longest name of a compression that is looked at (bytes); the rest is left out.
const NAME_LIMIT: usize = 16;

/// Opcodes.
#[allow(missing_docs, reason = "the specification's")]
pub mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const METADATA: u8 = 0x0c;
    pub const DATA_END: u8 = 0x0f;
    /// From here on records are anybody's own.
    pub const PRIVATE: u8 = 0x80;
}

/// A record for people.
#[must_use]
pub fn name(opcode: u8) -> String {
    const NAMES: [&str; 15] = [
        "a header",
        "a footer",
        "a schema",
        "a channel",
        "a message",
        "a chunk",
        "a message index",
        "a chunk index",
        "an attachment",
        "an attachment index",
        "the statistics",
        "a metadata record",
        "a metadata index",
        "a summary offset",
        "the end of the data",
    ];
    match NAMES.get(usize::from(opcode).wrapping_sub(1)) {
        Some(name) => (*name).to_owned(),
        None => format!("a record of the unknown kind {opcode:#04x}"),
    }
}

/// A record, framed.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Its kind.
    pub opcode: u8,
    /// What it holds.
    pub body: &'a [u8],
}

impl<'a> Frame<'a> {
    /// The record that begins at a byte, if it ends within `bytes`.
    #[must_use]
    pub fn at(bytes: &'a [u8], at: usize) -> Option<Self> {
        let (opcode, rest) = bytes.get(at..)?.split_first()?;
        let mut fields = Fields(rest);
        let length = usize::try_from(fields.u64()?).ok()?;
        Some(Self { opcode: *opcode, body: fields.take(length)? })
    }

    /// The byte after it, where it begins at this one.
    #[must_use]
    pub fn end(&self, at: usize) -> usize {
        at + HEADER_BYTES + self.body.len()
    }
}

/// A chunk, not unpacked.
#[derive(Clone, Copy, Debug)]
pub struct Chunk<'a> {
    /// How many bytes its records are.
    pub size: u64,
    /// Their checksum; 0 where it is not told.
    pub crc: u32,
    /// What they are compressed by; empty where they are not.
    pub compression: &'a str,
    /// The records, compressed.
    pub packed: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Reads the body of a chunk's record.
    #[must_use]
    pub fn of(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (_first_time, _last_time) = (fields.u64()?, fields.u64()?);
        let (size, crc, compression) = (fields.u64()?, fields.u32()?, fields.bytes()?);
        // A name; to look through more would take long where many bytes look like a chunk.
        let compression = str::from_utf8(compression.get(..NAME_LIMIT.min(compression.len()))?).ok()?;
        let packed = usize::try_from(fields.u64()?).ok()?;
        Some(Self { size, crc, compression, packed: fields.take(packed)? })
    }

    /// The first byte from `from` on at which a chunk begins, by its look: its lengths agree, and are such as chunks have.
    #[must_use]
    pub fn find(bytes: &'a [u8], from: usize) -> Option<usize> {
        (from..bytes.len()).filter(|at| bytes[*at] == op::CHUNK).find(|at| {
            Frame::at(bytes, *at).is_some_and(|frame| {
                // The body of a chunk ends with what is packed.
                Self::of(frame.body).is_some_and(|chunk| {
                    chunk.size <= CHUNK_LIMIT && chunk.packed.as_ptr_range().end == frame.body.as_ptr_range().end
                })
            })
        })
    }
}

/// The footer of a file that has its end.
#[derive(Clone, Copy, Debug)]
pub struct Footer {
    /// The byte at which its record begins.
    pub at: usize,
    /// The byte at which the summary begins; 0 where there is none.
    summary: u64,
    /// The checksum from there on; 0 where it is not told.
    pub crc: u32,
}

impl Footer {
    const BODY_BYTES: usize = 8 + 8 + 4;

    /// The footer at the end of `bytes`.
    #[must_use]
    pub fn find(bytes: &[u8]) -> Option<Self> {
        let at = bytes.len().checked_sub(HEADER_BYTES + Self::BODY_BYTES + MAGIC.len())?;
        let frame = Frame::at(bytes, at)?;
        if (frame.opcode, frame.body.len()) != (op::FOOTER, Self::BODY_BYTES) {
            return None;
        }
        let mut fields = Fields(frame.body);
        let (summary, _offsets) = (fields.u64()?, fields.u64()?);
        Some(Self { at, summary, crc: fields.u32()? })
    }

    /// The summary's records; none where the file has no summary, or not there.
    #[must_use]
    pub fn summary<'a>(&self, bytes: &'a [u8]) -> &'a [u8] {
        let start = usize::try_from(self.summary).ok().filter(|start| *start > 0);
        start.and_then(|start| bytes.get(start..self.at)).unwrap_or_default()
    }

    /// The checksum that the summary has, if it is where the footer says.
    #[must_use]
    pub fn found_crc(&self, bytes: &[u8]) -> Option<u32> {
        let start = if self.summary == 0 { self.at } else { usize::try_from(self.summary).ok()? };
        Some(crc32fast::hash(bytes.get(start..self.at + HEADER_BYTES + 16)?))
    }
}
