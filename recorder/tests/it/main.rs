//! Claims about what recordings hold, over a made-up episode.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod cli;
mod damage;
mod mcap;
mod order;
mod process;
mod rrd;
mod synthetic;

use recorder::mcap::{Contents, EpisodeWriter, ReadError, read};
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

/// What a recording holds, and its messages.
fn read_all(bytes: &[u8]) -> Result<(Contents, Vec<Message>), ReadError> {
    let mut messages = Vec::new();
    let contents = read(bytes, |message| messages.push(message))?;
    Ok((contents, messages))
}

/// The Rerun file of these messages.
fn rrd_of(messages: &[Message]) -> Vec<u8> {
    let mut drawing = Drawing::default();
    messages.iter().for_each(|message| drawing.push(message));
    drawing.finish("test", synthetic::SETTINGS).unwrap()
}
