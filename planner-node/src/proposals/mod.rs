//! The planner `proposals`: many ways to drive on along the route are driven in a small simulation among the predicted futures, judged by the sim's
//! own judges, and the best one is taken; the best few may be refined by Gauss-Newton.
//!
//! ```text
//! observation ─▶ Company (who is where, when, in each future)
//!            └─▶ policies ─▶ Rollout ─▶ Court: Verdict ─▶ the best few ─▶ refined ─▶ Court ─▶ the best
//! ```
//!
//! | file | what |
//! | --- | --- |
//! | `policy.rs` | the ways of driving |
//! | `company.rs` | who else is on the road, and where each is expected |
//! | `rollout.rs` | a proposal driven by the vehicle that the sim drives |
//! | `trial.rs` | what it is worth |
//! | `ride.rs` | what is felt in the car |
//! | `refine.rs` | a proposal improved by Gauss-Newton, over a tree of the futures |
//!
//! The idea of scoring proposals of IDM in a simulation is that of PDM-Closed (Dauner et al., "Parting with Misconceptions about Learning-based
//! Vehicle Motion Planning", CoRL 2023).

pub(crate) mod company;
mod policy;
mod refine;
mod ride;
mod rollout;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;
pub(crate) mod trial;

use episode::judges::lanes::{Against, Lanes};
use episode::judges::level::Level;
use episode::judges::road::RoadEdges;
use episode::metrics::comfort::Ride;
use wire::node::{History, Planner, PlannerFactory, StepInput};
use world::observation::{Briefing, Observation};
use world::plan::{Control, Diagnostics, PLAN_STEPS, Plan, PlanState, UncheckedPlan};

use company::{Company, FUTURES, likeliest};
use policy::{FALLBACK, POLICIES, SECOND_THOUGHTS};
use refine::Refinery;
use rollout::{Road, Rollout};
use trial::{Court, Filters, PAST, REACTION, Verdict, most_progress};

use crate::idm::{Corridor, DesiredSpeed, Obstacle, What, in_the_way};

/// How several futures are planned for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Contingency {
    /// The likeliest future alone
    Off,
    /// One plan that is good in all of them, by their probabilities
    Expected,
    /// One first second for all, then what is best in each
    #[default]
    Branches,
}

/// Proposals that are refined unless told otherwise.
const REFINED: u8 = 2;

/// What can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Args)]
#[group(id = "proposals")]
#[command(next_help_heading = "Options of proposals")]
pub struct Options {
    /// How several futures are planned for
    #[arg(long, value_enum, default_value_t)]
    pub contingency: Contingency,
    /// How many of the best proposals are refined by Gauss-Newton
    #[arg(long, value_name = "COUNT", default_value_t = REFINED, value_parser = clap::value_parser!(u8).range(0..=8))]
    pub refine: u8,
}

impl Options {
    /// How many proposals may be refined.
    pub const REFINE: std::ops::RangeInclusive<u8> = 0..=8;
}

impl Default for Options {
    fn default() -> Self {
        Self { contingency: Contingency::default(), refine: REFINED }
    }
}

/// The planner `proposals`.
pub struct Proposals(pub Options);

impl PlannerFactory for Proposals {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Drive::new(self.0, briefing)))
    }

    fn needs_prediction(&self) -> bool {
        true
    }
}

/// The steps that all branches share: one second.
const TRUNK: usize = gauss_newton::TRUNK;

/// A way to drive on, and what it is worth.
#[derive(Clone, Debug, Default)]
pub(crate) struct Candidate {
    pub name: &'static str,
    pub rollout: Rollout,
    pub verdict: Verdict,
    /// The same in each future where it has second thoughts after the first second; only where futures differ.
    pub after: Option<Verdict>,
    pub score: f64,
    /// Its place before the best came first.
    order: usize,
}

impl Candidate {
    /// What it is worth in a future where the best progress is `most` (m), and whether by being given up after the first second.
    pub fn worth(&self, future: usize, most: f64) -> (f64, bool) {
        let hoped = self.verdict.score(future, most);
        let after = self.after.map_or(f64::NEG_INFINITY, |after| after.score(future, most));
        (hoped.max(after), after > hoped)
    }
}

/// What proposals are called that are no policy's: the last plan, a refined one, and those of the predictor's futures.
const LAST: &str = "last";
const IMPROVED: &str = "refined";
const OF_FUTURES: [&str; FUTURES] = ["network 1", "network 2", "network 3"];

/// Whether a proposal is called so.
pub(crate) fn is_name(name: &str) -> bool {
    let others = [LAST, IMPROVED].into_iter().chain(OF_FUTURES);
    POLICIES.iter().map(|policy| policy.name).chain(others).any(|proposal| proposal == name)
}

/// The planner in one episode. Buffers are kept from step to step.
pub(crate) struct Drive {
    options: Options,
    corridor: Corridor,
    desired: DesiredSpeed,
    edges: RoadEdges,
    lanes: Lanes,
    against: Against,
    filters: Filters,
    company: Company,
    pub(crate) candidates: Vec<Candidate>,
    obstacles: Vec<Obstacle>,
    /// Stations of what stands for ever, and of red lights (m).
    stops: Vec<f64>,
    red: Vec<f64>,
    scratch: Rollout,
    last: Option<[Control; PLAN_STEPS]>,
    past: Vec<Ride>,
    /// The yaw rate (rad/s) before that.
    turning: f64,
    refinery: Refinery,
}

impl Drive {
    pub(crate) fn new(options: Options, briefing: &Briefing) -> Self {
        let line = &briefing.reference_line;
        let level = Level::of_line(line, OFF_ROUTE);
        // The last plan, and those of the futures.
        let most = POLICIES.len() + 1 + FUTURES + usize::from(options.refine);
        Self {
            options,
            corridor: Corridor::new(line),
            desired: DesiredSpeed::default(),
            edges: RoadEdges::of(&briefing.map, &level),
            lanes: Lanes::of(&briefing.map, &level),
            against: Against::default(),
            filters: Filters::default(),
            company: Company::default(),
            candidates: Vec::with_capacity(most),
            obstacles: Vec::new(),
            stops: Vec::new(),
            red: Vec::new(),
            scratch: Rollout::default(),
            last: None,
            past: Vec::with_capacity(PAST),
            turning: 0.0,
            refinery: Refinery::new(briefing),
        }
    }

    /// A planner that has seen `before`, the oldest first, and planned `last`.
    pub(crate) fn remembering(
        options: Options,
        briefing: &Briefing,
        before: &[Observation],
        last: Option<&Plan>,
    ) -> Self {
        let mut drive = Self::new(options, briefing);
        let history = History::new(briefing);
        for observation in before {
            drive.remember(&StepInput { briefing, observation, history: &history, prediction: None });
        }
        drive.last = last.and_then(Plan::controls).and_then(|controls| controls.try_into().ok());
        drive
    }

    /// The probability of each future that was looked at.
    pub(crate) fn probabilities(&self) -> &[f64] {
        self.company.probabilities()
    }

    /// The progress (m) that counts as all of it.
    pub(crate) fn most(&self) -> f64 {
        let verdicts = self.candidates.iter().map(|candidate| &candidate.verdict);
        most_progress(verdicts, self.probabilities().len())
    }

    /// All that was tried at this step, the best first.
    pub(crate) fn try_all(&mut self, step: &StepInput<'_>) -> Result<(), String> {
        let StepInput { briefing, observation, prediction, .. } = *step;
        let av = &observation.av;
        self.corridor
            .move_to(&observation.window)
            .ok_or("the window of the reference line has less than two samples")?;
        self.desired.fill(&self.corridor, &observation.window);
        let own = self.corridor.own(av.position());
        let place = self.corridor.project(av.position(), own);
        let futures = if self.options.contingency == Contingency::Off { 1 } else { FUTURES };
        self.company.fill(&self.corridor, own, observation, prediction, futures);
        self.remember(step);
        in_the_way(&self.corridor, place, observation, &mut self.obstacles);
        self.stops.clear();
        self.stops.extend(self.obstacles.iter().filter(|o| o.is_fixed()).map(|o| o.station));
        self.red.clear();
        self.red.extend(observation.window.red_stops.iter().map(|s| self.corridor.station(*s as usize)));
        let road = Road {
            corridor: &self.corridor,
            desired: &self.desired,
            company: &self.company,
            obstacles: &self.obstacles,
            stops: &self.stops,
            av,
            driven: observation.control,
            wheelbase: briefing.wheelbase,
            own,
        };
        let court = Court {
            company: &self.company,
            edges: &self.edges,
            lanes: &self.lanes,
            av,
            ground: self.corridor.height(own),
            wheelbase: briefing.wheelbase,
            red: &self.red,
            end: self.obstacles.iter().find(|o| o.what == What::LineEnd).map(|o| o.station),
            past: &self.past,
            begins: self.past.len() < PAST,
            turning: self.turning,
            filters: &self.filters,
        };
        let branches = self.options.contingency == Contingency::Branches && self.company.probabilities().len() > 1;
        let mut trial =
            Trial { road: &road, court: &court, scratch: &mut self.scratch, against: &mut self.against, branches };
        self.candidates.resize_with(POLICIES.len(), Candidate::default);
        for (candidate, policy) in self.candidates.iter_mut().zip(POLICIES) {
            candidate.name = policy.name;
            candidate.rollout.drive(&road, policy, 0);
            trial.judge(candidate);
        }
        let mut propose = |name, controls: &mut dyn Iterator<Item = Control>| {
            let mut candidate = Candidate { name, ..Candidate::default() };
            candidate.rollout.follow(&road, controls);
            trial.judge(&mut candidate);
            candidate
        };
        if let Some(last) = self.last {
            self.candidates.push(propose(LAST, &mut last[1..].iter().chain(last.last()).copied()));
        }
        let told = likeliest(prediction, futures).into_iter().flatten().filter(|future| !future.controls.is_empty());
        for (name, future) in OF_FUTURES.into_iter().zip(told) {
            self.candidates.push(propose(name, &mut future.controls.iter().copied()));
        }
        rank(&mut self.candidates, &self.company);
        let best = usize::from(self.options.refine).min(self.candidates.len());
        for index in 0..best {
            let from = &self.candidates[index].rollout;
            if let Some(mut controls) = self.refinery.refine(step, &road, from, branches) {
                self.candidates.push(propose(IMPROVED, &mut controls));
            }
        }
        if best > 0 {
            rank(&mut self.candidates, &self.company);
        }
        Ok(())
    }

    /// Notes what was driven last.
    fn remember(&mut self, step: &StepInput<'_>) {
        let StepInput { briefing, observation, .. } = *step;
        let Control { acceleration, steering } = observation.control;
        let yaw_rate = observation.av.speed() * libm::tan(steering) / briefing.wheelbase;
        if observation.step == 0 {
            // The wheels stand as in the log; nothing was driven yet.
            self.turning = yaw_rate;
            return;
        }
        if self.past.len() == PAST {
            self.turning = self.past.remove(0).yaw_rate;
        }
        self.past.push(Ride { acceleration, yaw_rate, ..Ride::default() });
    }
}

/// How far from the line the road's edges are of interest (m): farther is off the route.
const OFF_ROUTE: f64 = 5.0;

/// Judges candidates, one after the other.
struct Trial<'a> {
    road: &'a Road<'a>,
    court: &'a Court<'a>,
    scratch: &'a mut Rollout,
    against: &'a mut Against,
    branches: bool,
}

impl Trial<'_> {
    fn judge(&mut self, candidate: &mut Candidate) {
        candidate.verdict = self.court.judge(&candidate.rollout, self.against);
        self.scratch.clone_from(&candidate.rollout);
        self.scratch.drive(self.road, &FALLBACK, REACTION);
        (candidate.verdict.tight, candidate.verdict.unsaved) = self.court.brakes_late(self.scratch);
        candidate.after = self.branches.then(|| {
            self.scratch.clone_from(&candidate.rollout);
            self.scratch.drive(self.road, &SECOND_THOUGHTS, TRUNK);
            let Verdict { tight, unsaved, .. } = candidate.verdict;
            Verdict { tight, unsaved, ..self.court.judge(self.scratch, self.against) }
        });
    }
}

/// Scores them, and puts the best first; of equals the first stays first.
fn rank(candidates: &mut [Candidate], company: &Company) {
    let probabilities = company.probabilities();
    let most = most_progress(candidates.iter().map(|candidate| &candidate.verdict), probabilities.len());
    for (order, candidate) in candidates.iter_mut().enumerate() {
        candidate.order = order;
        let in_future = |(future, probability): (usize, &f64)| probability * candidate.worth(future, most).0;
        candidate.score = probabilities.iter().enumerate().map(in_future).sum();
    }
    candidates.sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.order.cmp(&b.order)));
}

impl Planner for Drive {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        self.try_all(step)?;
        let best = &self.candidates[0];
        self.last = Some(best.rollout.controls);
        let state = |s: &world::vehicle::VehicleState| PlanState { x: s.x, y: s.y, heading: s.heading, speed: s.speed };
        Ok(UncheckedPlan {
            step: step.observation.step,
            states: best.rollout.states[1..].iter().map(state).collect(),
            controls: best.rollout.controls.to_vec(),
            diagnostics: Diagnostics {
                objective: vec![("score".to_owned(), best.score)],
                iterations: u32::try_from(self.candidates.len()).unwrap_or(u32::MAX),
                status: best.name.to_owned(),
            },
        })
    }
}
