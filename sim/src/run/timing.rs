//! Where the time went, in a few lines for standard error.

use results::part::Part;
use world::plan::STEP_SECONDS;

/// Sums over the episodes that one sim drove.
#[derive(Debug, Default)]
pub struct Breakdown {
    episodes: usize,
    steps: usize,
    /// When the first step of all began, after the start of the program (s).
    first_step: Option<f64>,
    /// By name: seconds of all workers together.
    stages: [f64; 9],
}

const NAMES: [&str; 9] =
    ["load", "prepare", "brief", "observe", "traffic", "answer", "advance", "publish", "recording"];

impl Breakdown {
    /// Adds an episode.
    pub fn add(&mut self, part: &Part) {
        let timing = part.timing.unwrap_or_default();
        self.episodes += 1;
        self.steps += part.records.len();
        if !part.records.is_empty() {
            self.first_step = Some(self.first_step.map_or(timing.first_step, |first| first.min(timing.first_step)));
        }
        let t = timing;
        let stages = [t.load, t.prepare, t.brief, t.observe, t.traffic, t.answer, t.advance, t.publish, t.recording];
        self.stages.iter_mut().zip(stages).for_each(|(sum, stage)| *sum += stage);
    }

    /// The lines, for a program that ran so many seconds.
    #[must_use]
    pub fn lines(&self, wall: f64) -> String {
        let driven = self.steps as f64 * STEP_SECONDS;
        let first = self.first_step.map_or_else(|| "-".to_owned(), |first| format!("{first:.3} s"));
        let sum: f64 = self.stages.iter().sum();
        let share = |(name, stage): (&&str, &f64)| format!("{name} {:.1} %", 100.0 * stage / sum.max(1e-9));
        let shares: Vec<String> = NAMES.iter().zip(&self.stages).map(share).collect();
        format!(
            "timing: {} episodes, {} steps, {driven:.1} s driven in {wall:.2} s: {:.1} times real time; first step after {first}\n\
             timing: of {sum:.2} s of all workers: {}",
            self.episodes,
            self.steps,
            driven / wall.max(1e-9),
            shares.join(", "),
        )
    }
}
