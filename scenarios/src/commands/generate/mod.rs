//! `scenarios generate`: scenes of families as shards of TFRecords, as WOMD has them.
//!
//! ```text
//! threads: family ──▶ payload ──▶ segment (framed, packed) ──▶ this thread: shard's partial file ──▶ final name
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | `settings` | what is asked for, and the file of it in the folder: only the same goes on where it was interrupted |
//! | `folder` | which shards are there, which are to be made |
//! | `making` | many threads make scenes, one takes them in order: the bytes are the same for any number of threads |
//! | `shard` | a file that appears under its name when it is whole; gzip in segments |

mod folder;
mod making;
mod settings;
mod shard;

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use self::folder::Folder;
use self::settings::Settings;
use self::shard::ShardFile;
use super::Failure;
use super::table::count;
use crate::cli::GenerateArguments;

pub fn run(arguments: &GenerateArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let settings = Settings::resolve(arguments)?;
    let folder = Folder::open(&arguments.out, &settings, arguments.force)?;
    let jobs = arguments.jobs.map_or_else(default_jobs, |jobs| usize::from(jobs.get()));
    let missing = folder.missing();
    let kept = folder.shards().len() - missing.len();
    if kept > 0 {
        eprintln!("note: {} of {} are there already and stay", kept, count(folder.shards().len(), "shard"));
    }
    let stop = interrupts();
    let progress = progress(&settings, &missing);
    let made = making::make(&settings, &missing, jobs, |mut segments| {
        for shard in &missing {
            let mut file = ShardFile::create(folder.path(), &shard.name, settings.gzip)?;
            for _ in 0..shard.count {
                if stop.load(Ordering::Relaxed) {
                    return Err(Failure::Interrupted);
                }
                file.append(&segments.next()?)?;
                progress.inc(1);
            }
            file.finish()?;
        }
        Ok(())
    });
    progress.finish_and_clear();
    made?;
    let megabytes = folder.bytes()? as f64 / 1e6;
    let scenes = count(settings.scenes(), "scene");
    let folder = folder.path();
    write!(out, "{scenes} in {} ({megabytes:.1} MB)\ndrive them: sim run {}\n", folder.display(), quoted(folder))
        .map_err(Failure::Output)?;
    Ok(false)
}

fn default_jobs() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:@".contains(c);
    if text.chars().all(plain) { text.into_owned() } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// Says when to stop: after the first Ctrl-C. The second ends the program at once; what was not whole has no final name.
fn interrupts() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&stop);
    let handler = move || {
        if pressed.swap(true, Ordering::Relaxed) {
            std::process::exit(super::INTERRUPTED.into());
        }
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::warn!("Ctrl-C is not caught, and may leave a partial file: {error}");
    }
    stop
}

/// A bar of scenes, on a terminal alone.
fn progress(settings: &Settings, missing: &[folder::Shard]) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(settings.scenes() as u64), ProgressDrawTarget::hidden());
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} scenes, {per_sec}, {eta} to go");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let to_make: usize = missing.iter().map(|shard| shard.count as usize).sum();
    bar.set_position((settings.scenes() - to_make) as u64);
    // What was there took no time of this run.
    bar.reset_eta();
    if io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::stderr());
    }
    bar
}
