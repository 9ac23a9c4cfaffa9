//! Whole runs, played with scripted failures: no process, no bus, no clock.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use proptest::prelude::*;

use super::core::{Core, Drive, Effects, Ending, Event, TRIES};

/// What the script says of the next thing of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Well,
    Fails,
    /// Fails while the program stands still.
    IsSpoiled,
}

/// A world that does at once, or fails to do, what it is asked.
#[derive(Default)]
struct Script {
    /// Events that come of what was asked, oldest first.
    events: VecDeque<Event>,
    nodes: VecDeque<Fate>,
    drives: VecDeque<Fate>,
    recorders: VecDeque<Fate>,
    /// By scene: how often it was driven, and whether a recorder listened.
    driven: BTreeMap<usize, Vec<bool>>,
    ready: BTreeSet<usize>,
    /// Scenes made ready that nobody drives yet, and how many there were at most.
    ahead: BTreeSet<usize>,
    most_ahead: usize,
    recorder_ready: bool,
    warnings: Vec<String>,
    halted: usize,
}

impl Script {
    fn next(fates: &mut VecDeque<Fate>) -> Fate {
        fates.pop_front().unwrap_or(Fate::Well)
    }

    fn play(&mut self, core: &mut Core) -> Ending {
        core.start(self);
        for _ in 0..10_000 {
            if let Some(ending) = core.ending() {
                return ending.clone();
            }
            let event = self.events.pop_front().expect("the run waits, and nothing is under way");
            core.on(event, self);
        }
        panic!("the run does not end");
    }
}

impl Effects for Script {
    fn start_recorder(&mut self) {
        match Self::next(&mut self.recorders) {
            Fate::Well => {
                self.recorder_ready = true;
                self.events.push_back(Event::RecorderReady);
            }
            _ => self.events.push_back(Event::RecorderLost("no recorder".to_owned())),
        }
    }

    fn start_nodes(&mut self, worker: usize) {
        match Self::next(&mut self.nodes) {
            Fate::Well => {
                self.ready.insert(worker);
                self.events.push_back(Event::NodesReady(worker));
            }
            _ => self.events.push_back(Event::NodesLost(worker, "no nodes".to_owned())),
        }
    }

    fn prepare(&mut self, scene: usize) {
        self.ahead.insert(scene);
        self.most_ahead = self.most_ahead.max(self.ahead.len());
    }

    fn drive(&mut self, worker: usize, Drive { scene, recorder, repeatable }: Drive) {
        self.ahead.remove(&scene);
        assert!(self.ready.contains(&worker), "worker {worker} drives without nodes");
        self.driven.entry(scene).or_default().push(recorder.is_some());
        let fate = Self::next(&mut self.drives);
        let driver_failed = fate != Fate::Well;
        if driver_failed {
            self.ready.remove(&worker);
        }
        if fate == Fate::IsSpoiled && repeatable {
            return self.events.push_back(Event::Disturbed { worker, scene, missed: None });
        }
        self.events.push_back(Event::Driven { worker, driver_failed, recorded: recorder.is_some(), missed: None });
    }

    fn warn(&mut self, text: &str) {
        self.warnings.push(text.to_owned());
    }

    fn halt(&mut self, _: &Ending) {
        self.halted += 1;
    }
}

fn fails(times: usize) -> VecDeque<Fate> {
    vec![Fate::Fails; times].into()
}

fn all_once(script: &Script, scenes: usize) -> bool {
    (0..scenes).all(|scene| script.driven.get(&scene).is_some_and(|drives| drives.len() == 1))
}

#[test]
fn every_scene_is_driven_once() {
    let mut script = Script::default();
    assert_eq!(script.play(&mut Core::new((0..7).collect(), 3, true)), Ending::Complete);
    assert!(all_once(&script, 7));
    assert!(script.driven.values().flatten().all(|recorded| *recorded));
    assert_eq!(script.halted, 1);
    assert!((3..=4).contains(&script.most_ahead) && script.ahead.is_empty());
}

#[test]
fn a_run_without_scenes_is_complete_and_starts_nothing() {
    let mut script = Script::default();
    assert_eq!(script.play(&mut Core::new(Vec::new(), 4, true)), Ending::Complete);
    assert!(!script.recorder_ready && script.ready.is_empty());
}

#[test]
fn no_episode_begins_before_the_recorder_listens() {
    let mut script = Script::default();
    let mut core = Core::new(vec![0, 1], 2, true);
    core.start(&mut script);
    core.on(Event::NodesReady(0), &mut script);
    core.on(Event::NodesReady(1), &mut script);
    assert!(script.driven.is_empty());
    core.on(Event::RecorderReady, &mut script);
    assert_eq!(script.driven.len(), 2);
}

#[test]
fn nodes_that_failed_are_started_again_before_the_next_scene() {
    let mut script = Script { drives: fails(3), ..Script::default() };
    assert_eq!(script.play(&mut Core::new((0..5).collect(), 1, false)), Ending::Complete);
    assert!(all_once(&script, 5), "{:?}", script.driven);
}

#[test]
fn an_episode_that_a_pause_spoiled_is_driven_again_but_not_for_ever() {
    let spoiled = |times: usize| vec![Fate::IsSpoiled; times].into();
    let mut script = Script { drives: spoiled(2), ..Script::default() };
    assert_eq!(script.play(&mut Core::new(vec![0, 1], 1, true)), Ending::Complete);
    assert_eq!((script.driven[&0].len(), script.driven[&1].len()), (3, 1));
    let mut script = Script { drives: spoiled(100), ..Script::default() };
    assert_eq!(script.play(&mut Core::new(vec![0, 1], 1, true)), Ending::Complete);
    assert_eq!((script.driven[&0].len(), script.driven[&1].len()), (6, 6));
}

#[test]
fn nodes_that_never_start_end_the_run_at_once() {
    let mut script = Script { nodes: fails(1), ..Script::default() };
    let ending = script.play(&mut Core::new((0..5).collect(), 2, false));
    assert_eq!(ending, Ending::Broken("no nodes".to_owned()));
    assert!(script.driven.len() < 2);
}

#[test]
fn nodes_that_do_not_start_again_are_given_up_after_some_tries() {
    let nodes = std::iter::once(Fate::Well).chain(fails(TRIES as usize)).collect();
    let mut script = Script { nodes, drives: fails(1), ..Script::default() };
    assert_eq!(script.play(&mut Core::new((0..5).collect(), 1, false)), Ending::Broken("no nodes".to_owned()));
    assert_eq!(script.driven.len(), 1);
}

#[test]
fn one_worker_without_nodes_leaves_its_scenes_to_the_others() {
    let nodes = [Fate::Well; 2].into_iter().chain(fails(TRIES as usize)).collect();
    let mut script = Script { nodes, drives: fails(1), ..Script::default() };
    assert_eq!(script.play(&mut Core::new((0..9).collect(), 2, false)), Ending::Complete);
    assert!(all_once(&script, 9));
    assert_eq!(script.warnings.len(), 1);
}

#[test]
fn a_lost_recorder_is_started_again_and_then_gone_without() {
    let mut script = Script::default();
    let mut core = Core::new((0..3).collect(), 1, true);
    core.start(&mut script);
    core.on(Event::RecorderReady, &mut script);
    core.on(Event::NodesReady(0), &mut script);
    script.recorders = fails(TRIES as usize);
    script.events = [Event::RecorderLost("killed".to_owned())].into();
    script.events.push_back(Event::Driven { worker: 0, driver_failed: false, recorded: false, missed: None });
    while core.ending().is_none() {
        let event = script.events.pop_front().unwrap();
        core.on(event, &mut script);
    }
    assert_eq!(core.ending(), Some(&Ending::Complete));
    assert!(all_once(&script, 3));
    assert_eq!(script.driven[&2], [false], "the last scene has no recorder");
    assert!(script.warnings.last().unwrap().contains("without recordings"), "{:?}", script.warnings);
}

#[test]
fn a_recorder_that_one_episode_missed_costs_no_other_its_recording() {
    let mut script = Script::default();
    let mut core = Core::new((0..4).collect(), 1, true);
    core.start(&mut script);
    core.on(Event::RecorderReady, &mut script);
    core.on(Event::NodesReady(0), &mut script);
    let missed = |number| Event::Driven { worker: 0, driver_failed: false, recorded: false, missed: Some(number) };
    core.on(missed(0), &mut script);
    assert_eq!(script.driven.len(), 1, "nothing begins before its loss is told");
    core.on(Event::RecorderLost("killed".to_owned()), &mut script);
    core.on(Event::RecorderReady, &mut script);
    assert_eq!(script.driven.len(), 2);
    // That it was missed may be told late: another has taken its place.
    core.on(missed(0), &mut script);
    assert_eq!(script.driven.len(), 3);
    assert!(script.driven.values().flatten().all(|recorded| *recorded));
}

#[test]
fn an_episode_that_a_pause_spoiled_waits_for_the_recorder_that_it_missed() {
    let mut script = Script::default();
    let mut core = Core::new(vec![0], 1, true);
    core.start(&mut script);
    core.on(Event::RecorderReady, &mut script);
    core.on(Event::NodesReady(0), &mut script);
    core.on(Event::Disturbed { worker: 0, scene: 0, missed: Some(0) }, &mut script);
    core.on(Event::NodesReady(0), &mut script);
    assert_eq!(script.driven[&0].len(), 1, "nothing begins before its loss is told");
    core.on(Event::RecorderLost("killed".to_owned()), &mut script);
    core.on(Event::RecorderReady, &mut script);
    assert_eq!(script.driven[&0], [true, true]);
}

#[test]
fn an_interrupted_run_begins_nothing_more() {
    for interrupt_after in 0..8 {
        let mut script = Script::default();
        let mut core = Core::new((0..5).collect(), 2, true);
        core.start(&mut script);
        for _ in 0..interrupt_after {
            let Some(event) = script.events.pop_front() else { break };
            core.on(event, &mut script);
        }
        if core.ending().is_some() {
            continue;
        }
        core.on(Event::Interrupted, &mut script);
        let driven = script.driven.len();
        while let Some(event) = script.events.pop_front() {
            core.on(event, &mut script);
        }
        assert_eq!(core.ending(), Some(&Ending::Interrupted));
        assert_eq!((script.driven.len(), script.halted), (driven, 1));
    }
}

proptest! {
    /// Whatever fails, and in whatever order: the run ends, no scene is driven twice, and a complete run drove all of them.
    #[test]
    fn every_run_ends_and_drives_no_scene_twice(
        scenes in 0_usize..12,
        workers in 1_usize..5,
        record: bool,
        fates in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.4), 0..12), 3),
        order in prop::collection::vec(0_usize..6, 0..60),
    ) {
        let queue = |flags: &Vec<bool>| flags.iter().map(|f| if *f { Fate::Fails } else { Fate::Well }).collect();
        let mut script = Script {
            nodes: queue(&fates[0]), drives: queue(&fates[1]), recorders: queue(&fates[2]), ..Script::default()
        };
        let mut core = Core::new((0..scenes).collect(), workers, record);
        core.start(&mut script);
        let mut order = order.into_iter();
        let mut turns = 0;
        while core.ending().is_none() {
            prop_assert!(!script.events.is_empty(), "the run waits, and nothing is under way");
            let at = order.next().unwrap_or(0) % script.events.len();
            let event = script.events.remove(at).unwrap();
            core.on(event, &mut script);
            turns += 1;
            prop_assert!(turns < 1000, "the run does not end");
        }
        prop_assert!(script.driven.values().all(|drives| drives.len() == 1));
        if core.ending() == Some(&Ending::Complete) {
            prop_assert_eq!(script.driven.len(), scenes);
        }
        prop_assert_eq!(script.halted, 1);
    }
}
