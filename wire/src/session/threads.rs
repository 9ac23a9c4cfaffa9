//! How many threads the bus has in a process. Zenoh reads that from the environment alone, when it is first used, and a program cannot safely
//! change its own: it starts itself anew in its own place, which takes a few milliseconds and leaves the process number, the arguments and
//! all streams as they are.

/// Where Zenoh reads from how many threads it may have, and nowhere else.
pub const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// What [`RUNTIME_VARIABLE`] is best set to, for so many threads. By default Zenoh waits for the network in one thread, reads in another and
/// writes in a third: each step of a drive wakes all of them. So one does all three, and an answer that is given while reading wakes no
/// other.
#[must_use]
pub fn runtime(threads: u16) -> String {
    let handed_over = ["tx", "acc", "app", "net"].map(|name| format!("{name}: (handover: rx)")).join(", ");
    format!("(rx: (worker_threads: {threads}), {handed_over})")
}

/// Returns once this process has the threads that `runtime` says, or cannot have them. What the environment says already, holds.
pub fn settle(runtime: &str) {
    if std::env::var_os(RUNTIME_VARIABLE).is_some() {
        return;
    }
    #[cfg(unix)]
    if let Ok(program) = std::env::current_exe() {
        use std::os::unix::process::CommandExt as _;
        let mut arguments = std::env::args_os();
        let mut command = std::process::Command::new(program);
        if let Some(name) = arguments.next() {
            command.arg0(name);
        }
        // It returns only where it fails.
        let _ = command.args(arguments).env(RUNTIME_VARIABLE, runtime).exec();
    }
}

/// Whether one thread alone may serve the bus at `endpoint`: in Zenoh 1.10.2 a connection by TLS that one thread reads while another writes is
/// lost, most often within a second, because both use its cipher state at once (`zenoh-link-tls`, `LinkUnicastTls`).
#[must_use]
pub fn needs_one_thread(endpoint: &str) -> bool {
    endpoint.starts_with("tls/")
}

/// To be called before the first session of a program that is to speak to `endpoint`: it is started anew where that needs one thread.
pub fn settle_for(endpoint: &str) {
    if !needs_one_thread(endpoint) {
        return;
    }
    settle(&runtime(1));
    if std::env::var(RUNTIME_VARIABLE).ok() != Some(runtime(1)) {
        tracing::warn!(
            "by TLS the bus needs one thread, or connections are lost: set {RUNTIME_VARIABLE} to {}",
            runtime(1)
        );
    }
}
