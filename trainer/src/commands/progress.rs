//! How far it is: a bar on a terminal, a line an epoch in any case; and Ctrl-C.

use std::io::{self, IsTerminal, Write};
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::INTERRUPTED;
use crate::cql::{self, EpochMeans, Report};
use crate::metrics::{EpochRow, StepRow};
use crate::settings::Settings;
use crate::training::Watch;

/// Tells standard error, and stops at Ctrl-C.
pub struct Progress {
    bar: ProgressBar,
    pressed: Arc<AtomicBool>,
    epochs: usize,
}

impl Progress {
    /// Catches Ctrl-C and SIGTERM from here on: after the first the training stops when its step is done, after the second the program
    /// ends at once. Files are whole in both cases.
    pub fn new() -> Self {
        let pressed = Arc::new(AtomicBool::new(false));
        let caught = Arc::clone(&pressed);
        let handler = move || {
            if caught.swap(true, Ordering::Relaxed) {
                process::exit(INTERRUPTED.into());
            }
        };
        if let Err(error) = ctrlc::set_handler(handler) {
            tracing::warn!("Ctrl-C is not caught, and costs the steps since the last checkpoint: {error}");
        }
        Self { bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()), pressed, epochs: 0 }
    }

    /// Takes the bar away.
    pub fn end(&self) {
        self.bar.finish_and_clear();
        self.bar.set_draw_target(ProgressDrawTarget::hidden());
    }

    fn line(&self, text: &str) {
        self.bar.suspend(|| {
            // A closed standard error is no error: there is nobody to tell.
            let _ = writeln!(io::stderr(), "{text}");
        });
    }
}

impl Progress {
    fn start(&mut self, name: &str, epochs: usize, steps: u64, done: u64) {
        self.epochs = epochs;
        self.bar.set_prefix(name.to_owned());
        if done > 0 {
            self.line(&format!("{name}: {done} of {steps} steps are done already"));
        }
        let style =
            ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} steps, {elapsed} gone, {eta} to go  {msg}");
        self.bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        self.bar.set_length(steps);
        self.bar.reset();
        self.bar.set_position(done);
        // Steps of an earlier program took no time of this one.
        self.bar.reset_eta();
        if io::stderr().is_terminal() {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::Relaxed)
    }
}

impl Watch for Progress {
    fn begin(&mut self, name: &str, settings: &Settings, steps: u64, done: u64) {
        self.start(name, settings.epochs, steps, done);
    }

    fn step(&mut self, row: &StepRow) {
        let speed = row.windows as f64 / row.seconds;
        self.bar.set_message(format!("epoch {}, loss {:.3}, {speed:.0} windows/s", row.epoch, row.terms.total));
        self.bar.inc(1);
    }

    fn epoch(&mut self, row: &EpochRow) {
        let mut text = format!("{}: epoch {}/{}", self.bar.prefix(), row.epoch, self.epochs);
        if let Some((train, _)) = row.train.means() {
            text += &format!(": loss {:.3}", train.total);
        }
        if let Some((validation, _)) = row.validation.means() {
            text += &format!(
                "; validation: loss {:.3}, planner ADE {:.2} m, FDE {:.2} m, predictor ADE {:.2} m, FDE {:.2} m",
                validation.total,
                validation.planner_ade,
                validation.planner_fde,
                validation.predictor_ade,
                validation.predictor_fde
            );
        }
        if let Some(speed) = row.windows_per_second {
            text += &format!("; {speed:.1} windows/s");
        }
        self.line(&text);
    }

    fn stop(&self) -> bool {
        self.is_pressed()
    }
}

impl cql::Watch for Progress {
    fn begin(&mut self, name: &str, epochs: usize, steps: u64, done: u64) {
        self.start(name, epochs, steps, done);
    }

    fn step(&mut self, epoch: usize, report: &Report, speed: f64) {
        let [bellman, gap, ..] = report.0;
        let text = format!("epoch {epoch}, Bellman error {bellman:.3}, gap {gap:.2}, {speed:.0} transitions/s");
        self.bar.set_message(text);
        self.bar.inc(1);
    }

    fn epoch(&mut self, row: &EpochMeans) {
        let parts = Report::NAMES.iter().zip(row.report.0).map(|(name, value)| format!("{name} {value:.3}"));
        let parts: Vec<String> = parts.collect();
        let mut text = format!("{}: epoch {}/{}: {}", self.bar.prefix(), row.epoch, self.epochs, parts.join(", "));
        if !row.errors.is_empty() {
            let errors: Vec<String> = row.errors.iter().map(|error| format!("{error:.4}")).collect();
            text += &format!("; validation: off by {}", errors.join(", "));
        }
        if let Some(speed) = row.speed {
            text += &format!("; {speed:.1} transitions/s");
        }
        self.line(&text);
    }

    fn stop(&self) -> bool {
        self.is_pressed()
    }
}
