//! MCAP recordings, read by the public crate.

use std::fs;
use std::path::Path;

use wire::convert::compact;

/// A message of a recording.
pub struct Recorded {
    /// The channel's topic.
    pub topic: String,
    /// The payload; of a prediction, as it travelled.
    pub bytes: Vec<u8>,
}

/// All messages of a recording, in its order.
pub fn messages(path: &Path) -> Vec<Recorded> {
    let file = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let stream = mcap::MessageStream::new(&file).unwrap();
    let messages = stream.map(|message| {
        let message = message.unwrap();
        let (topic, bytes) = (message.channel.topic.clone(), message.data.into_owned());
        let bytes = if topic == "/reloop/prediction" { compact::unpack(&bytes).into_owned() } else { bytes };
        Recorded { topic, bytes }
    });
    messages.collect()
}
