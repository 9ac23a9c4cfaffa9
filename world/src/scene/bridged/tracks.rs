//! Gaps in a track: filled in between the states on either side, or gone on from the last one.

use super::{LONGEST_GAP, SeenAgent};
use crate::geometry::{Point, angle_difference};
use crate::plan::STEP_SECONDS;
use crate::scene::AgentState;

/// Nobody goes farther than this in a step (m), 144 km/h: what does is another road user under the same number.
const FARTHEST_IN_A_STEP: f64 = 4.0;

/// Logged velocities jump: the speed that is gone on with is the median of so many states.
const STATES_FOR_VELOCITY: usize = 5;

/// Steps within a track at which it is not listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrackGap {
    /// The track's place in the scene.
    pub track: usize,
    /// The last step at which it is listed.
    pub before: usize,
    /// The next step at which it is.
    pub after: usize,
    /// Whether the gap is filled in for judges.
    pub bridged: bool,
}

impl TrackGap {
    /// How many steps are missing.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.after - self.before - 1
    }
}

/// The gaps between states: the last step before and the first after each.
pub(super) fn gaps(states: &[Option<AgentState>]) -> Vec<(usize, usize)> {
    let mut gaps = Vec::new();
    let mut before: Option<usize> = None;
    for step in (0..states.len()).filter(|step| states[*step].is_some()) {
        gaps.extend(before.filter(|before| before + 1 < step).map(|before| (before, step)));
        before = Some(step);
    }
    gaps
}

/// Fills in the steps between `before` and `after`, where that can be; whether it was.
pub(super) fn bridge(states: &mut [Option<AgentState>], before: usize, after: usize) -> bool {
    let (Some(from), Some(to)) = (states[before], states[after]) else { return false };
    let steps = after - before;
    let chord = from.position().distance(to.position());
    if steps - 1 > LONGEST_GAP || chord > FARTHEST_IN_A_STEP * steps as f64 {
        return false;
    }
    let way = Way::between(&from, &to, steps as f64 * STEP_SECONDS);
    for (index, state) in states[before + 1..after].iter_mut().enumerate() {
        *state = Some(way.at((index + 1) as f64 / steps as f64));
    }
    true
}

/// The way from one state to another.
struct Way<'a> {
    from: &'a AgentState,
    to: &'a AgentState,
    /// Time between them (s).
    seconds: f64,
    /// Velocities at both ends (m/s).
    tangents: [Point; 2],
}

impl<'a> Way<'a> {
    /// A cubic with the logged velocities at its ends, which is exact for whoever brakes or speeds up evenly. Where those
    /// velocities would lead it back or far astray, as the jumping ones of far tracks do, straight on at an even speed.
    fn between(from: &'a AgentState, to: &'a AgentState, seconds: f64) -> Self {
        let mean = (to.position() - from.position()) * (1.0 / seconds);
        let fits = |velocity: Point| {
            let along = velocity.dot(mean);
            // Fritsch and Carlson's bound for a cubic that never turns back.
            (0.0..=3.0 * mean.norm_squared()).contains(&along) && velocity.norm() <= 3.0 * mean.norm()
        };
        let tangents = [from.velocity(), to.velocity()];
        let tangents = if tangents.into_iter().all(fits) { tangents } else { [mean, mean] };
        Self { from, to, seconds, tangents }
    }

    /// The state after `share` of the time.
    fn at(&self, share: f64) -> AgentState {
        let Self { from, to, seconds, tangents: [first, last] } = *self;
        let (a, b) = (from.position(), to.position());
        let (s, rest) = (share, 1.0 - share);
        let position = a * (rest * rest * (1.0 + 2.0 * s))
            + b * (s * s * (1.0 + 2.0 * rest))
            + first * (seconds * s * rest * rest)
            - last * (seconds * s * s * rest);
        let velocity =
            (b - a) * (6.0 * s * rest / seconds) + first * (rest * (1.0 - 3.0 * s)) + last * (s * (3.0 * s - 2.0));
        let mix = |a: f64, b: f64| a + s * (b - a);
        AgentState {
            x: position.x,
            y: position.y,
            z: mix(from.z, to.z),
            heading: from.heading + s * angle_difference(from.heading, to.heading),
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            length: mix(from.length, to.length),
            width: mix(from.width, to.width),
            height: mix(from.height, to.height),
        }
    }
}

/// The state at the last of these steps: as logged, or supposed from those before.
pub(super) fn supposed(past: &[Option<AgentState>]) -> Option<SeenAgent> {
    let window = past.len().saturating_sub(LONGEST_GAP + 1);
    let last = window + past[window..].iter().rposition(Option::is_some)?;
    let state = past[last]?;
    let unseen = past.len() - 1 - last;
    if unseen == 0 {
        return Some(SeenAgent { state, unseen: 0 });
    }
    let velocity = steady_velocity(&past[..=last]);
    let way = velocity * (unseen as f64 * STEP_SECONDS);
    let state =
        AgentState { x: state.x + way.x, y: state.y + way.y, velocity_x: velocity.x, velocity_y: velocity.y, ..state };
    Some(SeenAgent { state, unseen: unseen as u32 })
}

/// The median of the last velocities, each way by itself.
fn steady_velocity(past: &[Option<AgentState>]) -> Point {
    let recent = past.iter().rev().take(2 * STATES_FOR_VELOCITY).flatten().take(STATES_FOR_VELOCITY);
    let (mut x, mut y): (Vec<f64>, Vec<f64>) = recent.map(|state| (state.velocity_x, state.velocity_y)).unzip();
    Point::new(super::sizes::median(&mut x), super::sizes::median(&mut y))
}

/// For how many steps up to the last of these it has been there, gaps that may be filled in counted.
pub(super) fn visible_for(past: &[Option<AgentState>]) -> Option<u32> {
    let (mut unseen, mut visible) = (0, None);
    for (steps, state) in past.iter().rev().enumerate() {
        if state.is_some() {
            (unseen, visible) = (0, Some(steps as u32 + 1));
        } else if unseen == LONGEST_GAP {
            break;
        } else {
            unseen += 1;
        }
    }
    visible
}
