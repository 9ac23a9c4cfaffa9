//! Whether all that is learned can be learned: a few windows by heart. `cargo test --release -p trainer --test overfitting -- --ignored`
#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "a test may panic, and says what came out")]

use network::features::Settings as Features;
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

    fn features(&self) -> Features {
        Features::Mended
    }

    fn digest(&self) -> String {
        "a few generated windows".to_owned()
    }
}

struct Tell;

impl Watch for Tell {
    fn epoch(&mut self, row: &trainer::metrics::EpochRow) {
        let Some((terms, _)) = row.train.means().filter(|_| row.epoch.is_multiple_of(50)) else { return };
        eprintln!("epoch {}: loss {:.3}, planner ADE {:.3} m", row.epoch, terms.total, terms.planner_ade);
    }
}

/// Whole batches: what one window gains in a step must not be another's loss.
#[test]
#[ignore = "takes a quarter of an hour"]
fn sixty_four_windows_are_learned_by_heart() {
    let few = Few::new();
    assert_eq!(few.len(), WINDOWS);
    let text = "dropout = 0\nbatch = 64\nepochs = 1500\nepochs_without_planner = 1000\nhalve_every = 250\n\
        learning_rate = 1e-3\ncost = { kind = 'exp', start = 'hand-tuned' }";
    let settings = Settings::read(text, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut learner = Reckoner::new(&settings).unwrap();
    let task = Task { settings: &settings, examples: &few, folder: folder.path(), resume: false, rerun: false };
    assert_eq!(train(task, &mut learner, &mut Tell).unwrap(), Ended::Finished);
    let parameters = Checkpoint::read(&folder.path().join(CHECKPOINT)).unwrap().parameters;
    let terms = learner.step(&Ask::without_gradient(&few.windows, &parameters, true)).unwrap().terms;
    eprintln!("planner ADE {:.3} m, predictor ADE {:.3} m", terms.planner_ade, terms.predictor_ade);
    assert!(terms.planner_ade < 0.3, "the planner's ADE is {} m", terms.planner_ade);
}
