//! MCAP recordings, read by the public crate.

use std::fs;
use std::path::Path;

/// A message of a recording.
pub struct Recorded {
    /// The channel's topic.
    pub topic: String,
    /// The payload.
    pub bytes: Vec<u8>,
}

/// All messages of a recording, in its order.
pub fn messages(path: &Path) -> Vec<Recorded> {
    let file = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let stream = mcap::MessageStream::new(&file).unwrap();
    let messages = stream.map(|message| {
        let message = message.unwrap();
        Recorded { topic: message.channel.topic.clone(), bytes: message.data.into_owned() }
    });
    messages.collect()
}
