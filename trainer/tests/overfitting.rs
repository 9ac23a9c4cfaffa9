//! Whether everything that is learned can be learned: a few windows by heart. `cargo test --release -p trainer --test overfitting -- --ignored`
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "a test may panic, and says what came out")]

use scenarios::generated::{Family, Parameters};
use trainer::checkpoint::Checkpoint;
use trainer::examples::Examples;
use trainer::learner::Reckoner;
use trainer::settings::Settings;
use trainer::step::{Ask, Learner};
use trainer::training::{CHECKPOINT, Ended, Task, Watch, train};
use trainer::windows::{Recipe, Whose, Window, cut};

const WINDOWS: usize = 64;
const FAMILIES: [&str; 8] =
    ["cruise", "curve", "following", "red-light", "left-turn", "right-turn", "roundabout", "parked-cars"];

/// All to learn from, none to validate with.
struct Few {
    windows: Vec<Window>,
    all: Vec<usize>,
}

impl Few {
    fn new() -> Self {
        let recipe = Recipe { features: Whose::Mended, stride: 15, others: false };
        let of = |name: &&str| {
            let payload = Family::named(name).unwrap().payload(name, 1, 0, &Parameters::default()).unwrap();
            let scene = scenarios::womd::read(&payload).unwrap().0;
            cut(&scene, &recipe).windows.into_iter().take(WINDOWS / FAMILIES.len())
        };
        let windows: Vec<Window> = FAMILIES.iter().flat_map(of).collect();
        Self { all: (0..windows.len()).collect(), windows }
    }
}

impl Examples for Few {
    fn len(&self) -> usize {
        self.windows.len()
    }

    fn get(&self, index: usize) -> anyhow::Result<Window> {
        Ok(self.windows[index].clone())
    }

    fn training(&self) -> &[usize] {
        &self.all
    }

    fn validation(&self) -> &[usize] {
        &[]
    }

    fn digest(&self) -> String {
        "a few generated windows".to_owned()
    }
}

struct Nobody;

impl Watch for Nobody {}

#[test]
#[ignore = "takes minutes"]
fn sixty_four_windows_are_learned_by_heart() {
    let few = Few::new();
    assert_eq!(few.len(), WINDOWS);
    let text = "dropout = 0\nbatch = 8\nepochs = 160\nepochs_without_planner = 110\nhalve_every = 40\nlearning_rate = 5e-4\n\
        cost = { kind = 'exp', start = 'hand-tuned' }";
    let settings = Settings::read(text, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut learner = Reckoner::new(&settings).unwrap();
    let task = Task { settings: &settings, examples: &few, folder: folder.path(), resume: false, rerun: false };
    assert_eq!(train(task, &mut learner, &mut Nobody).unwrap(), Ended::Finished);
    let parameters = Checkpoint::read(&folder.path().join(CHECKPOINT)).unwrap().parameters;
    let ask = Ask::without_gradient(&few.windows, &parameters, true);
    let terms = learner.step(&ask).unwrap().terms;
    eprintln!("planner ADE {:.3} m, predictor ADE {:.3} m", terms.planner_ade, terms.predictor_ade);
    assert!(terms.planner_ade < 0.3, "the planner's ADE is {} m", terms.planner_ade);
}
