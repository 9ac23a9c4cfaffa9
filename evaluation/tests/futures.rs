//! The network with the log's futures: what a failure's drive is asked with to see whether prediction is to blame.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use episode::Episode;
use episode::protocol::Protocol;
use predictor_node::{Network, Oracle};
use scenarios::SceneSet;
use wire::node::{History, PredictorFactory, StepInput};

/// The oracle of the built-in scenes.
fn log_of_the_demo() -> Oracle {
    Oracle(std::sync::Arc::new(scenarios::SceneSet::open(&[]).unwrap()))
}

#[test]
fn the_network_with_the_logs_futures_keeps_where_its_plan_begins_and_what_it_costs() {
    let (scene, _) = SceneSet::open(&[]).unwrap().load(0).unwrap();
    let episode = Episode::new(scene, &Protocol::default()).unwrap();
    let (briefing, observation) = (episode.briefing(), episode.observe());
    let mut history = History::new(&briefing);
    history.push(&observation);
    let input = StepInput { briefing: &briefing, observation: &observation, history: &history, prediction: None };
    let ask = |factory: &dyn PredictorFactory| factory.start(&briefing).unwrap().predict(&input).unwrap();
    let network = || Network::open(None, None).unwrap();
    let (own, log) = (ask(&network()), ask(&log_of_the_demo()));
    let both = ask(&network().with_futures(log_of_the_demo()));
    assert_eq!((both.futures.len(), &both.futures), (1, &log.futures));
    assert_ne!(own.futures, log.futures);
    assert_eq!((both.initial_controls, both.cost_weights), (own.initial_controls, own.cost_weights));
}
