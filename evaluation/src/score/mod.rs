//! Every score from one drive: by our own rules and by other tools', from a run's `steps.parquet` and its scenes, without driving again.
//!
//! ```text
//! drives::Run ─▶ a drive beside its scene ─▶ a score's figures ─▶ Scored ─▶ table, CSV, JSON, Parquet
//! results.parquet ─ where the run was judged so already ──────────┘
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | here | a run scored, on all cores, in the order of its scenes |
//! | `strict`, `paper`, `nuplan` | our protocols and nuPlan's score: from `results.parquet`, or judged again by [`episode`] |
//! | `navsim`, `waymax`, `alpasim` | other tools' scores, by their code |
//! | `figure` | what a score tells, by name |
//! | `drive`, `ground`, `edges`, `convex` | what they read: the drive, the map around its route, road edges, boxes with round corners |
//! | `table`, `rows` | how it is printed and written |
//!
//! `docs/scores/README.md` says which to use when; each score has a page there.

mod again;
mod alpasim;
pub(crate) mod convex;
mod drive;
mod edges;
pub mod figure;
mod ground;
mod navsim;
mod nuplan;
mod paper;
mod rows;
mod strict;
mod table;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;
mod waymax;

use std::collections::BTreeMap;

use clap::ValueEnum;
use episode::protocol::Protocol;
use results::parquet::ParquetError;
use results::summary::Summary;
use thiserror::Error;

use self::drive::Drive;
use self::figure::{Figure, OfRun};
use crate::drives::{Driven, DrivesError, Run};

pub use rows::{write, write_steps};
pub use table::{Format, render};

/// A way to score a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Score {
    /// Our rules: oriented boxes, every agent, whose fault it was
    Strict,
    /// The authors' metrics of the DIPP paper
    Paper,
    /// nuPlan's closed-loop score and its eight terms
    Nuplan,
    /// NAVSIM's PDMS and EPDMS, progress by the human's
    Navsim,
    /// Waymax's metrics
    Waymax,
    /// AlpaSim's rollout score and its parts
    Alpasim,
}

impl Score {
    /// All of them, in the order of tables.
    pub const ALL: [Self; 6] = [Self::Strict, Self::Paper, Self::Nuplan, Self::Navsim, Self::Waymax, Self::Alpasim];

    /// As it is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Paper => "paper",
            Self::Nuplan => "nuplan",
            Self::Navsim => "navsim",
            Self::Waymax => "waymax",
            Self::Alpasim => "alpasim",
        }
    }

    /// Its figures, in the order of files.
    #[must_use]
    pub fn figures(self) -> Vec<Figure> {
        match self {
            Self::Strict => strict::figures(),
            Self::Paper => paper::figures(),
            Self::Nuplan => nuplan::figures(),
            Self::Navsim => navsim::figures(),
            Self::Waymax => waymax::figures(),
            Self::Alpasim => alpasim::figures(),
        }
    }
}

/// A run that cannot be scored.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ScoreError {
    #[error(transparent)]
    Drives(#[from] DrivesError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
}

/// What a score says of a drive.
#[derive(Clone, Debug, Default, PartialEq)]
struct Judged {
    /// In the order of its figures.
    values: Vec<Option<f64>>,
    /// Why it says nothing, or not all.
    reason: Option<String>,
}

impl Judged {
    /// Nothing, of so many figures.
    fn none(figures: usize, reason: String) -> Self {
        Self { values: vec![None; figures], reason: Some(reason) }
    }
}

/// A run scored.
#[derive(Clone, Debug)]
pub struct Scored {
    /// The run.
    pub run: Summary,
    /// The scores, in the order in which they were asked for.
    pub groups: Vec<Group>,
    /// A row an episode, in the order of the run's scenes.
    pub episodes: Vec<Episode>,
}

/// A score's part of a row.
#[derive(Clone, Debug)]
pub struct Group {
    /// Which.
    pub score: Score,
    /// Its figures.
    pub figures: Vec<Figure>,
    /// Where its values begin in a row.
    first: usize,
}

/// An episode scored.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// The scene.
    pub scene: String,
    /// The figures of all scores, one after the other.
    pub values: Vec<Option<f64>>,
    /// Which scores say nothing, or not all, and why.
    pub reasons: Vec<(Score, String)>,
    /// Waymax's figures of each step, where they are asked for.
    steps: waymax::Steps,
    /// Log index at which it starts.
    start: u32,
}

impl Scored {
    /// A figure of the run, and of how many episodes it is made; `figure` is its place in the group.
    #[must_use]
    pub fn of_run(&self, group: &Group, figure: usize) -> Option<(f64, usize)> {
        let column = |name: &str| group.figures.iter().position(|figure| figure.name == name);
        let value = |episode: &Episode, figure: usize| episode.values[group.first + figure];
        match group.figures[figure].of_run {
            OfRun::Mean => {
                let values = self.episodes.iter().filter_map(|episode| value(episode, figure));
                let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value));
                (count > 0).then(|| (sum / count as f64, count))
            }
            OfRun::KilometresPer { distance, incidents } => {
                let (distance, incidents) = (column(distance)?, column(incidents)?);
                let both = |episode: &Episode| Some((value(episode, distance)?, value(episode, incidents)?));
                let add = |(count, way, hits): (usize, f64, f64), (more, hit)| (count + 1, way + more, hits + hit);
                let (count, way, hits) = self.episodes.iter().filter_map(both).fold((0, 0.0, 0.0), add);
                (hits > 0.0).then(|| (way / hits / 1000.0, count))
            }
        }
    }

    /// Of how many episodes a score says anything.
    #[must_use]
    pub fn judged(&self, group: &Group) -> usize {
        let values = |episode: &Episode| group.values(episode).iter().any(Option::is_some);
        self.episodes.iter().filter(|episode| values(episode)).count()
    }
}

impl Group {
    fn values<'e>(&self, episode: &'e Episode) -> &'e [Option<f64>] {
        &episode.values[self.first..self.first + self.figures.len()]
    }
}

/// Whether the results of a run under `protocol` hold all that these scores tell: then its scenes are not needed.
#[must_use]
pub fn need_no_scenes(protocol: &Protocol, scores: &[Score]) -> bool {
    scores.iter().all(|score| is_told(protocol, *score))
}

fn is_told(protocol: &Protocol, score: Score) -> bool {
    match score {
        Score::Strict => strict::is_as_driven(protocol),
        Score::Paper => paper::is_as_driven(protocol),
        Score::Nuplan => nuplan::is_as_driven(protocol),
        Score::Navsim | Score::Waymax | Score::Alpasim => false,
    }
}

/// Scores a run: each of its drives by each of `scores`; Waymax's figures step by step too, if they are asked for.
///
/// # Errors
/// [`ScoreError`].
pub fn score(run: &Run, scores: &[Score], with_steps: bool) -> Result<Scored, ScoreError> {
    let mut groups: Vec<Group> = Vec::new();
    for &score in scores {
        let first = groups.last().map_or(0, |group| group.first + group.figures.len());
        groups.push(Group { score, figures: score.figures(), first });
    }
    let told = Told::of(run)?;
    let episodes = if need_no_scenes(&run.file.settings.protocol, scores) {
        (0..told.scenes.len()).map(|index| told.episode(index, scores, None, with_steps)).collect()
    } else {
        run.each(&Drive::COLUMNS, |index, driven| told.episode(index, scores, driven, with_steps))?
    };
    Ok(Scored { run: run.summary.clone(), groups, episodes })
}

/// What `results.parquet` tells of a run.
struct Told<'r> {
    run: &'r Run,
    scenes: Vec<String>,
    numbers: BTreeMap<String, Vec<Option<f64>>>,
    starts: Vec<u32>,
    unjudged: Vec<String>,
    /// Why an episode has no result; empty where it has.
    failures: Vec<String>,
}

impl<'r> Told<'r> {
    fn of(run: &'r Run) -> Result<Self, ParquetError> {
        let table = &run.results;
        let (failed, details) = (table.flags("failed")?, table.text("end_detail")?);
        let reasons = table.text("end_reason")?;
        let failure = |row: usize| match (failed[row], details[row].is_empty()) {
            (false, _) => String::new(),
            (true, true) => reasons[row].clone(),
            (true, false) => format!("{}: {}", reasons[row], details[row]),
        };
        Ok(Self {
            run,
            scenes: table.text("scene")?,
            numbers: table.numbers()?,
            starts: table.counts("start_log_index")?,
            unjudged: table.text("unjudged")?,
            failures: (0..failed.len()).map(failure).collect(),
        })
    }

    /// Whether it has all that a score tells.
    fn has(&self, score: Score) -> bool {
        is_told(&self.run.file.settings.protocol, score)
    }

    fn episode(&self, index: usize, scores: &[Score], driven: Option<&Driven>, with_steps: bool) -> Episode {
        let mut episode = Episode {
            scene: self.scenes[index].clone(),
            values: Vec::new(),
            reasons: Vec::new(),
            steps: Vec::new(),
            start: self.starts[index],
        };
        let failure = &self.failures[index];
        let drive = driven.map(|driven| Drive::of(driven, &self.run.file.settings.protocol, &self.unjudged[index]));
        let mut again = again::Again::default();
        for &score in scores {
            let judged = match &drive {
                _ if !failure.is_empty() => Judged::none(score.figures().len(), failure.clone()),
                _ if self.has(score) => self.results(index, score),
                Some(Ok(drive)) => judge(score, drive, &mut again, with_steps.then_some(&mut episode.steps)),
                Some(Err(reason)) => Judged::none(score.figures().len(), reason.clone()),
                None => Judged::none(score.figures().len(), "nothing was driven".to_owned()),
            };
            episode.values.extend(judged.values);
            episode.reasons.extend(judged.reason.map(|reason| (score, reason)));
        }
        episode
    }

    fn results(&self, index: usize, score: Score) -> Judged {
        let names: Vec<&str> = match score {
            Score::Strict => strict::metrics().collect(),
            Score::Paper => paper::metrics().collect(),
            _ => nuplan::metrics().collect(),
        };
        let value = |name: &str| self.numbers.get(name).and_then(|values| values[index]);
        Judged { values: names.into_iter().map(value).collect(), reason: None }
    }
}

fn judge(score: Score, drive: &Drive<'_>, again: &mut again::Again, steps: Option<&mut waymax::Steps>) -> Judged {
    match score {
        Score::Strict => again.strict(drive),
        Score::Paper => again::paper(drive),
        Score::Nuplan => again.nuplan(drive),
        Score::Navsim => navsim::judge(drive),
        Score::Waymax => {
            let (judged, each) = waymax::judge(drive);
            if let Some(steps) = steps {
                *steps = each;
            }
            judged
        }
        Score::Alpasim => alpasim::judge(drive),
    }
}
