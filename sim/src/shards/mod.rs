//! A run that several processes drive together, each a shard of its scenes, in one folder that all of them see.
//!
//! ```text
//! sim run SET --out RUN --shard 1/3 ─▶ RUN/parts/*.part ─┐
//! sim run SET --out RUN --shard 2/3 ─▶ RUN/parts/*.part ─┼─ sim merge RUN ─▶ the files of a run that one process drove
//! sim run SET --out RUN --shard 3/3 ─▶ RUN/parts/*.part ─┘
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`merge`] | what all have driven becomes a run |
//! | [`status`] | what is missing, and who drives it |
//! | [`plan`] | what a shard takes, from a sample |

pub mod merge;
pub mod plan;
pub mod status;

use std::ffi::OsString;

use results::settings::{RunFile, Shards};
use shard::Shard;

/// What pins a run of so many shards whose command line is this.
#[must_use]
pub fn pinned(of: u32, typed: impl IntoIterator<Item = OsString>) -> Shards {
    Shards { count: of, sha256: String::new(), command: without_shard(typed) }
}

/// A command line but for which shard it is, with the program's name and not where it lies.
fn without_shard(typed: impl IntoIterator<Item = OsString>) -> Vec<String> {
    let mut words = typed.into_iter().skip(1).map(|word| word.to_string_lossy().into_owned());
    let mut command = vec!["sim".to_owned()];
    while let Some(word) = words.next() {
        if word == "--shard" {
            words.next();
        } else if !word.starts_with("--shard=") {
            command.push(word);
        }
    }
    command
}

/// What drives a shard of a run, or without a shard all of it, as it would be typed.
fn command(file: &RunFile, shard: Option<Shard>) -> String {
    let words = file.machine.shards.iter().flat_map(|shards| &shards.command).map(|word| quoted(word));
    let shard = shard.map(|shard| format!("--shard {shard}"));
    words.chain(shard).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%^".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_kept_without_its_shard_and_given_back_as_a_shell_takes_it() {
        let typed =
            ["/opt/sim", "run", "my set.toml", "--shard", "3/8", "--planner-command", "echo 'x'", "--shard=4/8"];
        let command = without_shard(typed.map(OsString::from));
        assert_eq!(command, ["sim", "run", "my set.toml", "--planner-command", "echo 'x'"]);
        let words: Vec<_> = command.iter().map(|word| quoted(word)).collect();
        assert_eq!(words.join(" "), r"sim run 'my set.toml' --planner-command 'echo '\''x'\'''");
    }
}
