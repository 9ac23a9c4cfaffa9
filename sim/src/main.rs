//! `sim`: drives an autonomous vehicle through logged traffic, and tells how well it drove.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 done; 1 done, with episodes that failed or
//! are not recorded whole, or a comparison that broke a rule; 2 usage or unusable input; 130 interrupted.

use std::io::{self, Write as _};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread;

use evaluation::compare::{CompareFormat, compare, gate, json, junit, markdown, text};
use evaluation::drives::Run;
use evaluation::latency;
use evaluation::scenes::{self, Scenes};
use evaluation::score;
use evaluation::table::{self, TableFormat};
use evaluation::{traffic, validity};
use results::files;
use results::summary::{Summary, SummaryError};
use sim::cli::{
    BlameArgs, CancelArgs, CheckFormat, CheckNodeArgs, Cli, Command, CompareArgs, EvaluateArgs, MatrixArgs, MergeArgs,
    PlanArgs, PredictionsArgs, RenderArgs, ReplayArgs, ReportArgs, RunArgs, ScoreArgs, ServeArgs, SessionArgs,
    StatusArgs, SubmitArgs, TableArgs, ValidityArgs, VerifyArgs, WatchArgs,
};
use sim::client::watch::Watched;
use sim::client::{self, Service};
use sim::evaluate::request::Evaluation;
use sim::matrix;
use sim::predictions;
use sim::replay;
use sim::request::Request;
use sim::run::bus_threads;
use sim::run::clock::{Clock, WallClock};
use sim::run::console::Console;
use sim::run::interrupt::{INTERRUPTED, Interrupts};
use sim::run::refusals::Refusals;
use sim::run::{self, Done, RunError, ShardDone};
use sim::shards::{merge, plan, status};
use sim::side_by_side;
use sim::verify::verify;
use sim::{render, report};
use tracing_subscriber::prelude::*;
use tracing_subscriber::{EnvFilter, fmt};

fn main() -> ExitCode {
    let clock = WallClock::start();
    let cli: Cli = terminal::parse(terminal::REVISION);
    if cli.command.is_on_the_bus() {
        bus_threads::settle(cli.command.endpoint());
    }
    let console = Console::new();
    // What the sim warns of is provoked there, and told in the report.
    let quiet = if matches!(cli.command, Command::CheckNode(_)) { "error" } else { "warn,zenoh=error" };
    log_to(&console, cli.verbose, quiet);
    let done = match cli.command {
        Command::Run(arguments) => drive(*arguments, clock, &console),
        Command::Matrix(arguments) => drive_matrix(&arguments, clock, &console),
        Command::Evaluate(arguments) => evaluate(*arguments, clock, &console),
        Command::Merge(arguments) => merge_shards(&arguments, &console),
        Command::Plan(arguments) => print_plan(*arguments, clock, &console),
        Command::Table(arguments) => print_tables(&arguments, &console),
        Command::Compare(arguments) => print_comparison(&arguments, &console),
        Command::Score(arguments) => print_scores(&arguments),
        Command::Predictions(arguments) => print_predictions(&arguments, &console),
        Command::Validity(arguments) => print_validity(&arguments),
        Command::Replay(arguments) => replay_runs(&arguments, clock, &console),
        Command::Blame(arguments) => print_blame(&arguments, clock, &console),
        Command::Report(arguments) => write_report(&arguments, &console),
        Command::Render(arguments) => draw(&arguments, clock, &console),
        Command::CheckNode(arguments) => check_node(&arguments, &console),
        Command::Serve(arguments) => serve(&arguments, clock, &console),
        Command::Submit(arguments) => submit(*arguments, &console),
        Command::Status(arguments) => print_status(&arguments),
        Command::Watch(arguments) => watch(&arguments, &console),
        Command::Cancel(arguments) => cancel(&arguments, &console),
        Command::Session(arguments) => hold_session(&arguments, &console),
        Command::Verify(arguments) => print_verdict(&arguments),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            console.line(&format!("error: {error}"));
            match error.downcast_ref() {
                Some(RunError::Interrupted { .. }) => ExitCode::from(INTERRUPTED as u8),
                _ => ExitCode::from(2),
            }
        }
    }
}

/// The log goes to standard error; `RUST_LOG` says of what, else the number of `-v`.
fn log_to(console: &Console, verbose: u8, quiet: &str) {
    let level = match verbose {
        0 => quiet,
        1 => "warn,zenoh=error,sim=info,wire=info",
        2 => "info,sim=debug,wire=debug,scenarios=debug",
        _ => "debug",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let log = fmt::layer().with_ansi(terminal::colours(&io::stderr())).with_writer(console.clone()).without_time();
    tracing_subscriber::registry().with(log.with_filter(filter)).with(Refusals::told_on(console)).init();
}

fn drive(arguments: RunArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    let leaves = arguments.exit_with_parent;
    let request = Request::resolve(arguments, cores())?;
    let interrupts = Interrupts::catch()?;
    if leaves {
        interrupts.leave_with_standard_input();
    }
    let done = run::run(&request, clock, console, &interrupts)?;
    let code = print_done(&done)?;
    if request.timing {
        console.line(&done.breakdown.lines(clock.now().as_secs_f64()));
    }
    Ok(code)
}

/// Prints what was driven: a run, or a shard of one.
fn print_done(done: &Done) -> anyhow::Result<ExitCode> {
    let Some(ShardDone { shard, episodes, failures }) = &done.shard else { return print_run(&done.folder) };
    let (folder, failed) = (done.folder.display(), failures.len());
    terminal::say(&format!("shard {shard} of {folder} is whole: {episodes} episodes, {failed} failed\n"))?;
    Ok(if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Makes runs of shards, and prints them.
fn merge_shards(arguments: &MergeArgs, console: &Console) -> anyhow::Result<ExitCode> {
    if arguments.runs.len() > 1 && !arguments.from.is_empty() {
        anyhow::bail!("--from is for one run\nhint: merge them one after the other");
    }
    let merged = arguments.runs.iter().map(|run| {
        merge::merge(run, &arguments.from, console)?;
        print_run(run)
    });
    worst_of(merged)
}

/// The first that is no success, when all are done.
fn worst_of(codes: impl Iterator<Item = anyhow::Result<ExitCode>>) -> anyhow::Result<ExitCode> {
    let codes = codes.collect::<Result<Vec<_>, _>>()?;
    Ok(codes.into_iter().find(|code| *code != ExitCode::SUCCESS).unwrap_or(ExitCode::SUCCESS))
}

/// Prints what a run would take.
fn print_plan(arguments: PlanArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    let PlanArgs { shards, sample, run } = arguments;
    let request = Request::resolve(run, cores())?;
    let interrupts = Interrupts::catch()?;
    terminal::say(&plan::plan(&request, (sample as usize, &shards), clock, console, &interrupts)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Prints the run that was driven, and where it is.
fn print_run(folder: &Path) -> anyhow::Result<ExitCode> {
    let summary = Summary::read(folder)?;
    let clean = summary.failures.is_empty() && summary.broken_recordings.is_empty();
    terminal::say(&table::render(&[summary], TableFormat::Text, width()))?;
    terminal::say(&format!("\nfolder {}\ndigest {}\n", folder.display(), results::digest(folder)?))?;
    Ok(if clean { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn cores() -> u16 {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    cores.try_into().unwrap_or(u16::MAX)
}

fn drive_matrix(arguments: &MatrixArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    let requests = matrix::requests(arguments, cores())?;
    let interrupts = Interrupts::catch()?;
    let driven = matrix::drive(&requests, clock, console, &interrupts)?;
    if driven.iter().any(|done| done.shard.is_some()) {
        return worst_of(driven.iter().map(print_done));
    }
    let runs = driven.iter().map(|done| Summary::read(&done.folder)).collect::<Result<Vec<Summary>, _>>()?;
    let clean = runs.iter().all(|run| run.failures.is_empty() && run.broken_recordings.is_empty());
    terminal::say(&table::render(&runs, arguments.format, width()))?;
    if latency::is_a_sweep(&runs) {
        plot_latency(&runs, &arguments.out.join("latency.svg"), console)?;
    }
    if arguments.format == TableFormat::Text {
        terminal::say(&format!("\nfolder {}\n", arguments.out.display()))?;
    }
    Ok(if clean { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Draws score against latency.
fn plot_latency(runs: &[Summary], path: &Path, console: &Console) -> anyhow::Result<()> {
    let plot = latency::plot(runs)?;
    files::write_whole(path, |file| file.write_all(plot.as_bytes()))?;
    console.line(&format!("score against latency is drawn in {}", path.display()));
    Ok(())
}

/// Prints what plans are worth that are not driven.
fn evaluate(arguments: EvaluateArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    if arguments.traffic {
        return print_realism(&arguments);
    }
    let evaluation = Evaluation::resolve(arguments, cores())?;
    let interrupts = Interrupts::catch()?;
    let found = sim::evaluate::evaluate(&evaluation, width(), clock, console, &interrupts)?;
    terminal::say(&found.table)?;
    Ok(if found.clean { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Prints whether the agents that reacted are believable.
fn print_realism(arguments: &EvaluateArgs) -> anyhow::Result<ExitCode> {
    let runs = arguments.paths.iter().map(|folder| traffic::Figures::of(folder.as_ref(), &arguments.scenarios));
    let runs = runs.collect::<Result<Vec<_>, _>>()?;
    terminal::say(&traffic::render(&runs, arguments.format))?;
    Ok(ExitCode::SUCCESS)
}

/// The finished runs among these folders; what is not finished is passed over where others are.
fn finished(folders: &[PathBuf], console: &Console) -> anyhow::Result<Vec<Summary>> {
    let (mut runs, mut unfinished) = (Vec::new(), Vec::new());
    for folder in folders {
        match Summary::read(folder) {
            Ok(run) => runs.push(run),
            Err(error @ (SummaryError::Unfinished(_) | SummaryError::NoRun(_))) => unfinished.push((folder, error)),
            Err(error) => return Err(error.into()),
        }
    }
    if runs.is_empty()
        && let Some((_, error)) = unfinished.pop()
    {
        return Err(error.into());
    }
    if !unfinished.is_empty() {
        let names: Vec<String> = unfinished.iter().map(|(folder, _)| folder.display().to_string()).collect();
        console.line(&format!("note: passed over, because there is no finished run: {}", names.join(", ")));
    }
    Ok(runs)
}

/// Prints the finished runs.
fn print_tables(arguments: &TableArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let runs = finished(&arguments.runs, console)?;
    if let Some(path) = &arguments.plot {
        plot_latency(&runs, path, console)?;
    }
    if !arguments.scenes {
        terminal::say(&table::render(&runs, arguments.format, width()))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut by_scene = Vec::new();
    for run in runs {
        let scenes = Scenes::read(&run.folder, arguments.worst)?;
        by_scene.push((run, scenes));
    }
    terminal::say(&scenes::render(&by_scene, arguments.format, width()))?;
    Ok(ExitCode::SUCCESS)
}

/// Prints what differs between two runs; a rule that is broken makes the exit code.
fn print_comparison(arguments: &CompareArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let comparison = compare(&arguments.baseline, &arguments.candidate, arguments.seed)?;
    let gates = gate::check(&comparison, &arguments.fail_on)?;
    if let Some(path) = &arguments.junit {
        let report = junit::render(&comparison, &gates)?;
        files::write_whole(path, |file| file.write_all(report.as_bytes()))?;
    }
    terminal::say(&match arguments.format {
        CompareFormat::Text => text::render(&comparison, &gates, width()),
        CompareFormat::Markdown => markdown::render(&comparison, &gates),
        CompareFormat::Json => json::render(&comparison, &gates)?,
    })?;
    if let Some(scene) = &arguments.open {
        let shown = side_by_side::open(&comparison, scene, arguments.rrd.as_deref())?;
        let part = match shown.part_at_step {
            Some(step) => format!("they part after step {step}"),
            None => "they never part".to_owned(),
        };
        console.line(&format!("{}: {part}; both side by side are in {}", shown.scene, shown.rrd.display()));
        if !shown.viewer {
            console.line("hint: no viewer was found: pip install rerun-sdk==0.36.3, then rerun FILE");
        }
    }
    Ok(if gates.iter().any(|gate| gate.hit) { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Columns of the terminal; where there is none, what `COLUMNS` says, else 80.
fn width() -> usize {
    let terminal = terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| usize::from(width.0));
    let said = || std::env::var("COLUMNS").ok()?.parse().ok();
    terminal.or_else(said).unwrap_or(80)
}

/// Prints what drives were worth, by whose definitions ever.
fn print_scores(arguments: &ScoreArgs) -> anyhow::Result<ExitCode> {
    let mut runs = Vec::new();
    for folder in &arguments.runs {
        let (scores, mut run) = (arguments.scores(), Run::read(folder)?);
        if !score::need_no_scenes(&run.file.settings.protocol, &scores) {
            run = Run::open(folder, &arguments.scenarios)?;
        }
        runs.push(score::score(&run, &scores, arguments.out_steps.is_some())?);
    }
    if let Some(path) = &arguments.out {
        score::write(path, &runs)?;
    }
    if let Some(path) = &arguments.out_steps {
        score::write_steps(path, &runs)?;
    }
    terminal::say(&score::render(&runs, arguments.scenes, arguments.format, width()))?;
    Ok(ExitCode::SUCCESS)
}

/// Prints what predictions were worth, over all recordings of each run.
fn print_predictions(arguments: &PredictionsArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let mut runs = Vec::new();
    for folder in &arguments.runs {
        let run = predictions::of_run(folder)?;
        if run.unrecorded > 0 {
            console.line(&format!("note: {} has no recording of {} episodes", folder.display(), run.unrecorded));
        }
        runs.push((folder.display().to_string(), run.figures));
    }
    terminal::say(&evaluation::predictions::render(&runs, arguments.format))?;
    Ok(ExitCode::SUCCESS)
}

/// Prints where replayed agents would have had to react.
fn print_validity(arguments: &ValidityArgs) -> anyhow::Result<ExitCode> {
    let runs = arguments.runs.iter().map(|folder| validity::Figures::of(folder, &arguments.scenarios));
    let runs = runs.collect::<Result<Vec<_>, _>>()?;
    if let Some(path) = &arguments.out {
        validity::file::write(path, &runs)?;
    }
    let told = if arguments.scenes {
        validity::scenes(&runs, arguments.format)
    } else {
        validity::render(&runs, arguments.format)
    };
    terminal::say(&told)?;
    Ok(ExitCode::SUCCESS)
}

fn replay_runs(arguments: &ReplayArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    if let Some(from) = arguments.from {
        let interrupts = Interrupts::catch()?;
        return print_run(&replay::fork::run(arguments, from, cores(), clock, console, &interrupts)?.folder);
    }
    let interrupts = if arguments.live { Some(Interrupts::catch()?) } else { None };
    let mut is_same = true;
    for folder in &arguments.runs {
        let replayed = match &interrupts {
            Some(interrupts) => replay::live::run(folder, arguments, cores(), clock, console, interrupts)?,
            None => replay::run(folder, arguments)?,
        };
        terminal::say(&replayed.text)?;
        is_same &= replayed.is_same;
    }
    Ok(if is_same { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Prints what would have saved the drives that failed.
fn print_blame(arguments: &BlameArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    let interrupts = Interrupts::catch()?;
    let blamed = sim::blame::blame(arguments, cores(), clock, console, &interrupts)?;
    terminal::say(&evaluation::blame::table::render(&blamed, arguments.format, width())?)?;
    Ok(ExitCode::SUCCESS)
}

/// Writes finished runs as a page.
fn write_report(arguments: &ReportArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let runs = finished(&arguments.runs, console)?.into_iter().map(|run| run.folder).collect();
    let written = report::write(arguments, runs)?;
    written.notes.iter().for_each(|note| console.line(&format!("note: {note}")));
    terminal::say(&written.text)?;
    Ok(ExitCode::SUCCESS)
}

/// Draws a drive.
fn draw(arguments: &RenderArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    let drawn = render::draw(arguments, &clock)?;
    if arguments.timing {
        console.line(&drawn.timing());
    }
    terminal::say(&drawn.text())?;
    Ok(ExitCode::SUCCESS)
}

/// Prints what is wrong with a node.
fn check_node(arguments: &CheckNodeArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let interrupts = Interrupts::catch()?;
    let report = sim::check::check(arguments, console, interrupts.nodes())?;
    terminal::say(&match arguments.format {
        CheckFormat::Text => report.text(width()),
        CheckFormat::Json => report.json()?,
    })?;
    Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Serves until somebody stops it; that is no failure.
fn serve(arguments: &ServeArgs, clock: WallClock, console: &Console) -> anyhow::Result<ExitCode> {
    sim::serve::serve(arguments, cores(), clock, console)?;
    Ok(ExitCode::SUCCESS)
}

/// Submits a run and prints its name.
fn submit(arguments: SubmitArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let run = client::submit(&arguments, &mut Service::new(&arguments.service)?)?;
    terminal::say(&format!("{}\n", run.name))?;
    if !arguments.watch {
        return Ok(ExitCode::SUCCESS);
    }
    let service = arguments.service;
    watch(&WatchArgs { run: run.name, ends: false, format: TableFormat::Text, service }, console)
}

fn print_status(arguments: &StatusArgs) -> anyhow::Result<ExitCode> {
    // At a service a run has a name, which is no path.
    if let Some(folder) =
        arguments.run.as_ref().map(Path::new).filter(|run| run.components().count() > 1 || run.is_dir())
    {
        let found = status::status(folder, arguments.json)?;
        terminal::say(&found.text)?;
        return Ok(if found.is_clean { ExitCode::SUCCESS } else { ExitCode::from(1) });
    }
    terminal::say(&client::status::status(arguments, &mut Service::new(&arguments.service)?)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Shows how a run goes, and its table at the end. Exits as `sim run` would.
fn watch(arguments: &WatchArgs, console: &Console) -> anyhow::Result<ExitCode> {
    let Watched { run, table } =
        client::watch::watch(arguments, width(), &mut Service::new(&arguments.service)?, console)?;
    let Some(table) = table else {
        let state = client::status::state_name(run.state());
        console
            .line(&format!("{} is {state}, with {} of {} episodes: {}", run.name, run.done, run.episodes, run.detail));
        return Ok(ExitCode::from(2));
    };
    terminal::say(&table)?;
    if arguments.format == TableFormat::Text {
        terminal::say(&format!("\nrun {}\ndigest {}\n", run.name, run.digest))?;
    }
    Ok(if run.failed > 0 { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn cancel(arguments: &CancelArgs, console: &Console) -> anyhow::Result<ExitCode> {
    for run in client::cancel(arguments, &mut Service::new(&arguments.service)?)? {
        let state = client::status::state_name(run.state());
        console.line(&format!("{} is {state}, with {} of {} episodes", run.name, run.done, run.episodes));
    }
    Ok(ExitCode::SUCCESS)
}

fn hold_session(arguments: &SessionArgs, console: &Console) -> anyhow::Result<ExitCode> {
    client::session::session(arguments, &mut Service::new(&arguments.service)?, console)?;
    Ok(ExitCode::SUCCESS)
}

fn print_verdict(arguments: &VerifyArgs) -> anyhow::Result<ExitCode> {
    // These errors name their causes as sources; whoever prints the error prints one line.
    let report = verify(&arguments.scenarios, &arguments.vectors)
        .map_err(|error| anyhow::anyhow!("{:#}", anyhow::Error::from(error)))?;
    terminal::say(&format!("{report}\n"))?;
    Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
