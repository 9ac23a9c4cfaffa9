//! The recorder's thread: starts it when told to, and says when it is gone, or hears nothing any more.

use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use wire::hub::Hub;
use wire::keys::{Role, Workers};

use super::core::Event;
use super::process::{Groups, Process};
use super::shared::Shared;

/// How often the recorder is looked at.
const GLANCE: Duration = Duration::from_millis(50);

/// How long it may take to close its files.
const CLOSING: Duration = Duration::from_secs(5);

/// Starts the recorder at each order; ends it when nobody orders any more.
pub fn keep(shared: &Arc<Shared>, groups: &Groups, orders: &Receiver<()>, events: &SyncSender<Event>) {
    // Each that was started, whether or not it came to be ready, is counted when its loss is told.
    let mut number = 0_u64;
    while orders.recv().is_ok() {
        let mut process = match start(shared, groups) {
            Ok(process) => process,
            Err(reason) => {
                number += 1;
                if events.send(Event::RecorderLost(reason)).is_err() {
                    return;
                }
                continue;
            }
        };
        if events.send(Event::RecorderReady).is_err() {
            return process.stop(CLOSING);
        }
        loop {
            if let Some(how) = process.gone() {
                number += 1;
                if events.send(Event::RecorderLost(format!("the recorder {how}"))).is_err() {
                    return;
                }
                break;
            }
            if shared.missed_recorder.load(Ordering::Relaxed) == number || !is_on_the_bus(shared) {
                number += 1;
                // It takes or says nothing: frozen, it would not leave by itself, and waiting for that costs again.
                drop(process);
                if events
                    .send(Event::RecorderLost("the recorder was frozen, or lost its connection".to_owned()))
                    .is_err()
                {
                    return;
                }
                break;
            }
            // No order comes while it runs: this waits for the end of the run.
            if orders.recv_timeout(GLANCE) == Err(RecvTimeoutError::Disconnected) {
                return process.stop(CLOSING);
            }
        }
    }
}

fn is_on_the_bus(shared: &Shared) -> bool {
    shared.hub.iter().flat_map(Hub::nodes).any(|node| node.role == Role::Recorder)
}

fn start(shared: &Shared, groups: &Groups) -> Result<Process, String> {
    let out = shared.folder.episodes();
    let out = out.to_string_lossy();
    let arguments = ["record", "--out", &out];
    let seat = shared.hub()?.seat(Role::Recorder, &Workers::All).map_err(|error| error.to_string())?;
    let mut process = shared.start_program("recorder", "the recorder", &arguments, &seat, groups)?;
    shared.wait_for(&seat, Some(&mut process))?;
    *shared.recorder.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(seat));
    Ok(process)
}
