//! From record to record, into chunks and out again.

use std::collections::BTreeSet;
use std::ops::Range;

use thiserror::Error;

use crate::damage::{Damage, Fault};
use crate::definitions::{Channel, Definitions};
use crate::fields::Fields;
use crate::records::{CHUNK_LIMIT, Chunk, Footer, Frame, MAGIC, op};
use crate::unpacking::Unpacker;

/// The most bytes that all chunks of a file may hold, so that no small file takes for ever.
const UNPACKED_LIMIT: u64 = 2 << 30;

/// The most records of a file. A long drive has some ten thousand.
const RECORD_LIMIT: u64 = 1 << 21;

/// The most bytes of a named table: the run's settings, some kilobytes.
const METADATA_LIMIT: usize = 8 << 20;

/// The bytes do not begin as an MCAP file, and no chunk of one is among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "no readable MCAP file\n  hint: recordings are the files <run>/episodes/<scene>.mcap, and .mcap.partial where they are not whole"
)]
pub struct NotMcap;

/// A message of a file.
#[derive(Clone, Copy, Debug)]
pub struct Message<'r> {
    /// Its channel.
    pub channel: &'r Channel,
    /// When it was said (ns).
    pub log_time: u64,
    /// What it says.
    pub data: &'r [u8],
    /// The byte of the file at which its data begins, or the chunk that holds it.
    pub at: u64,
}

/// What a reader comes upon.
#[derive(Debug)]
pub enum Event<'r> {
    /// A named table of texts.
    Metadata {
        /// Its name.
        name: &'r str,
        /// Keys and values, in the file's order.
        entries: Vec<(&'r str, &'r str)>,
    },
    /// A channel, before its first message.
    Channel(&'r Channel),
    /// A message.
    Message(Message<'r>),
    /// Something that is not as it was written, and is passed over.
    Damage(Damage),
}

/// An [`Event`] whose bytes are still to be looked up.
enum Found {
    Metadata(usize),
    Channel(u16),
    Message { channel: u16, log_time: u64, data: Range<usize> },
    Damage(Damage),
}

/// Reads a file's bytes from the front.
pub struct Reader<'a> {
    bytes: &'a [u8],
    /// The next record of the file.
    at: usize,
    /// The chunk that is being read.
    chunk: Option<Open>,
    /// Its records.
    unpacker: Unpacker,
    definitions: Definitions,
    footer: Option<Footer>,
    /// Channels of messages that nothing describes: each is named once.
    unknown: BTreeSet<u16>,
    /// Found before it is its turn.
    waiting: Option<Damage>,
    /// Something was named: that the data's checksum is another then says nothing new.
    damaged: bool,
    /// No chunk follows, by its look.
    no_more_chunks: bool,
    /// Whether the end of the data was passed.
    after_data: bool,
    /// What was read so far.
    spent: Spent,
    done: bool,
}

/// A chunk that is being read.
struct Open {
    /// Its first byte in the file.
    at: usize,
    /// The next of its records, in the bytes that it holds.
    next: usize,
}

#[derive(Default)]
struct Spent {
    unpacked: u64,
    records: u64,
}

impl<'a> Reader<'a> {
    /// A reader of the bytes of a file.
    ///
    /// # Errors
    /// [`NotMcap`].
    pub fn new(bytes: &'a [u8]) -> Result<Self, NotMcap> {
        let (at, waiting) = if bytes.starts_with(MAGIC) {
            (MAGIC.len(), None)
        } else {
            (Chunk::find(bytes, 0).ok_or(NotMcap)?, Some(Damage { at: 0, fault: Fault::Beginning }))
        };
        let footer = Footer::find(bytes);
        let sound = footer.filter(|footer| footer.crc == 0 || footer.found_crc(bytes) == Some(footer.crc));
        let definitions =
            sound.map_or_else(Definitions::default, |footer| Definitions::of_summary(footer.summary(bytes)));
        Ok(Self {
            bytes,
            at,
            chunk: None,
            unpacker: Unpacker::default(),
            definitions,
            footer,
            unknown: BTreeSet::new(),
            damaged: waiting.is_some(),
            waiting,
            no_more_chunks: false,
            after_data: false,
            spent: Spent::default(),
            done: false,
        })
    }

    /// The next event; none after the last.
    #[allow(clippy::should_implement_trait, reason = "an iterator's items cannot borrow from it")]
    pub fn next(&mut self) -> Option<Event<'_>> {
        let found = self.find()?;
        let records = self.records();
        Some(match found {
            Found::Damage(damage) => Event::Damage(damage),
            Found::Channel(id) => Event::Channel(self.definitions.channel(id)?),
            Found::Metadata(at) => {
                let mut fields = Fields(Frame::at(self.bytes, at)?.body);
                Event::Metadata { name: fields.text()?, entries: fields.table()? }
            }
            Found::Message { channel, log_time, data } => {
                let at = self.chunk.as_ref().map_or(data.start, |chunk| chunk.at);
                let data = records.get(data)?;
                Event::Message(Message { channel: self.definitions.channel(channel)?, log_time, data, at: at as u64 })
            }
        })
    }

    /// What the records that are being read lie in.
    fn records(&self) -> &[u8] {
        if self.chunk.is_some() { self.unpacker.records() } else { self.bytes }
    }

    /// Goes on to the next event. Each turn of the loop moves `at`, or the place in the chunk, forward.
    fn find(&mut self) -> Option<Found> {
        if let Some(damage) = self.waiting.take() {
            return Some(Found::Damage(damage));
        }
        while !self.done {
            self.spent.records += 1;
            if self.spent.records > RECORD_LIMIT {
                return Some(self.too_much("records"));
            }
            let found = if self.chunk.is_some() { self.in_chunk() } else { self.in_file() };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    fn damage(&mut self, at: usize, fault: Fault) -> Option<Found> {
        self.damaged = true;
        Some(Found::Damage(Damage { at: at as u64, fault }))
    }

    fn too_much(&mut self, what: &'static str) -> Found {
        self.done = true;
        Found::Damage(Damage { at: self.at as u64, fault: Fault::TooMuch(what) })
    }

    /// The next record of the file.
    fn in_file(&mut self) -> Option<Found> {
        let (bytes, at) = (self.bytes, self.at);
        if self.footer.is_some_and(|footer| footer.at == at) {
            return self.end();
        }
        let Some(frame) = Frame::at(bytes, at) else {
            return self.lost(at);
        };
        self.at = frame.end(at);
        let opcode = frame.opcode;
        match opcode {
            op::CHUNK if !self.after_data => self.open(at, frame.body),
            op::SCHEMA | op::CHANNEL | op::MESSAGE if !self.after_data => {
                let found = take(&mut self.definitions, &mut self.unknown, frame, self.at);
                found.unwrap_or_else(|fault| self.damage(at, fault))
            }
            op::METADATA if !self.after_data => {
                // Entries take more room here than there.
                let mut fields = Fields(if frame.body.len() <= METADATA_LIMIT { frame.body } else { &[] });
                match (fields.text(), fields.table()) {
                    (Some(_), Some(_)) => Some(Found::Metadata(at)),
                    _ => self.damage(at, Fault::Fields { opcode }),
                }
            }
            op::DATA_END if !self.after_data => {
                self.after_data = true;
                let Some(told) = Fields(frame.body).u32() else { return self.damage(at, Fault::Fields { opcode }) };
                // Who has named the damage need not say that there is some.
                let found = if self.damaged || told == 0 { told } else { crc32fast::hash(&bytes[..at]) };
                if found == told { None } else { self.damage(at, Fault::Data { told, found }) }
            }
            // The summary says again what was said.
            op::SCHEMA..=op::DATA_END if opcode != op::MESSAGE && opcode != op::CHUNK => None,
            op::HEADER if at == MAGIC.len() => None,
            op::FOOTER if self.after_data => None,
            op::PRIVATE.. => None,
            _ => self.damage(at, Fault::Stray { opcode }),
        }
    }

    /// Goes on at the next chunk, or at the end, after the framing was lost at a byte.
    fn lost(&mut self, at: usize) -> Option<Found> {
        let next = if self.after_data { None } else { self.next_chunk(at + 1) };
        match next.or(self.footer.map(|footer| footer.at).filter(|end| *end > at)) {
            Some(next) => {
                self.at = next;
                let opcode = self.bytes.get(at).copied().unwrap_or_default();
                self.damage(at, Fault::Length { opcode })
            }
            None => {
                self.done = true;
                let has_end = at > MAGIC.len() && self.bytes.ends_with(MAGIC);
                self.damage(at, if has_end { Fault::End } else { Fault::CutOff })
            }
        }
    }

    /// Where the next chunk begins. That there is none is found out once, for to find it out takes a look at all the rest.
    fn next_chunk(&mut self, from: usize) -> Option<usize> {
        let found = if self.no_more_chunks { None } else { Chunk::find(self.bytes, from) };
        self.no_more_chunks = found.is_none();
        found
    }

    /// The footer.
    fn end(&mut self) -> Option<Found> {
        self.done = true;
        let footer = self.footer?;
        if !self.bytes.ends_with(MAGIC) {
            return self.damage(footer.at, Fault::End);
        }
        let (told, found) = (footer.crc, footer.found_crc(self.bytes).unwrap_or_default());
        if told == 0 || found == told { None } else { self.damage(footer.at, Fault::Summary { told, found }) }
    }

    /// Unpacks a chunk, the next to be read if it is sound.
    fn open(&mut self, at: usize, body: &[u8]) -> Option<Found> {
        let Some(chunk) = Chunk::of(body) else {
            // Its length is as doubtful as the rest.
            self.at = self.next_chunk(at + 1).unwrap_or(self.at);
            return self.damage(at, Fault::Fields { opcode: op::CHUNK });
        };
        self.spent.unpacked += chunk.size.min(CHUNK_LIMIT);
        if self.spent.unpacked > UNPACKED_LIMIT {
            return Some(self.too_much("data"));
        }
        match self.unpacker.unpack(&chunk) {
            Ok(()) => {
                self.chunk = Some(Open { at, next: 0 });
                None
            }
            Err(fault) => self.damage(at, fault),
        }
    }

    /// The next record of the open chunk.
    fn in_chunk(&mut self) -> Option<Found> {
        let Open { at, next } = self.chunk.take()?;
        let records = self.unpacker.records();
        let Some(frame) = Frame::at(records, next) else {
            let opcode = *records.get(next)?;
            return self.damage(at, Fault::Length { opcode });
        };
        let next = frame.end(next);
        let found = match frame.opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE => take(&mut self.definitions, &mut self.unknown, frame, next),
            op::PRIVATE.. => Ok(None),
            opcode => Err(Fault::Stray { opcode }),
        };
        self.chunk = Some(Open { at, next });
        found.unwrap_or_else(|fault| self.damage(at, fault))
    }
}

/// A record that may lie in a chunk, and ends before the byte `end` of what it lies in.
fn take(
    definitions: &mut Definitions,
    unknown: &mut BTreeSet<u16>,
    frame: Frame<'_>,
    end: usize,
) -> Result<Option<Found>, Fault> {
    if frame.opcode != op::MESSAGE {
        return Ok(definitions.take(frame)?.map(Found::Channel));
    }
    let mut fields = Fields(frame.body);
    let head = (fields.u16(), fields.u32(), fields.u64(), fields.u64());
    let (Some(channel), Some(_sequence), Some(log_time), Some(_published)) = head else {
        return Err(Fault::Fields { opcode: op::MESSAGE });
    };
    match definitions.channel(channel) {
        Some(_) => Ok(Some(Found::Message { channel, log_time, data: end - fields.0.len()..end })),
        None if unknown.insert(channel) => Err(Fault::NoChannel(channel)),
        None => Ok(None),
    }
}
