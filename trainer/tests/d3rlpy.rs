//! One step of conservative Q-learning against d3rlpy's own, by the same networks, batch and noise (`checks/d3rlpy_step.py`).
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

use std::fs;
use std::path::Path;
use std::process::Command;

use network::cql::{Convolution, Shape};
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use trainer::cql::{Batch, Networks, Noise, Settings, State, step};
use trainer::draw::{Draw, Purpose};
use trainer::windows::Transition;

const COUNT: usize = 20;
const SAMPLES: usize = 10;

/// Layers as the driver has, on a picture of 36 x 36.
fn shape() -> Shape {
    let layer = |filters, kernel, stride| Convolution { filters, kernel, stride };
    let convolutions = vec![layer(6, 8, 4), layer(7, 4, 2), layer(5, 2, 1)];
    Shape { side: 36, channels: 3, convolutions, dense: 24, actions: 3 }
}

fn batch(shape: &Shape) -> Batch {
    let mut draw = Draw::new(11, Purpose::Order, 0);
    let transition = |index: usize| {
        let mut picture = || (0..shape.picture()).map(|_| draw.below(256) as u8).collect();
        let (state, next) = (picture(), picture());
        let action = (0..3).map(|_| draw.within(1.0) as f32).collect();
        Transition { state, action, distance: draw.unit() as f32, goal: index % 5 == 4, next }
    };
    Batch { transitions: (0..COUNT).map(transition).collect() }
}

/// What the script reads, beside the checkpoint.
fn write_before(path: &Path, shape: &Shape, settings: &Settings, batch: &Batch, noise: &Noise) {
    let all = |of: &dyn Fn(&Transition) -> Vec<f32>| batch.transitions.iter().flat_map(of).collect::<Vec<f32>>();
    let bytes = |picture: &[u8]| picture.iter().map(|value| f32::from(*value)).collect();
    let reward = |one: &Transition| one.distance + if one.goal { settings.goal_bonus as f32 } else { 0.0 };
    let convolutions = shape.convolutions.iter().flat_map(|layer| [layer.filters, layer.kernel, layer.stride]);
    let sizes = [shape.side, shape.channels, shape.actions, shape.dense, SAMPLES];
    let numbers: Vec<(&str, Vec<usize>, Vec<f32>)> = vec![
        ("sizes", vec![5], sizes.iter().map(|value| *value as f32).collect()),
        ("filters", vec![shape.convolutions.len(), 3], convolutions.map(|value| value as f32).collect()),
        ("states", vec![COUNT, shape.picture()], all(&|one| bytes(&one.state))),
        ("nexts", vec![COUNT, shape.picture()], all(&|one| bytes(&one.next))),
        ("actions", vec![COUNT, 3], all(&|one| one.action.clone())),
        ("rewards", vec![COUNT], all(&|one| vec![reward(one)])),
        ("terminals", vec![COUNT], all(&|one| vec![f32::from(u8::from(one.goal))])),
        ("noise.now", vec![COUNT, SAMPLES, 3], noise.now.clone()),
        ("noise.next", vec![COUNT, SAMPLES, 3], noise.next.clone()),
        ("noise.anywhere", vec![COUNT, SAMPLES, 3], noise.anywhere.clone()),
        ("noise.actor", vec![COUNT, 3], noise.actor.clone()),
    ];
    let data: Vec<Vec<u8>> =
        numbers.iter().map(|(.., values)| values.iter().flat_map(|value| value.to_le_bytes()).collect()).collect();
    let views = numbers
        .iter()
        .zip(&data)
        .map(|((name, shape, _), data)| (*name, TensorView::new(Dtype::F32, shape.clone(), data).unwrap()));
    fs::write(path, serialize(views, None).unwrap()).unwrap();
}

fn numbers(file: &SafeTensors<'_>, name: &str) -> Vec<f32> {
    let data = file.tensor(name).unwrap_or_else(|_| panic!("no {name}"));
    data.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

/// How far apart, by the largest of theirs.
fn apart(own: &[f32], theirs: &[f32]) -> f64 {
    assert_eq!(own.len(), theirs.len());
    let most =
        |values: &mut dyn Iterator<Item = f32>| f64::from(values.fold(0.0_f32, |most, value| most.max(value.abs())));
    most(&mut own.iter().zip(theirs).map(|(own, theirs)| own - theirs)) / most(&mut theirs.iter().copied()).max(1e-12)
}

#[test]
#[ignore = "installs d3rlpy with torch, gigabytes: minutes"]
fn a_step_is_that_of_d3rlpy() {
    let environment = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().join("d3rlpy-venv");
    let python = std::env::var("D3RLPY_PYTHON").map_or_else(|_| environment.join("bin/python"), Into::into);
    let ran = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let pip = ["-m", "pip", "install", "--quiet", "d3rlpy==2.8.1", "safetensors"];
    let ready = ran(Command::new(&python).args(["-c", "import d3rlpy, safetensors"]))
        || (ran(Command::new("python3").args(["-m", "venv"]).arg(&environment))
            && ran(Command::new(&python).args(pip)));
    if !ready {
        eprintln!("skipped: no python3 with venv, or no package index that has d3rlpy");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (shape, settings) = (shape(), Settings { n_action_samples: SAMPLES, ..Settings::default() });
    let networks = Networks::new(shape.clone());
    let mut state = State::first(&networks, &settings, String::new());
    // As if they had followed for a while.
    state.targets.iter_mut().for_each(|value| *value *= 0.9);
    let (batch, noise) = (batch(&shape), Noise::draw(&settings, COUNT, 3, 1));
    state.write(&networks, &folder.path().join("checkpoint.safetensors")).unwrap();
    write_before(&folder.path().join("before.safetensors"), &shape, &settings, &batch, &noise);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("checks/d3rlpy_step.py");
    let output = Command::new(&python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = fs::read(folder.path().join("after.safetensors")).unwrap();
    let after = SafeTensors::deserialize(&bytes).unwrap();

    let report = step(&networks, &settings, &mut state, &batch, &noise);
    let [bellman, _, conservative, alpha, temperature, actor, ..] = report.0.map(|value| value as f32);
    let mut worst = 0.0_f64;
    let mut hold = |name: &str, own: &[f32], theirs: &[f32]| {
        let apart = apart(own, theirs);
        eprintln!("{name:40} {apart:.1e}");
        assert!(apart < 1e-4, "{name}: {own:?} {theirs:?}");
        worst = worst.max(apart);
    };
    let theirs = numbers(&after, "report");
    for (at, (name, own)) in [
        ("Bellman", bellman),
        ("conservative", conservative),
        ("alpha", alpha),
        ("temperature", temperature),
        ("actor", actor),
    ]
    .into_iter()
    .enumerate()
    {
        hold(name, &[own], &theirs[at..=at]);
    }
    for tensor in &networks.policy {
        let name = format!("exp_avg.policy.{}", tensor.name);
        hold(&name, &state.policy.first[tensor.place.clone()], &numbers(&after, &name));
    }
    for tensor in &networks.critics {
        let name = format!("exp_avg.{}", tensor.name);
        hold(&name, &state.critics.first[tensor.place.clone()], &numbers(&after, &name));
        let name = tensor.name.replacen("critic.", "target.", 1);
        hold(&name, &state.targets[tensor.place.clone()], &numbers(&after, &name));
    }
    eprintln!("worst {worst:.1e}");
}
