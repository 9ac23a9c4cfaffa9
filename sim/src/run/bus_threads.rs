//! How many threads the bus has in this process and in those that it starts.

use std::num::NonZero;
use std::process::Command;
use std::thread;

use wire::session::{self, RUNTIME_VARIABLE, needs_one_thread, runtime};

/// Threads of the bus: one serves some four workers.
fn wanted() -> String {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    runtime((cores / 4).clamp(1, 16) as u16)
}

/// Returns once this process has them, or cannot have them: then all is as it should be, but slower. What the user says about Zenoh's
/// threads holds. `endpoint` is where others come in.
pub fn settle(endpoint: Option<&str>) {
    match endpoint.filter(|endpoint| needs_one_thread(endpoint)) {
        Some(endpoint) => session::settle_for(endpoint),
        None => session::settle(&wanted()),
    }
}

/// Has `command` start with so many threads of the bus, or as many as it likes. Not where the user says otherwise.
pub fn set(command: &mut Command, threads: Option<u16>) {
    if std::env::var(RUNTIME_VARIABLE).is_ok_and(|set| set != wanted()) {
        return;
    }
    match threads {
        Some(threads) => command.env(RUNTIME_VARIABLE, runtime(threads)),
        None => command.env_remove(RUNTIME_VARIABLE),
    };
}
