//! The answer of whoever drives the agents that react: a state a step later for each. It comes from outside, so it is checked.

use thiserror::Error;

use super::Taken;
use crate::geometry::{angle_difference, wrap_angle};
use crate::plan::STEP_SECONDS;
use crate::scene::{AgentState, LARGEST_NUMBER, TrackId, is_in_range};

/// Nothing on wheels changes its speed by more in a step (m/s): 15 m/s^2 is beyond the grip of any tyre on a road.
const MOST_SPEED_CHANGE: f64 = 1.5;

/// Nothing turns by more in a step (rad).
const MOST_TURN: f64 = 0.35;

/// How far a place may be from where its speeds lead (m).
const MOST_ASTRAY: f64 = 0.5;

/// Nothing on wheels rises or sinks by more in a step (m): at 40 m/s, on a slope of one in eight.
const MOST_RISE: f64 = 0.5;

/// Nor are its wheels farther above or below the ground of its way (m): on another level nobody sees it.
const MOST_ABOVE: f64 = 3.0;

/// What the ground of a way may be off by between its samples (m).
const ROUGH: f64 = 0.1;

/// One agent a step later.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrafficMove {
    /// Which track.
    pub track: TrackId,
    /// Where it is then. Its size is what it was.
    pub state: AgentState,
}

/// Moves as they came in. [`UncheckedMoves::check`] makes [`Moves`] of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UncheckedMoves {
    /// The step of the observation that they answer.
    pub step: u32,
    /// A move for each agent that is taken over, in any order.
    pub moves: Vec<TrafficMove>,
}

/// A move for each agent that is taken over, in their order, that a body could make.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moves(Vec<TrafficMove>);

/// How a body's state changes over a step, beyond what its speeds say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// How far its place is from where its speeds lead (m).
    pub astray: f64,
    /// How much its speed changes (m/s).
    pub speed: f64,
    /// How far it turns (rad).
    pub turn: f64,
    /// How far it rises or sinks (m).
    pub rise: f64,
}

impl Change {
    /// From one state to that of a step later.
    #[must_use]
    pub fn between(before: &AgentState, after: &AgentState) -> Self {
        let mean = (before.velocity() + after.velocity()) * 0.5;
        Self {
            astray: (after.position() - before.position() - mean * STEP_SECONDS).norm(),
            speed: (after.speed() - before.speed()).abs(),
            turn: angle_difference(before.heading, after.heading).abs(),
            rise: (after.z - before.z).abs(),
        }
    }
}

/// What is wrong with moves from outside.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum MoveError {
    #[error("it answers step {got}, but step {expected} was asked for")]
    WrongStep { expected: u32, got: u32 },
    #[error("it does not say where track {track} is next")]
    Missing { track: TrackId },
    #[error("it says twice where track {track} is next")]
    Twice { track: TrackId },
    #[error("it moves track {track}, which it was not given")]
    NotTaken { track: TrackId },
    #[error("the state of track {track} is not finite, or beyond {LARGEST_NUMBER:e}")]
    OutOfRange { track: TrackId },
    #[error("track {track} has another size than before")]
    Resized { track: TrackId },
    #[error("track {track} {what} by {value:.2} {unit} in a step, more than {limit}")]
    Impossible { track: TrackId, what: &'static str, value: f64, unit: &'static str, limit: f64 },
}

impl UncheckedMoves {
    /// The moves, if they answer `step` and tell of each of `taken` once what it can do.
    ///
    /// # Errors
    /// [`MoveError`] names the first thing that is wrong.
    pub fn check(self, step: u32, taken: &[Taken]) -> Result<Moves, MoveError> {
        if self.step != step {
            return Err(MoveError::WrongStep { expected: step, got: self.step });
        }
        let mut moves = self.moves;
        moves.sort_by_key(|told| told.track);
        if let Some(pair) = moves.windows(2).find(|pair| pair[0].track == pair[1].track) {
            return Err(MoveError::Twice { track: pair[0].track });
        }
        let find = |agent: &Taken| {
            let place = moves.binary_search_by_key(&agent.track, |told| told.track);
            let told = moves[place.map_err(|_| MoveError::Missing { track: agent.track })?];
            possible(agent, &told).map(|()| TrafficMove { state: plain(told.state), ..told })
        };
        let in_order: Vec<TrafficMove> = taken.iter().map(find).collect::<Result<_, _>>()?;
        // All that were given are told of: what is more was not given.
        let is_given = |told: &&TrafficMove| taken.iter().any(|agent| agent.track == told.track);
        match moves.iter().find(|told| moves.len() > taken.len() && !is_given(told)) {
            Some(told) => Err(MoveError::NotTaken { track: told.track }),
            None => Ok(Moves(in_order)),
        }
    }
}

impl Moves {
    /// The moves, in the order of the agents that were given.
    #[must_use]
    pub fn moves(&self) -> &[TrafficMove] {
        &self.0
    }
}

/// The state with its heading in [-pi, pi), and 0 for -0, which messages do not tell apart.
fn plain(state: AgentState) -> AgentState {
    AgentState {
        x: state.x + 0.0,
        y: state.y + 0.0,
        z: state.z + 0.0,
        heading: wrap_angle(state.heading) + 0.0,
        velocity_x: state.velocity_x + 0.0,
        velocity_y: state.velocity_y + 0.0,
        ..state
    }
}

/// Whether a body that is where `agent` is can be there a step later.
fn possible(agent: &Taken, told: &TrafficMove) -> Result<(), MoveError> {
    let (track, before, after) = (agent.track, &agent.state, &told.state);
    let numbers = [after.x, after.y, after.z, after.heading, after.velocity_x, after.velocity_y];
    if !numbers.into_iter().all(is_in_range) {
        return Err(MoveError::OutOfRange { track });
    }
    if (before.length, before.width, before.height) != (after.length, after.width, after.height) {
        return Err(MoveError::Resized { track });
    }
    let within = |what, value: f64, unit, limit| {
        if value <= limit { Ok(()) } else { Err(MoveError::Impossible { track, what, value, unit, limit }) }
    };
    let change = Change::between(before, after);
    within("jumps", change.astray, "m", MOST_ASTRAY)?;
    within("changes its speed", change.speed, "m/s", MOST_SPEED_CHANGE)?;
    within("turns", change.turn, "rad", MOST_TURN)?;
    within("rises or sinks", change.rise, "m", MOST_RISE)?;
    if change.rise == 0.0 {
        return Ok(());
    }
    // A log may have it anywhere, but from there it gets no farther from the ground, however slowly.
    let way = &agent.way;
    let ground = |state: &AgentState| way.height(way.nearest(state.position()));
    let off = |state: &AgentState| (state.z - 0.5 * state.height - ground(state)).abs();
    let most = if off(before) <= MOST_ABOVE { MOST_ABOVE } else { off(before) + ROUGH };
    within("leaves the ground of its way", off(after), "m", most)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::geometry::Point3;
    use crate::scene::AgentKind;
    use crate::traffic::Way;

    fn taken(track: i32) -> Taken {
        let samples: Vec<Point3> = (0..9).map(|k| Point3::new(0.5 * f64::from(k), 0.0, 0.0)).collect();
        let state = AgentState { velocity_x: 10.0, length: 4.5, width: 2.0, height: 1.5, ..AgentState::default() };
        let way = Arc::new(Way::new(&samples, Vec::new()).unwrap());
        Taken { track: TrackId(track), kind: AgentKind::Vehicle, since_step: 0, state, way }
    }

    fn told(track: i32, change: impl FnOnce(&mut AgentState)) -> TrafficMove {
        let mut state = AgentState { x: 1.0, ..taken(track).state };
        change(&mut state);
        TrafficMove { track: TrackId(track), state }
    }

    fn check(moves: Vec<TrafficMove>) -> Result<Moves, MoveError> {
        UncheckedMoves { step: 3, moves }.check(3, &[taken(7), taken(5)])
    }

    #[test]
    fn moves_are_taken_in_any_order_and_kept_in_that_of_the_agents() {
        let moves = check(vec![told(5, |_| ()), told(7, |_| ())]).unwrap();
        assert_eq!(moves.moves().iter().map(|told| told.track.0).collect::<Vec<_>>(), [7, 5]);
        assert_eq!(check(vec![told(7, |_| ()), told(5, |_| ())]), Ok(moves));
    }

    #[test]
    fn each_agent_is_told_of_once_and_no_other() {
        let track = TrackId;
        assert_eq!(check(vec![told(5, |_| ())]), Err(MoveError::Missing { track: track(7) }));
        assert_eq!(check(vec![told(5, |_| ()), told(5, |_| ())]), Err(MoveError::Twice { track: track(5) }));
        let more = vec![told(5, |_| ()), told(7, |_| ()), told(9, |_| ())];
        assert_eq!(check(more), Err(MoveError::NotTaken { track: track(9) }));
        let late = UncheckedMoves { step: 2, moves: Vec::new() }.check(3, &[]);
        assert_eq!(late, Err(MoveError::WrongStep { expected: 3, got: 2 }));
    }

    #[test]
    fn nobody_leaves_the_ground_bit_by_bit_and_a_log_may_have_had_him_there() {
        let rises = |from: f64, by: f64| {
            let mut agent = taken(5);
            agent.state.z = from;
            let moved = told(5, |state| state.z = from + by);
            UncheckedMoves { step: 3, moves: vec![moved] }.check(3, &[agent]).map(|_| ())
        };
        for (from, by) in [(0.0, 0.4), (3.5, 0.2), (7.0, 0.05), (7.0, -0.4)] {
            assert_eq!(rises(from, by), Ok(()));
        }
        for (from, by) in [(3.5, 0.4), (7.0, 0.2), (-2.1, -0.2)] {
            let refused = rises(from, by).unwrap_err().to_string();
            assert!(refused.starts_with("track 5 leaves the ground of its way by"), "{refused}");
        }
    }

    #[test]
    fn headings_are_told_within_half_a_turn() {
        let moves = check(vec![told(5, |state| state.heading = 100.0 * std::f64::consts::TAU + 0.1), told(7, |_| ())]);
        assert!((moves.unwrap().moves()[1].state.heading - 0.1).abs() < 1e-9);
    }

    #[test]
    fn what_no_body_can_do_is_refused() {
        let refused = |change: fn(&mut AgentState)| check(vec![told(5, change), told(7, |_| ())]).unwrap_err();
        assert_eq!(refused(|state| state.y = f64::NAN), MoveError::OutOfRange { track: TrackId(5) });
        assert_eq!(refused(|state| state.width = 1.0), MoveError::Resized { track: TrackId(5) });
        for (change, what) in [
            ((|state| state.x = 3.0) as fn(&mut AgentState), "jumps"),
            (|state| state.velocity_x = 8.0, "changes its speed"),
            (|state| state.heading = 1.0, "turns"),
            (|state| state.z = -0.6, "rises or sinks"),
        ] {
            assert!(matches!(refused(change), MoveError::Impossible { what: said, .. } if said == what), "{what}");
        }
    }
}
