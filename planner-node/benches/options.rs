//! What each option of the planner is worth: what its plans cost, and what finding them takes, against the authors' search.
//!
//! `cargo bench -p planner-node --bench options` prints the table of `docs/planner.md`; it depends on no clock. Its problems are
//! the vectors in `../shared/dipp/planner-vectors` that have a solution, and every observation of the real scenes along the
//! logged drive: others by `ctrv`, start at zero, weights tuned by hand.
//!
//! | column | what |
//! | --- | --- |
//! | own | the objective that the setting minimizes, of its plan over that of the authors' plan; geometric mean |
//! | strict | the same by the objective of `strict` |
//! | worse | share of the problems in which the own one is higher than that of the authors' plan |
//! | iterations | mean; the authors' end after 50 |
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

#[allow(dead_code, reason = "tests use more of it")]
#[path = "../tests/log/mod.rs"]
mod log;

use gauss_newton::constants::HAND_TUNED;
use gauss_newton::{
    Controls, Costing, Evaluation, Layer, LayerSettings, LinearSolver, Problem, Safety, Settings, Solver,
};
use planner_node::{Rules, Situation, one_step_on, verify};
use scenarios::SceneSet;
use world::plan::{Control, STEP_SECONDS};
use world::vehicle::{BicycleModel, Limits};

use crate::log::{Foresight, Log, START, real_scenes};

struct Case {
    problem: Problem,
    initial: Controls,
    /// Whether it comes a step after the case before it.
    follows: bool,
}

/// The authors' cases.
fn authors_cases() -> Vec<Case> {
    let Some(folder) = vectors::shared("dipp/planner-vectors") else { return vec![] };
    let read = |path: &std::path::PathBuf| {
        let npz = vectors::Npz::read(path).unwrap();
        let problem = verify::problem(&npz).unwrap();
        Case { problem, initial: verify::controls(&npz, "controls0").unwrap(), follows: false }
    };
    let mut all: Vec<_> = vectors::npz_files(&folder).unwrap().iter().map(read).collect();
    all.retain(|case| {
        Layer::new(LayerSettings::paper(), LinearSolver::Sweep).forward(&case.problem, &case.initial).is_ok()
    });
    all
}

/// What the logged AV saw.
fn frames() -> Vec<Case> {
    let scenes = real_scenes();
    if scenes.is_empty() {
        return vec![];
    }
    let set = SceneSet::open(&scenes).unwrap();
    let mut all = Vec::new();
    for index in 0..set.entries().len() {
        let mut log = Log::new(set.load(index).unwrap().0, "strict");
        let mut follows = false;
        for step in 0..log.steps() {
            let (Some(av), Some(before)) = (log.av(START + step), log.av(START + step - 1)) else { continue };
            let observation = log.observe(step, av, driven(&before, &av));
            let prediction = log.predict(&observation, Foresight::Ctrv);
            let input = wire::node::StepInput {
                briefing: &log.briefing,
                observation: &observation,
                history: &log.history,
                prediction: Some(&prediction),
            };
            let mut situation = Situation::default();
            situation.fill(Rules::Strict, &input, &prediction).unwrap();
            let problem = situation.with_inputs(HAND_TUNED, Problem::new).unwrap();
            all.push(Case { problem, initial: Controls::ZERO, follows });
            follows = true;
        }
    }
    all
}

/// The control that leads from one logged state to the next.
fn driven(before: &world::scene::AgentState, now: &world::scene::AgentState) -> Control {
    let yaw_rate = world::geometry::angle_difference(before.heading, now.heading) / STEP_SECONDS;
    let steering = if now.speed() < 0.5 { 0.0 } else { libm::atan(world::vehicle::WHEELBASE * yaw_rate / now.speed()) };
    Control { acceleration: (now.speed() - before.speed()) / STEP_SECONDS, steering: steering.clamp(-0.5, 0.5) }
}

#[derive(Clone, Copy, PartialEq)]
struct Setting {
    settings: Settings,
    /// Whether the last plan is a second start.
    warm: bool,
}

impl Setting {
    /// The objective's part of the settings.
    fn costing(&mut self) -> &mut Costing {
        &mut self.settings.costing
    }
}

/// What each option switches.
type Switch = fn(&mut Setting, bool);

const OPTIONS: [(&str, Switch); 8] = [
    ("a line search from the best iterate", |s, on| s.settings.polish = if on { 50 } else { 0 }),
    ("the last plan as a second start", |s, on| s.warm = on),
    ("the vehicle that is driven", |s, on| {
        s.costing().model = if on { BicycleModel::default() } else { BicycleModel::authors_planner() };
    }),
    ("the first control from the present one", |s, on| s.costing().from_present = on),
    ("wheels that turn so fast and no faster", |s, on| {
        s.costing().steering_rate = if on { Limits::STRICT.steering_rate } else { f64::INFINITY };
    }),
    ("a lane with an edge", |s, on| {
        let edge = Settings::strict(BicycleModel::default()).costing.lane_edge;
        s.costing().lane_edge = if on { edge } else { f64::INFINITY };
    }),
    ("headings compared as angles", |s, on| s.costing().wrap_heading = on),
    ("everyone in the path", |s, on| s.costing().safety = if on { Safety::Everyone } else { Safety::Nearest }),
];

fn objective(problem: &Problem, costing: &Costing, controls: &Controls) -> f64 {
    let mut at = Evaluation::default();
    at.evaluate(problem, costing, controls);
    at.objective
}

/// A plan's controls and the iterations that it took.
fn plan(solver: &mut Solver, case: &Case, setting: &Setting, last: Option<&Controls>) -> (Controls, usize) {
    let first = solver.solve(&case.problem, &setting.settings, &case.initial).unwrap();
    let controls = solver.best().clone();
    let Some(last) = last.filter(|_| setting.warm && case.follows) else { return (controls, first.iterations) };
    let again = solver.solve(&case.problem, &setting.settings, &one_step_on(last)).unwrap();
    let better = if again.best_objective < first.best_objective { solver.best().clone() } else { controls };
    (better, first.iterations + again.iterations)
}

/// A row of the table over these cases.
fn row(cases: &[Case], authors: &[Controls], setting: &Setting, strict: &Costing) -> String {
    /// What is not worth an iteration is no difference: the tolerance at which a search stops.
    const NOTHING: f64 = 0.01;
    let mut solver = Solver::new(LinearSolver::Sweep);
    let (mut own, mut by_strict, mut worse, mut iterations) = (0.0, 0.0, 0, 0);
    let mut last = None;
    for (case, authors) in cases.iter().zip(authors) {
        let (controls, taken) = plan(&mut solver, case, setting, last.as_ref());
        let ratio = |costing: &Costing| {
            (objective(&case.problem, costing, &controls) + NOTHING)
                / (objective(&case.problem, costing, authors) + NOTHING)
        };
        let own_ratio = ratio(&setting.settings.costing);
        own += libm::log(own_ratio);
        by_strict += libm::log(ratio(strict));
        worse += usize::from(own_ratio > 1.0 + 1e-6);
        iterations += taken;
        last = Some(controls);
    }
    let count = cases.len() as f64;
    let (own, by_strict) = (libm::exp(own / count), libm::exp(by_strict / count));
    let worse = 100.0 * worse as f64 / count;
    format!("| {own:.3} | {by_strict:.3} | {worse:.0} % | {:.0} ", iterations as f64 / count)
}

fn main() {
    let authors = Setting { settings: Settings::paper_test(), warm: false };
    let strict = Setting { settings: Settings::strict(BicycleModel::default()), warm: true };
    let mut settings = vec![("the authors'".to_owned(), authors)];
    for (name, set) in OPTIONS {
        let mut setting = authors;
        set(&mut setting, true);
        settings.push((format!("... {name}"), setting));
    }
    settings.push(("strict".to_owned(), strict));
    for (name, set) in OPTIONS {
        let (mut without, mut with) = (strict, strict);
        set(&mut without, false);
        set(&mut with, true);
        // Strict has it, or not.
        let (word, setting) = if with == strict { ("without", without) } else { ("with", with) };
        settings.push((format!("... {word} {name}"), setting));
    }
    for (what, cases) in [("vectors", authors_cases()), ("frames", frames())] {
        if cases.is_empty() {
            continue;
        }
        let mut solver = Solver::new(LinearSolver::Sweep);
        let reference: Vec<_> = cases.iter().map(|case| plan(&mut solver, case, &authors, None).0).collect();
        println!(
            "\n{} {what}\n\n| search | own | strict | worse | iterations |\n| --- | --- | --- | --- | --- |",
            cases.len()
        );
        for (name, setting) in &settings {
            println!("| {name} {}|", row(&cases, &reference, setting, &strict.settings.costing));
        }
    }
}
