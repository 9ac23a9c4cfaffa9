//! Several drivers over the same scenes: a run for each driver and protocol, one after the other.

use std::collections::BTreeSet;

use scenarios::SceneSet;
use thiserror::Error;

use crate::cli::{self, Entrant, LatencyChoice, MatrixArgs, ProtocolName, RunArgs};
use crate::entrants::{self, EntrantsError};
use crate::request::{Request, RequestError};
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::interrupt::Interrupts;
use crate::run::{self, Done, RunError};

/// A matrix that cannot be meant.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum MatrixError {
    #[error("{option} names {name} twice\nhint: leave one out")]
    Repeated { option: &'static str, name: String },
    #[error("two drivers are called {0}\nhint: LABEL:DRIVER, as other-{0}:{0}, gives one another name")]
    Twice(String),
    #[error("the latency {0} is there twice\nhint: leave one of them out")]
    SameLatency(String),
    #[error("{label}: {source}")]
    Request { label: String, source: RequestError },
    #[error(transparent)]
    Entrants(#[from] EntrantsError),
}

/// A run for each driver and protocol: protocol after protocol, the drivers in their order.
///
/// # Errors
/// [`MatrixError`] before anything is driven.
pub fn requests(arguments: &MatrixArgs, cores: u16) -> Result<Vec<Request>, MatrixError> {
    let mut drivers = arguments.drivers.clone();
    if let Some(file) = &arguments.entrants {
        drivers.extend(entrants::read(file)?);
    }
    let mut labels = BTreeSet::new();
    if let Some(entrant) = drivers.iter().find(|entrant| !labels.insert(&entrant.label)) {
        return Err(MatrixError::Twice(entrant.label.clone()));
    }
    named_once("--protocols", arguments.protocols.iter().map(|protocol| protocol.name()))?;
    named_once("--traffic", arguments.traffic.iter().map(String::as_str))?;
    let latencies = latencies(&arguments.latency)?;
    let cells = arguments.protocols.iter().flat_map(|protocol| drivers.iter().map(move |it| (protocol, it)));
    let cells = cells.flat_map(|cell| latencies.iter().map(move |latency| (cell, latency)));
    let cells = cells.flat_map(|cell| arguments.traffic.iter().map(move |traffic| (cell, traffic)));
    type Cell<'c> = (((&'c ProtocolName, &'c Entrant), &'c (String, Option<LatencyChoice>)), &'c String);
    let request = |(((protocol, entrant), (suffix, latency)), traffic): Cell<'_>| {
        let label = entrant.label.clone();
        let run = RunArgs {
            paths: arguments.paths.clone(),
            scenarios: arguments.scenarios.clone(),
            protocol: *protocol,
            set: arguments.set.clone(),
            out: Some(arguments.out.join(format!("{label}-{}{suffix}{}", protocol.name(), behind(traffic)))),
            traffic: traffic.clone(),
            latency: latency.clone(),
            shard: arguments.shard,
            retry: arguments.retry.clone(),
            record: arguments.record,
            parallel: arguments.parallel,
            in_process: arguments.in_process && entrant.planner_command.is_none(),
            pin: arguments.pin,
            deadline: arguments.deadline,
            ..RunArgs::of(entrant)
        };
        Request::resolve(run, cores).map_err(|source| MatrixError::Request { label, source })
    };
    cells.map(request).collect()
}

/// That no two runs would be the same.
fn named_once<'n>(option: &'static str, mut names: impl Iterator<Item = &'n str>) -> Result<(), MatrixError> {
    let mut known = BTreeSet::new();
    match names.find(|name| !known.insert(*name)) {
        Some(name) => Err(MatrixError::Repeated { option, name: name.to_owned() }),
        None => Ok(()),
    }
}

/// What the folder of a run under this traffic ends in.
fn behind(traffic: &str) -> String {
    if traffic == cli::NO_TRAFFIC { String::new() } else { format!("-{traffic}") }
}

/// The latencies, each with what the folders of its runs end in; that none is asked for is one.
fn latencies(asked: &[LatencyChoice]) -> Result<Vec<(String, Option<LatencyChoice>)>, MatrixError> {
    let suffix = |choice: &LatencyChoice| match choice {
        LatencyChoice::Latency(latency) if latency.is_none() => String::new(),
        LatencyChoice::Latency(latency) => format!("-{}", latency.to_string().replace([':', '='], "-")),
        LatencyChoice::Trace(path) => format!("-trace-{}", path.file_stem().unwrap_or_default().to_string_lossy()),
    };
    if asked.is_empty() {
        return Ok(vec![(String::new(), None)]);
    }
    let mut suffixes = BTreeSet::new();
    let latency = |choice: &LatencyChoice| {
        let suffix = suffix(choice);
        if suffixes.insert(suffix.clone()) {
            Ok((suffix, Some(choice.clone())))
        } else {
            Err(MatrixError::SameLatency(suffix.trim_start_matches('-').to_owned()))
        }
    };
    asked.iter().map(latency).collect()
}

/// Drives them all, or what is left of them, in their order.
///
/// # Errors
/// [`RunError`] of the first that is not complete; what is done is kept.
pub fn drive(
    requests: &[Request],
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> Result<Vec<Done>, RunError> {
    let Some(first) = requests.first() else { return Ok(Vec::new()) };
    let scenes = SceneSet::open(&first.machine.scenarios)?.entries().len();
    console.begin("episodes", scenes * requests.len(), 0);
    let driven = requests.iter().map(|request| {
        let (driver, protocol) = (&request.settings.driver, request.settings.protocol.name());
        let latency = request.settings.latency.as_ref().map_or_else(String::new, |latency| format!(", {latency}"));
        let traffic =
            request.settings.traffic.as_ref().map_or_else(String::new, |traffic| format!(", traffic {traffic}"));
        let shared = console.shared(format!("{driver}, {protocol}{latency}{traffic}"));
        run::run(request, clock, &shared, interrupts)
    });
    let driven = driven.collect();
    console.end();
    driven
}
