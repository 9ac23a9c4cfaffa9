//! Which proposals were tried, what each was worth, and what is against those that lost.
//!
//! The step is planned again by the planner itself, with what it remembered: the steps before, and its last plan. From the same recording
//! comes the same plan, to the bit; where it does not, what is missing is told.

use std::array::from_fn;
use std::fmt;

use clap::ValueEnum;
use wire::node::{History, StepInput};
use world::plan::{Diagnostics, STEP_SECONDS};
use world::scene::TrackId;

use super::recording::BEFORE;
use super::{ExplainError, RecordedStep};
use crate::ProposalsOptions;
use crate::proposals::company::{FUTURES, LOOK_STEPS};
use crate::proposals::trial::{FARTHEST, Hit, Meeting, OFF_ROAD, ON_THE_LINE, Verdict};
use crate::proposals::{Candidate, Drive, is_name};

#[cfg(test)]
mod tests;

/// Scores that differ by less are the same.
const ROUNDING: f64 = 1e-9;

/// Progress that differs by less (m) is the same.
const FARTHER: f64 = 0.5;

/// What is to be said of a plan that was chosen among proposals.
#[derive(Clone, Debug)]
pub struct Trials {
    scene: String,
    protocol: String,
    step: u32,
    /// What the recording does not tell, and what became otherwise.
    notes: Vec<String>,
    /// All proposals, the best first.
    tried: Vec<Tried>,
    /// What becomes of the best one in each future; nothing where there is one future.
    futures: Vec<InFuture>,
    binding: Option<Binding>,
}

/// A proposal.
#[derive(Clone, Debug)]
struct Tried {
    name: &'static str,
    score: f64,
    /// Along the line (m).
    progress: f64,
    /// 1 within nuPlan's bounds, less beyond.
    comfort: f64,
    against: Vec<Objection>,
    /// The futures in which it is given up after the first second.
    given_up: Among,
}

/// Some of the futures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Among {
    chosen: [bool; FUTURES],
    /// How many there are.
    count: usize,
}

impl Among {
    /// None of so many.
    fn none(count: usize) -> Self {
        Self { chosen: [false; FUTURES], count }
    }

    fn is_empty(self) -> bool {
        !self.chosen.contains(&true)
    }
}

impl fmt::Display for Among {
    /// Which, where it is not all.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let chosen = || self.chosen.iter().enumerate().filter(|(_, chosen)| **chosen);
        let how_many = chosen().count();
        if how_many == self.count {
            return Ok(());
        }
        f.write_str(if how_many == 1 { " in future" } else { " in futures" })?;
        for (nth, (future, _)) in chosen().enumerate() {
            write!(f, "{} {}", if nth == 0 { "" } else { " and" }, future + 1)?;
        }
        Ok(())
    }
}

/// What the best proposal is worth in a future.
#[derive(Clone, Copy, Debug)]
struct InFuture {
    probability: f64,
    worth: f64,
    /// Whether by being given up after the first second.
    given_up: bool,
}

/// The best of the proposals that come farther than the one that was taken.
#[derive(Clone, Debug)]
struct Binding {
    name: &'static str,
    score: f64,
    /// How much farther it comes (m).
    farther: f64,
    /// What it loses most by, and its score without that.
    loss: Option<(Objection, f64)>,
}

/// What is against a proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Objection {
    /// A contact at fault.
    Contact(Encounter),
    /// A time to collision that is too short.
    Close(Encounter),
    OffRoad,
    OverTheEdge,
    Oncoming,
    OffRoute,
    Red,
    /// Whom it would hit, if those ahead braked at once.
    Unsaved(TrackId),
    /// To whom it would come too near then.
    Tight(TrackId),
    /// It ends so far beside the line (m).
    Aside(f64),
    /// What the ride is worth.
    Discomfort(f64),
}

/// Who is met.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Encounter {
    track: TrackId,
    /// When first (s).
    seconds: f64,
    /// In which futures.
    futures: Among,
}

/// Whether a plan is one that was chosen among proposals: it tells a score and nothing else, and is called as a proposal.
pub(super) fn is_chosen(diagnostics: &Diagnostics) -> bool {
    let [(name, _)] = &diagnostics.objective[..] else { return false };
    name == "score" && is_name(&diagnostics.status)
}

impl Trials {
    /// Tries all proposals of a step again.
    ///
    /// # Errors
    /// [`ExplainError`].
    pub fn of(step: u32, recorded: &RecordedStep) -> Result<Self, ExplainError> {
        let RecordedStep { briefing, observation, prediction, plan, before, last, planner } = recorded;
        // Before a fork another run's planner drove, whose options are not told; at its first step the last plan is that one's.
        let told = if planner.from.is_some_and(|from| step < from) { None } else { planner.proposals(step)? };
        let last = last.as_ref().filter(|_| planner.from != Some(step));
        let options = told.unwrap_or_default();
        let mut drive = Drive::remembering(options, briefing, before, last);
        let history = History::new(briefing);
        let input = StepInput { briefing, observation, history: &history, prediction: prediction.as_ref() };
        drive.try_all(&input).map_err(|what| ExplainError::Problem { step, what })?;
        let mut notes = missing(step, recorded, last.is_some(), told);
        notes.extend(otherwise(plan.diagnostics(), &drive.candidates, !notes.is_empty()));
        let (probabilities, most) = (drive.probabilities(), drive.most());
        let futures = match &drive.candidates[..] {
            [best, ..] if probabilities.len() > 1 => {
                let in_future = |(future, probability): (usize, &f64)| {
                    let (worth, given_up) = best.worth(future, most);
                    InFuture { probability: *probability, worth, given_up }
                };
                probabilities.iter().enumerate().map(in_future).collect()
            }
            _ => Vec::new(),
        };
        let tried = |candidate: &Candidate| Tried {
            name: candidate.name,
            score: candidate.score,
            progress: candidate.verdict.progress,
            comfort: candidate.verdict.comfort,
            against: against(&candidate.verdict, probabilities.len()),
            given_up: Among {
                chosen: from_fn(|future| future < probabilities.len() && candidate.worth(future, most).1),
                count: probabilities.len(),
            },
        };
        Ok(Self {
            scene: briefing.scene.to_string(),
            protocol: briefing.protocol.clone(),
            step,
            notes,
            tried: drive.candidates.iter().map(tried).collect(),
            futures,
            binding: binding(&drive.candidates, probabilities, most),
        })
    }

    /// The best proposal: its name and its score.
    #[must_use]
    pub fn best(&self) -> Option<(&str, f64)> {
        self.tried.first().map(|best| (best.name, best.score))
    }

    /// What the recording does not tell, and what became otherwise than recorded.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// What the recording does not tell of what the planner knew.
fn missing(step: u32, recorded: &RecordedStep, has_last: bool, told: Option<ProposalsOptions>) -> Vec<String> {
    let mut notes = Vec::new();
    let (seen, due) = (recorded.before.len(), step.min(BEFORE));
    if seen < due as usize {
        notes.push(format!(
            "of the {due} steps before it the recording tells {seen}: its comfort may be judged otherwise"
        ));
    }
    if step > 0 && !has_last {
        notes.push("its last plan is not recorded, and not among the proposals".to_owned());
    }
    if recorded.prediction.is_none() {
        notes.push("nobody predicted: everybody is expected to keep their velocity".to_owned());
    }
    if let Some(from) = recorded.planner.from.filter(|from| step < *from) {
        notes.push(format!(
            "up to step {from} another run's plans were driven: what was predicted for them is not recorded, nor their planner's options"
        ));
    } else if told.is_none() {
        let ProposalsOptions { contingency, refine } = ProposalsOptions::default();
        let name = contingency.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
        notes.push(format!(
            "its run does not tell the planner's options: --contingency {name} and --refine {refine} are taken"
        ));
    }
    notes
}

/// What became otherwise than recorded; `doubted` if it is said already why that may be.
fn otherwise(recorded: &Diagnostics, candidates: &[Candidate], doubted: bool) -> Vec<String> {
    let (Some(best), Some((_, score))) = (candidates.first(), recorded.objective.first()) else { return Vec::new() };
    let mut notes = Vec::new();
    let differs = best.name != recorded.status || (best.score - score).abs() > ROUNDING;
    if differs {
        notes.push(format!(
            "recorded is {} with a score of {score:.4}, not {} with {:.4}",
            recorded.status, best.name, best.score
        ));
    }
    if recorded.iterations as usize != candidates.len() {
        notes.push(format!("it chose among {} proposals, not {}", recorded.iterations, candidates.len()));
    }
    if differs && !doubted {
        notes.push("it may have been planned by another build, or with other options".to_owned());
    }
    notes
}

/// All that is against a proposal but its comfort, which has a column.
fn against(verdict: &Verdict, futures: usize) -> Vec<Objection> {
    let mut against = Vec::new();
    let meetings = &verdict.meetings[..futures];
    against.extend(encounters(meetings, |meeting| meeting.contact).into_iter().map(Objection::Contact));
    against.extend(encounters(meetings, |meeting| meeting.close).into_iter().map(Objection::Close));
    if verdict.drivable <= OFF_ROAD {
        against.push(Objection::OffRoad);
    } else if verdict.drivable < 1.0 {
        against.push(Objection::OverTheEdge);
    }
    if verdict.oncoming {
        against.push(Objection::Oncoming);
    }
    if verdict.farthest > FARTHEST {
        against.push(Objection::OffRoute);
    }
    if verdict.red {
        against.push(Objection::Red);
    }
    against.extend(verdict.unsaved.map(Objection::Unsaved).or(verdict.tight.map(Objection::Tight)));
    if verdict.beside > ON_THE_LINE {
        against.push(Objection::Aside(verdict.beside));
    }
    against
}

/// Who is met in these futures, each once.
fn encounters(meetings: &[Meeting], hit: impl Fn(&Meeting) -> Option<Hit>) -> Vec<Encounter> {
    let mut encounters: Vec<Encounter> = Vec::new();
    for (future, Hit { look, track, .. }) in meetings.iter().enumerate().filter_map(|(at, m)| Some((at, hit(m)?))) {
        let seconds = (look * LOOK_STEPS) as f64 * STEP_SECONDS;
        if let Some(known) = encounters.iter_mut().find(|known| known.track == track) {
            known.seconds = known.seconds.min(seconds);
            known.futures.chosen[future] = true;
        } else {
            let mut futures = Among::none(meetings.len());
            futures.chosen[future] = true;
            encounters.push(Encounter { track, seconds, futures });
        }
    }
    encounters
}

/// Who comes farther than the best, and what it loses most by.
fn binding(candidates: &[Candidate], probabilities: &[f64], most: f64) -> Option<Binding> {
    let (best, others) = candidates.split_first()?;
    let farther = |other: &Candidate| other.verdict.progress - best.verdict.progress;
    // They are in their order.
    let other = others.iter().find(|other| farther(other) > FARTHER)?;
    let score = |candidate: &Candidate| -> f64 {
        let in_future = |(future, probability): (usize, &f64)| probability * candidate.worth(future, most).0;
        probabilities.iter().enumerate().map(in_future).sum()
    };
    let mut objections = against(&other.verdict, probabilities.len());
    if other.verdict.comfort < 1.0 {
        objections.push(Objection::Discomfort(other.verdict.comfort));
    }
    let without = objections.into_iter().map(|objection| {
        let mut lifted = other.clone();
        objection.lift(&mut lifted.verdict);
        lifted.after.iter_mut().for_each(|after| objection.lift(after));
        (objection, score(&lifted))
    });
    let loss =
        without.filter(|(_, score)| *score > other.score + ROUNDING).reduce(|a, b| if b.1 > a.1 { b } else { a });
    Some(Binding { name: other.name, score: other.score, farther: farther(other), loss })
}

impl Objection {
    /// Takes it out of a verdict.
    fn lift(self, verdict: &mut Verdict) {
        match self {
            Self::Contact(Encounter { track, .. }) => {
                for meeting in &mut verdict.meetings {
                    meeting.contact = meeting.contact.filter(|hit| hit.track != track);
                }
            }
            Self::Close(Encounter { track, .. }) => {
                for meeting in &mut verdict.meetings {
                    meeting.close = meeting.close.filter(|hit| hit.track != track);
                }
            }
            Self::OffRoad | Self::OverTheEdge => verdict.drivable = 1.0,
            Self::Oncoming => verdict.oncoming = false,
            Self::Red => verdict.red = false,
            Self::OffRoute => verdict.farthest = 0.0,
            Self::Unsaved(_) | Self::Tight(_) => (verdict.unsaved, verdict.tight) = (None, None),
            Self::Aside(_) => (verdict.aside, verdict.beside) = (0.0, 0.0),
            Self::Discomfort(_) => verdict.comfort = 1.0,
        }
    }
}

impl fmt::Display for Objection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Contact(met) => {
                write!(f, "contact at fault with track {} at {:.1} s{}", met.track, met.seconds, met.futures)
            }
            Self::Close(met) => {
                write!(
                    f,
                    "time to collision with track {} too short from {:.1} s{}",
                    met.track, met.seconds, met.futures
                )
            }
            Self::OffRoad => f.write_str("off the road"),
            Self::OverTheEdge => f.write_str("over the road's edge"),
            Self::Oncoming => f.write_str("in the oncoming lane"),
            Self::Red => f.write_str("passes a red light, or the line's end"),
            Self::OffRoute => f.write_str("almost off the route"),
            Self::Unsaved(track) => write!(f, "would hit track {track} if those ahead braked at once"),
            Self::Tight(track) => write!(f, "too near to track {track} if those ahead braked at once"),
            Self::Aside(meters) => write!(f, "{meters:.1} m beside the line"),
            Self::Discomfort(comfort) => write!(f, "a comfort of {comfort:.3}"),
        }
    }
}

impl fmt::Display for Trials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, protocol, step, notes, tried, futures, binding } = self;
        let name = tried.first().map_or("", |best| best.name);
        writeln!(f, "scene {scene} under {protocol}, step {step}: {name}, the best of {} proposals", tried.len())?;
        for note in notes {
            writeln!(f, "{note}")?;
        }
        writeln!(f, "\nwhat was tried, judged over 4 s")?;
        writeln!(f, "{:<16} {:>8} {:>11} {:>8}  against it", "proposal", "score", "progress m", "comfort")?;
        for Tried { name, score, progress, comfort, against, given_up } in tried {
            let mut against: Vec<String> = against.iter().map(Objection::to_string).collect();
            if !given_up.is_empty() {
                against.push(format!("given up after 1 s{given_up}"));
            }
            let against = if against.is_empty() { "-".to_owned() } else { against.join("; ") };
            writeln!(f, "{name:<16} {score:>8.4} {progress:>11.2} {comfort:>8.3}  {against}")?;
        }
        if !futures.is_empty() {
            writeln!(f, "\nwhat {name} is worth in each future")?;
            writeln!(f, "{:<16} {:>11} {:>8}  how", "future", "probability", "worth")?;
            for (number, InFuture { probability, worth, given_up }) in (1..).zip(futures) {
                let how = if *given_up { "given up after 1 s" } else { "as it is" };
                writeln!(f, "{:<16} {probability:>11.3} {worth:>8.4}  {how}", i32::to_string(&number))?;
            }
        }
        writeln!(f, "\nwhat binds")?;
        match binding {
            None => writeln!(f, "no proposal comes farther"),
            Some(Binding { name: other, score, farther, loss }) => {
                writeln!(f, "{other} would come {farther:.1} m farther, with a score of {score:.4}")?;
                let best = tried.first().map_or(0.0, |best| best.score);
                match loss {
                    None => writeln!(f, "nothing is against it"),
                    Some((objection, without)) if *without > best => {
                        writeln!(f, "it loses by: {objection}; without that {without:.4}, more than {name}")
                    }
                    Some((objection, without)) => {
                        writeln!(
                            f,
                            "it loses most by: {objection}; without that {without:.4}, still not more than {name}"
                        )
                    }
                }
            }
        }
    }
}
