//! Where one stops at red.

use world::map::MapId;
use world::scene::bridged::SeenSignal;
use world::signal::{Signal, SignalState};
use world::traffic::Way;
use world::traffic::way::SPACING;

use crate::idm::{HARDEST_BRAKING, Idm};

/// How far ahead a signal matters (m).
const SIGHT: f64 = 80.0;

/// A stop point farther from the way than this (m) is not on it: then one stops where the lane begins.
const ON_WAY: f64 = 3.0;

/// A stop point lies at the beginning of its lane, or so far before it (m).
const BEFORE: f64 = 9.0;

/// Who is slower than this (m/s) can always stop.
const CRAWL: f64 = 1.0;

/// One stands so far before the line (m).
const STAND_BACK: f64 = 0.8;

/// The signals of a step that stop somebody.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights(Vec<Signal>);

impl Lights {
    pub(crate) fn see(&mut self, signals: &[SeenSignal]) {
        self.0.clear();
        self.0.extend(signals.iter().map(|seen| seen.signal).filter(|signal| braking(signal.state).is_some()));
    }

    /// The acceleration (m/s^2) that the next light on `way` allows somebody whose front is at station `front` (m).
    pub(crate) fn acceleration(&self, way: &Way, front: f64, speed: f64, idm: &Idm) -> f64 {
        self.next_stop(way, front, speed).map_or(f64::INFINITY, |line| idm.before_a_line(speed, line - STAND_BACK))
    }

    /// The distance (m) to the next line at which one must stop and can.
    fn next_stop(&self, way: &Way, front: f64, speed: f64) -> Option<f64> {
        if self.0.is_empty() {
            return None;
        }
        let stretches = way.lanes().iter().enumerate().take_while(|(_, stretch)| stretch.from < front + SIGHT);
        let stops = stretches.filter_map(|(index, stretch)| {
            let until = way.lanes().get(index + 1).map_or(way.length(), |next| next.from);
            if until < front {
                return None;
            }
            let signal = self.of(stretch.lane?)?;
            let place = way.follow(signal.stop_point.xy(), (stretch.from / SPACING) as usize);
            let is_on = place.lateral.abs() <= ON_WAY && (stretch.from - BEFORE..=until).contains(&place.station);
            let line = if is_on { place.station } else { stretch.from };
            let distance = line - front;
            // Past it already, or too fast: to brake now would be to stop in the crossing.
            let can_stop = speed < CRAWL || speed * speed <= 2.0 * braking(signal.state)? * distance;
            (distance > 0.0 && can_stop).then_some(distance)
        });
        stops.min_by(f64::total_cmp)
    }

    fn of(&self, lane: MapId) -> Option<&Signal> {
        self.0.iter().find(|signal| signal.lane == lane)
    }
}

/// How hard one brakes at most for what is shown (m/s^2): as hard as can be at red, comfortably before it; not at all for the rest.
fn braking(state: SignalState) -> Option<f64> {
    match state {
        SignalState::Stop | SignalState::ArrowStop => Some(HARDEST_BRAKING),
        SignalState::Caution | SignalState::ArrowCaution => Some(3.0),
        _ => None,
    }
}
