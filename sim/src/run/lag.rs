//! When the plans of an episode take effect, under a latency.

use std::time::Duration;

use episode::guidance::Guidance;
use episode::latency::Latency;
use episode::latency::delays::Delays;
use episode::latency::pipeline::Pipeline;
use results::part::Plans;
use results::trace::Trace;
use world::plan::Plan;

/// The plans of one episode.
#[derive(Debug)]
pub struct Lag<'t> {
    source: Source<'t>,
    pipeline: Pipeline,
    delays_us: Vec<i32>,
}

/// Where delays come from.
#[derive(Debug)]
enum Source<'t> {
    Fixed(u32),
    Drawn(Delays),
    /// Of each step.
    Traced(&'t [Option<u32>]),
    /// The clock; but at the first steps, which are another drive's, what was measured then.
    Measured(&'t [Option<u32>]),
}

impl<'t> Lag<'t> {
    /// Before the first step of the scene of this name. The plans of the first `led` steps are another drive's, whose trace this is.
    #[must_use]
    pub fn new(latency: &Latency, trace: Option<&'t Trace>, scene: &str, led: usize) -> Self {
        let traced = trace.map_or(&[][..], |trace| trace.delays_us(scene));
        let source = match latency {
            Latency::Fixed(delay) => Source::Fixed(*delay),
            Latency::Drawn(distribution) => Source::Drawn(Delays::new(distribution, scene)),
            Latency::Trace { .. } => Source::Traced(traced),
            Latency::Measured => Source::Measured(&traced[..led.min(traced.len())]),
        };
        Self { source, pipeline: Pipeline::default(), delays_us: Vec::new() }
    }

    /// What is followed in the step for which `plan` was asked. It was `taken` by the clock until the plan was there.
    ///
    /// # Errors
    /// That nobody knows how long it took, as a sentence.
    pub fn step(&mut self, plan: Plan, taken: Duration) -> Result<Guidance<'_>, String> {
        let step = plan.step();
        let measured = || Some(u32::try_from(taken.as_micros()).unwrap_or(u32::MAX));
        let delay_us = match &mut self.source {
            Source::Fixed(delay) => Some(*delay),
            Source::Drawn(delays) => delays.draw(),
            Source::Traced(delays) => *delays.get(step as usize).ok_or_else(|| {
                format!("step {step}: the trace of latencies ends before it, after {} steps", delays.len())
            })?,
            Source::Measured(before) => before.get(step as usize).copied().unwrap_or_else(measured),
        };
        self.delays_us.push(delay_us.map_or(-1, |delay| i32::try_from(delay).unwrap_or(i32::MAX)));
        Ok(self.pipeline.step(plan, delay_us))
    }

    /// What became of the plans.
    #[must_use]
    pub fn plans(self) -> Plans {
        Plans { delays_us: self.delays_us, late: self.pipeline.fates.late, lost: self.pipeline.fates.lost }
    }
}
