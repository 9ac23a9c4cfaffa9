//! What every input must keep, in functions that a fuzzer calls; `fuzz/` does so by the million, a test by the thousand.

use crate::info::Info;
use crate::mcap::{EpisodeWriter, read};
use crate::message::{CHANNELS, Message};
use crate::rrd::Drawing;

/// Any bytes as a recording: no panic, whether it is shown or drawn.
pub fn recording(bytes: &[u8]) {
    let Ok(info) = Info::read("fuzzed.mcap".to_owned(), bytes, true) else { return };
    let _ = info.to_string();
    let mut drawing = Drawing::default();
    if read(bytes, |message| drawing.push(&message)).is_ok() {
        let _ = drawing.finish("fuzzed", "");
    }
}

/// Any bytes as what comes over the bus, message after message (the channel's number, the length in four bytes, the message): no
/// panic in writing and drawing what is taken.
pub fn messages(mut bytes: &[u8]) {
    let mut taken = Vec::new();
    while let [channel, a, b, c, d, rest @ ..] = bytes {
        let length = (u32::from_le_bytes([*a, *b, *c, *d]) as usize).min(rest.len());
        let (payload, after) = rest.split_at(length);
        taken.extend(Message::decode(CHANNELS[usize::from(*channel) % CHANNELS.len()], payload.to_vec()).ok());
        bytes = after;
    }
    if let Ok(mut writer) = EpisodeWriter::new("fuzzed", "") {
        for message in &taken {
            let _ = writer.write(message);
        }
        let _ = writer.finish();
    }
    draw(&taken);
}

fn draw(messages: &[Message]) {
    let mut drawing = Drawing::default();
    messages.iter().for_each(|message| drawing.push(message));
    let _ = drawing.finish("fuzzed", "");
}
