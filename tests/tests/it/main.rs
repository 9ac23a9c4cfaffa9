//! End to end: the built programs, from outside.
//!
//! | file | what is claimed |
//! | --- | --- |
//! | `hosts.rs` | nodes of other hosts and users: who may come in, who may do what, and what a flood does |
//! | `bus.rs` | second planners, strays and strangers are named and change nothing |
//! | `demo.rs` | one command, a table, a folder; finished runs and other runs' folders are left alone |
//! | `repeat.rs` | same command, same bytes, for any number of workers |
//! | `killed.rs` | a killed run is continued, and comes out as if it had not been |
//! | `latency.rs` | plans that take effect late: the same bytes again, by their trace too; late and lost ones are counted |
//! | `healed.rs` | a retried run, and one whose disk was full, come out as if nothing had happened; changed files are named |
//! | `planner_command.rs` | a planner's command is one for a shell; what it says is logged |
//! | `check_node.rs` | what is wrong with a node is found, and nothing else |
//! | `own_planner.rs` | the example of a planner in Rust drives |
//! | `python.rs` | the Python SDK: planners and predictors in it drive, and it reads what a run leaves |
//! | `nodes.rs` | nodes that die, stall or lie cost their own episode and nothing else |
//! | `recorder.rs` | a recorder that dies costs recordings and no result |
//! | `interrupt.rs` | Ctrl-C leaves nothing running |
//! | `explain.rs` | a plan chosen among proposals is explained as it was driven, to the bit |
//! | `future.rs` | no message holds a logged state later than its step |
//! | `predictions.rs` | predictions are scored against what then happened |
//! | `replay.rs` | `sim replay` finds what was driven the same, names what is not and who is to blame, and lets others take over |
//! | `blame.rs` | `sim blame` fails again what failed, and tells what saves it |
//! | `report.rs`, `browser.rs` | a report is played, scrubbed and filtered in a browser, where there is one; drives are pictures and clips |
//! | `view.rs` | a viewer is shown the run, and holds nothing up |
//! | `validity.rs` | drives judged again: where somebody would have had to react, and every figure without that |
//! | `shards.rs` | a run that several processes drive comes out as if one had |
//! | `side_by_side.rs` | two drives of a scene are drawn into one file |
//! | `pause.rs` | a run that stands still for a while comes out as if it had not |
//! | `network.rs` | the repository's weights are whole, and drive; the authors' drive as in their simulator |
//! | `open_loop.rs` | plans that are not driven are worth what the authors' test says; a frame costs no other |
//! | `paper.rs` | under `paper` the nodes get the authors' numbers |
//! | `real_scenes.rs` | real scenes come to a result, where they are at hand |
//! | `scenes.rs` | damaged scenes cost their own episodes, replaced ones are noticed; nodes find packed ones |
//! | `serve.rs` | a service drives what is asked for, in turns, whatever kills it; sessions come to what runs come to |
//! | `stage.rs`, `recording.rs` | what they share: running programs, comparing folders, reading MCAP |

#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs, reason = "a test may panic")]

mod blame;
mod browser;
mod bus;
mod check_node;
mod demo;
mod explain;
mod future;
mod healed;
mod hosts;
mod interrupt;
mod killed;
mod latency;
mod network;
mod nodes;
mod open_loop;
mod own_planner;
mod paper;
mod pause;
mod planner_command;
mod predictions;
mod python;
mod real_scenes;
mod recorder;
mod recording;
mod repeat;
mod replay;
mod report;
mod scenes;
mod serve;
mod shards;
mod side_by_side;
mod stage;
mod traffic;
mod validity;
mod view;
