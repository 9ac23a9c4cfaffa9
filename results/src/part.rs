//! One finished episode, whole: kept in `parts/` until the run is complete, so that a killed run is continued from there.

use prost::Message;
use sha2::{Digest, Sha256};
use wire::proto::{AgentState, EndReason, EpisodeEnd, Event, StepRecord, TrafficMoves};

use crate::files::hexadecimal;

/// Bytes of a part's checksum.
const CHECKSUM: usize = 32;

/// A finished episode. Protobuf, so that what is read back is what was written, to the bit.
#[derive(Clone, PartialEq, Message)]
pub struct Part {
    /// How it ended.
    #[prost(message, optional, tag = "1")]
    pub end: Option<EpisodeEnd>,
    /// What was driven.
    #[prost(message, repeated, tag = "2")]
    pub records: Vec<StepRecord>,
    /// What happened.
    #[prost(message, repeated, tag = "3")]
    pub events: Vec<Event>,
    /// The AV before step 0; none where no step could be driven.
    #[prost(message, optional, tag = "4")]
    pub start: Option<AgentState>,
    /// The log index of step 0.
    #[prost(uint32, tag = "5")]
    pub start_log_index: u32,
    /// The logged AV at each record's log index.
    #[prost(message, repeated, tag = "6")]
    pub logged: Vec<LoggedState>,
    /// What is wrong with the recording; empty where nothing is.
    #[prost(string, tag = "7")]
    pub recording_error: String,
    /// Whether there is a recording.
    #[prost(bool, tag = "8")]
    pub recorded: bool,
    /// What took how long.
    #[prost(message, optional, tag = "9")]
    pub timing: Option<Timing>,
    /// What a person should know of the scene: the codes of the warnings that `scenarios lint` has for it.
    #[prost(string, repeated, tag = "10")]
    pub findings: Vec<String>,
    /// What cannot be judged in the scene.
    #[prost(string, repeated, tag = "11")]
    pub unjudged: Vec<String>,
    /// SHA-256 of the scene's record as it was driven, in hexadecimal digits; empty where it could not be read.
    #[prost(string, tag = "12")]
    pub scene_sha256: String,
    /// Under a latency: what became of its plans.
    #[prost(message, optional, tag = "13")]
    pub plans: Option<Plans>,
    /// Which run it is of, see [`crate::settings::RunFile::identity`].
    #[prost(string, tag = "14")]
    pub run_sha256: String,
    /// Where those were that reacted, step by step; nothing in replay.
    #[prost(message, repeated, tag = "15")]
    pub moved: Vec<TrafficMoves>,
    /// How many agents of the log did not appear, because somebody was in their place; none in replay.
    #[prost(uint32, tag = "16")]
    pub without_room: u32,
}

/// The plans of an episode under a latency.
#[derive(Clone, PartialEq, Message)]
pub struct Plans {
    /// How long each took from the observation that it answers (us), step after step; -1 where it never arrived.
    #[prost(sint32, repeated, tag = "1")]
    pub delays_us: Vec<i32>,
    /// Took effect in a later step than that of their observation.
    #[prost(uint32, tag = "2")]
    pub late: u32,
    /// Never took effect.
    #[prost(uint32, tag = "3")]
    pub lost: u32,
}

/// How an episode came out, as far as it matters for driving it again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// It has no result.
    pub failed: bool,
    /// Its recording is not whole.
    pub unrecorded: bool,
}

/// The logged AV, if the log has it.
#[derive(Clone, PartialEq, Message)]
pub struct LoggedState {
    /// Where it was.
    #[prost(message, optional, tag = "1")]
    pub state: Option<AgentState>,
}

/// Seconds of wall clock: the only figures of a run that do not repeat.
#[derive(Clone, Copy, PartialEq, Message)]
pub struct Timing {
    /// From the start of the program to the first step of the episode.
    #[prost(double, tag = "1")]
    pub first_step: f64,
    /// The worker that drove.
    #[prost(uint32, tag = "2")]
    pub worker: u32,
    /// Reading the scene.
    #[prost(double, tag = "3")]
    pub load: f64,
    /// Making the episode: route, reference line, grids.
    #[prost(double, tag = "4")]
    pub prepare: f64,
    /// Handing the scene to the nodes.
    #[prost(double, tag = "5")]
    pub brief: f64,
    /// Observing, all steps.
    #[prost(double, tag = "6")]
    pub observe: f64,
    /// Sending observations and waiting for answers, all steps.
    #[prost(double, tag = "7")]
    pub answer: f64,
    /// Driving and judging, all steps.
    #[prost(double, tag = "8")]
    pub advance: f64,
    /// Sending records and events, all steps.
    #[prost(double, tag = "9")]
    pub publish: f64,
    /// Waiting for the recorder at the end.
    #[prost(double, tag = "10")]
    pub recording: f64,
    /// The whole episode.
    #[prost(double, tag = "11")]
    pub wall: f64,
    /// Half of the answers took at most this.
    #[prost(double, tag = "12")]
    pub answer_p50: f64,
    /// 99 of 100 answers took at most this.
    #[prost(double, tag = "13")]
    pub answer_p99: f64,
    /// The longest answer.
    #[prost(double, tag = "14")]
    pub answer_max: f64,
    /// Waiting for who drives the agents that react, all steps.
    #[prost(double, tag = "15")]
    pub traffic: f64,
}

impl Part {
    /// As it stands in its file: the message, and its SHA-256 behind it.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.encode_to_vec();
        let checksum = Sha256::digest(&bytes);
        bytes.extend_from_slice(&checksum);
        bytes
    }

    /// A part from its file; none where the bytes are not one of `scene`, or not as they were written.
    #[must_use]
    pub fn from_bytes(bytes: &[u8], scene: &str) -> Option<Self> {
        let (message, checksum) = bytes.split_at_checked(bytes.len().checked_sub(CHECKSUM)?)?;
        if *Sha256::digest(message) != *checksum {
            return None;
        }
        let part = Self::decode(message).ok()?;
        (part.end.as_ref()?.scene == scene && part.logged.len() == part.records.len()).then_some(part)
    }

    /// Why it ended.
    #[must_use]
    pub fn reason(&self) -> EndReason {
        self.end.as_ref().map_or(EndReason::Unspecified, EpisodeEnd::reason)
    }

    /// Whether it has no result: the driver failed, or the scene cannot be driven.
    #[must_use]
    pub fn failed(&self) -> bool {
        matches!(self.reason(), EndReason::DriverFailed | EndReason::Undrivable | EndReason::Unspecified)
    }

    /// How it came out.
    #[must_use]
    pub fn standing(&self) -> Standing {
        Standing { failed: self.failed(), unrecorded: !self.recording_error.is_empty() }
    }

    /// SHA-256 over the encoded end, records, events and moves, each with its length before it.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hash = Sha256::new();
        let mut add = |bytes: Vec<u8>| hash.update(bytes);
        add(self.end.as_ref().map(Message::encode_length_delimited_to_vec).unwrap_or_default());
        self.records.iter().for_each(|record| add(record.encode_length_delimited_to_vec()));
        self.events.iter().for_each(|event| add(event.encode_length_delimited_to_vec()));
        self.moved.iter().for_each(|moves| add(moves.encode_length_delimited_to_vec()));
        hexadecimal(&hash.finalize())
    }
}

/// What tables and files call the reason.
#[must_use]
pub fn reason_name(reason: EndReason) -> &'static str {
    match reason {
        EndReason::Unspecified => "unknown",
        EndReason::Horizon => "horizon",
        EndReason::LogEnd => "log-end",
        EndReason::Collision => "collision",
        EndReason::OffRoute => "off-route",
        EndReason::Undrivable => "undrivable",
        EndReason::DriverFailed => "driver-failed",
        EndReason::RouteLost => "route-lost",
    }
}
