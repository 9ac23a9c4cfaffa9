//! Laws of trees of futures.

use std::slice::from_ref;

use proptest::prelude::*;

use super::super::linear::NormalEquations;
use super::super::tree::Part;
use super::*;

/// Futures of one situation: who is where, and what light may be red, is of each branch.
#[derive(Clone, Debug)]
struct Futures {
    problems: Vec<Problem>,
    probabilities: Vec<f64>,
    trunk: usize,
}

impl Futures {
    fn branches(&self) -> Vec<Branch<'_>> {
        let pairs = self.problems.iter().zip(&self.probabilities);
        pairs.map(|(problem, &probability)| Branch { problem, probability }).collect()
    }
}

prop_compose! {
    fn any_futures()(
        situation in any_situation(), others in prop::collection::vec(any_situation(), 0..BRANCHES),
        shares in prop::array::uniform3(0.05..1.0), trunk in 0..=STEPS,
    ) -> Futures {
        let mut problems = vec![situation.problem()];
        for other in others {
            problems.push(Situation { line: situation.line.clone(), speed: situation.speed, ..other }.problem());
        }
        let sum: f64 = shares[..problems.len()].iter().sum();
        let probabilities = shares[..problems.len()].iter().map(|share| share / sum).collect();
        Futures { problems, probabilities, trunk }
    }
}

fn any_tree_controls(largest: f64) -> impl Strategy<Value = Vec<Controls>> {
    prop::collection::vec(any_controls(largest), BRANCHES)
}

/// As many of them as the tree has branches, the trunk shared.
fn shared(tree: &Tree<'_>, controls: &[Controls]) -> TreeControls {
    let mut all = TreeControls::with_room(BRANCHES);
    all.set(tree, &controls[..tree.branches.len()]);
    all
}

fn evaluations(tree: &Tree<'_>, costing: &Costing, controls: &TreeControls) -> Vec<Evaluation> {
    let pairs = tree.branches.iter().zip(controls.branches());
    pairs.map(|(branch, controls)| evaluated(branch.problem, costing, controls)).collect()
}

fn objective(tree: &Tree<'_>, at: &[Evaluation]) -> f64 {
    tree.branches.iter().zip(at).map(|(branch, at)| branch.probability * at.objective).sum()
}

fn parts<'a>(tree: &Tree<'a>, at: &'a [Evaluation]) -> Vec<Part<'a>> {
    let pairs = tree.branches.iter().zip(at);
    pairs.map(|(b, at)| Part { at, weights: b.problem.weights(), probability: b.probability }).collect()
}

fn gradient(tree: &Tree<'_>, at: &[Evaluation]) -> TreeControls {
    let mut gradient = shared(tree, &vec![Controls::ZERO; tree.branches.len()]);
    let mut rows = Rows::ZERO;
    for ((branch, at), gradient) in tree.branches.iter().zip(at).zip(gradient.branches_mut()) {
        at.gradient(branch.problem, &mut rows, gradient);
    }
    gradient.add_up_gradient(tree);
    gradient
}

/// How far apart they are, as a share of the second.
fn apart(a: &TreeControls, b: &TreeControls) -> f64 {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    (difference.dot(&difference) / b.dot(b)).sqrt()
}

proptest! {
    #[test]
    fn a_tree_of_one_branch_is_the_chain_to_the_last_bit(
        situation in any_situation(), costing in any_costing(), initial in any_controls(1.0), trunk in 0..=STEPS,
    ) {
        let problem = situation.problem();
        let settings = Settings { costing, iterations: 12, polish: 12, ..Settings::paper_test() };
        let branches = [Branch { problem: &problem, probability: 1.0 }];
        let (mut chain, mut tree) = (Solver::new(LinearSolver::Sweep), TreeSolver::new(LinearSolver::Sweep));
        let of_chain = chain.solve(&problem, &settings, &initial).unwrap();
        let of_tree = tree.solve(&Tree { trunk, branches: &branches }, &settings, from_ref(&initial)).unwrap();
        let bits = |history: &[f64]| history.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(of_chain, of_tree);
        prop_assert_eq!(bits(chain.history()), bits(tree.history()));
        let bits = |controls: &Controls| controls.interleaved().map(f64::to_bits).collect::<Vec<_>>();
        prop_assert_eq!(bits(chain.best()), bits(&tree.best().branches()[0]));
        prop_assert_eq!(bits(chain.last()), bits(&tree.last().branches()[0]));
    }

    #[test]
    fn the_sweep_of_a_tree_and_the_dense_factorization_give_the_same_step(
        futures in any_futures(), costing in any_costing(), controls in any_tree_controls(2.0),
    ) {
        let branches = futures.branches();
        let tree = Tree { trunk: futures.trunk, branches: &branches };
        let at = evaluations(&tree, &costing, &shared(&tree, &controls));
        let gradient = gradient(&tree, &at);
        let steps = [LinearSolver::Sweep, LinearSolver::Dense].map(|linear| {
            let mut normal = NormalEquations::new(linear, BRANCHES);
            normal.factorize(&parts(&tree, &at), tree.trunk).unwrap();
            let mut step = gradient.clone();
            normal.solve(&parts(&tree, &at), gradient.branches(), step.branches_mut());
            step
        });
        prop_assert!(apart(&steps[0], &steps[1]) <= 1e-9, "{}", apart(&steps[0], &steps[1]));
    }

    #[test]
    fn the_sweep_of_a_tree_undoes_products_with_its_normal_matrix(
        futures in any_futures(), costing in any_costing(), controls in any_tree_controls(2.0), along in any_tree_controls(1.0),
    ) {
        let branches = futures.branches();
        let tree = Tree { trunk: futures.trunk, branches: &branches };
        let at = evaluations(&tree, &costing, &shared(&tree, &controls));
        let along = shared(&tree, &along);
        let mut product = along.clone();
        let (mut rows, mut weighted) = (Rows::ZERO, Rows::ZERO);
        let mut change = [StateChange::default(); STEPS];
        for ((at, branch), controls) in at.iter().zip(tree.branches).zip(product.branches_mut()) {
            at.push_forward(&controls.clone(), &mut change, &mut rows);
            weighted.set_weighted(branch.problem.weights(), &rows, None);
            at.pull_back(&weighted, controls);
        }
        product.add_up_gradient(&tree);
        let mut normal = NormalEquations::new(LinearSolver::Sweep, BRANCHES);
        normal.factorize(&parts(&tree, &at), tree.trunk).unwrap();
        let mut solution = along.clone();
        normal.solve(&parts(&tree, &at), product.branches(), solution.branches_mut());
        prop_assert!(apart(&solution, &along) <= 1e-7, "{}", apart(&solution, &along));
    }

    #[test]
    fn the_gradient_of_a_tree_is_that_of_central_differences(
        futures in any_futures(), costing in any_costing(), controls in any_tree_controls(1.0), along in any_tree_controls(1.0),
    ) {
        let branches = futures.branches();
        let tree = Tree { trunk: futures.trunk, branches: &branches };
        let (controls, along) = (shared(&tree, &controls), shared(&tree, &along));
        let beside = |h: f64| {
            let mut moved = controls.clone();
            moved.add_scaled(h, &along);
            evaluations(&tree, &costing, &moved)
        };
        let h = 1e-5;
        let [low, at, high] = [-h, 0.0, h].map(beside);
        let smooth = |other: &[Evaluation]| at.iter().zip(other).all(|(a, b)| pieces(a) == pieces(b));
        prop_assume!(smooth(&low) && smooth(&high));
        let gradient = gradient(&tree, &at);
        let slope = gradient.dot(&along);
        let difference = (objective(&tree, &high) - objective(&tree, &low)) / (2.0 * h);
        let scale = objective(&tree, &at) + slope.abs();
        prop_assert!((slope - difference).abs() <= 1e-5 * (1.0 + scale), "{slope} {difference}");
    }

    #[test]
    fn without_a_trunk_every_branch_steps_as_a_chain(
        futures in any_futures(), costing in any_costing(), controls in any_tree_controls(2.0),
    ) {
        let branches = futures.branches();
        let tree = Tree { trunk: 0, branches: &branches };
        let mut solver = TreeSolver::new(LinearSolver::Sweep);
        let step = solver.step_at(&tree, &costing, &controls[..branches.len()]).unwrap().clone();
        for ((branch, of_tree), controls) in branches.iter().zip(step.branches()).zip(&controls) {
            let mut chain = Solver::new(LinearSolver::Sweep).step_at(branch.problem, &costing, controls).unwrap();
            let scale = chain.dot(&chain).sqrt();
            chain.add_scaled(1.0, of_tree);
            prop_assert!(chain.dot(&chain).sqrt() <= 1e-9 * scale);
        }
    }

    #[test]
    fn a_polish_of_a_tree_never_raises_its_objective_and_the_trunk_stays_shared(
        futures in any_futures(), costing in any_costing(), controls in any_tree_controls(1.0), steps in 1..12_usize,
    ) {
        let branches = futures.branches();
        let tree = Tree { trunk: futures.trunk, branches: &branches };
        let settings = Settings { costing, ..Settings::paper_test() }.refining(steps);
        let mut solver = TreeSolver::new(LinearSolver::Sweep);
        let summary = solver.solve(&tree, &settings, &controls[..branches.len()]).unwrap();
        prop_assert!(summary.iterations <= steps);
        prop_assert!(solver.history().windows(2).all(|pair| pair[1] <= pair[0]), "{:?}", solver.history());
        let best = solver.best().clone();
        for controls in best.branches() {
            prop_assert_eq!(&controls.acceleration[..tree.trunk], &best.branches()[0].acceleration[..tree.trunk]);
            prop_assert_eq!(&controls.steering[..tree.trunk], &best.branches()[0].steering[..tree.trunk]);
        }
        let at = solver.evaluate_best(&tree, &costing);
        prop_assert_eq!(at.len(), branches.len());
        prop_assert_eq!(objective(&tree, at).to_bits(), summary.best_objective.to_bits());
    }

    #[test]
    fn whatever_makes_a_tree_what_comes_out_is_a_plan_of_numbers_or_an_error(
        futures in any_futures(), costing in any_costing(), shares in prop::array::uniform3(wild()), trunk in 0..60_usize,
        initial in prop::collection::vec((wild(), wild()), STEPS), given in 0..4_usize, kept in any::<bool>(),
    ) {
        let mut branches = futures.branches();
        if !kept {
            branches.iter_mut().zip(shares).for_each(|(branch, share)| branch.probability = share);
        }
        let initial = vec![Controls::from_pairs(initial.into_iter()).unwrap(); given];
        let mut solver = TreeSolver::new(LinearSolver::Sweep);
        let settings = Settings { costing, iterations: 3, polish: 3, ..Settings::paper_test() };
        let solved = solver.solve(&Tree { trunk, branches: &branches }, &settings, &initial);
        prop_assert!(solved.is_err() || solver.best().is_finite() && solved.unwrap().best_objective.is_finite());
    }
}

#[test]
fn what_is_no_tree_is_refused_by_name() {
    let mut other = straight([1.0; TERMS]);
    other.speed = 1.0;
    let (problem, other) = (straight([1.0; TERMS]).problem(), other.problem());
    let mut solver = TreeSolver::new(LinearSolver::Sweep);
    let mut refused = |trunk: usize, branches: &[Branch<'_>], initial: usize| {
        let initial = vec![Controls::ZERO; initial];
        let tree = Tree { trunk, branches };
        solver.solve(&tree, &Settings::paper_test(), &initial).unwrap_err().to_string()
    };
    let half = Branch { problem: &problem, probability: 0.5 };
    assert_eq!(refused(10, &[], 1), "a tree has 1 to 3 branches, not 0");
    assert_eq!(refused(10, &[Branch { probability: 0.25, ..half }; 4], 1), "a tree has 1 to 3 branches, not 4");
    assert_eq!(refused(51, &[half; 2], 1), "a trunk has 0 to 50 steps, not 51");
    assert_eq!(refused(10, &[half], 1), "the branches' probabilities sum up to 0.5, not 1");
    let nobody = Branch { probability: f64::NAN, ..half };
    assert_eq!(refused(10, &[half, nobody], 1), "the probability of branch 1 is NaN, not more than 0");
    let another = Branch { problem: &other, ..half };
    assert_eq!(refused(10, &[half, another], 1), "branch 1 begins with another AV than the first");
    let wanted = "there are initial controls for 3 branches of 2; one for all will do";
    assert_eq!(refused(10, &[half; 2], 3), wanted);
    assert_eq!(refused(10, &[half; 2], 0), wanted.replace('3', "0"));
}

#[test]
fn before_the_junction_the_av_is_ready_for_either_future_and_after_it_for_its_own() {
    // Somebody 20 m ahead drives on, or stops there.
    let mut goes = straight(constants::HAND_TUNED);
    goes.speed = 8.0;
    let mut stops = goes.clone();
    goes.positions = vec![Some((0..STEPS).map(|t| (20.0 + 0.8 * (t + 1) as f64, 0.0)).collect())];
    stops.positions = vec![Some(vec![(20.0, 0.0); STEPS])];
    let (goes, stops) = (goes.problem(), stops.problem());
    let settings = Settings::contingency(BicycleModel::default());
    let mut solver = TreeSolver::new(LinearSolver::Sweep);
    let mut speeds = |futures: &[(&Problem, f64)]| {
        let branches: Vec<_> = futures.iter().map(|&(problem, probability)| Branch { problem, probability }).collect();
        let tree = Tree { trunk: TRUNK, branches: &branches };
        solver.solve(&tree, &settings, &[Controls::ZERO]).unwrap();
        let at = solver.evaluate_best(&tree, &settings.costing);
        at.iter().map(|at| [at.motion.states[TRUNK - 1].speed, at.motion.states[STEPS - 1].speed]).collect::<Vec<_>>()
    };
    let (only_goes, only_stops) = (speeds(&[(&goes, 1.0)])[0], speeds(&[(&stops, 1.0)])[0]);
    let both = speeds(&[(&goes, 0.5), (&stops, 0.5)]);
    assert_eq!(both[0][0], both[1][0]);
    assert!(only_stops[0] < both[0][0] && both[0][0] < only_goes[0], "{only_stops:?} {both:?} {only_goes:?}");
    assert!(both[0][1] > 7.0 && both[1][1] < 3.0, "{both:?}");
}
