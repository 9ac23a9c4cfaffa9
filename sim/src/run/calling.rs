//! How a program is called to a seat of the bus: by its environment and by arguments.

use std::process::Command;

use wire::hub::{Hub, Seat};
use wire::keys::Secret;

use super::{bus_threads, process, shell};

/// Tells `command` where the bus is, and which seat is its own.
pub fn to_seat(command: &mut Command, hub: &Hub, seat: &Seat) {
    to_run(command, hub);
    // There alone: everybody on the machine can read arguments.
    command.env(Secret::VARIABLE, seat.secret().reveal());
}

/// Tells `command` where the bus is.
pub fn to_run(command: &mut Command, hub: &Hub) {
    let run = hub.run().to_string();
    // Nodes say what the sim would say, unless the user said otherwise.
    if std::env::var_os("RUST_LOG").is_none() {
        // A message that comes while a session closes is an error to Zenoh; here it is the end of every run. And of each socket that it
        // connects to it warns that it cannot.
        let (info, quiet) =
            ("info,zenoh_link_unixsock_stream=error", "warn,zenoh_link_unixsock_stream=error,zenoh::api::session=off");
        command.env("RUST_LOG", if tracing::enabled!(tracing::Level::INFO) { info } else { quiet });
    }
    // In the environment too, for a planner's command that is a script.
    command.env("NO_COLOR", "1").env("RELOOP_ENDPOINT", hub.endpoint()).env("RELOOP_RUN", &run);
    // It comes in by the sim's own door.
    command.env("RELOOP_EXIT_WITH_PARENT", "true").env_remove(Secret::VARIABLE).env_remove("RELOOP_ZENOH_CONFIG");
    command.args(["--endpoint", hub.endpoint(), "--run", &run, "--exit-with-parent"]);
}

/// A command of the user's, as a node called `name` of `worker`.
#[must_use]
pub fn own(command: &str, worker: &str, name: &str) -> Command {
    let mut shell = Command::new("sh");
    // So that a command finds the nodes of this sim, wherever they are installed.
    if let Some(path) = process::path_with_our_programs() {
        shell.env("PATH", path);
    }
    shell.args(["-c", &shell::line(command), "sh", "--worker", worker, "--name", name]);
    bus_threads::set(&mut shell, None);
    shell.env("RELOOP_WORKER", worker).env("RELOOP_NAME", name);
    shell
}
