//! Who had to yield at a crossing, and whether he did.
//!
//! Somebody's way crosses where another goes, at an angle of 30 to 150 degrees. Three seconds before the other comes to where his box would sweep over the
//! way, or when he was taken over if that was later, but at least one second before: if both went on as fast as they are, the other would be
//! there first, and he before the other had been gone for a second. Then he had to yield. He did if he is not there until the other is through.

use world::geometry::{OrientedBox, Pose, angle_difference, boxes_overlap};
use world::plan::STEP_SECONDS;
use world::scene::AgentState;
use world::traffic::Taken;
use world::traffic::ways::BEHIND_SAMPLES;

/// Steps before the other comes at which it is looked.
const EARLIEST: usize = 30;
const LATEST: usize = 10;

/// So long after the other has gone (s) nobody needs to have waited for him.
const MARGIN: f64 = 1.0;

/// Samples of a way from one box to the next: 1 m.
const STRIDE: usize = 2;

/// Whether `taken`, which was in `own` from its hand-over on, yielded to who was in `other` at the same steps; none where it did not have to.
pub(super) fn yielded(taken: &Taken, own: &[Option<AgentState>], other: &[Option<AgentState>]) -> Option<bool> {
    let swept = Swept::of(taken, other)?;
    let looks = swept.begins.saturating_sub(EARLIEST);
    if swept.begins - looks < LATEST {
        return None;
    }
    let mut hint = BEHIND_SAMPLES;
    let mut stations = Vec::with_capacity(own.len());
    for state in own {
        stations.push(state.map(|state| {
            let place = taken.way.follow(state.oriented_box().front(), hint);
            hint = place.sample;
            place.station
        }));
    }
    let (left, speed) = (swept.station - (*stations.get(looks)?)?, own[looks]?.speed());
    let seconds = |step: usize| (step - looks) as f64 * STEP_SECONDS;
    let arrives = left / speed.max(0.1);
    let is_due = left > 0.0 && seconds(swept.begins) < arrives && arrives < seconds(swept.ends) + MARGIN;
    let enters = || (looks..own.len()).find(|step| stations[*step].is_some_and(|station| station >= swept.station));
    is_due.then(|| enters().is_none_or(|enters| enters > swept.ends))
}

/// Where somebody else's box sweeps over a way.
struct Swept {
    /// From this station on (m).
    station: f64,
    /// From this step on, until this one.
    begins: usize,
    ends: usize,
}

impl Swept {
    fn of(taken: &Taken, other: &[Option<AgentState>]) -> Option<Self> {
        let way = &taken.way;
        let mut swept: Option<Self> = None;
        for (step, state) in other.iter().enumerate() {
            let Some(state) = state else { continue };
            let outline = state.oriented_box();
            let reach = outline.radius() + 0.5 * taken.state.width;
            let near = way.points().iter().enumerate().step_by(STRIDE);
            let near = near.filter(|(_, point)| point.distance_squared(outline.center) < reach * reach);
            // A slice of the way, as wide as who goes there.
            let is_swept = |sample: usize| {
                let pose = Pose::new(way.points()[sample].x, way.points()[sample].y, way.heading(sample));
                boxes_overlap(&OrientedBox::new(pose, 1.0, taken.state.width), &outline)
            };
            let Some(sample) = near.map(|(sample, _)| sample).find(|sample| is_swept(*sample)) else { continue };
            let station = way.follow(way.points()[sample], sample).station;
            match &mut swept {
                None => {
                    let angle = angle_difference(way.heading(sample), state.heading).abs().to_degrees();
                    if !(30.0..=150.0).contains(&angle) {
                        return None;
                    }
                    swept = Some(Self { station, begins: step, ends: step });
                }
                Some(swept) => {
                    swept.station = swept.station.min(station);
                    swept.ends = step;
                }
            }
        }
        swept
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use world::geometry::{Point, Point3};
    use world::scene::{AgentKind, TrackId};
    use world::traffic::Way;

    use super::*;

    const START: AgentState = AgentState { length: 4.0, width: 2.0, height: 1.5, velocity_x: 10.0, ..zero() };

    const fn zero() -> AgentState {
        AgentState {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            heading: 0.0,
            velocity_x: 0.0,
            velocity_y: 0.0,
            length: 0.0,
            width: 0.0,
            height: 0.0,
        }
    }

    /// To the east, from 10 m behind on.
    fn taken() -> Taken {
        let samples: Vec<Point3> = (0..300).map(|k| Point3::new(-10.0 + 0.5 * f64::from(k), 0.0, 0.0)).collect();
        let way = Arc::new(Way::new(&samples, Vec::new()).unwrap());
        Taken { track: TrackId(1), kind: AgentKind::Vehicle, since_step: 0, state: START, way }
    }

    /// Eastwards, at 10 m/s for a second, then at so many m/s.
    fn own(speed: f64) -> Vec<Option<AgentState>> {
        let x = |step: f64| step.min(10.0) + 0.1 * speed * (step - 10.0).max(0.0);
        let speed = |step: f64| if step <= 10.0 { 10.0 } else { speed };
        (0..80).map(f64::from).map(|step| Some(AgentState { x: x(step), velocity_x: speed(step), ..START })).collect()
    }

    /// Headed `heading` at 10 m/s, it is at (x, 0) at step 40.
    fn other(x: f64, heading: f64) -> Vec<Option<AgentState>> {
        let forward = Point::unit(heading);
        let state = |step: i32| {
            let place = forward * f64::from(step - 40) + Point::new(x, 0.0);
            let velocity = forward * 10.0;
            AgentState { x: place.x, y: place.y, heading, velocity_x: velocity.x, velocity_y: velocity.y, ..START }
        };
        (0..80).map(|step| Some(state(step))).collect()
    }

    #[test]
    fn who_comes_second_yields_or_does_not() {
        let north = std::f64::consts::FRAC_PI_2;
        // At 42 m a moment after the other.
        let crossing = other(42.0, north);
        assert_eq!(yielded(&taken(), &own(10.0), &crossing), Some(false), "he drives into it");
        assert_eq!(yielded(&taken(), &own(4.0), &crossing), Some(true), "he lets it pass");
        assert_eq!(yielded(&taken(), &own(4.0), &other(20.0, north)), None, "he would be there first");
        assert_eq!(yielded(&taken(), &own(4.0), &other(90.0, north)), None, "it would be gone");
        assert_eq!(yielded(&taken(), &own(4.0), &other(42.0, 0.1)), None, "it goes the same way");
        assert_eq!(yielded(&taken(), &own(4.0), &[]), None);
    }
}
