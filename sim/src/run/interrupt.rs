//! Ctrl-C and SIGTERM: the first asks the run to stop, the second ends everything at once.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use std::{io, process, thread};

use super::core::Event;
use super::process::Groups;

/// The exit code of an interrupted program.
pub const INTERRUPTED: i32 = 130;

/// How long a run may take to leave when whoever started it is gone.
const GRACE: Duration = Duration::from_secs(10);

/// What the signal's thread and the run share.
#[derive(Clone, Default)]
pub struct Interrupts {
    /// The run that is to be told.
    listener: Arc<Mutex<Option<SyncSender<Event>>>>,
    /// How often it was pressed.
    pressed: Arc<AtomicUsize>,
    /// The planners and predictors that run.
    nodes: Groups,
    /// The recorder that runs: apart, for a run that stops leaves it time to close its files.
    recorder: Groups,
}

impl Interrupts {
    /// Catches Ctrl-C and SIGTERM from here on.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn catch() -> Result<Self, ctrlc::Error> {
        let interrupts = Self::default();
        let caught = interrupts.clone();
        ctrlc::set_handler(move || caught.press())?;
        Ok(interrupts)
    }

    /// From here on the end of standard input is as good as Ctrl-C: whoever started this program is gone, or wants it to leave.
    pub fn leave_with_standard_input(&self) {
        let interrupts = self.clone();
        thread::spawn(move || {
            // Nothing is ever written there.
            let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
            interrupts.press();
            thread::sleep(GRACE);
            interrupts.press();
        });
    }

    /// Whom to tell. When nobody listens any more there is nothing to stop, and the program ends.
    pub fn forward_to(&self, listener: SyncSender<Event>) {
        *self.listener.lock().unwrap_or_else(PoisonError::into_inner) = Some(listener);
    }

    /// The planners and predictors that run.
    #[must_use]
    pub fn nodes(&self) -> &Groups {
        &self.nodes
    }

    /// The recorder that runs.
    #[must_use]
    pub fn recorder(&self) -> &Groups {
        &self.recorder
    }

    fn press(&self) {
        let first = self.pressed.fetch_add(1, Ordering::Relaxed) == 0;
        let listener = self.listener.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if first && listener.is_some_and(|run| run.try_send(Event::Interrupted).is_ok()) {
            return;
        }
        self.nodes.kill_all();
        self.recorder.kill_all();
        process::exit(INTERRUPTED);
    }
}
