//! An episode as an MCAP file: the product's own messages, and the same in Foxglove's, so that Foxglove and Lichtblick show
//! them as they are. `docs/recordings.md` lists the channels.

mod file;
mod foxglove_messages;
mod reader;
mod writer;

pub use file::{ChannelId, Encoder};
pub use reader::{ChannelSummary, Contents, ReadError, read};
pub use writer::EpisodeWriter;
