//! Held to the authors' own step of learning (`training-vectors/`): losses, gradients, outputs.

use std::path::Path;

use network::Frame;
use network::constants::{AGENTS, CROSSWALKS, LANES, NEIGHBORS, POINTS, STEPS};
use network::weights::formula_numbers;
use thiserror::Error;
use vectors::{Npz, NpzError, Quantity, Report};

use crate::batch::{self, BatchError, Done, Work};
use crate::model::Layout;
use crate::parameters::{Parameters, tensors};
use crate::planning::Planning;
use crate::settings::{LossWeights, Rules, Settings};
use crate::tape::{Scalar, Spares};
use crate::windows::{Sketch, Window};

/// Residuals of the authors' planner.
const RESIDUALS: usize = 383;

/// Why nothing could be compared.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum VerifyError {
    #[error(transparent)]
    Npz(#[from] NpzError),
    #[error(transparent)]
    Batch(#[from] BatchError),
}

/// The windows of `batch.npz`.
///
/// # Errors
/// [`NpzError`] where an array is missing or has another shape.
pub fn windows(npz: &Npz) -> Result<Vec<Window>, NpzError> {
    let count = npz.array("timestep", &[None])?.len();
    let n = Some(count);
    let steps = npz.array("timestep", &[n])?;
    let ego = npz.array("ego", &[n, Some(20), Some(8)])?;
    let neighbors = npz.array("neighbors", &[n, Some(NEIGHBORS), Some(20), Some(9)])?;
    let lanes = npz.array("map_lanes", &[n, Some(AGENTS), Some(LANES), Some(POINTS), Some(17)])?;
    let crosswalks = npz.array("map_crosswalks", &[n, Some(AGENTS), Some(CROSSWALKS), Some(POINTS), Some(3)])?;
    let line = npz.array("ref_line", &[n, Some(1200), Some(5)])?;
    let future = npz.array("gt_future_states", &[n, Some(AGENTS), Some(STEPS), Some(5)])?;
    let part = |all: &[f64], index: usize| {
        let size = all.len() / count;
        all[index * size..][..size].iter().map(|value| *value as f32).collect::<Vec<f32>>()
    };
    let window = |index: usize| {
        let mut frame = Frame::empty();
        frame.ego.as_flattened_mut().copy_from_slice(&part(ego, index));
        frame.neighbors.as_flattened_mut().as_flattened_mut().copy_from_slice(&part(neighbors, index));
        frame.lanes.as_flattened_mut().as_flattened_mut().copy_from_slice(&part(lanes, index));
        frame.crosswalks.as_flattened_mut().as_flattened_mut().copy_from_slice(&part(crosswalks, index));
        frame.presence = frame.presence_by_zeros();
        let mut truth = Box::new([[[0.0; 5]; STEPS]; AGENTS]);
        truth.as_flattened_mut().as_flattened_mut().copy_from_slice(&part(future, index));
        let seen = Box::new(truth.map(|row| row.map(|state| state[0] != 0.0)));
        Window {
            scene: format!("window {index}"),
            step: steps[index] as u32,
            av: 0,
            sketch: Sketch::of(&frame),
            line: part(line, index).as_chunks().0.to_vec(),
            future: truth,
            seen,
        }
    };
    Ok((0..count).map(window).collect())
}

/// One step without dropout by the authors' rules.
#[must_use]
pub fn work(planner: bool, couples: bool) -> Work {
    Work {
        rules: Rules::Authors,
        weights: LossWeights::default(),
        planning: planner.then(|| Planning::of(&Settings::default())),
        keeps_predictor_loss: true,
        couples,
        prior: None,
        dropout: None,
        wants_gradient: true,
        wants_looks: false,
    }
}

/// Does it.
///
/// # Errors
/// [`BatchError`].
pub fn step<T: Scalar>(parameters: &Parameters, windows: &[&Window], work: &Work) -> Result<Done<T>, BatchError> {
    let layout = Layout::new(parameters.variant());
    let values: Vec<T> = parameters.values().iter().map(|value| T::of(f64::from(*value))).collect();
    batch::run(&layout, &values, windows, work, &Spares::default())
}

/// What is compared in double and in single precision.
const QUANTITIES: [[Quantity; 6]; 2] = [
    [
        Quantity::exact("best futures, f64"),
        Quantity::within("losses, f64", 1e-8, "rel"),
        Quantity::within("plans, f64", 1e-6, "rel"),
        Quantity::within("gradients by outputs, f64", 1e-6, "rel"),
        Quantity::within("gradient norms, f64", 1e-6, "rel"),
        Quantity::within("gradient products, f64", 1e-6, "rel"),
    ],
    [
        Quantity::exact("best futures, f32"),
        Quantity::within("losses, f32", 1e-4, "rel"),
        Quantity::within("plans, f32", 1e-3, "rel"),
        Quantity::within("gradients by outputs, f32", 1e-3, "rel"),
        Quantity::within("gradient norms, f32", 1e-3, "rel"),
        Quantity::within("gradient products, f32", 1e-3, "rel"),
    ],
];

/// How far double and single precision are from the authors' numbers in a folder of `training-vectors`: without the planner, through it, and
/// through it where their coupling of the windows is mended.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(parameters: &Parameters, folder: &Path) -> Result<Report, VerifyError> {
    let windows = windows(&Npz::read(&folder.join("batch.npz"))?)?;
    let windows: Vec<&Window> = windows.iter().collect();
    let mut report = Report::new(&["trainer"], &QUANTITIES.concat());
    let cases = [("no_planner_f64", false, false), ("planner_mended_f64", true, false), ("planner_f64", true, true)];
    for (file, planner, couples) in cases {
        let work = work(planner, couples);
        let truth = Npz::read(&folder.join(format!("{file}.npz")))?;
        report.count_case();
        let double = step::<f64>(parameters, &windows, &work)?;
        compare(&mut report, &QUANTITIES[0], file, &truth, parameters, &double)?;
        compare_plans(&mut report, &QUANTITIES[0], file, &truth, &windows, &work, &double)?;
        let single = step::<f32>(parameters, &windows, &work)?;
        compare(&mut report, &QUANTITIES[1], file, &truth, parameters, &single)?;
        compare_plans(&mut report, &QUANTITIES[1], file, &truth, &windows, &work, &single)?;
    }
    Ok(report)
}

fn compare<T: Scalar>(
    report: &mut Report,
    quantities: &[Quantity; 6],
    file: &str,
    truth: &Npz,
    parameters: &Parameters,
    done: &Done<T>,
) -> Result<(), NpzError> {
    let [futures, losses, _, by_outputs, norms, products] = *quantities;
    let n = Some(done.windows.len());
    let best = truth.array("best_mode", &[n])?;
    let different = done.windows.iter().zip(best).filter(|((.., by), best)| by.future as f64 != **best).count();
    report.add(0, futures, different as f64, file);

    let weights = LossWeights::default();
    let parts = &done.parts;
    let mut loss = |name: &str, got: f64, wanted: f64| {
        report.add(0, losses, (got - wanted).abs() / wanted.abs().max(1e-12), format_args!("{file} {name}"));
    };
    let has_planner = truth.has("plan_cost");
    let total = if has_planner { parts.total(&weights, true) } else { parts.without_planner(&weights) };
    loss("loss", total, truth.number("loss")?);
    loss("mfma_loss", parts.without_planner(&weights), truth.number("mfma_loss")?);
    loss("score_loss", parts.score, truth.number("score_loss")?);
    for (agent, (got, wanted)) in
        parts.prediction.iter().zip(truth.rows::<2>("prediction_terms", &[Some(AGENTS), Some(2)])?).enumerate()
    {
        loss(&format!("prediction_terms {agent}"), got[0], wanted[0]);
        loss(&format!("prediction_terms {agent}"), got[1], wanted[1]);
    }
    if has_planner {
        for (got, wanted) in parts.plan.iter().zip(truth.array("plan_loss_terms", &[Some(2)])?) {
            loss("plan_loss_terms", *got, *wanted);
        }
        loss("plan_cost", parts.cost, truth.number("plan_cost")?);
    }

    if truth.has("dloss_d_plans") {
        let by_plans = truth.array("dloss_d_plans", &[n, Some(3), Some(STEPS), Some(2)])?;
        let by_predictions =
            truth.array("dloss_d_predictions", &[n, Some(3), Some(NEIGHBORS), Some(STEPS), Some(3)])?;
        let by_scores = truth.array("dloss_d_scores", &[n, Some(3)])?;
        let mut by = |name: &str, got: Vec<f64>, wanted: &[f64]| {
            report.add(0, by_outputs, apart(&got, wanted), format_args!("{file} {name}"));
        };
        for (index, (.., said)) in done.windows.iter().enumerate() {
            let plan = &by_plans[(3 * index + said.future) * 2 * STEPS..][..2 * STEPS];
            by(&format!("plan {index}"), said.plan.interleaved().collect(), plan);
            let size = NEIGHBORS * STEPS * 3;
            let predictions = &by_predictions[(3 * index + said.future) * size..][..size];
            by(&format!("predictions {index}"), said.poses.as_flattened().as_flattened().to_vec(), predictions);
            by(&format!("scores {index}"), said.scores.clone(), &by_scores[3 * index..][..3]);
        }
    }

    let count = Some(tensors(parameters.variant()).len());
    let (wanted_norms, wanted_products) = (truth.array("grad_norm", &[count])?, truth.array("grad_dot", &[count])?);
    let all = wanted_norms.iter().map(|norm| norm * norm).sum::<f64>().sqrt();
    for (((name, _, place), norm), product) in tensors(parameters.variant()).zip(wanted_norms).zip(wanted_products) {
        let gradient: Vec<f64> = done.gradient[place].iter().map(|value| value.f64()).collect();
        let got = gradient.iter().map(|value| value * value).sum::<f64>().sqrt();
        // Some are exactly zero by theory, and rounding in single precision.
        let scale = norm.max(1e-6 * all);
        report.add(0, norms, (got - norm).abs() / scale, format_args!("{file} {name}"));
        let projection = format!("{name}#dot");
        let signs = formula_numbers(&projection);
        let got: f64 = gradient.iter().zip(signs).map(|(value, sign)| value * sign).sum();
        report.add(0, products, (got - product).abs() / scale, format_args!("{file} {name}"));
    }
    Ok(())
}

/// The planner's controls, and the sums of its squared residuals.
fn compare_plans<T>(
    report: &mut Report,
    quantities: &[Quantity; 6],
    file: &str,
    truth: &Npz,
    windows: &[&Window],
    work: &Work,
    done: &Done<T>,
) -> Result<(), VerifyError> {
    let [_, losses, plans, ..] = *quantities;
    if work.planning.is_none() || !truth.has("plan_final") {
        return Ok(());
    }
    let n = Some(windows.len());
    let wanted = truth.array("plan_final", &[n, Some(2 * STEPS)])?.chunks_exact(2 * STEPS);
    let errors = truth.array("planner_error", &[n, Some(RESIDUALS)])?.chunks_exact(RESIDUALS);
    let mut loss = work.loss(None);
    for (index, (((window, (said, ..)), wanted), errors)) in
        windows.iter().zip(&done.windows).zip(wanted).zip(errors).enumerate()
    {
        let named = |error| BatchError { scene: window.scene.clone(), step: window.step, error };
        let Some(layer) = loss.solve(window, said).map_err(named)? else { continue };
        let controls: Vec<f64> = layer.controls().interleaved().collect();
        report.add(0, plans, apart(&controls, wanted), format_args!("{file} plan {index}"));
        let (got, sum) = (2.0 * layer.objective(), errors.iter().map(|error| error * error).sum::<f64>());
        report.add(0, losses, (got - sum).abs() / sum, format_args!("{file} planner_error {index}"));
        let choices = layer.choices();
        if work.couples {
            loss.lead.get_or_insert(choices);
        }
    }
    Ok(())
}

/// The distance of two vectors, in shares of the second's length.
fn apart(got: &[f64], wanted: &[f64]) -> f64 {
    let norm = wanted.iter().map(|value| value * value).sum::<f64>().sqrt().max(1e-12);
    got.iter().zip(wanted).map(|(got, wanted)| (got - wanted) * (got - wanted)).sum::<f64>().sqrt() / norm
}

#[cfg(test)]
mod tests {
    use network::weights::{Variant, Weights};

    use super::*;

    #[test]
    fn a_step_of_learning_is_the_authors() {
        let Some(folder) = vectors::shared("dipp/training-vectors") else { return };
        let report = verify(&Parameters::of(&Weights::formula(Variant::Joint)), &folder).unwrap();
        println!("{report}");
        assert!(report.holds(), "{report}");
    }

    #[test]
    fn the_first_window_leads_all_groups_whatever_the_number_of_threads() {
        let Some(folder) = vectors::shared("dipp/training-vectors") else { return };
        let windows = windows(&Npz::read(&folder.join("batch.npz")).unwrap()).unwrap();
        let parameters = Parameters::of(&Weights::formula(Variant::Joint));
        // Two groups, and the first window in the second group alone.
        let twice: Vec<&Window> = windows.iter().chain(&windows[..2]).collect();
        let run = |couples: bool, threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| step::<f32>(&parameters, &twice, &work(true, couples))).unwrap()
        };
        let [mended, coupled, again] =
            [(false, 2), (true, 1), (true, 3)].map(|(couples, threads)| run(couples, threads));
        assert_eq!(coupled.gradient, again.gradient);
        assert_eq!(coupled.parts, again.parts);
        let cost = |done: &Done<f32>, index: usize| done.windows[index].1.cost;
        for index in 0..2 {
            assert!((cost(&coupled, index) / cost(&coupled, index + 8) - 1.0).abs() < 1e-2);
        }
        assert_eq!(cost(&coupled, 0), cost(&mended, 0));
        assert!((0..8).any(|index| (cost(&coupled, index) / cost(&mended, index) - 1.0).abs() > 1e-2));
    }
}
