//! Which cores a thread may run on.
//!
//! Simulator and nodes wait for each other in turn. To wake a thread on another core costs more than on the same one, on a virtual machine
//! up to 60 microseconds. Where nothing else wants the cores, it pays to keep those who talk to each other on one.

use std::io;

#[cfg(target_os = "linux")]
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
#[cfg(target_os = "linux")]
use nix::unistd::Pid;

/// Some of the machine's cores. Linux alone lets threads be kept to them; elsewhere there are none to be had.
#[derive(Clone, Copy, Debug)]
pub struct Cores(#[cfg(target_os = "linux")] CpuSet, #[cfg(not(target_os = "linux"))] std::convert::Infallible);

#[cfg(not(target_os = "linux"))]
#[allow(missing_docs, clippy::missing_errors_doc, reason = "see the others")]
impl Cores {
    pub fn of_this_thread() -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub fn one(&self, _: usize) -> io::Result<Self> {
        match self.0 {}
    }

    pub fn keep_to(&self) -> io::Result<()> {
        match self.0 {}
    }
}

#[cfg(target_os = "linux")]
impl Cores {
    /// Those that the calling thread may run on.
    ///
    /// # Errors
    /// Where the system does not say.
    pub fn of_this_thread() -> io::Result<Self> {
        Ok(Self(sched_getaffinity(Pid::from_raw(0))?))
    }

    /// One of them, by number, around and around.
    ///
    /// # Errors
    /// Where there is none.
    pub fn one(&self, number: usize) -> io::Result<Self> {
        let all: Vec<usize> = (0..CpuSet::count()).filter(|core| self.0.is_set(*core).unwrap_or(false)).collect();
        let mut one = CpuSet::new();
        one.set(*all.get(number % all.len().max(1)).ok_or(io::ErrorKind::NotFound)?)?;
        Ok(Self(one))
    }

    /// Keeps the calling thread to these, and every thread and process that it starts from now on.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn keep_to(&self) -> io::Result<()> {
        Ok(sched_setaffinity(Pid::from_raw(0), &self.0)?)
    }
}

#[cfg(all(test, target_os = "linux"))]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_thread_kept_to_one_core_may_use_no_other_and_hands_that_on() {
        let count = |cores: &Cores| (0..CpuSet::count()).filter(|core| cores.0.is_set(*core).unwrap()).count();
        std::thread::spawn(move || {
            let all = Cores::of_this_thread().unwrap();
            all.one(1).unwrap().keep_to().unwrap();
            let child = std::thread::spawn(|| Cores::of_this_thread().unwrap()).join().unwrap();
            assert_eq!((count(&Cores::of_this_thread().unwrap()), count(&child)), (1, 1));
            all.keep_to().unwrap();
            assert_eq!(count(&Cores::of_this_thread().unwrap()), count(&all));
        })
        .join()
        .unwrap();
    }
}
