//! Reads recordings: MCAP bytes in, messages out, whole, cut off or damaged.
//!
//! Whatever the bytes are, reading ends, in time and memory that are bounded; what is damaged is named, and the rest is read. So
//! the records are framed and checked here, by hand, and no part of a file is believed before it is checked: a chunk is unpacked
//! into a room of the size that it may have at most, and read when its checksum is right.
//!
//! ```text
//!   file ──load──▶ bytes ──▶ Reader ──▶ Event, Event, Event ...
//!                              │
//!                              └── where the framing is lost, it goes on at the next chunk
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`reader`] | from record to record, into chunks and out again |
//! | [`unpacking`] | chunks to records |
//! | [`definitions`] | schemas and channels |
//! | [`damage`] | what can be wrong, and where |
//! | [`records`] | MCAP's records, as bytes |
//! | [`fields`] | numbers and texts of a record |
//! | [`file`](mod@file) | bytes from a file that may have no end |
//!
//! What the messages say is nobody's business here: that is `wire`'s.

pub mod damage;
pub mod definitions;
pub mod fields;
pub mod file;
#[doc(hidden)]
pub mod mutants;
pub mod reader;
pub mod records;
#[cfg(test)]
mod tests;
pub mod unpacking;

pub use damage::{Damage, Fault};
pub use definitions::Channel;
pub use file::{LoadError, load};
pub use reader::{Event, Message, NotMcap, Reader};

/// The metadata record that says what a recording is of.
pub const METADATA: &str = "reloop";
/// Its entry with the run's name.
pub const METADATA_RUN: &str = "run";
/// Its entry with the run's settings (TOML).
pub const METADATA_SETTINGS: &str = "run.toml";
/// What the topics of the product's own messages begin with; the channel's name on the bus follows.
pub const TOPICS: &str = "/reloop/";
