//! Files under TensorFlow's compression types: the whole file is one stream of gzip (which may be of several members) or zlib.
//!
//! [`Unpack`] is a [`Read`] over one, with a bounded buffer. At any time it can be asked where it is: a [`Restart`] holds the
//! decompressor's state, 43 kB, so that a record deep in a file is reached without unpacking all that lies before it.

use std::fmt;
use std::io::{self, Read};

use miniz_oxide::inflate::stream::{InflateState, inflate};
use miniz_oxide::{DataFormat, MZError, MZFlush, MZStatus};
use thiserror::Error;

/// What is read of a file at a time.
const BUFFER_BYTES: usize = 64 << 10;

/// From here on it counts how much a stream grows: 64 MiB, as long as a record may be.
const GROWTH_COUNTS_FROM: u64 = super::MAX_PAYLOAD_BYTES;

/// A stream that grows by more than this is a bomb. Scenes grow by 3 to 4; what deflate can do is 1032.
const MOST_GROWTH: u64 = 200;

/// How a file is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// TensorFlow's type GZIP.
    Gzip,
    /// TensorFlow's type ZLIB.
    Zlib,
}

impl Packing {
    /// How a file is packed that begins with `start`; `None` for one that is not.
    #[must_use]
    pub fn of(start: &[u8]) -> Option<Self> {
        match start {
            _ if super::looks_like_tfrecord(start) => None,
            [0x1f, 0x8b, ..] => Some(Self::Gzip),
            // Deflate with a window of 32 KiB, TensorFlow's; both bytes together divide by 31.
            [0x78, flags, ..] if (0x7800 | u16::from(*flags)).is_multiple_of(31) => Some(Self::Zlib),
            _ => None,
        }
    }
}

impl fmt::Display for Packing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
        })
    }
}

/// What is wrong with a packed stream, and where in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the {packing} stream {problem} (byte {byte} of the packed file)")]
pub struct PackedError {
    /// How it is packed.
    pub packing: Packing,
    /// How far the file had been read.
    pub byte: u64,
    /// What is wrong.
    pub problem: PackedProblem,
}

/// What is wrong with a packed stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PackedProblem {
    #[error("is cut off")]
    CutOff,
    #[error("is damaged")]
    Damaged,
    #[error("does not match its own checksum")]
    Checksum,
    #[error("has grown to {unpacked} bytes, more than {MOST_GROWTH} times what was read")]
    Bomb { unpacked: u64 },
}

impl PackedProblem {
    /// What the user can do.
    #[must_use]
    pub fn hint(self) -> &'static str {
        match self {
            Self::CutOff => "the download was cut off: fetch the file again and compare its size",
            Self::Damaged | Self::Checksum => "the file is damaged: fetch it again and compare its checksum",
            Self::Bomb { .. } => "no scenes pack so well: see where the file comes from, or unpack it (gzip -d FILE)",
        }
    }
}

/// A place in a packed file from which it can be unpacked on.
#[derive(Clone)]
pub struct Restart {
    packing: Packing,
    /// Where the next byte lies in the file.
    byte: u64,
    /// How many bytes were unpacked before it.
    unpacked: u64,
    stage: Stage,
}

impl Restart {
    /// The beginning of a file.
    #[must_use]
    pub fn beginning(packing: Packing) -> Self {
        Self { packing, byte: 0, unpacked: 0, stage: Stage::Header }
    }

    /// How the file is packed.
    #[must_use]
    pub fn packing(&self) -> Packing {
        self.packing
    }

    /// Where in the file reading goes on from here.
    #[must_use]
    pub fn byte(&self) -> u64 {
        self.byte
    }

    /// How many bytes were unpacked before.
    #[must_use]
    pub fn unpacked(&self) -> u64 {
        self.unpacked
    }
}

impl fmt::Debug for Restart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} from byte {}, {} unpacked", self.packing, self.byte, self.unpacked)
    }
}

impl PartialEq for Restart {
    fn eq(&self, other: &Self) -> bool {
        (self.packing, self.byte, self.unpacked) == (other.packing, other.byte, other.unpacked)
    }
}

impl Eq for Restart {}

/// What the next byte of a packed file belongs to.
#[derive(Clone)]
enum Stage {
    /// Before a stream, or at the file's end if there was one.
    Header,
    Stream(Box<InflateState>),
    /// After a stream, before its checksum.
    Trailer,
    End,
}

/// Unpacks a file as it is read. Its errors hold a [`PackedError`] where the file is at fault.
pub struct Unpack<R> {
    source: R,
    packing: Packing,
    buffer: Vec<u8>,
    /// The bytes of the buffer that are still to be taken.
    pending: std::ops::Range<usize>,
    stage: Stage,
    /// Bytes taken from the file.
    byte: u64,
    unpacked: u64,
    /// Where counting of growth begins: bytes of the file and unpacked ones when this was made.
    origin: (u64, u64),
    /// Checksum and length of the gzip member so far; nothing where it was not read from its beginning.
    member: Option<(crc32fast::Hasher, u32)>,
}

impl<R: Read> Unpack<R> {
    /// Unpacks `source`, whose next byte is that of `restart`.
    pub fn from(source: R, restart: &Restart) -> Self {
        Self {
            source,
            packing: restart.packing,
            buffer: vec![0; BUFFER_BYTES],
            pending: 0..0,
            stage: restart.stage.clone(),
            byte: restart.byte,
            unpacked: restart.unpacked,
            origin: (restart.byte, restart.unpacked),
            member: None,
        }
    }

    /// The place that has been read up to.
    #[must_use]
    pub fn restart(&self) -> Restart {
        Restart { packing: self.packing, byte: self.byte, unpacked: self.unpacked, stage: self.stage.clone() }
    }

    /// How many bytes have been unpacked.
    #[must_use]
    pub fn unpacked(&self) -> u64 {
        self.unpacked
    }

    fn error(&self, problem: PackedProblem) -> io::Error {
        io::Error::other(PackedError { packing: self.packing, byte: self.byte, problem })
    }

    /// Sees to it that bytes are pending; whether there are, or the file has ended.
    fn fill(&mut self) -> io::Result<bool> {
        while self.pending.is_empty() {
            match self.source.read(&mut self.buffer) {
                Ok(0) => return Ok(false),
                Ok(count) => self.pending = 0..count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    fn take(&mut self) -> io::Result<u8> {
        if !self.fill()? {
            return Err(self.error(PackedProblem::CutOff));
        }
        let byte = self.buffer[self.pending.start];
        self.pending.start += 1;
        self.byte += 1;
        Ok(byte)
    }

    fn take_number(&mut self) -> io::Result<u32> {
        let mut bytes = [0; 4];
        for byte in &mut bytes {
            *byte = self.take()?;
        }
        Ok(u32::from_le_bytes(bytes))
    }

    /// Begins the next stream, if there is one.
    fn begin(&mut self) -> io::Result<()> {
        if !self.fill()? {
            if self.byte == 0 {
                return Err(self.error(PackedProblem::CutOff));
            }
            self.stage = Stage::End;
            return Ok(());
        }
        let format = match self.packing {
            Packing::Gzip => {
                self.gzip_header()?;
                DataFormat::Raw
            }
            // What follows a zlib stream belongs to nobody.
            Packing::Zlib if self.byte > 0 => return Err(self.error(PackedProblem::Damaged)),
            Packing::Zlib => DataFormat::Zlib,
        };
        self.member = Some((crc32fast::Hasher::new(), 0));
        self.stage = Stage::Stream(InflateState::new_boxed(format));
        Ok(())
    }

    /// RFC 1952, section 2.3.
    fn gzip_header(&mut self) -> io::Result<()> {
        const EXTRA: u8 = 4;
        const NAME: u8 = 8;
        const COMMENT: u8 = 16;
        const CHECKSUM: u8 = 2;
        for expected in [0x1f, 0x8b, 8] {
            if self.take()? != expected {
                return Err(self.error(PackedProblem::Damaged));
            }
        }
        let flags = self.take()?;
        // When and by what it was packed.
        for _ in 0..6 {
            self.take()?;
        }
        if flags & EXTRA != 0 {
            let length = u16::from_le_bytes([self.take()?, self.take()?]);
            for _ in 0..length {
                self.take()?;
            }
        }
        for text in [NAME, COMMENT] {
            while flags & text != 0 && self.take()? != 0 {}
        }
        if flags & CHECKSUM != 0 {
            self.take()?;
            self.take()?;
        }
        Ok(())
    }

    /// Ends a stream: its checksum is right, as far as that can be said.
    fn end(&mut self) -> io::Result<()> {
        self.stage = Stage::Header;
        if self.packing == Packing::Gzip {
            let stored = (self.take_number()?, self.take_number()?);
            let computed = self.member.take().map(|(hasher, length)| (hasher.finalize(), length));
            if computed.is_some_and(|computed| computed != stored) {
                return Err(self.error(PackedProblem::Checksum));
            }
        }
        Ok(())
    }
}

impl<R: Read> Read for Unpack<R> {
    fn read(&mut self, space: &mut [u8]) -> io::Result<usize> {
        if space.is_empty() {
            return Ok(0);
        }
        loop {
            match self.stage {
                Stage::Header => self.begin()?,
                Stage::Trailer => self.end()?,
                Stage::Stream(_) | Stage::End => {}
            }
            let more = self.fill()?;
            let state = match &mut self.stage {
                Stage::Stream(state) => state,
                Stage::End => return Ok(0),
                Stage::Header | Stage::Trailer => continue,
            };
            let result = inflate(state, &self.buffer[self.pending.clone()], space, MZFlush::None);
            self.pending.start += result.bytes_consumed;
            self.byte += result.bytes_consumed as u64;
            self.unpacked += result.bytes_written as u64;
            if let Some((hasher, length)) = &mut self.member {
                hasher.update(&space[..result.bytes_written]);
                *length = length.wrapping_add(result.bytes_written as u32); // modulo 2^32, as it is stored
            }
            let (taken, unpacked) = (self.byte - self.origin.0, self.unpacked - self.origin.1);
            if unpacked > GROWTH_COUNTS_FROM && unpacked / MOST_GROWTH > taken {
                return Err(self.error(PackedProblem::Bomb { unpacked: self.unpacked }));
            }
            if let Ok(MZStatus::StreamEnd) = result.status {
                self.stage = Stage::Trailer;
            }
            // What was unpacked before a fault is given first, so that a record is whole however the bytes arrive.
            if result.bytes_written > 0 {
                return Ok(result.bytes_written);
            }
            match result.status {
                Ok(_) | Err(MZError::Buf) if result.bytes_consumed == 0 && !more => {
                    return Err(self.error(PackedProblem::CutOff));
                }
                Ok(_) | Err(MZError::Buf) => {}
                Err(_) => return Err(self.error(PackedProblem::Damaged)),
            }
        }
    }
}
