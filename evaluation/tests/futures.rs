//! The network with the log's futures: what a failure's drive is asked with to see whether prediction is to blame.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use episode::Episode;
use episode::protocol::Protocol;
use predictor_node::{Network, Oracle};
use scenarios::SceneSet;
use wire::node::{History, PredictorFactory, StepInput};
use world::plan::UncheckedPrediction;

/// What `factory` predicts at the first step of the first built-in scene.
fn asked(factory: &dyn PredictorFactory) -> UncheckedPrediction {
    let (scene, _) = SceneSet::open(&[]).unwrap().load(0).unwrap();
    let episode = Episode::new(scene, &Protocol::default()).unwrap();
    let (briefing, observation) = (episode.briefing(), episode.observe());
    let mut history = History::new(&briefing);
    history.push(&observation);
    let input = StepInput { briefing: &briefing, observation: &observation, history: &history, prediction: None };
    factory.start(&briefing).unwrap().predict(&input).unwrap()
}

/// The oracle of the built-in scenes.
fn log_of_the_demo() -> Oracle {
    Oracle(std::sync::Arc::new(scenarios::SceneSet::open(&[]).unwrap()))
}

#[test]
fn the_network_with_the_logs_futures_keeps_where_its_plan_begins_and_what_it_costs() {
    let network = || Network::open(None, None).unwrap();
    let (own, log) = (asked(&network()), asked(&log_of_the_demo()));
    let both = asked(&network().with_futures(log_of_the_demo()));
    assert_eq!((both.futures.len(), &both.futures), (1, &log.futures));
    assert_ne!(own.futures, log.futures);
    // What the network would do in its own futures says nothing of the log's.
    assert!(both.futures[0].controls.is_empty());
    assert_eq!((both.initial_controls, both.cost_weights), (own.initial_controls, own.cost_weights));
}

#[test]
fn each_future_of_the_network_says_what_the_av_does_in_it_and_the_likeliest_is_where_a_plan_begins() {
    let told = asked(&Network::open(None, None).unwrap()).check(0).unwrap();
    let controls: Vec<_> = told.futures().iter().map(|future| &future.controls).collect();
    assert_eq!(controls.len(), 3);
    assert!(controls[0] != controls[1] && controls[1] != controls[2] && controls[2] != controls[0]);
    let likeliest = told.most_likely().unwrap();
    assert_eq!(told.initial_controls(), Some(&likeliest.controls[..]));
}
