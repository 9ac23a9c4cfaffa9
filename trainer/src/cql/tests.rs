//! A small problem whose best actions and values are known, and the loop: stopped and gone on with, and with any number of threads.

use std::fs;
use std::path::Path;

use network::cql::{Convolution, Shape};

use super::*;
use crate::draw::{Draw, Purpose};
use crate::training::{Ended, TrainingError};
use crate::windows::{Experience, Transition};

/// Two steps: from `here` wherever one goes comes `there`, and then the goal. An action is worth 1, and less by four times its squared distance from the best
/// one, 0.5 here and -0.5 there. So the best values are 1 there, and here 1 + gamma.
struct Steps {
    training: Vec<usize>,
    validation: Vec<usize>,
}

const HERE: [u8; 2] = [255, 0];
const THERE: [u8; 2] = [0, 255];

impl Steps {
    fn new() -> Self {
        Self { training: (0..256).collect(), validation: (256..320).collect() }
    }
}

impl Experience for Steps {
    fn get(&self, index: usize) -> anyhow::Result<Transition> {
        let action = Draw::new(7, Purpose::Order, index as u64).within(1.0) as f32;
        let goal = index % 2 == 1;
        let (state, best) = if goal { (THERE, -0.5) } else { (HERE, 0.5) };
        let distance = 1.0 - 4.0 * (action - best) * (action - best);
        Ok(Transition { state: state.to_vec(), action: vec![action], distance, goal, next: THERE.to_vec() })
    }

    fn training(&self) -> &[usize] {
        &self.training
    }

    fn validation(&self) -> &[usize] {
        &self.validation
    }

    fn digest(&self) -> String {
        "steps".to_owned()
    }
}

fn shape() -> Shape {
    Shape { side: 1, channels: 2, convolutions: Vec::new(), dense: 32, actions: 1 }
}

fn settings(changes: &[&str]) -> Settings {
    let all = ["batch_size=64", "goal_bonus=0", "gamma=0.9", "n_action_samples=4"];
    Settings::read("", &all.iter().chain(changes).map(ToString::to_string).collect::<Vec<_>>()).unwrap()
}

#[test]
fn the_best_actions_of_two_steps_are_found_and_what_they_are_worth() {
    // Little of what is conservative: it moves values of actions that are rarer than others, which none is here.
    let quick = ["actor_learning_rate=3e-3", "critic_learning_rate=3e-3", "temp_learning_rate=1e-2", "tau=0.02"];
    let settings = settings(&[&quick[..], &["conservative_weight=0.01", "initial_temperature=0.1"]].concat());
    let (networks, steps) = (Networks::new(shape()), Steps::new());
    let mut state = State::first(&networks, &settings, String::new());
    let transitions: Vec<Transition> = (0..64).map(|index| steps.get(index).unwrap()).collect();
    let batch = Batch { transitions };
    let first = greedy(&networks, &state.policy, &[&HERE, &THERE]);
    let mut last = Report::default();
    for number in 0..1500 {
        last = step(&networks, &settings, &mut state, &batch, &Noise::draw(&settings, 64, 1, number));
    }
    let found = greedy(&networks, &state.policy, &[&HERE, &THERE]);
    assert!((found[0] - 0.5).abs() < 0.15 && (found[1] + 0.5).abs() < 0.15, "{first:?} {found:?} {last:?}");
    // The mean value of what was logged: rewards, and 0.9 of the best value there for half of them.
    let rewards = batch.transitions.iter().map(|transition| f64::from(transition.distance)).sum::<f64>() / 64.0;
    let [bellman, .., value, _] = last.0;
    assert!((value - (rewards + 0.45)).abs() < 0.15 && bellman < 0.2, "{value} {rewards} {last:?}");
}

#[test]
fn what_is_conservative_keeps_to_what_was_logged() {
    // Logged here is 0.5 alone, and no reward tells it from anything else.
    let settings = settings(&["actor_learning_rate=3e-3", "critic_learning_rate=3e-3", "conservative_weight=5"]);
    let networks = Networks::new(shape());
    let mut state = State::first(&networks, &settings, String::new());
    let logged =
        Transition { state: HERE.to_vec(), action: vec![0.5], goal: true, next: HERE.to_vec(), ..Default::default() };
    let batch = Batch { transitions: vec![logged; 64] };
    for number in 0..300 {
        step(&networks, &settings, &mut state, &batch, &Noise::draw(&settings, 64, 1, number));
    }
    let found = greedy(&networks, &state.policy, &[&HERE])[0];
    assert!((found - 0.5).abs() < 0.2, "{found}");
}

#[test]
fn a_step_is_the_same_for_any_number_of_threads() {
    let layer = |filters, kernel, stride| Convolution { filters, kernel, stride };
    let shape =
        Shape { side: 9, channels: 3, convolutions: vec![layer(4, 3, 2), layer(5, 2, 1)], dense: 8, actions: 3 };
    let networks = Networks::new(shape);
    let settings = Settings { n_action_samples: 2, ..Settings::default() };
    let mut draw = Draw::new(3, Purpose::Order, 0);
    let mut picture = || -> Vec<u8> { (0..networks.shape.picture()).map(|_| draw.below(256) as u8).collect() };
    let transition = |index: usize| Transition {
        state: picture(),
        action: vec![0.1 * index as f32 - 1.0, 0.0, 0.5],
        distance: 1.0,
        goal: index.is_multiple_of(7),
        next: picture(),
    };
    let batch = Batch { transitions: (0..20).map(transition).collect() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut state = State::first(&networks, &settings, String::new());
        pool.install(|| {
            for number in 1..3 {
                step(&networks, &settings, &mut state, &batch, &Noise::draw(&settings, 20, 3, number));
            }
        });
        state
    };
    let (one, three) = (run(1), run(3));
    assert!(one == three);
    let first = State::first(&networks, &settings, String::new());
    for (tensor, rows) in networks.policy.iter().map(|tensor| (tensor, (&one.policy, &first.policy))) {
        let moved = tensor.place.clone().any(|index| rows.0.values[index] != rows.1.values[index]);
        assert!(moved, "{} is learned", tensor.name);
    }
    for tensor in &networks.critics {
        assert!(
            tensor.place.clone().any(|index| one.critics.values[index] != first.critics.values[index]),
            "{tensor:?}"
        );
    }
}

/// Stops after so many steps.
struct StopAfter(std::cell::Cell<i32>);

impl Watch for StopAfter {
    fn stop(&self) -> bool {
        self.0.set(self.0.get() - 1);
        self.0.get() == 0
    }
}

fn trained(folder: &Path, settings: &Settings, resume: bool, stop: i32) -> Result<Ended, TrainingError> {
    let (shape, experience) = (shape(), Steps::new());
    let task = Task { shape: &shape, settings, experience: &experience, folder, resume };
    train(task, &mut StopAfter(std::cell::Cell::new(stop)))
}

#[test]
fn a_training_that_was_stopped_ends_as_one_that_was_not() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
    let settings = settings(&["epochs=3"]);
    assert_eq!(trained(&whole, &settings, false, 0).unwrap(), Ended::Finished);
    assert_eq!(trained(&parts, &settings, false, 2).unwrap(), Ended::Stopped);
    assert_eq!(trained(&parts, &settings, true, 5).unwrap(), Ended::Stopped);
    assert!(matches!(trained(&parts, &settings, false, 0), Err(TrainingError::Exists(_))));
    let other = Settings { gamma: 0.5, ..settings.clone() };
    let refused = trained(&parts, &other, true, 0).unwrap_err().to_string();
    assert!(refused.contains("gamma is 0.5 here and 0.9 there"), "{refused}");
    assert_eq!(trained(&parts, &settings, true, 0).unwrap(), Ended::Finished);
    for name in ["weights.safetensors", "checkpoint.safetensors", "settings.toml"] {
        assert!(fs::read(whole.join(name)).unwrap() == fs::read(parts.join(name)).unwrap(), "{name}");
    }
    let rows = |folder: &Path| fs::read_to_string(folder.join("steps.csv")).unwrap().lines().count();
    assert_eq!([rows(&whole), rows(&parts)], [13, 13]);
    let epochs = fs::read_to_string(whole.join("metrics.csv")).unwrap();
    assert!(epochs.lines().all(|line| line.split(',').count() == 11), "{epochs}");
}

#[test]
fn too_few_for_a_step_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(&["batch_size=257"]);
    let refused = trained(folder.path(), &settings, false, 0).unwrap_err().to_string();
    assert!(refused.starts_with("there are 256 transitions to train on, and a step takes 257"), "{refused}");
}
