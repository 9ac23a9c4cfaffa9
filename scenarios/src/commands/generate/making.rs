//! Many threads make scenes, one takes them in order.
//!
//! Of `n` threads the first makes scenes 0, n, 2n ..., the second 1, n + 1 ..., each into a channel of its own with little room; the
//! taker goes from channel to channel. So the order is that of one thread, and there are never more than a few scenes in memory.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use super::super::Failure;
use super::folder::Shard;
use super::settings::Settings;
use super::shard::Segment;

/// Scenes that may lie ready for each thread: enough that one that takes longer does not hold up the others at once.
const READY: usize = 2;

type Made = Result<Segment, Failure>;

/// Lets `jobs` threads make the scenes of `shards`, and `take` have them one by one, in order. What `take` answers.
pub fn make<T>(
    settings: &Settings,
    shards: &[Shard],
    jobs: usize,
    take: impl FnOnce(Segments) -> Result<T, Failure>,
) -> Result<T, Failure> {
    thread::scope(|scope| {
        let start = |job: usize| {
            let (sender, receiver) = sync_channel(READY);
            scope.spawn(move || work(settings, shards, (job, jobs), &sender));
            receiver
        };
        let channels = (0..jobs).map(start).collect();
        take(Segments { channels, next: 0 })
    })
}

/// The scenes, in order. When this is dropped the threads end.
#[derive(Debug)]
pub struct Segments {
    channels: Vec<Receiver<Made>>,
    next: usize,
}

impl Segments {
    /// The next scene.
    ///
    /// # Errors
    /// What its making said; or that there is no other, which is a fault of whoever counts.
    pub fn next(&mut self) -> Made {
        let channel = &self.channels[self.next % self.channels.len()];
        self.next += 1;
        // A thread ends early by panic alone, which the scope passes on.
        channel.recv().unwrap_or(Err(Failure::Interrupted))
    }
}

fn work(settings: &Settings, shards: &[Shard], (job, jobs): (usize, usize), sender: &SyncSender<Made>) {
    let scenes = shards.iter().flat_map(|shard| {
        let indices = shard.first..shard.first + shard.count;
        shard.family.into_iter().flat_map(move |family| indices.clone().map(move |index| (family, index)))
    });
    for (family, index) in scenes.skip(job).step_by(jobs) {
        let made = settings.payload(family, index).map(|payload| Segment::of(&payload, settings.gzip));
        let failed = made.is_err();
        // Nobody takes it: the taker has ended.
        if sender.send(made).is_err() || failed {
            return;
        }
    }
}
