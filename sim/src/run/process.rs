//! Processes that the sim starts: nodes and the recorder. None outlives it.
//!
//! - Each is the head of a process group of its own: Ctrl-C in the terminal reaches the sim alone, which decides; and whatever
//!   a planner's command starts is ended with it.
//! - Each has a pipe of the sim's as standard input. Nodes leave at its end, so also when the sim was killed.
//! - What they write to standard output and standard error comes out on the sim's standard error, and in a log.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use thiserror::Error;

use super::voice::Voice;

/// A process that cannot be started.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum StartError {
    #[error("{name} cannot be started: {} is not there\nhint: build the whole workspace, or keep its programs in one folder", path.display())]
    Missing { name: String, path: PathBuf },
    #[error("{name} cannot be started: {source}")]
    Spawn { name: String, source: std::io::Error },
}

/// The groups that run at the moment, so that a second Ctrl-C can end all of them from another thread.
#[derive(Clone, Debug, Default)]
pub struct Groups(Arc<Mutex<BTreeSet<i32>>>);

impl Groups {
    fn lock(&self) -> MutexGuard<'_, BTreeSet<i32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends every process of every group.
    pub fn kill_all(&self) {
        self.lock().iter().for_each(|group| kill_group(*group));
    }
}

/// SIGKILL reaches stopped processes too. A group that is gone already is no error.
fn kill_group(group: i32) {
    let _ = killpg(Pid::from_raw(group), Signal::SIGKILL);
}

/// The program `name` beside this one.
///
/// # Errors
/// [`StartError::Missing`].
pub fn program(name: &str) -> Result<PathBuf, StartError> {
    let own = std::env::current_exe().map_err(|source| StartError::Spawn { name: name.to_owned(), source })?;
    let path = own.with_file_name(name).with_extension(std::env::consts::EXE_EXTENSION);
    if path.is_file() { Ok(path) } else { Err(StartError::Missing { name: name.to_owned(), path }) }
}

/// The search path for commands of users: the programs of this sim first, which are of its version.
#[must_use]
pub fn path_with_our_programs() -> Option<OsString> {
    let own = std::env::current_exe().ok()?.parent()?.to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(own).chain(std::env::split_paths(&others))).ok()
}

/// A running process. It is killed when this is dropped.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    groups: Groups,
    voice: Voice,
    /// The threads that hear what it says.
    ears: Vec<JoinHandle<()>>,
    /// How it ended, once it has.
    ended: Option<ExitStatus>,
}

impl Process {
    /// Starts `command` under `name`.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(name: &str, mut command: Command, groups: &Groups, voice: Voice) -> Result<Self, StartError> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
        let failed = |source| StartError::Spawn { name: name.to_owned(), source };
        let mut child = command.spawn().map_err(failed)?;
        groups.lock().insert(child.id() as i32);
        // These threads end with the process, at the end of what it says.
        let mut ears = Vec::new();
        if let Some(output) = child.stdout.take() {
            let voice = voice.clone();
            ears.push(thread::spawn(move || voice.read(output)));
        }
        if let Some(errors) = child.stderr.take() {
            let voice = voice.clone();
            ears.push(thread::spawn(move || voice.read(errors)));
        }
        Ok(Self { name: name.to_owned(), child, groups: groups.clone(), voice, ears, ended: None })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it ended, if it has. What it started is ended with it.
    pub fn gone(&mut self) -> Option<String> {
        if self.ended.is_none() {
            let status = self.child.try_wait().ok().flatten()?;
            self.end_group();
            // Whoever was asked to leave does so in peace.
            if self.child.stdin.is_some() {
                self.voice.note(&format!("{} {}", self.name, describe(status)));
            }
            self.ended = Some(status);
        }
        self.ended.map(describe)
    }

    /// Its exit code, once it has ended; none where a signal ended it.
    #[must_use]
    pub fn exit_code(&self) -> Option<i32> {
        self.ended?.code()
    }

    /// What it raised last, if it said so. Of one that is gone all is heard first, within `patience`.
    pub fn raised(&mut self, patience: Duration) -> Option<String> {
        self.hear_out(patience);
        self.voice.raised()
    }

    /// If it is gone, waits until all that it said was heard, at most `patience`.
    pub fn hear_out(&mut self, patience: Duration) {
        let until = Instant::now() + patience;
        while self.gone().is_some() && self.ears.iter().any(|ear| !ear.is_finished()) && Instant::now() < until {
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Kills the group once: when its head was waited for and nobody is left in it, its number may be given away.
    fn end_group(&self) {
        let group = self.child.id() as i32;
        if self.groups.lock().remove(&group) {
            kill_group(group);
        }
    }

    /// Asks it to leave, and kills it if it has not left after `patience`.
    pub fn stop(mut self, patience: Duration) {
        self.end_input();
        self.wait(patience);
    }

    /// Ends its standard input: a node that was told so leaves.
    pub fn end_input(&mut self) {
        drop(self.child.stdin.take());
    }

    /// Sends `signal` to it and to what it started. That it is gone already is no error.
    pub fn signal(&self, signal: Signal) {
        let _ = killpg(Pid::from_raw(self.child.id() as i32), signal);
    }

    /// Waits until it has ended, at most for `patience`, and says how it did.
    pub fn wait(&mut self, patience: Duration) -> Option<String> {
        let until = Instant::now() + patience;
        while self.gone().is_none() && Instant::now() < until {
            thread::sleep(Duration::from_millis(5));
        }
        self.gone()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end_group();
        let _ = self.child.wait();
    }
}

fn describe(status: ExitStatus) -> String {
    let name = |signal| Signal::try_from(signal).map_or_else(|_| format!("signal {signal}"), |name| name.to_string());
    match (status.code(), status.signal()) {
        // So a shell says that what it ran was killed.
        (Some(code @ 129..=159), _) => format!("exited with code {code}, as after {}", name(code - 128)),
        (Some(code), _) => format!("exited with code {code}"),
        (None, Some(signal)) => format!("was killed by {}", name(signal)),
        (None, None) => "ended".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_described_by_code_or_signal() {
        let how = |wait_status| describe(ExitStatus::from_raw(wait_status));
        assert_eq!(how(3 << 8), "exited with code 3");
        assert_eq!(how(137 << 8), "exited with code 137, as after SIGKILL");
        assert_eq!(how(11), "was killed by SIGSEGV");
    }
}
