use network::constants::{HISTORY, NEIGHBORS};
use network::weights::{Variant, Weights};
use scenarios::generated::Parameters as Given;
use world::scene::Scene;

use super::*;
use crate::parameters::{Parameters, tensors};
use crate::settings::Settings;
use crate::windows::{Recipe, Whose, cut};

/// A few windows of a generated scene.
fn few(family: &str, count: usize) -> Vec<Window> {
    let scene = scene(family);
    let recipe = Recipe { features: Whose::Mended, stride: 40, others: false };
    cut(&scene, &recipe).windows.into_iter().take(count).collect()
}

fn scene(family: &str) -> Scene {
    let family = scenarios::generated::Family::named(family).unwrap();
    let payload = family.payload("x", 1, 0, &Given::default()).unwrap();
    scenarios::womd::read(&payload).unwrap().0
}

fn work(rules: Rules, planning: bool) -> Work {
    Work {
        rules,
        weights: LossWeights::default(),
        planning: planning.then(|| Planning::of(&Settings::default())),
        keeps_predictor_loss: true,
        couples: rules == Rules::Authors,
        prior: None,
        dropout: None,
        wants_gradient: true,
        wants_looks: false,
    }
}

/// The formula's weights, in double precision.
fn values() -> Vec<f64> {
    Parameters::of(&Weights::formula(Variant::Joint)).values().iter().map(|value| f64::from(*value)).collect()
}

/// The gradient of the whole loss against central differences along one number of each of some tensors. But for the score loss: nothing but its
/// own head learns from it, though all else moves it (`network.md` 5.8).
fn holds(windows: &[Window], work: Work) {
    let work = &Work { weights: LossWeights { score: 0.0, ..work.weights }, ..work };
    let layout = Layout::new(Variant::Joint);
    let windows: Vec<&Window> = windows.iter().collect();
    let values = values();
    let done = run(&layout, &values, &windows, work, &Spares::default()).unwrap();
    assert!(done.gradient.iter().all(|value| value.is_finite()));
    let best: Vec<usize> = done.windows.iter().map(|(.., by)| by.future).collect();
    let mut checked = 0;
    for (name, _, place) in tensors(Variant::Joint) {
        let wanted =
            ["_l0", "pointnet.0.weight", "left_type", "point_net.2.weight", "in_proj_weight", "linear1.weight"];
        let wanted =
            wanted.iter().any(|part| name.contains(part)) || name.starts_with("plan.") || name.starts_with("predict.");
        // The number of the tensor that matters most.
        let index = place.clone().max_by(|a, b| done.gradient[*a].abs().total_cmp(&done.gradient[*b].abs())).unwrap();
        if !wanted || done.gradient[index] == 0.0 {
            continue;
        }
        let at = |change: f64| {
            let mut moved = values.clone();
            moved[index] += change;
            let done =
                run(&layout, &moved, &windows, &Work { wants_gradient: false, ..work.clone() }, &Spares::default())
                    .unwrap();
            let same = done.windows.iter().zip(&best).all(|((.., by), best)| by.future == *best);
            same.then(|| done.parts.total(&work.weights, true))
        };
        // Hinges and nearest samples of the planner make kinks: one of three steps must not reach the next.
        let is_right = |slope: f64| (slope / done.gradient[index] - 1.0).abs() < 1e-3;
        let mut slopes =
            [1e-6, 1e-7, 1e-8].into_iter().filter_map(|step| Some((at(step)? - at(-step)?) / (2.0 * step)));
        let Some(first) = slopes.next() else { continue }; // another future is best right beside
        assert!(is_right(first) || slopes.any(is_right), "{name}: {} is {first}", done.gradient[index]);
        checked += 1;
    }
    assert!(checked > 25, "{checked}");
}

#[test]
fn the_gradient_of_the_whole_loss_is_its_slope() {
    holds(&few("left-turn", 1), work(Rules::Mended, true));
}

#[test]
fn so_it_is_by_the_authors_rules_and_without_the_planner() {
    holds(&few("following", 1), work(Rules::Authors, true));
    holds(&few("crosswalk", 1), work(Rules::Mended, false));
}

/// The AV and everybody else stand where they are, in the past and in the future, and the network asks for nothing.
fn standing() -> Window {
    let mut window = few("red-light", 1).remove(0);
    let still =
        |row: [f32; 8]| std::array::from_fn(|column| if column == 3 || column == 4 { 0.0 } else { row[column] });
    let now = still(window.sketch.ego[HISTORY - 1]);
    window.sketch.ego = [now; HISTORY];
    window.future[0] = [[now[0], now[1], now[2], 0.0, 0.0]; STEPS];
    window.seen[0] = [true; STEPS];
    for number in 0..NEIGHBORS {
        let mut now = window.sketch.neighbors[number][HISTORY - 1];
        (now[3], now[4]) = (0.0, 0.0);
        window.sketch.neighbors[number] = [now; HISTORY];
        window.future[number + 1] = [[now[0], now[1], now[2], 0.0, 0.0]; STEPS];
    }
    window
}

#[test]
fn where_nobody_moves_no_gradient_is_nan() {
    let window = standing();
    let layout = Layout::new(Variant::Joint);
    // Plans and offsets of exactly zero: every difference is one of equal numbers, and a neighbour may stand where the AV does.
    let mut values = values();
    for (name, _, place) in tensors(Variant::Joint) {
        if name.starts_with("plan.control.3") || name.starts_with("predict.decode.3") {
            values[place].fill(0.0);
        }
    }
    let mut on_the_av = window.clone();
    let own = on_the_av.sketch.ego[HISTORY - 1];
    for row in &mut on_the_av.sketch.neighbors[0] {
        (row[0], row[1]) = (own[0], own[1]);
    }
    for window in [&window, &on_the_av] {
        for rules in [Rules::Authors, Rules::Mended] {
            let planned = run(&layout, &values, &[window], &work(rules, true), &Spares::default()).unwrap();
            assert!(planned.gradient.iter().all(|value| value.is_finite()));
            // What it is: predictions that are right teach nothing, and steering a vehicle that stands moves nothing.
            let (.., by) =
                &run(&layout, &values, &[&standing()], &work(rules, false), &Spares::default()).unwrap().windows[0];
            assert!(by.poses.as_flattened().as_flattened().iter().all(|value| *value == 0.0));
            assert!(by.plan.steering.iter().all(|value| *value == 0.0), "{:?}", by.plan.steering);
        }
    }
}

#[test]
fn a_batch_gives_the_same_bytes_for_any_number_of_threads() {
    let windows: Vec<Window> = few("urban", 4).into_iter().cycle().take(18).collect();
    let windows: Vec<&Window> = windows.iter().collect();
    let layout = Layout::new(Variant::Joint);
    let parameters = Parameters::of(&Weights::formula(Variant::Joint));
    let work = Work { dropout: Some((5, 0.1)), ..work(Rules::Mended, true) };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let done = pool.install(|| run(&layout, parameters.values(), &windows, &work, &Spares::default())).unwrap();
        (done.gradient.iter().map(|value| value.to_bits()).collect::<Vec<u32>>(), done.parts)
    };
    assert!(with(1) == with(3));
}

#[test]
fn a_window_without_a_finite_loss_is_named() {
    let mut windows = few("cruise", 2);
    windows[1].line[0][0] = f32::NAN;
    let layout = Layout::new(Variant::Joint);
    let parameters = Parameters::of(&Weights::formula(Variant::Joint));
    let windows: Vec<&Window> = windows.iter().collect();
    let error =
        run(&layout, parameters.values(), &windows, &work(Rules::Mended, true), &Spares::default()).unwrap_err();
    assert_eq!((error.scene.as_str(), error.step), (windows[1].scene.as_str(), windows[1].step));
    assert!(error.to_string().contains("reference line"), "{error}");
}

#[test]
fn what_is_looked_at_is_as_far_from_what_happened_as_the_metrics_say() {
    let windows = few("urban", 3);
    let windows: Vec<&Window> = windows.iter().collect();
    let layout = Layout::new(Variant::Joint);
    for planning in [false, true] {
        let work = Work { wants_looks: true, wants_gradient: false, ..work(Rules::Mended, planning) };
        let done = run(&layout, &values(), &windows, &work, &Spares::default()).unwrap();
        assert_eq!(done.looks.len(), windows.len());
        for ((window, look), (_, parts, _)) in windows.iter().zip(&done.looks).zip(&done.windows) {
            let [x, y] = look.plan[STEPS - 1];
            let [there_x, there_y, ..] = window.future[0][STEPS - 1].map(f64::from);
            let away = libm::hypot(x - there_x, y - there_y);
            assert!((away - 3.0 * parts.plan_error[1]).abs() < 1e-9, "{away}, {}", parts.plan_error[1]);
        }
    }
}
