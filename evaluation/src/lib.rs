//! From runs to judgement: what drives were worth, side by side.
//!
//! | module | what |
//! | --- | --- |
//! | [`table`] | finished runs, a line each |
//! | [`latency`] | score against latency, drawn |
//! | [`scenes`] | a run scene by scene, the worst first |
//! | [`compare`](mod@compare) | two runs over the same scenes: flips, figures, what may be chance |
//! | [`open_loop`] | plans held to the log, frame by frame, and never driven: by the paper's definitions and by mended ones |
//! | [`predictions`] | predictions made in a drive against what the agents then did |
//! | [`recorded`] | a recording's messages, for both of these |
//! | [`drives`] | the drives of a finished run beside their scenes, for whoever judges them again |
//! | [`traffic`] | agents that reacted, held to what the log has them do |
//! | [`validity`] | where a replayed agent would have had to react to the AV, and what figures are worth without those steps |
//! | [`score`](mod@score) | every score from one drive: ours and other tools' |
//! | [`replay`] | an episode driven again: by the plans of its recording, or by its nodes |
//! | [`blame`] | failures, and what would have saved them |
//! | [`footage`] | all of a drive that can be seen |
//! | [`picture`] | a drive drawn: a picture, or a clip |
//! | [`report`] | runs as one page to send to somebody |

pub mod blame;
pub mod compare;
pub mod drives;
pub mod footage;
pub mod latency;
pub mod open_loop;
pub mod picture;
pub mod predictions;
pub mod recorded;
pub mod replay;
pub mod report;
pub mod scenes;
pub mod score;
pub mod table;
pub mod traffic;
pub mod validity;
