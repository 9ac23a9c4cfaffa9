//! Threads whose panic ends the run with its message, and leaves nobody waiting for them.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::SyncSender;
use std::thread::{self, JoinHandle};

use super::core::Event;

/// Starts a thread that does `work`; if that panics, `events` hear of it.
pub fn start(name: String, events: SyncSender<Event>, work: impl FnOnce() + Send + 'static) -> JoinHandle<()> {
    thread::spawn(move || {
        // What the work shared with others is behind locks that are taken even after a panic.
        if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
            let _ = events.send(Event::Broken(format!(
                "{name} panicked: {}\nhint: this is a fault of reloop: please report it, with the lines above",
                message(&*panic)
            )));
        }
    })
}

/// What was said at a panic.
fn message(panic: &(dyn Any + Send)) -> &str {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    owned.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("it did not say why")
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::sync_channel;

    use super::*;

    #[test]
    fn a_panic_ends_the_run_with_its_message() {
        let (events, heard) = sync_channel(1);
        let numbers: [u32; 2] = [1, 2];
        let at = std::hint::black_box(7);
        start("worker 3".to_owned(), events, move || panic!("there is no scene {at} of {}", numbers.len()))
            .join()
            .unwrap();
        let Ok(Event::Broken(reason)) = heard.recv() else { panic!("the run goes on") };
        assert!(reason.starts_with("worker 3 panicked: there is no scene 7 of 2\nhint: "), "{reason}");
    }

    #[test]
    fn work_that_ends_well_says_nothing() {
        let (events, heard) = sync_channel(1);
        start("worker 0".to_owned(), events, || {}).join().unwrap();
        assert!(heard.recv().is_err());
    }
}
