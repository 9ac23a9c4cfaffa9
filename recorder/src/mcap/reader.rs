//! The product's messages in a recording, whole, cut off or damaged; what is damaged is named, and the rest read.

use std::collections::BTreeMap;

use recording::{Damage, Event, Fault, METADATA, METADATA_RUN, METADATA_SETTINGS, NotMcap, Reader, TOPICS};
use thiserror::Error;
use wire::convert::compact;
use wire::keys::Channel;

use crate::message::{CHANNELS, Message, STEP_NANOSECONDS};

/// As many places are named as a user may want to look at; more are counted.
const NAMED: usize = 8;

/// Topics that are counted; a recording has some twenty.
const TOPICS_COUNTED: usize = 1024;

/// Why a file is no recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ReadError {
    /// It is no MCAP file.
    #[error(transparent)]
    NotMcap(#[from] NotMcap),
    /// An MCAP of somebody else.
    #[error("an MCAP file, but not one of reloop: it has no /reloop/scene channel")]
    Foreign,
}

/// A channel's messages, counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChannelSummary {
    /// The messages' full name.
    pub schema: String,
    /// How many.
    pub messages: u64,
    /// Their bytes, not compressed.
    pub bytes: u64,
}

/// What a recording holds, beside the messages.
#[derive(Debug, Default)]
pub struct Contents {
    /// The run's name on the bus; empty where the file does not tell.
    pub run: String,
    /// The run's settings (TOML).
    pub settings: String,
    /// All channels by topic.
    pub channels: BTreeMap<String, ChannelSummary>,
    /// Simulated time of the last message (steps).
    pub last_step: u64,
    /// The first places that are damaged, each with the step that was read last before it.
    pub damage: Vec<(u64, Damage)>,
    /// How many places more are.
    pub more_damage: u64,
    /// Whether the file ends too early: its recorder was killed, or the disk was full.
    pub is_cut_off: bool,
}

impl Contents {
    /// What is wrong with the file, in a sentence; nothing where it is whole.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        let more = if self.more_damage > 0 { format!(" and {} places more", self.more_damage) } else { String::new() };
        match (self.damage.first(), self.damage.len(), self.is_cut_off) {
            (None, _, false) => None,
            (None, _, true) => Some("cut off".to_owned()),
            (Some((_, first)), 1, _) => Some(format!("damaged ({first}){more}")),
            (Some((_, first)), places, _) => Some(format!("damaged in {places} places{more} (the first: {first})")),
        }
    }

    fn damaged(&mut self, damage: Damage) {
        if damage.fault == Fault::CutOff {
            self.is_cut_off = true;
        } else if self.damage.len() < NAMED {
            self.damage.push((self.last_step, damage));
        } else {
            self.more_damage += 1;
        }
    }

    fn count(&mut self, topic: &str, bytes: usize) {
        if let Some(summary) = self.channels.get_mut(topic) {
            summary.messages += 1;
            summary.bytes += bytes as u64;
        }
    }
}

/// Reads the bytes of a recording, and gives the product's messages to `hear` in the file's order.
///
/// # Errors
/// [`ReadError`]. A file that is cut off or damaged is none, if it is a recording: see [`Contents`].
pub fn read(bytes: &[u8], mut hear: impl FnMut(Message)) -> Result<Contents, ReadError> {
    let mut reader = Reader::new(bytes)?;
    let mut contents = Contents::default();
    while let Some(event) = reader.next() {
        match event {
            Event::Metadata { name: METADATA, entries } => {
                for (key, value) in entries {
                    match key {
                        METADATA_RUN => value.clone_into(&mut contents.run),
                        METADATA_SETTINGS => value.clone_into(&mut contents.settings),
                        _ => {}
                    }
                }
            }
            Event::Metadata { .. } => {}
            Event::Channel(channel) if contents.channels.len() < TOPICS_COUNTED => {
                contents.channels.entry(channel.topic.clone()).or_default().schema.clone_from(&channel.schema);
            }
            Event::Channel(_) => {}
            Event::Message(message) => {
                let topic = &message.channel.topic;
                contents.last_step = contents.last_step.max(message.log_time / STEP_NANOSECONDS);
                contents.count(topic, message.data.len());
                let Some(channel) = own(topic) else { continue };
                match Message::decode(channel, compact::as_told(channel.name(), message.data).into_owned()) {
                    Ok(message) => hear(message),
                    Err(error) => {
                        let fault = Fault::Message { topic: topic.clone(), why: error.to_string() };
                        contents.damaged(Damage { at: message.at, fault });
                    }
                }
            }
            Event::Damage(damage) => contents.damaged(damage),
        }
    }
    let is_ours = contents.channels.contains_key("/reloop/scene");
    // A file that is cut before its first chunk has no channels, but says whose it is.
    let says_so = contents.channels.is_empty() && !contents.settings.is_empty();
    if is_ours || says_so { Ok(contents) } else { Err(ReadError::Foreign) }
}

/// The channel of one of our own topics.
fn own(topic: &str) -> Option<Channel> {
    let name = topic.strip_prefix(TOPICS)?;
    CHANNELS.into_iter().find(|channel| channel.name() == name)
}
