//! The recorder process: hears all that the simulator tells of a run, writes each episode down, says when it is done.
//!
//! The transport's thread copies messages into the bounded queue of a writer thread. When a queue is full the transport
//! waits, and with it the senders: nothing is dropped, and memory is bounded. An episode's messages all go to one writer.
//!
//! Shutdown: when the run leaves (or Ctrl-C comes, or standard input ends) the subscribers end with the connection, the
//! queues are closed, each writer writes what it has, and episodes that have not ended stay `.partial`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::bail;
use prost::Message as _;
use wire::keys::{Address, Role};
use wire::node::{Connection, Options, Stop, Voice};

use crate::desk::Desk;
use crate::message::CHANNELS;
use crate::partial_file::FileError;
use crate::recording::{Format, RunSettings};
use crate::sequence::Answers;

/// Writer threads: one compresses while the other does.
const WRITERS: usize = 2;

/// Messages that may wait for a writer: some six episodes' worth.
const QUEUE: usize = 4096;

/// Records a run until it ends. Says why it stopped.
///
/// # Errors
/// Where the run cannot be joined, or the folder cannot be made.
pub fn record(options: &Options, folder: PathBuf, formats: Vec<Format>) -> anyhow::Result<Stop> {
    std::fs::create_dir_all(&folder).map_err(FileError::at("create the folder", &folder))?;
    let connection = Connection::open(options)?;
    let info = connection.run_info()?;
    let run = Arc::new(RunSettings {
        folder,
        formats,
        run: options.run.to_string(),
        settings: info.settings,
        answers: Answers { predictor: info.predictor, traffic: info.traffic },
    });
    let mut queues = Vec::new();
    let mut threads: Vec<JoinHandle<()>> = Vec::new();
    for _ in 0..WRITERS {
        let (queue, messages) = sync_channel(QUEUE);
        let (desk, voice) = (Desk::new(Arc::clone(&run)), connection.voice());
        threads.push(std::thread::spawn(move || write(desk, &messages, &voice)));
        queues.push(queue);
    }
    let closing = queues.clone();
    connection.subscribe(&CHANNELS, move |address, payload| {
        let queue = &queues[writer_of(&address)];
        // Fails only when the writers are gone: then so is everything.
        let _ = queue.send(Job::Message(address, payload.to_bytes().into_owned()));
    })?;
    let stop = connection.serve(Role::Recorder);
    for queue in closing {
        let _ = queue.send(Job::Stop);
    }
    for thread in threads {
        if thread.join().is_err() {
            bail!("a writer thread panicked; this is a bug of the recorder");
        }
    }
    Ok(stop?)
}

/// The writer that serves an episode's worker.
fn writer_of(address: &Address) -> usize {
    address.worker.to_string().bytes().map(usize::from).sum::<usize>() % WRITERS
}

enum Job {
    Message(Address, Vec<u8>),
    Stop,
}

/// A writer thread.
fn write(mut desk: Desk, jobs: &Receiver<Job>, voice: &Voice) {
    loop {
        let wait = desk.next_due().map_or(Duration::MAX, |due| due.saturating_duration_since(Instant::now()));
        let answer = match jobs.recv_timeout(wait) {
            Ok(Job::Message(address, payload)) => desk.take(address, payload, Instant::now()),
            Err(RecvTimeoutError::Timeout) => desk.take_overdue(Instant::now()),
            Ok(Job::Stop) | Err(RecvTimeoutError::Disconnected) => return desk.abandon(),
        };
        if let Some((address, recorded)) = answer
            && let Err(error) = voice.say(&address.worker, address.channel, recorded.encode_to_vec())
        {
            // Closed by this process itself: the simulator is gone, or a stop is asked for.
            if voice.session().is_closed() {
                tracing::debug!("nobody hears any more that {} is recorded", address.scene);
            } else {
                tracing::error!("the simulator does not hear that {} is recorded: {error}", address.scene);
            }
        }
    }
}
