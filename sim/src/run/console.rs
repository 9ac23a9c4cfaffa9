//! Standard error, shared by the progress bar, the log and what the nodes say.

use std::io::{self, IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracing_subscriber::fmt::MakeWriter;

/// Writes lines above the progress bar. The bar is shown on a terminal only.
#[derive(Clone, Debug)]
pub struct Console {
    bar: ProgressBar,
    /// The bar is of more than one run.
    is_shared: bool,
    /// Nothing is written.
    is_silent: bool,
}

impl Default for Console {
    fn default() -> Self {
        Self::new()
    }
}

impl Console {
    /// A console without a bar yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            bar: ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()),
            is_shared: false,
            is_silent: false,
        }
    }

    /// A console that shows nothing, for what is kept elsewhere.
    #[must_use]
    pub fn silent() -> Self {
        Self { is_silent: true, ..Self::new() }
    }

    /// The same console for one run of several that share a bar, which tells what runs.
    #[must_use]
    pub fn shared(&self, what: String) -> Self {
        self.bar.set_message(what);
        Self { is_shared: true, ..self.clone() }
    }

    /// Shows a bar of so many `things` (a plural), some of them done.
    pub fn begin(&self, things: &str, total: usize, done: usize) {
        if self.is_shared {
            return self.pass_over(done);
        }
        if !io::stderr().is_terminal() {
            return;
        }
        let template = format!("{{bar:30}} {{pos}}/{{len}} {things}, {{elapsed}} gone, {{eta}} to go  {{msg}}");
        let style = ProgressStyle::with_template(&template);
        self.bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        // Those of an earlier sim took no time of this one.
        self.bar.reset_eta();
        self.bar.set_draw_target(ProgressDrawTarget::stderr());
    }

    /// One more.
    pub fn advance(&self) {
        self.bar.inc(1);
    }

    /// So many that were driven before, by another command.
    pub fn pass_over(&self, episodes: usize) {
        self.bar.inc(episodes as u64);
        self.bar.reset_eta();
    }

    /// Takes the bar away.
    pub fn end(&self) {
        if self.is_shared {
            return;
        }
        self.bar.finish_and_clear();
        self.bar.set_draw_target(ProgressDrawTarget::hidden());
    }

    /// Writes a line. A closed standard error is no error: there is nobody to tell.
    pub fn line(&self, text: &str) {
        if self.is_silent {
            return;
        }
        self.bar.suspend(|| {
            let _ = writeln!(io::stderr(), "{text}");
        });
    }
}

/// One write of the log: whole lines.
pub struct LogWriter(Console);

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.bar.suspend(|| io::stderr().write_all(bytes))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

impl MakeWriter<'_> for Console {
    type Writer = LogWriter;

    fn make_writer(&self) -> LogWriter {
        LogWriter(self.clone())
    }
}
