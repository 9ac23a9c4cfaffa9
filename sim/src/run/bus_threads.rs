//! How many threads the bus has in this process. Zenoh reads that from the environment alone, and a program cannot safely change its own: it
//! starts itself anew in its own place, which takes a few milliseconds and leaves the process number, the arguments and all streams as they are.

use std::num::NonZero;
use std::process::Command;
use std::thread;

use wire::session::{RUNTIME_VARIABLE, runtime};

/// Threads of the bus: one serves some four workers.
fn wanted() -> String {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    runtime((cores / 4).clamp(1, 16) as u16)
}

/// Returns once this process has them, or cannot have them: then all is as it should be, but slower. What the user says about Zenoh's
/// threads holds.
pub fn settle() {
    if std::env::var_os(RUNTIME_VARIABLE).is_some() {
        return;
    }
    #[cfg(unix)]
    if let Ok(program) = std::env::current_exe() {
        use std::os::unix::process::CommandExt as _;
        let mut arguments = std::env::args_os();
        let mut command = Command::new(program);
        if let Some(name) = arguments.next() {
            command.arg0(name);
        }
        // It returns only where it fails.
        let _ = command.args(arguments).env(RUNTIME_VARIABLE, wanted()).exec();
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
