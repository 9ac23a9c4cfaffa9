//! Claims about what recordings hold, over a made-up episode.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod cli;
mod damage;
mod mcap;
mod order;
mod process;
mod rrd;
mod synthetic;

use recorder::mcap::EpisodeWriter;
use recorder::message::Message;
use recorder::rrd::Drawing;

/// The MCAP file of these messages.
fn mcap_of(messages: &[Message]) -> Vec<u8> {
    let mut writer = EpisodeWriter::new("test", synthetic::SETTINGS).unwrap();
    messages.iter().for_each(|message| writer.write(message).unwrap());
    let mut bytes = writer.take();
    bytes.extend(writer.finish().unwrap());
    bytes
}

/// The Rerun file of these messages.
fn rrd_of(messages: &[Message]) -> Vec<u8> {
    let mut drawing = Drawing::default();
    messages.iter().for_each(|message| drawing.push(message));
    drawing.finish("test", synthetic::SETTINGS).unwrap()
}
