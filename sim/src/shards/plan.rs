//! `sim plan`: what a shard takes in time, memory and room, from a sample of the episodes.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::sys::resource::{Usage, UsageWho, getrusage};
use results::files::{FileError, at};
use results::folder::{part_of, recording_of};
use results::part::Part;
use results::settings::Machine;
use scenarios::{SceneSet, SetError};
use shard::Shard;
use thiserror::Error;

use crate::request::Request;
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::interrupt::Interrupts;
use crate::run::{self, RunError, Task};

/// What cannot be planned.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PlanError {
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("how much memory was used is not known: {0}")]
    Usage(#[from] nix::errno::Errno),
    #[error("these sets hold no scene\nhint: name others")]
    NoScene,
}

/// What a sample of episodes took.
#[derive(Debug)]
struct Sample {
    /// Episodes of the whole list.
    scenes: usize,
    /// Seconds of each episode.
    seconds: Vec<f64>,
    /// Seconds from the start of the program to the first step.
    start: f64,
    /// Episodes driven at a time.
    parallel: usize,
    /// Memory of this process, and the most of a node's (bytes).
    memory: [u64; 2],
    /// Nodes of each worker, and recorders.
    nodes: [usize; 2],
    /// Bytes of an episode as its shard stores it, and of its recordings.
    bytes: [f64; 2],
}

/// Drives at most `most` of the episodes, spread evenly over the list, and says what each of so many shards would take.
///
/// # Errors
/// [`PlanError`].
pub fn plan(
    request: &Request,
    (most, counts): (usize, &[u32]),
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> Result<String, PlanError> {
    let set = SceneSet::open(&request.machine.scenarios)?;
    let scenes = set.entries().len();
    if scenes == 0 {
        return Err(PlanError::NoScene);
    }
    let taken = most.clamp(1, scenes);
    let places: Vec<usize> = (0..taken).map(|number| number * scenes / taken).collect();
    let folder = tempfile::tempdir().map_err(at("create a folder in", &std::env::temp_dir()))?;
    let path = folder.path().join("sample");
    let all = Shard::all(1).next();
    let request = Request { out: Some(path.clone()), shard: all, retry: Vec::new(), ..request.clone() };
    let machine = Machine { shards: Some(super::pinned(1, [])), ..request.machine };
    let request = Request { machine, ..request };
    let ids: Vec<String> = places.iter().map(|place| set.entries()[*place].id.to_string()).collect();
    let driven = run::run_task(&request, Task::of(set.only(&places)), clock, console, interrupts);
    driven.map_err(RunError::with_nothing_kept)?;
    let parts = ids.iter().filter_map(|id| part_of(&path, id).transpose()).collect::<Result<Vec<Part>, _>>()?;
    let stored = parts.iter().map(|part| part.to_bytes().len() as f64).sum::<f64>();
    let recordings = ids.iter().flat_map(|id| recording_files(&path, id)).map(size).sum::<f64>();
    let timing = || parts.iter().filter_map(|part| part.timing);
    let first = timing().map(|timing| timing.first_step).filter(|first| *first > 0.0).fold(f64::INFINITY, f64::min);
    let count = parts.len().max(1) as f64;
    let settings = &request.settings;
    let nodes = if request.machine.in_process { 0 } else { 1 + usize::from(settings.predictor.is_some()) };
    let sample = Sample {
        scenes,
        seconds: timing().map(|timing| timing.wall).collect(),
        start: if first.is_finite() { first } else { 0.0 },
        parallel: usize::from(request.machine.parallel).min(taken),
        memory: [UsageWho::RUSAGE_SELF, UsageWho::RUSAGE_CHILDREN].map(getrusage).map(|usage| usage.map_or(0, bytes)),
        nodes: [nodes, usize::from(settings.record != results::settings::Record::None)],
        bytes: [stored / count, recordings / count],
    };
    Ok(sample.text(&settings.driver, counts))
}

fn recording_files(folder: &Path, scene: &str) -> [PathBuf; 2] {
    ["mcap", "rrd"].map(|kind| recording_of(folder, scene).with_file_name(format!("{scene}.{kind}")))
}

/// Bytes of a file; none where there is none.
fn size(path: PathBuf) -> f64 {
    fs::metadata(path).map_or(0.0, |file| file.len() as f64)
}

/// The most memory that was used at a time: the system counts kilobytes.
fn bytes(usage: Usage) -> u64 {
    u64::try_from(usage.max_rss()).unwrap_or(0) * 1024
}

impl Sample {
    fn mean(&self) -> f64 {
        self.seconds.iter().sum::<f64>() / self.seconds.len().max(1) as f64
    }

    /// By how much the mean may be off: two standard errors.
    fn doubt(&self) -> f64 {
        let (mean, count) = (self.mean(), self.seconds.len() as f64);
        let squares: f64 = self.seconds.iter().map(|seconds| (seconds - mean) * (seconds - mean)).sum();
        if count < 2.0 { mean } else { 2.0 * (squares / (count - 1.0) / count).sqrt() }
    }

    /// Memory of a shard (bytes): every node is taken for the largest.
    fn memory(&self) -> u64 {
        let [workers, recorders] = self.nodes;
        self.memory[0] + self.memory[1] * (workers * self.parallel + recorders) as u64
    }

    /// Seconds that a shard of so many episodes takes, and by how much that may be off.
    fn time(&self, episodes: usize) -> [f64; 2] {
        let rounds = episodes as f64 / self.parallel as f64;
        [self.start + rounds * self.mean(), rounds * self.doubt()]
    }

    fn text(&self, driver: &str, counts: &[u32]) -> String {
        let (scenes, [stored, recorded]) = (self.scenes, self.bytes);
        let mut text = format!(
            "{scenes} episodes by {driver}, {} at a time; from {} of them, driven here and now:\n\n",
            self.parallel,
            self.seconds.len()
        );
        let mut say = |name: &str, value: String| {
            let _ = writeln!(text, "{name:<18}{value}");
        };
        say("an episode", format!("{} (mean, within {})", seconds(self.mean()), seconds(self.doubt())));
        say("the start", seconds(self.start));
        let nodes = match (self.nodes[0] * self.parallel + self.nodes[1], self.memory[1]) {
            (0, _) => String::new(),
            (count, each) => {
                format!(
                    ": {} the sim, {count} nodes and recorders of at most {} each",
                    room(self.memory[0] as f64),
                    room(each as f64)
                )
            }
        };
        say("memory of a shard", format!("{}{nodes}", room(self.memory() as f64)));
        let all = scenes as f64;
        let rows = format!("{} until it is merged", room(stored * all));
        let all_room = if recorded > 0.0 { format!("{rows}, recordings {}", room(recorded * all)) } else { rows };
        say("room of the run", all_room);
        let usual: Vec<u32> = [1, 2, 4, 8, 16, 32, 64, 128].into_iter().filter(|of| *of as usize <= scenes).collect();
        let counts = if counts.is_empty() { &usual } else { counts };
        text += "\n  shards  episodes each      time each         within\n";
        for of in counts {
            let episodes = scenes.div_ceil((*of).max(1) as usize);
            let [time, doubt] = self.time(episodes);
            let _ = writeln!(text, "{of:>8}  {episodes:>13}  {:>13}  {:>13}", seconds(time), seconds(doubt));
        }
        text += "\nTime is that of this machine with nothing else on it: shards of one machine share its cores.\n";
        text
    }
}

/// As people say it.
fn seconds(seconds: f64) -> String {
    let whole = Duration::from_secs_f64(seconds.max(0.0)).as_secs();
    match seconds {
        small if small < 1.0 => format!("{:.1} ms", 1000.0 * small),
        short if short < 60.0 => format!("{short:.1} s"),
        _ if whole < 3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

fn room(bytes: f64) -> String {
    match bytes {
        small if small < 1e6 => format!("{:.0} kB", small / 1e3),
        medium if medium < 1e9 => format!("{:.0} MB", medium / 1e6),
        large => format!("{:.1} GB", large / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Sample {
        Sample {
            scenes: 1000,
            seconds: vec![1.0, 2.0, 3.0],
            start: 0.5,
            parallel: 2,
            memory: [50_000_000, 20_000_000],
            nodes: [2, 1],
            bytes: [10_000.0, 2_000_000.0],
        }
    }

    #[test]
    fn a_shard_takes_its_share_of_the_time_and_every_node_its_memory() {
        let sample = sample();
        assert_eq!(sample.memory(), 50_000_000 + 5 * 20_000_000);
        // 100 episodes, two at a time, of 2 s each; the mean of three that are 1 s apart is known within 2 / sqrt(3).
        let [time, doubt] = sample.time(100);
        assert!((time - 100.5).abs() < 1e-9 && (doubt - 50.0 * 2.0 / 3.0_f64.sqrt()).abs() < 1e-9, "{time} {doubt}");
    }

    #[test]
    fn it_is_told_in_a_table() {
        insta::assert_snapshot!(sample().text("dipp", &[1, 8]), @"
        1000 episodes by dipp, 2 at a time; from 3 of them, driven here and now:

        an episode        2.0 s (mean, within 1.2 s)
        the start         500.0 ms
        memory of a shard 150 MB: 50 MB the sim, 5 nodes and recorders of at most 20 MB each
        room of the run   10 MB until it is merged, recordings 2.0 GB

          shards  episodes each      time each         within
               1           1000    16 min 40 s     9 min 37 s
               8            125     2 min 05 s     1 min 12 s

        Time is that of this machine with nothing else on it: shards of one machine share its cores.
        ");
    }
}
