//! A driver whose processes are looked at when it fails: how one of them ended is part of the reason.

use std::thread;
use std::time::{Duration, Instant};

use wire::proto::{EpisodeEnd, Event, StepRecord};
use world::observation::{Briefing, Observation};
use world::plan::Plan;
use world::traffic::{Taken, UncheckedMoves};

use super::drive::Driver;
use super::process::Process;
use super::voice;

/// How long a process may take to be gone after its connection is.
const DYING: Duration = Duration::from_millis(300);

/// A driver, and the processes that it consists of.
pub struct Witness<'a, D> {
    /// The driver.
    pub driver: D,
    /// Its processes, as far as the sim started them.
    pub nodes: &'a mut [Process],
}

/// The role alone: a result does not depend on which worker drove.
fn role(node: &Process) -> &str {
    node.name().split(' ').next().unwrap_or_default()
}

impl<D> Witness<'_, D> {
    /// The reason, with the end of a process that is gone, and what one raised.
    fn testify(&mut self, reason: &str) -> String {
        let until = Instant::now() + DYING;
        let ended = loop {
            let gone = self.nodes.iter_mut().find_map(|node| {
                let how = node.gone()?;
                Some(format!("the {} {how}", role(node)))
            });
            if gone.is_some() || self.nodes.is_empty() || Instant::now() >= until {
                break gone;
            }
            thread::sleep(Duration::from_millis(5));
        };
        let raised = self.nodes.iter_mut().find_map(|node| {
            let what = node.raised(DYING)?;
            Some(format!("the {} {what}", role(node)))
        });
        let told = [Some(reason.to_owned()), ended, raised];
        voice::reason(&told.into_iter().flatten().collect::<Vec<_>>().join(": "))
    }
}

impl<D: Driver> Driver for Witness<'_, D> {
    fn brief(&mut self, briefing: &Briefing) -> Result<(), String> {
        self.driver.brief(briefing).map_err(|reason| self.testify(&reason))
    }

    fn answer(&mut self, observation: &Observation) -> Result<Plan, String> {
        self.driver.answer(observation).map_err(|reason| self.testify(&reason))
    }

    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        self.driver.moves(observation, taken).map_err(|reason| self.testify(&reason))
    }

    fn step_done(&mut self, record: &StepRecord, events: &[Event]) {
        self.driver.step_done(record, events);
    }

    fn dismiss(&mut self, end: &EpisodeEnd) -> Result<(), String> {
        self.driver.dismiss(end).map_err(|reason| self.testify(&reason))
    }

    fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String> {
        self.driver.end(events, end)
    }
}
