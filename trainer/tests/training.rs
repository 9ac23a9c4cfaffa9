//! The loop, with a bowl instead of a network: stopped and gone on with, refused, without a finite loss; and lists of trainings.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

use std::fs;
use std::path::Path;

use network::Presence;
use network::constants::{AGENTS, HISTORY, NEIGHBOR_ROW, NEIGHBORS, STATE, STEPS};
use network::weights::Weights;
use trainer::ablation::{self, List};
use trainer::checkpoint::Checkpoint;
use trainer::examples::Examples;
use trainer::metrics::StepRow;
use trainer::settings::Settings;
use trainer::step::{Answer, Ask, Learner, Look, StepError, Terms};
use trainer::training::{CHECKPOINT, Ended, Task, TrainingError, Watch, train};
use trainer::windows::{Sketch, Window};

/// Windows without content, of one scene.
struct Blank {
    scene: &'static str,
    training: Vec<usize>,
    validation: Vec<usize>,
}

impl Blank {
    fn new(scene: &'static str, training: usize, validation: usize) -> Self {
        Self { scene, training: (0..training).collect(), validation: (training..training + validation).collect() }
    }
}

impl Examples for Blank {
    fn len(&self) -> usize {
        self.training.len() + self.validation.len()
    }

    fn get(&self, index: usize) -> anyhow::Result<Window> {
        anyhow::ensure!(index < self.len(), "there is no window {index}");
        let sketch = Sketch {
            ego: [[0.0; STATE]; HISTORY],
            neighbors: [[[0.0; NEIGHBOR_ROW]; HISTORY]; NEIGHBORS],
            presence: Presence::default(),
            lane_points: Vec::new(),
            lanes: Vec::new(),
            crosswalk_points: Vec::new(),
            crosswalks: Vec::new(),
        };
        Ok(Window {
            scene: self.scene.to_owned(),
            step: 10 * index as u32,
            av: 1,
            sketch,
            line: Vec::new(),
            future: Box::new([[[0.0; 5]; STEPS]; AGENTS]),
            seen: Box::new([[false; STEPS]; AGENTS]),
        })
    }

    fn features(&self) -> network::features::Settings {
        network::features::Settings::Mended
    }

    fn training(&self) -> &[usize] {
        &self.training
    }

    fn validation(&self) -> &[usize] {
        &self.validation
    }

    fn digest(&self) -> String {
        format!("{}-{}", self.scene, self.len())
    }
}

/// A bowl over the first sixteen numbers of the first tensor, with a bottom that each window pulls to itself, and a dropout.
#[derive(Default)]
struct Bowl {
    asked: u64,
    /// What happens when so many questions were asked.
    then: Option<(u64, Accident)>,
}

#[derive(Clone, Copy)]
enum Accident {
    /// As if the program were killed: the error comes before anything is written.
    Killed,
    NanLoss,
    NanGradient,
}

impl Learner for Bowl {
    fn step(&mut self, ask: &Ask<'_>) -> Result<Answer, StepError> {
        self.asked += 1;
        let accident = self.then.filter(|(when, _)| *when == self.asked).map(|(_, what)| what);
        if let Some(Accident::Killed) = accident {
            let first = &ask.windows[0];
            return Err(StepError::NotFinite { scene: first.scene.clone(), step: first.step, what: "plan" });
        }
        let values = ask.parameters.values();
        let mut gradient = if ask.wants_gradient { vec![0.0; values.len()] } else { Vec::new() };
        let mut total = 0.0;
        for window in ask.windows {
            for index in 0..16 {
                let error = values[index] - (window.step as f32 / 100.0 + index as f32);
                total += f64::from(error * error) / ask.windows.len() as f64;
                let dropped = ask.dropout.is_some_and(|seed| (seed >> index) & 1 == 1);
                if ask.wants_gradient && !dropped {
                    gradient[index] += 2.0 * error / ask.windows.len() as f32;
                }
            }
        }
        match accident {
            Some(Accident::NanLoss) => total = f64::NAN,
            Some(Accident::NanGradient) => gradient[3] = f32::NAN,
            _ => {}
        }
        let tensors = if ask.wants_gradient { trainer::parameters::tensors(ask.parameters.variant()).len() } else { 0 };
        let has_gradient = (0..tensors).map(|index| index == 0).collect();
        let terms = Terms { total, plan: f64::from(u8::from(ask.planning)), ..Terms::default() };
        let look = |window: &Window| Look {
            plan: std::array::from_fn(|t| [f64::from(values[0]) + t as f64, f64::from(window.step)]),
            predictions: Some(Box::new([[[f64::from(values[1]), 0.0]; STEPS]; NEIGHBORS])),
        };
        let looks = if ask.wants_looks { ask.windows.iter().map(look).collect() } else { Vec::new() };
        Ok(Answer { gradient, has_gradient, terms, looks })
    }
}

/// Presses Ctrl-C after a step.
struct Hand(Option<u64>, u64);

impl Watch for Hand {
    fn step(&mut self, row: &StepRow) {
        self.1 = row.step;
    }

    fn stop(&self) -> bool {
        self.0.is_some_and(|step| self.1 >= step)
    }
}

/// 3 epochs of 4 batches, the last of one window, with a planner from the second on where there is one.
fn settings(changes: &[&str]) -> Settings {
    let usual = ["mode=il", "epochs=3", "batch=3", "learning_rate=0.1", "halve_every=1", "epochs_without_planner=1"];
    let all: Vec<String> = usual.iter().chain(changes).map(ToString::to_string).collect();
    Settings::read("", &all).unwrap()
}

fn examples() -> Blank {
    Blank::new("one", 10, 3)
}

fn go(folder: &Path, settings: &Settings, bowl: &mut Bowl, stop: Option<u64>) -> Result<Ended, TrainingError> {
    go_and_draw(folder, settings, bowl, stop, false)
}

fn go_and_draw(
    folder: &Path,
    settings: &Settings,
    bowl: &mut Bowl,
    stop: Option<u64>,
    rerun: bool,
) -> Result<Ended, TrainingError> {
    let task = Task { settings, examples: &examples(), folder, resume: true, rerun };
    train(task, bowl, &mut Hand(stop, 0))
}

/// What must not depend on interruptions: all files, without how long it took.
fn left(folder: &Path) -> Vec<Vec<u8>> {
    let timeless = |name: &str| {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        // The first column of metrics.csv is the folder's name, the last of both is time.
        let run = folder.file_name().unwrap().to_str().unwrap();
        let cut = |line: &str| line.rsplit_once(',').unwrap().0.trim_start_matches(run).to_owned();
        text.lines().map(cut).collect::<Vec<_>>().join("\n").into_bytes()
    };
    let bytes = |name: &str| fs::read(folder.join(name)).unwrap();
    vec![
        bytes("weights.safetensors"),
        bytes("weights.f16.safetensors"),
        bytes(CHECKPOINT),
        timeless("metrics.csv"),
        timeless("steps.csv"),
    ]
}

#[test]
fn it_learns_and_leaves_what_it_learned() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(&["epochs=6", "learning_rate=0.5", "dropout=0"]);
    let task = Task {
        settings: &settings,
        examples: &Blank::new("one", 100, 5),
        folder: folder.path(),
        resume: false,
        rerun: false,
    };
    assert_eq!(train(task, &mut Bowl::default(), &mut Hand(None, 0)).unwrap(), Ended::Finished);
    let weights = Weights::read(&fs::read(folder.path().join("weights.safetensors")).unwrap()).unwrap();
    let (_, _, values) = weights.tensors().next().unwrap();
    // In the middle of what the windows of training pull to.
    let middle = (0..100).map(|window| 0.1 * window as f32).sum::<f32>() / 100.0;
    for (index, value) in values[..16].iter().enumerate() {
        assert!((value - middle - index as f32).abs() < 0.3, "{index}: {value}, {middle}");
    }
    let metrics = fs::read_to_string(folder.path().join("metrics.csv")).unwrap();
    assert_eq!(metrics.lines().count(), 7);
    let settings_there = fs::read_to_string(folder.path().join("settings.toml")).unwrap();
    assert_eq!(Settings::read(&settings_there, &[]).unwrap(), settings);
}

#[test]
fn wherever_it_is_stopped_or_killed_it_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for change in ["checkpoint_every=0", "checkpoint_every=3"] {
        let settings = settings(&[change]);
        let straight = folder.path().join(format!("straight-{}", settings.checkpoint_every));
        go(&straight, &settings, &mut Bowl::default(), None).unwrap();
        let wanted = left(&straight);
        assert_eq!(wanted[4].split(|byte| *byte == b'\n').count(), 13);
        // Stopped after steps 1, 4 (the end of an epoch), 6 and 12 (the end of all, before validation).
        let stopped = folder.path().join(format!("stopped-{}", settings.checkpoint_every));
        for step in [1, 4, 6, 12] {
            assert_eq!(go(&stopped, &settings, &mut Bowl::default(), Some(step)).unwrap(), Ended::Stopped);
        }
        assert_eq!(go(&stopped, &settings, &mut Bowl::default(), None).unwrap(), Ended::Finished);
        assert!(left(&stopped) == wanted, "stopped");
        // Killed in the second step, and so on: questions count validation too.
        let killed = folder.path().join(format!("killed-{}", settings.checkpoint_every));
        for question in [2, 8, 3, 5, 4] {
            let mut bowl = Bowl { then: Some((question, Accident::Killed)), ..Bowl::default() };
            go(&killed, &settings, &mut bowl, None).unwrap_err();
        }
        go(&killed, &settings, &mut Bowl::default(), None).unwrap();
        assert!(left(&killed) == wanted, "killed");
    }
}

#[test]
fn a_checkpoint_of_other_settings_or_windows_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let usual = settings(&[]);
    go(folder.path(), &usual, &mut Bowl::default(), Some(2)).unwrap();
    let told = |settings: &Settings, examples: &dyn Examples, resume| {
        let task = Task { settings, examples, folder: folder.path(), resume, rerun: false };
        train(task, &mut Bowl::default(), &mut Hand(None, 0)).unwrap_err().to_string()
    };
    assert!(told(&usual, &examples(), false).contains("--resume"));
    let other = told(&settings(&["clip=1", "seed=7"]), &examples(), true);
    assert!(other.contains("clip is 1.0 here and 5.0 there; seed is 7 here and 42 there"), "{other}");
    let windows = told(&usual, &Blank::new("one", 7, 1), true);
    assert!(windows.contains("the windows are one-8 here and "), "{windows}");
    assert!(told(&usual, &Blank::new("one", 0, 8), true).starts_with("there are no windows to train on, of 8"));
    // More epochs go on.
    assert_eq!(go(folder.path(), &settings(&["epochs=4"]), &mut Bowl::default(), None).unwrap(), Ended::Finished);
    assert_eq!(Checkpoint::read(&folder.path().join(CHECKPOINT)).unwrap().step, 16);
}

#[test]
fn without_a_finite_loss_or_gradient_it_stops_and_the_checkpoint_stays() {
    let folder = tempfile::tempdir().unwrap();
    let usual = settings(&[]);
    go(folder.path(), &usual, &mut Bowl::default(), Some(5)).unwrap();
    let before = fs::read(folder.path().join(CHECKPOINT)).unwrap();
    for (accident, what) in [(Accident::NanLoss, "the loss"), (Accident::NanGradient, "the gradient")] {
        let mut bowl = Bowl { then: Some((2, accident)), ..Bowl::default() };
        let error = go(folder.path(), &usual, &mut bowl, None).unwrap_err();
        let TrainingError::NotFinite { step: 7, epoch: 2, what: told, windows } = &error else { panic!("{error}") };
        assert_eq!(*told, what);
        assert!(windows.split(' ').count() == 3 && windows.contains('@'), "{windows}");
    }
    let mut bowl = Bowl { then: Some((1, Accident::Killed)), ..Bowl::default() };
    let error = go(folder.path(), &usual, &mut bowl, None).unwrap_err().to_string();
    assert!(error.starts_with("step 6 (epoch 2): the window at step "), "{error}");
    assert_eq!(fs::read(folder.path().join(CHECKPOINT)).unwrap(), before);
}

#[test]
fn two_do_not_train_in_one_folder() {
    struct Second<'a>(&'a Path, Option<String>);
    impl Watch for Second<'_> {
        fn step(&mut self, _: &StepRow) {
            let second = go(self.0, &settings(&[]), &mut Bowl::default(), None);
            self.1 = second.err().map(|error| error.to_string());
        }
        fn stop(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let (examples, usual) = (examples(), settings(&[]));
    let mut watch = Second(folder.path(), None);
    let task = Task { settings: &usual, examples: &examples, folder: folder.path(), resume: false, rerun: false };
    train(task, &mut Bowl::default(), &mut watch).unwrap();
    assert!(watch.1.unwrap().starts_with("somebody else trains in"));
}

#[test]
fn a_list_is_trained_and_goes_on_where_it_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let runs = ablation::read(
        "base = { mode = \"il\", batch = 5, epochs = 1 }\n[[run]]\nname = \"a\"\n[[run]]\nname = \"b\"\nsettings = { epochs = 2 }",
    )
    .unwrap();
    let made = std::cell::Cell::new(0);
    let go = |stop, then: Option<(u64, Accident)>| {
        let learner = |_: &Settings| -> anyhow::Result<Box<dyn Learner>> {
            made.set(made.get() + 1);
            Ok(Box::new(Bowl { then: then.filter(|_| made.get() % 2 == 0), ..Bowl::default() }))
        };
        let list = List { runs: &runs, folder: folder.path(), writes_tables: true, rerun: false };
        ablation::run(&list, &examples(), &learner, &mut Hand(stop, 0)).unwrap()
    };
    // Two steps an epoch.
    assert_eq!(go(Some(3), None), None);
    let failed = go(None, Some((1, Accident::NanLoss))).unwrap();
    assert!(failed[0].failure.is_none() && failed[1].failure.as_ref().unwrap().contains("the loss is not finite"));
    let done = go(None, None).unwrap();
    assert!(done.iter().all(|outcome| outcome.failure.is_none()));
    let table = fs::read_to_string(folder.path().join("ablation.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!([&rows[0][..3], &rows[1][..3]], [["a", "42", "1"], ["b", "42", "2"]]);
    assert!(rows.iter().all(|row| row[3].parse::<f64>().unwrap() > 0.0));
    assert_eq!(fs::read_to_string(folder.path().join("ablation.md")).unwrap(), ablation::markdown(&done));
    assert_eq!(fs::read_to_string(folder.path().join("b/steps.csv")).unwrap().lines().count(), 5);
}

#[test]
fn shares_of_a_list_are_trained_apart_and_the_whole_list_then_has_a_table_and_trains_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let text = "base = { mode = \"il\", batch = 5, epochs = 1 }\n[[run]]\nname = \"a\"\n[[run]]\nname = \"b\"";
    let runs = ablation::read(text).unwrap();
    let learner = |_: &Settings| -> anyhow::Result<Box<dyn Learner>> { Ok(Box::new(Bowl::default())) };
    let train = |runs: &[ablation::Run], writes_tables, most| {
        let list = List { runs, folder: folder.path(), writes_tables, rerun: false };
        ablation::run(&list, &examples(), &learner, &mut Hand(most, 0)).unwrap()
    };
    for share in [&runs[1..], &runs[..1]] {
        assert!(train(share, false, None).is_some());
    }
    assert!(!folder.path().join("ablation.csv").exists() && folder.path().join("b/weights.safetensors").exists());
    // Somebody who stops it at the first step finds no step to stop at.
    let whole = train(&runs, true, Some(0)).unwrap();
    assert_eq!(whole.len(), 2);
    assert_eq!(fs::read_to_string(folder.path().join("ablation.md")).unwrap(), ablation::markdown(&whole));
}

/// What a drawing holds: entities by how many rows they have beside what always holds.
#[cfg(feature = "rerun")]
fn drawn(folder: &Path) -> (String, std::collections::BTreeMap<String, usize>) {
    use re_log_encoding::DecoderApp;
    use re_log_types::{LogMsg, StoreKind};
    let bytes = fs::read(folder.join("training.rrd")).unwrap();
    let mut rows = std::collections::BTreeMap::new();
    let mut id = String::new();
    for message in DecoderApp::decode_lazy(std::io::Cursor::new(bytes)).map(Result::unwrap) {
        let LogMsg::ArrowMsg(store, chunk) = message else { continue };
        if store.kind() == StoreKind::Recording {
            id = store.recording_id().to_string();
            let chunk = re_chunk::Chunk::from_arrow_msg(&chunk).unwrap();
            let moving = if chunk.is_static() { 0 } else { chunk.num_rows() };
            *rows.entry(chunk.entity_path().to_string()).or_default() += moving;
        }
    }
    (id, rows)
}

#[cfg(feature = "rerun")]
#[test]
fn a_drawing_changes_no_weight_and_has_every_epoch() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, drawing] = ["a", "b"].map(|parent| folder.path().join(parent).join("t"));
    let usual = settings(&["mode=dipp"]);
    go(&plain, &usual, &mut Bowl::default(), None).unwrap();
    go_and_draw(&drawing, &usual, &mut Bowl::default(), None, true).unwrap();
    assert!(left(&plain) == left(&drawing));
    assert!(!plain.join("training.rrd").exists());
    let (id, rows) = drawn(&drawing);
    assert!(id.starts_with("t."), "{id}");
    // Three epochs, one of them without the planner, of four steps; three windows to validate with.
    let expected = [
        ("/loss/total/training", 3),
        ("/loss/total/validation", 3),
        ("/loss/terms/plan/validation", 2),
        ("/errors/planner/ade/training", 3),
        ("/cost_weights/safety", 3),
        ("/learning_rate", 3),
        ("/steps/loss", 12),
        ("/steps/gradient_norm", 12),
        ("/windows/1/av/plan", 3),
        ("/windows/3/neighbors/now", 0),
        ("/settings", 0),
    ];
    for (entity, count) in expected {
        assert_eq!(rows.get(entity), Some(&count), "{entity} of {rows:#?}");
    }
    assert!(!rows.keys().any(|entity| entity.starts_with("/windows/4")));
}

#[cfg(feature = "rerun")]
#[test]
fn a_drawing_is_the_same_wherever_the_training_was_stopped_or_killed() {
    let folder = tempfile::tempdir().unwrap();
    let usual = settings(&["checkpoint_every=3"]);
    let of = |parent: &str| folder.path().join(parent).join("t");
    let bytes = |folder: &Path| fs::read(folder.join("training.rrd")).unwrap();
    go_and_draw(&of("straight"), &usual, &mut Bowl::default(), None, true).unwrap();
    for step in [1, 4, 6, 12] {
        go_and_draw(&of("stopped"), &usual, &mut Bowl::default(), Some(step), true).unwrap();
    }
    go_and_draw(&of("stopped"), &usual, &mut Bowl::default(), None, true).unwrap();
    assert!(bytes(&of("stopped")) == bytes(&of("straight")));
    // At steps and validations; checkpoints are after steps 3, 4, 6, 8, 9 and 12.
    for question in [2, 5, 5, 5, 6] {
        let mut bowl = Bowl { then: Some((question, Accident::Killed)), ..Bowl::default() };
        go_and_draw(&of("killed"), &usual, &mut bowl, None, true).unwrap_err();
    }
    go_and_draw(&of("killed"), &usual, &mut Bowl::default(), None, true).unwrap();
    assert!(bytes(&of("killed")) == bytes(&of("straight")));
    // Killed between the drawing of an epoch and its checkpoint.
    let short = settings(&["checkpoint_every=3", "epochs=1"]);
    go_and_draw(&of("ahead"), &short, &mut Bowl::default(), None, true).unwrap();
    fs::copy(of("straight").join("training.rrd"), of("ahead").join("training.rrd")).unwrap();
    go_and_draw(&of("ahead"), &usual, &mut Bowl::default(), None, true).unwrap();
    assert!(bytes(&of("ahead")) == bytes(&of("straight")));
}

#[cfg(feature = "rerun")]
#[test]
fn a_finished_training_can_still_be_drawn_and_a_damaged_drawing_stops_none() {
    let folder = tempfile::tempdir().unwrap();
    let usual = settings(&["epochs=1"]);
    go(folder.path(), &usual, &mut Bowl::default(), None).unwrap();
    go_and_draw(folder.path(), &usual, &mut Bowl::default(), None, true).unwrap();
    assert_eq!(drawn(folder.path()).1["/loss/total/validation"], 1);
    fs::write(folder.path().join("training.rrd"), b"RRF2 or not").unwrap();
    go_and_draw(folder.path(), &settings(&["epochs=2"]), &mut Bowl::default(), None, true).unwrap();
    let rows = drawn(folder.path()).1;
    assert_eq!((rows["/loss/total/validation"], rows["/windows/1/av/plan"]), (2, 1));
}
