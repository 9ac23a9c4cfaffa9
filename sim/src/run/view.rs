//! The live view: a process that shows the run in a viewer while it is driven. The run waits for it neither while it drives nor at its end.

use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use super::process::{Process, program};
use super::shared::Shared;
use super::voice::Voice;
use super::{bus_threads, calling};

/// How long it may take to listen, so that the first episode is seen too.
const JOINING: Duration = Duration::from_secs(3);

/// How long it may take to show what it has heard when the run is over.
const LEAVING: Duration = Duration::from_secs(4);

/// The view of a run.
pub struct View(Process);

impl View {
    /// Starts it, and waits a moment until it listens. Where there is none, the user is told why, and the run goes on.
    pub fn start(shared: &Shared) -> Option<Self> {
        let started = (|| -> Result<Self, String> {
            let hub = shared.hub()?;
            let mut command = Command::new(program("recorder").map_err(|error| error.to_string())?);
            command.arg("view");
            bus_threads::set(&mut command, Some(1));
            calling::to_run(&mut command, hub);
            let voice = Voice::new("the view", &shared.console, shared.folder.logs().join("view.log"));
            let mut process =
                Process::start("the view", command, &shared.groups, voice).map_err(|error| error.to_string())?;
            let until = Instant::now() + JOINING;
            while !hub.is_heard() && Instant::now() < until {
                if let Some(how) = process.gone() {
                    return Err(format!("it {how}"));
                }
                thread::sleep(Duration::from_millis(5));
            }
            Ok(Self(process))
        })();
        started.map_err(|why| shared.console.line(&format!("note: there is no live view: {why}; the run goes on"))).ok()
    }

    /// Lets it show what it has heard, and leave. Its viewer stays.
    pub fn end(self) {
        self.0.stop(LEAVING);
    }
}
