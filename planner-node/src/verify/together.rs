//! The authors' search of several cases as one batch.
//!
//! Each case takes the steps that it takes alone, but they stop together: when every case has converged, or when the *mean* of
//! their objectives is below the absolute tolerance. A case that has converged stays where it is while others go on, and a
//! matrix that cannot be factorized ends the search of all.

use gauss_newton::{Controls, Evaluation, LinearSolver, Problem, Settings, Solver};

use super::ending::Ending;

/// What the search of a case came to.
#[derive(Clone, Debug)]
pub(super) struct Searched {
    /// The initial controls and those after each iteration.
    pub iterates: Vec<Controls>,
    /// Their objectives.
    pub history: Vec<f64>,
    /// The iterate of the lowest objective.
    pub best: usize,
    /// The authors' words on its end.
    pub ending: Ending,
}

impl Searched {
    /// Controls and objective of the last iterate.
    fn last(&self) -> (&Controls, f64) {
        (&self.iterates[self.iterates.len() - 1], self.history[self.history.len() - 1])
    }
}

/// Searches all cases, each a problem and its initial controls, by the paper's settings.
pub(super) fn search(cases: &[(&Problem, &Controls)], settings: &Settings, linear: LinearSolver) -> Vec<Searched> {
    let mut solver = Solver::new(linear);
    let mut at = Evaluation::default();
    let mut objective = |problem: &Problem, controls: &Controls| {
        at.evaluate(problem, &settings.costing, controls);
        at.objective
    };
    let start = |(problem, initial): &(&Problem, &Controls)| Searched {
        iterates: vec![(*initial).clone()],
        history: vec![objective(problem, initial)],
        best: 0,
        ending: Ending { status: Ending::STARTED, ..Ending::default() },
    };
    let mut all: Vec<Searched> = cases.iter().map(start).collect();
    let mut frozen = vec![false; cases.len()];
    for iteration in 0..settings.iterations {
        let pairs = cases.iter().zip(&all);
        let steps: Result<Vec<_>, _> =
            pairs.map(|((problem, _), one)| solver.step_at(problem, &settings.costing, one.last().0)).collect();
        let Ok(steps) = steps else {
            all.iter_mut().for_each(|one| one.ending.status = Ending::FAILED);
            return all;
        };
        for ((((problem, _), one), step), frozen) in cases.iter().zip(&mut all).zip(&steps).zip(&frozen) {
            let mut next = one.last().0.clone();
            if !frozen {
                next.add_scaled(settings.step, step);
                one.ending.converged_after += 1.0;
            }
            let now = objective(problem, &next);
            if now < one.history[one.best] {
                one.best = iteration + 1;
                one.ending.best_iteration = iteration as f64;
            }
            one.iterates.push(next);
            one.history.push(now);
        }
        let mean = all.iter().map(|one| one.last().1).sum::<f64>() / all.len() as f64;
        for (one, frozen) in all.iter_mut().zip(&mut frozen) {
            let before = one.history[one.history.len() - 2];
            *frozen = mean < settings.absolute_tolerance || settings.settled(before, one.last().1);
            if *frozen {
                one.ending.status = Ending::CONVERGED;
            }
        }
        if frozen.iter().all(|frozen| *frozen) {
            break;
        }
    }
    for one in all.iter_mut().filter(|one| one.ending.status == Ending::STARTED) {
        one.ending = Ending { status: Ending::ITERATION_LIMIT, converged_after: -1.0, ..one.ending };
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use gauss_newton::constants::{STEPS, Term};
    use gauss_newton::{Inputs, Vehicle};

    /// Standing still, where controls cost themselves alone: each iteration of 0.2 leaves 0.64 of the objective.
    fn problem(acceleration_weight: f64) -> Problem {
        let mut weights = [0.0; 9];
        weights[Term::Acceleration as usize] = acceleration_weight;
        weights[Term::Steering as usize] = 1.0;
        Problem::new(&Inputs {
            line_x: &[0.0, 1.0],
            line_y: &[0.0, 0.0],
            line_heading: &[0.0, 0.0],
            speed_target: 0.0,
            speed_targets: None,
            stop_distance: None,
            av: Vehicle::default(),
            present: None,
            neighbors: &[],
            weights,
        })
        .unwrap()
    }

    /// Controls of this objective under an acceleration weight of 1.
    fn costing(objective: f64) -> Controls {
        Controls { acceleration: [(2.0 * objective / STEPS as f64).sqrt(); STEPS], ..Controls::ZERO }
    }

    fn searched(objectives: &[f64]) -> Vec<Searched> {
        let problem = problem(1.0);
        let initial: Vec<_> = objectives.iter().map(|objective| costing(*objective)).collect();
        let cases: Vec<_> = initial.iter().map(|initial| (&problem, initial)).collect();
        search(&cases, &Settings::paper_test(), LinearSolver::Sweep)
    }

    #[test]
    fn a_case_that_has_converged_stays_while_others_go_on() {
        let all = searched(&[0.03, 100.0]);
        // 0.03, 0.0192, 0.0123: the second change is below 0.01.
        let early = &all[0];
        assert_eq!((early.ending.converged_after, early.ending.best_iteration, early.best), (2.0, 1.0, 2));
        assert!(early.history.len() == all[1].history.len() && early.history.len() > 10);
        assert!(early.history[3..].iter().all(|e| *e == early.history[2]) && early.history[2] < early.history[1]);
        assert_eq!(early.iterates[2], early.iterates[10]);
        assert_eq!(all[1].ending.converged_after, (all[1].history.len() - 1) as f64);
        assert!(all.iter().all(|one| one.ending.status == Ending::CONVERGED));
    }

    #[test]
    fn a_batch_stops_where_the_mean_of_its_objectives_is_small() {
        // 0.0192 after one iteration; a third of it is below 0.01, though it changed by more.
        assert_eq!(searched(&[0.03])[0].history.len(), 3);
        let all = searched(&[0.03, 0.0, 0.0]);
        assert!(all.iter().all(|one| one.history.len() == 2 && one.ending.converged_after == 1.0));
    }

    #[test]
    fn a_case_alone_is_searched_as_the_solver_does() {
        let (problem, initial) = (problem(1.0), costing(7.0));
        let mut solver = Solver::new(LinearSolver::Sweep);
        let summary = solver.solve(&problem, &Settings::paper_test(), &initial).unwrap();
        let one = &search(&[(&problem, &initial)], &Settings::paper_test(), LinearSolver::Sweep)[0];
        assert_eq!(one.history, solver.history());
        assert_eq!(&one.iterates[one.best], solver.best());
        assert_eq!(one.ending, Ending::of(&summary));
    }

    #[test]
    fn one_singular_matrix_ends_the_search_of_all() {
        let (good, bad, initial) = (problem(1.0), problem(0.0), costing(7.0));
        let all = search(&[(&good, &initial), (&bad, &initial)], &Settings::paper_test(), LinearSolver::Sweep);
        assert!(all.iter().all(|one| one.ending.status == Ending::FAILED && one.history.len() == 1));
    }
}
