//! One episode under one driver. The driver may be a process on the bus or, in tests and benches, a few lines beside it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use episode::{Episode, Outcome};
use results::part::{Plans, Timing};
use wire::proto::{EpisodeEnd, Event, StepRecord};
use world::observation::{Briefing, Observation};
use world::plan::Plan;
use world::traffic::{Taken, UncheckedMoves};

use super::clock::Clock;
use super::lag::Lag;

/// Answers observations with plans, and hears how it went.
pub trait Driver {
    /// Told once, before the first step.
    ///
    /// # Errors
    /// Why it cannot drive this scene, as a sentence.
    fn brief(&mut self, briefing: &Briefing) -> Result<(), String>;

    /// Where the agents are after the coming step that are taken over from the log. Asked before the plan, in drives whose agents react.
    ///
    /// # Errors
    /// Why that cannot be told, as a sentence.
    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String>;

    /// The plan for a step.
    ///
    /// # Errors
    /// Why there is none, as a sentence.
    fn answer(&mut self, observation: &Observation) -> Result<Plan, String>;

    /// How the step went.
    fn step_done(&mut self, record: &StepRecord, events: &[Event]);

    /// Told once, after the last step, how the episode ended: nothing more is asked.
    ///
    /// # Errors
    /// What is wrong with what the driver said all in all, as a sentence: then it failed after all.
    fn dismiss(&mut self, end: &EpisodeEnd) -> Result<(), String>;

    /// How the episode ended, and the events that no step had. Fills in how many messages there were.
    ///
    /// # Errors
    /// What is wrong with the recording, as a sentence.
    fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String>;
}

/// A drive that was driven to its end.
#[derive(Debug)]
pub struct Driven {
    /// What came of it.
    pub outcome: Outcome,
    /// What became of its plans, under a latency.
    pub plans: Option<Plans>,
    /// What is wrong with its recording.
    pub recording: Result<(), String>,
    /// What took how long; load, preparation and the whole are the caller's to add.
    pub timing: Timing,
}

/// Drives `episode` to its end, by plans that take effect as `lag` says, or at once; none if `stop` was set in between.
pub fn drive(
    mut episode: Episode,
    driver: &mut impl Driver,
    mut lag: Option<Lag<'_>>,
    clock: &impl Clock,
    stop: &AtomicBool,
) -> Option<Driven> {
    let mut timing = Timing::default();
    let mut answers = Vec::with_capacity(episode.briefing().horizon as usize);
    let mut last = clock.now();
    let mut lap = |sum: &mut f64| -> Duration {
        let now = clock.now();
        let lap = now.saturating_sub(std::mem::replace(&mut last, now));
        *sum += lap.as_secs_f64();
        lap
    };
    let mut failure = driver.brief(&episode.briefing()).err();
    lap(&mut timing.brief);
    timing.first_step = clock.now().as_secs_f64();
    while failure.is_none() {
        let observation = episode.observe();
        lap(&mut timing.observe);
        let moved = match episode.reacts() {
            true => move_traffic(&mut episode, driver, &observation),
            false => Ok(()),
        };
        lap(&mut timing.traffic);
        let answer = moved.and_then(|()| driver.answer(&observation));
        let taken = lap(&mut timing.answer);
        answers.push(taken);
        let advanced = answer.and_then(|plan| match &mut lag {
            None => Ok(episode.advance(&plan)),
            Some(lag) => Ok(episode.follow(&lag.step(plan, taken)?)),
        });
        let advance = match advanced {
            Ok(advance) => advance,
            Err(reason) => {
                failure = Some(reason);
                break;
            }
        };
        let ended = advance.ended.is_some();
        lap(&mut timing.advance);
        driver.step_done(&advance.record, &advance.events);
        lap(&mut timing.publish);
        if ended {
            break;
        }
    }
    if stop.load(Ordering::Relaxed) {
        return None;
    }
    let mut outcome = episode.finish();
    if failure.is_none() {
        failure = driver.dismiss(&outcome.end).err();
    }
    // Events of steps have been told; that of a failure belongs to none.
    let mut untold = Vec::new();
    if let Some(reason) = failure {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        untold.clone_from(&episode.fail(reason).events);
        outcome = episode.finish();
    }
    let recording = driver.end(&untold, &mut outcome.end);
    lap(&mut timing.recording);
    answers.sort_unstable();
    let share = |share: f64| answers.get(((answers.len() as f64 - 1.0) * share).round() as usize);
    let seconds = |answer: Option<&Duration>| answer.map_or(0.0, Duration::as_secs_f64);
    timing.answer_p50 = seconds(share(0.5));
    timing.answer_p99 = seconds(share(0.99));
    timing.answer_max = seconds(answers.last());
    Some(Driven { outcome, plans: lag.map(Lag::plans), recording, timing })
}

/// Asks for the moves of the agents that react, and makes them.
fn move_traffic(episode: &mut Episode, driver: &mut impl Driver, observation: &Observation) -> Result<(), String> {
    let moves = driver.moves(observation, episode.taken())?;
    let refused = |error| format!("step {}: the traffic's answer is refused: {error}", observation.step);
    episode.move_traffic(moves).map_err(refused)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::Arc;

    use scenarios::generated::{Family, Parameters};
    use wire::proto::EndReason;
    use world::plan::{Control, PLAN_STEPS, PlanState, UncheckedPlan};

    use super::*;
    use episode::protocol::Protocol;

    /// A clock that moves on by what the script says.
    #[derive(Default)]
    struct Script(Cell<Duration>);

    impl Clock for Script {
        fn now(&self) -> Duration {
            self.0.get()
        }
    }

    impl Script {
        fn pass(&self, milliseconds: u64) {
            self.0.set(self.0.get() + Duration::from_millis(milliseconds));
        }
    }

    /// Straight on; fails at `fails_at`. Its answers take 10 ms, the last of each hundred 90 ms.
    struct Straight<'a> {
        clock: &'a Script,
        fails_at: Option<u32>,
        says_too_much: bool,
        heard: Vec<String>,
    }

    impl Driver for Straight<'_> {
        fn brief(&mut self, briefing: &Briefing) -> Result<(), String> {
            self.clock.pass(500);
            self.heard.push(briefing.scene.to_string());
            Ok(())
        }

        fn moves(&mut self, _: &Observation, _: &[Taken]) -> Result<UncheckedMoves, String> {
            Err("nobody reacts here".to_owned())
        }

        fn answer(&mut self, observation: &Observation) -> Result<Plan, String> {
            let step = observation.step;
            self.clock.pass(if step % 100 == 99 { 90 } else { 10 });
            if self.fails_at == Some(step) {
                return Err("no idea".to_owned());
            }
            let av = &observation.av;
            let states = vec![PlanState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() }; PLAN_STEPS];
            let controls = vec![Control::default(); PLAN_STEPS];
            UncheckedPlan { step, states, controls, ..UncheckedPlan::default() }.check(step).map_err(|e| e.to_string())
        }

        fn step_done(&mut self, record: &StepRecord, events: &[Event]) {
            assert_eq!(record.events as usize, events.len());
            self.clock.pass(1);
            self.heard.push(format!("step {}", record.step));
        }

        fn dismiss(&mut self, end: &EpisodeEnd) -> Result<(), String> {
            self.heard.push(format!("{:?}", end.reason()));
            if self.says_too_much { Err("one plan too many".to_owned()) } else { Ok(()) }
        }

        fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String> {
            self.clock.pass(7);
            self.heard.extend(events.iter().map(|event| event.text.clone()));
            self.heard.push(format!("{:?} after {}", end.reason(), end.records));
            Ok(())
        }
    }

    fn episode() -> Episode {
        let payload = Family::named("curve").unwrap().payload("curve", 1, 0, &Parameters::default()).unwrap();
        let (scene, _) = scenarios::womd::read(&payload).unwrap();
        Episode::new(Arc::new(scene), &Protocol::default()).unwrap()
    }

    #[test]
    fn a_driver_is_told_everything_in_order_and_time_is_booked_where_it_went() {
        let clock = Script::default();
        let mut driver = Straight { clock: &clock, fails_at: None, says_too_much: false, heard: Vec::new() };
        let driven = drive(episode(), &mut driver, None, &clock, &AtomicBool::new(false)).unwrap();
        let steps = driven.outcome.records.len();
        assert!(steps > 10);
        assert_eq!(driver.heard.len(), steps + 3);
        assert_eq!(driver.heard[1], "step 0");
        assert_eq!(driven.recording, Ok(()));
        let timing = driven.timing;
        assert_eq!((timing.brief, timing.first_step, timing.observe, timing.recording), (0.5, 0.5, 0.0, 0.007));
        assert!((timing.publish - 0.001 * steps as f64).abs() < 1e-9);
        assert_eq!(timing.answer_p50, 0.01);
        assert_eq!(timing.answer_max, if steps > 99 { 0.09 } else { 0.01 });
    }

    #[test]
    fn a_driver_that_fails_ends_its_episode_with_the_reason() {
        let clock = Script::default();
        let mut driver = Straight { clock: &clock, fails_at: Some(3), says_too_much: false, heard: Vec::new() };
        let Driven { outcome, .. } = drive(episode(), &mut driver, None, &clock, &AtomicBool::new(false)).unwrap();
        assert_eq!((outcome.end.reason(), outcome.end.detail.as_str()), (EndReason::DriverFailed, "no idea"));
        assert_eq!(driver.heard[4..], ["the driver failed: no idea", "DriverFailed after 3"]);
    }

    #[test]
    fn a_driver_that_says_too_much_fails_after_the_last_step() {
        let clock = Script::default();
        let mut driver = Straight { clock: &clock, fails_at: None, says_too_much: true, heard: Vec::new() };
        let Driven { outcome, .. } = drive(episode(), &mut driver, None, &clock, &AtomicBool::new(false)).unwrap();
        assert_eq!((outcome.end.reason(), outcome.end.detail.as_str()), (EndReason::DriverFailed, "one plan too many"));
        let steps = outcome.records.len();
        assert_eq!(driver.heard[steps + 2], "the driver failed: one plan too many");
        assert_eq!(
            outcome.events.last().map(|event| event.text.as_str()),
            Some("the driver failed: one plan too many")
        );
    }

    #[test]
    fn a_stopped_drive_has_no_outcome() {
        let clock = Script::default();
        let mut driver = Straight { clock: &clock, fails_at: Some(3), says_too_much: false, heard: Vec::new() };
        assert!(drive(episode(), &mut driver, None, &clock, &AtomicBool::new(true)).is_none());
    }
}
