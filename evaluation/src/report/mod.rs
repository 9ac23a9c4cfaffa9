//! Runs as one page to send to somebody: a file that needs no other, and no network.
//!
//! ```text
//! RUN... ─▶ Source ─ figures, faults, scenes worst first ─▶ overview, versus, plots, episodes ──┐
//!              └─ the worst drives ─ Footage ─▶ Reel ─────────────────────────────────────────┴─▶ page (HTML)
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | what is asked for, and what is read |
//! | `overview` | who drove what, by which rules, and how it came out |
//! | `versus` | A against B |
//! | `plots` | distributions |
//! | `episodes` | the table of all drives |
//! | `reel`, `packed`, `thinned` | drives as the player plays them |
//! | `stage` | the player's controls |
//! | `page` | all of it in one file |
//!
//! Every figure is one of [`crate::table`], [`crate::scenes`] and [`crate::compare`]; nothing is defined here.

mod episodes;
mod overview;
mod packed;
mod page;
mod plots;
mod reel;
mod stage;
mod thinned;
mod versus;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use results::folder::read_run_file;
use results::parquet::ParquetError;
use results::settings::RunFile;
use results::summary::{Summary, SummaryError};
use thiserror::Error;
use world::plan::PlanState;

use crate::compare::run::Run as Judged;
use crate::compare::{CompareError, Comparison};
use crate::drives::{self, DrivesError};
use crate::footage::{self, Footage};
use crate::scenes::{Row, Scenes};
use crate::table::label;
use reel::{Beside, Reel};

pub use plots::PlotError;
pub use reel::MOST_BYTES;

/// What a report is of.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Folders of finished runs; of two, the first is A, the baseline.
    pub runs: Vec<PathBuf>,
    /// Where their scenes are, if not where the runs had them from.
    pub scenarios: Vec<String>,
    /// So many of the failed drives have a player, the worst first.
    pub players: usize,
    /// These have one beside, of every run that drove them.
    pub episodes: Vec<String>,
    /// What draws the resamples of A against B.
    pub seed: u64,
}

/// A page.
#[derive(Clone, Debug)]
pub struct Report {
    /// The file.
    pub html: String,
    /// How many drives it plays.
    pub players: usize,
    /// What whoever asked should know.
    pub notes: Vec<String>,
}

/// Runs of which there is no report.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ReportError {
    #[error(transparent)]
    Summary(#[from] SummaryError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error(transparent)]
    Compare(#[from] CompareError),
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error("no run has an episode {0}\nhint: `sim table --scenes RUN` lists them")]
    NoEpisode(String),
    #[error("the table of scenes cannot be written: {0}")]
    Json(#[from] serde_json::Error),
}

/// A run, read.
struct Source {
    /// What it is called beside the others.
    label: String,
    summary: Summary,
    file: RunFile,
    judged: Judged,
    scenes: Scenes,
}

/// A drive of a run, in the order of trouble.
#[derive(Clone, Copy)]
struct Episode<'a> {
    /// Number of its run.
    run: usize,
    row: &'a Row,
    judged: &'a crate::compare::run::Episode,
}

/// A drive that the page plays.
struct Played {
    run: usize,
    scene: String,
    end: String,
    reel: Reel,
}

/// The page of these runs.
///
/// # Errors
/// [`ReportError`]: a run that is not finished or was changed, an episode that nobody drove.
pub fn report(request: &Request) -> Result<Report, ReportError> {
    let sources = read(&request.runs)?;
    let episodes = by_trouble(&sources);
    if let Some(nobody) = request.episodes.iter().find(|id| !episodes.iter().any(|one| one.row.scene == **id)) {
        return Err(ReportError::NoEpisode(nobody.clone()));
    }
    let comparison = match &sources[..] {
        [a, b] => Some(compared(a, b, request.seed)?),
        _ => None,
    };
    let mut notes = Vec::new();
    let played = played(request, &sources, &episodes, &mut notes);
    let html = page::page(&sources, &episodes, comparison.as_ref(), &played, request.players, &notes)?;
    Ok(Report { html, players: played.len(), notes })
}

fn read(runs: &[PathBuf]) -> Result<Vec<Source>, ReportError> {
    let mut sources = Vec::with_capacity(runs.len());
    for folder in runs {
        let summary = Summary::read(folder)?;
        let file = read_run_file(folder).map_err(SummaryError::from)?;
        let file = file.ok_or_else(|| SummaryError::NoRun(folder.clone()))?;
        let (judged, scenes) = (Judged::read(folder)?, Scenes::read(folder, None)?);
        sources.push(Source { label: String::new(), summary, file, judged, scenes });
    }
    let labels: Vec<String> = {
        let summaries: Vec<&Summary> = sources.iter().map(|source| &source.summary).collect();
        summaries.iter().map(|summary| label(summary, &summaries)).collect()
    };
    let labels = distinct(labels);
    for (source, label) in sources.iter_mut().zip(labels) {
        source.label = label;
    }
    Ok(sources)
}

/// Namesakes get a number.
fn distinct(labels: Vec<String>) -> Vec<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let told = labels.iter().map(|label| {
        let times = seen.entry(label.clone()).or_default();
        *times += 1;
        if *times == 1 { label.clone() } else { format!("{label} ({times})") }
    });
    told.collect()
}

/// All drives of all runs, the worst first; those alike in the runs' order.
fn by_trouble(sources: &[Source]) -> Vec<Episode<'_>> {
    let mut episodes = Vec::new();
    for (run, source) in sources.iter().enumerate() {
        let judged: BTreeMap<&str, _> = source.judged.episodes.iter().map(|one| (one.scene.as_str(), one)).collect();
        let rows = source.scenes.rows().iter();
        episodes.extend(rows.filter_map(|row| Some(Episode { run, row, judged: *judged.get(row.scene.as_str())? })));
    }
    episodes.sort_by(|a, b| a.row.compare(b.row));
    episodes
}

/// A against B, or why they cannot be compared; damaged files are an error still.
fn compared(a: &Source, b: &Source, seed: u64) -> Result<Result<Comparison, String>, ReportError> {
    let made = Comparison::of(&a.judged, &b.judged, seed).and_then(|mut comparison| {
        comparison.look_into_flips(&a.judged.folder, &b.judged.folder)?;
        Ok(comparison)
    });
    match made {
        Ok(comparison) => Ok(Ok(comparison)),
        Err(error @ (CompareError::Run(_) | CompareError::Parquet(_))) => Err(error.into()),
        Err(error) => Ok(Err(error.to_string())),
    }
}

/// The drives that are asked for, packed. Where scenes are not to be found there is a note instead.
fn played(request: &Request, sources: &[Source], episodes: &[Episode<'_>], notes: &mut Vec<String>) -> Vec<Played> {
    let mut worst = request.players;
    let mut chosen: Vec<&Episode<'_>> = Vec::new();
    for episode in episodes {
        let is_worst = !episode.judged.faults.is_empty() && worst > 0;
        worst -= usize::from(is_worst);
        if is_worst || request.episodes.contains(&episode.row.scene) {
            chosen.push(episode);
        }
    }
    let mut reels: BTreeMap<(usize, &str), Option<Reel>> = BTreeMap::new();
    let opened: Vec<Option<drives::Run>> = sources
        .iter()
        .enumerate()
        .map(|(run, source)| {
            // Of two runs each is shown beside the other.
            let is_wanted = chosen.iter().any(|one| one.run == run || sources.len() == 2);
            let opened = is_wanted.then(|| drives::Run::open(&source.summary.folder, &request.scenarios))?;
            opened.map_err(|error| notes.push(format!("{} has no player: {error}", source.label))).ok()
        })
        .collect();
    let ways = if sources.len() == 2 { other_ways(&opened, &chosen) } else { BTreeMap::new() };
    for (run, opened) in opened.iter().enumerate() {
        let Some(opened) = opened else { continue };
        match developed(opened, run, &scenes_of(&chosen, |one| one == run), &ways) {
            Ok(developed) => reels.extend(developed.into_iter().map(|(scene, reel)| ((run, scene), reel))),
            Err(error) => notes.push(format!("{} has no player: {error}", sources[run].label)),
        }
    }
    let mut played = Vec::new();
    for one in chosen {
        let scene = one.row.scene.as_str();
        match reels.remove(&(one.run, scene)) {
            Some(Some(reel)) => {
                let end = if one.judged.detail.is_empty() { &one.judged.end } else { &one.judged.detail };
                played.push(Played { run: one.run, scene: scene.to_owned(), end: end.clone(), reel });
            }
            Some(None) => notes.push(format!("{scene} of {} is too large for a player", sources[one.run].label)),
            None => {}
        }
    }
    played
}

/// Where each run's AV went in a scene: to be shown beside the other run's.
type Ways<'a> = BTreeMap<(usize, &'a str), Vec<PlanState>>;

fn other_ways<'a>(opened: &[Option<drives::Run>], chosen: &[&Episode<'a>]) -> Ways<'a> {
    let mut ways = BTreeMap::new();
    for (run, opened) in opened.iter().enumerate() {
        let Some(opened) = opened else { continue };
        // Those that the other run shows. What cannot be read is not shown beside, and told of where it is shown itself.
        let scenes = scenes_of(chosen, |one| one != run);
        let places = places(opened, &scenes);
        let read =
            opened.picked(&[], &places.keys().copied().collect(), |driven| (driven.index, driven.states.clone()));
        for (index, states) in read.unwrap_or_default() {
            if let Some(scene) = places.get(&index) {
                ways.insert((run, *scene), states);
            }
        }
    }
    ways
}

/// The scenes of the chosen drives of some runs.
fn scenes_of<'a>(chosen: &[&Episode<'a>], is_of: impl Fn(usize) -> bool) -> BTreeSet<&'a str> {
    chosen.iter().filter(|one| is_of(one.run)).map(|one| one.row.scene.as_str()).collect()
}

/// Where scenes are in a run.
fn places<'a>(opened: &drives::Run, scenes: &BTreeSet<&'a str>) -> BTreeMap<usize, &'a str> {
    let all = opened.file.scenes.iter().enumerate();
    all.filter_map(|(place, line)| Some((place, *scenes.get(line.id.as_str())?))).collect()
}

/// The drives of a run through these scenes.
fn developed<'a>(
    opened: &drives::Run,
    run: usize,
    scenes: &BTreeSet<&'a str>,
    ways: &Ways<'_>,
) -> Result<Vec<(&'a str, Option<Reel>)>, DrivesError> {
    let places = places(opened, scenes);
    let packed = opened.picked(&footage::COLUMNS, &places.keys().copied().collect(), |driven| {
        let (other, label) = if run == 0 { (1, "B") } else { (0, "A") };
        let scene = places.get(&driven.index).copied().unwrap_or_default();
        let beside = ways.get(&(other, scene)).map(|states| Beside { label, states });
        Footage::of(opened, driven).map(|footage| (scene, Reel::of(&footage, beside.as_ref())))
    })?;
    packed.into_iter().map(|one| Ok(one?)).collect()
}
