//! What travels between the simulator, its nodes and the recorder, and how: messages, keys, sessions. Whoever writes a planner or a predictor
//! needs this crate, `world` and clap, and no other of reloop.
//!
//! No planner lives here, and no file is read or written but a user's Zenoh configuration.
//!
//! # A planner of your own
//!
//! ```toml
//! [dependencies]
//! clap = { version = "4", features = ["derive"] }
//! wire = { path = "reloop/wire" }
//! world = { path = "reloop/world" }
//! ```
//!
//! It follows the reference line, no faster than the limit, and stops behind whoever is in the way:
//!
//! ```no_run
#![doc = include_str!("../examples/follow_the_line.rs")]
//! ```
//!
//! `cargo build --release`, then `sim run --planner-command target/release/my-planner`. A planner that keeps something from step to step
//! is a closure or implements [`node::Planner`]; what is known at a step is [`node::StepInput`]: units are SI, angles radians, and
//! places those of the log. A refusal (`Err`) ends the episode as failed, with the sentence as its reason; so does a panic.
//!
//! # Inside
//!
//! | module | what |
//! | --- | --- |
//! | [`proto`] | the messages as prost makes them of `proto/reloop.proto` |
//! | [`convert`] | between messages and the world's types; checks what comes from outside |
//! | [`cores`] | which cores those who talk to each other run on |
//! | [`digest`] | whether a recording holds what was told |
//! | [`envelope`] | what messages travel in, packed and unpacked without looking inside |
//! | [`keys`] | every key of the bus |
//! | [`pulse`] | notices that this process stood still |
//! | [`session`] | bus sessions: the simulator's router, the nodes' clients |
//! | [`hub`] | the simulator's side: barrier, watch over nodes, a line for each episode |
//! | [`node`] | the nodes' side: what a planner or predictor implements, and how it is served |
//! | [`service`] | runs and sessions that are asked for from afar: both ends of a service |

pub mod convert;
pub mod cores;
pub mod digest;
pub mod envelope;
#[doc(hidden)]
pub mod fuzzing;
pub mod hub;
pub mod keys;
pub mod node;
pub mod proto;
pub mod pulse;
pub mod service;
pub mod session;

/// The version of messages, keys and their order. A node of another version is refused; raise it with every change that an
/// older node would misread.
pub const WIRE_VERSION: u32 = 3;

/// `proto/reloop.proto`, compiled: the schema of every message, as recordings carry it (a serialized `FileDescriptorSet`).
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// `proto/service.proto`, compiled, without the messages of the bus that it uses.
pub const SERVICE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/service.bin"));

#[cfg(test)]
mod tests {
    #[test]
    fn the_descriptor_set_names_every_message() {
        let text = String::from_utf8_lossy(super::FILE_DESCRIPTOR_SET);
        assert!(text.contains("reloop.v1"));
        for name in [
            "Scene",
            "Observation",
            "Prediction",
            "Plan",
            "StepRecord",
            "Event",
            "EpisodeEnd",
            "RunInfo",
            "Recorded",
            "Told",
            "Answer",
            "Done",
            "Admission",
        ] {
            assert!(text.contains(name), "{name}");
        }
    }
}
