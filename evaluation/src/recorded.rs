//! The messages of a recording that are our own, one after the other.

use recording::{Event, NotMcap, Reader, TOPICS};
use thiserror::Error;
use wire::convert::compact;

/// A recording that cannot be taken at its word.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RecordedError {
    #[error(transparent)]
    NotMcap(#[from] NotMcap),
    #[error("it is damaged: {0}\nhint: `recorder info` tells what of it can be read")]
    Damaged(String),
    #[error("its message on {topic} at byte {at} cannot be used: {why}")]
    Message { topic: String, at: u64, why: String },
    #[error("it has no {0}: it is not whole")]
    Missing(&'static str),
}

/// Tells each message of the MCAP file `bytes`: its channel's name on the bus, and what it says. What `tell` refuses is named by place.
///
/// # Errors
/// [`RecordedError`], also of the first damage.
pub(crate) fn messages(
    bytes: &[u8],
    mut tell: impl FnMut(&str, &[u8]) -> Result<(), String>,
) -> Result<(), RecordedError> {
    let mut reader = Reader::new(bytes)?;
    while let Some(event) = reader.next() {
        let message = match event {
            Event::Message(message) => message,
            Event::Damage(damage) => return Err(RecordedError::Damaged(damage.to_string())),
            Event::Metadata { .. } | Event::Channel(_) => continue,
        };
        let topic = &message.channel.topic;
        let Some(name) = topic.strip_prefix(TOPICS) else { continue };
        tell(name, &compact::as_told(name, message.data)).map_err(|why| RecordedError::Message {
            topic: topic.clone(),
            at: message.at,
            why,
        })?;
    }
    Ok(())
}
