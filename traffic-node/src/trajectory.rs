//! Somebody's part of a future, made drivable: the way that it goes, and how far along it somebody is at each step.
//!
//! A trajectory says where and when. The where becomes a [`Way`], as of a log, so that steering, gaps and lights are those of any way;
//! the when becomes stations along it, held by the accelerator. What no car could drive is no trajectory.

use std::sync::Arc;

use world::geometry::{Point, Pose};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState};
use world::traffic::ways::BEHIND_SAMPLES;
use world::traffic::{Way, Ways};

use crate::motion::TIGHTEST;

/// Its first pose is no farther than this (m) from where somebody is after a step who goes on as he does.
const LEAP: f64 = 2.0;

/// Nobody goes faster (m/s).
const FASTEST: f64 = 50.0;

/// Who goes less far (m) stays on the way that he is on: what so few metres tell of a direction is noise.
const LEAST_WAY: f64 = 4.0;

/// A trajectory farther from the way than this (m) does not go along it.
const ALONG: f64 = 3.0;

/// The way leads up to the first pose over this distance (m), in steps of this.
const LEAD: f64 = 10.0;
const LEAD_STEP: f64 = 1.0;

/// So many steps ahead one is to be where the future has one: 1 s. Held anew at each step that is a spring, critically damped but for a little
/// (e'' = -2 e - 2 e').
const HORIZON: usize = 10;

/// Whoever drives it accelerates and brakes no harder for its sake (m/s^2): the bounds of `strict` for the AV are 5.
const MOST_ACCELERATION: f64 = 3.0;
const MOST_BRAKING: f64 = 5.0;

/// Who is where, and goes where.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traveller<'a> {
    pub kind: AgentKind,
    pub state: &'a AgentState,
    /// Where the centre goes (rad).
    pub course: f64,
    /// The way that it was taken over with: it knows how high the ground is.
    pub own: &'a Way,
    /// The way that it is on.
    pub way: &'a Arc<Way>,
}

/// A trajectory that is followed.
#[derive(Clone, Debug)]
pub(crate) struct Trajectory {
    pub way: Arc<Way>,
    /// The step from which on it is followed.
    from: u32,
    /// Where on the way one is to be, at that step and at each after it (m). They never fall.
    stations: Vec<f64>,
}

impl Trajectory {
    /// What `traveller` is to follow from `step` on, whose poses these are a step later, two steps later, and so on. None where a car could not.
    pub(crate) fn new(step: u32, poses: &[Pose], traveller: &Traveller<'_>, ways: &Ways) -> Option<Self> {
        let last = *poses.last()?;
        if !is_sound(poses, traveller.state) {
            return None;
        }
        let here = traveller.state.position();
        let goes = last.position().distance(here) >= LEAST_WAY;
        // Poses that back up make no way either: then he waits where he is.
        let new = if goes { way(poses, traveller, ways) } else { None };
        let is_new = new.is_some();
        let (way, hint) = match new {
            Some(way) => (Arc::new(way), BEHIND_SAMPLES),
            None => (Arc::clone(traveller.way), nearest(traveller.way, here)),
        };
        let mut place = way.follow(here, hint);
        let mut stations = vec![place.station];
        for pose in poses {
            place = way.follow(pose.position(), place.sample);
            if place.lateral.abs() > ALONG {
                return None;
            }
            stations.push(place.station.max(stations[stations.len() - 1]));
        }
        let mut stretch = way.sample_at(stations[0])..=place.sample;
        if is_new && stretch.any(|sample| way.curvature(sample).abs() > TIGHTEST) {
            return None;
        }
        Some(Self { way, from: step, stations })
    }

    /// The acceleration (m/s^2) that holds its time for who is at a station (m) with a speed (m/s) at `step`.
    pub(crate) fn acceleration(&self, step: u32, station: f64, speed: f64) -> f64 {
        let ahead = step.saturating_sub(self.from) as usize + HORIZON;
        let wanted = self.stations[ahead.min(self.stations.len() - 1)];
        let seconds = HORIZON as f64 * STEP_SECONDS;
        let needed = 2.0 * (wanted - station - speed * seconds) / (seconds * seconds);
        needed.clamp(-MOST_BRAKING, MOST_ACCELERATION)
    }
}

/// Whether its numbers are those of somebody who drives on from `state`.
fn is_sound(poses: &[Pose], state: &AgentState) -> bool {
    let mut before = state.position() + state.velocity() * STEP_SECONDS;
    let mut most = LEAP;
    poses.iter().all(|pose| {
        // What is not a number is near to nothing.
        let is_near = pose.position().distance(before) <= most && pose.heading.is_finite();
        (before, most) = (pose.position(), FASTEST * STEP_SECONDS);
        is_near
    })
}

/// The way over the poses, and on along the lanes. The ground under it is as high as that of the own way beside it.
fn way(poses: &[Pose], traveller: &Traveller<'_>, ways: &Ways) -> Option<Way> {
    let Traveller { state, own, .. } = *traveller;
    let first = poses[0].position();
    let back = Point::unit(traveller.course);
    let steps = (LEAD / LEAD_STEP) as u32;
    let leads = (1..=steps).rev().map(|step| {
        let point = first - back * (LEAD_STEP * f64::from(step));
        Pose::new(point.x, point.y, traveller.course)
    });
    let mut sample = nearest(own, state.position());
    let ground = own.height(sample);
    let mut before = first;
    let states: Vec<Option<AgentState>> = leads
        .chain(poses.iter().copied())
        .map(|pose| {
            sample = own.follow(pose.position(), sample).sample;
            let velocity = (pose.position() - before) * (1.0 / STEP_SECONDS);
            before = pose.position();
            Some(AgentState {
                x: pose.x,
                y: pose.y,
                z: state.z + own.height(sample) - ground,
                heading: pose.heading,
                velocity_x: velocity.x,
                velocity_y: velocity.y,
                ..*state
            })
        })
        .collect();
    ways.of_log(&states, steps as usize, traveller.kind)
}

/// The sample of a way that is nearest to a point, wherever on it that is.
pub(crate) fn nearest(way: &Way, point: Point) -> usize {
    let away = |(_, sample): &(usize, &Point)| sample.distance_squared(point);
    let nearest = way.points().iter().enumerate().min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.map_or(0, |(sample, _)| sample)
}

#[cfg(test)]
mod tests {
    use world::geometry::Point3;
    use world::map::{Lane, Map, MapId};
    use world::pcg::Pcg32;
    use world::scene::TrackId;
    use world::traffic::{Taken, TrafficMove, UncheckedMoves};

    use super::*;
    use crate::character::Character;
    use crate::driver::Driver;

    /// A lane of 300 m to the east, which climbs by 5 %.
    fn road() -> Ways {
        let centerline = (0..600).map(|k| 0.5 * f64::from(k)).map(|x| Point3::new(x, 0.0, 0.05 * x)).collect();
        Ways::on(&Arc::new(Map { lanes: vec![Lane { id: MapId(1), centerline, ..Lane::default() }], ..Map::default() }))
    }

    fn state(x: f64, speed: f64) -> AgentState {
        AgentState {
            x,
            z: 0.05 * x + 0.75,
            velocity_x: speed,
            length: 4.6,
            width: 2.0,
            height: 1.5,
            ..AgentState::default()
        }
    }

    /// Somebody at x = 50 m.
    fn taken(ways: &Ways, speed: f64) -> Taken {
        let log: Vec<_> = (0..150).map(|k| Some(state(40.0 + f64::from(k), 10.0))).collect();
        let way = Arc::new(ways.of_log(&log, 10, AgentKind::Vehicle).unwrap());
        Taken { track: TrackId(1), kind: AgentKind::Vehicle, since_step: 0, state: state(50.0, speed), way }
    }

    /// Poses over 5 s, by the time (s).
    fn poses(at: impl Fn(f64) -> (f64, f64, f64)) -> Vec<Pose> {
        let pose = |step| {
            let (x, y, heading) = at(STEP_SECONDS * f64::from(step));
            Pose::new(x, y, heading)
        };
        (1..=50).map(pose).collect()
    }

    /// Where somebody is at each step who follows `poses`; each of his moves is checked.
    fn driven(ways: &Ways, speed: f64, poses: &[Pose]) -> Vec<AgentState> {
        let mut taken = taken(ways, speed);
        let mut driver = Driver::new(&taken, Character::IDM, ways);
        driver.follow(0, Some(poses), ways);
        let step = |step: u32| {
            driver.see(&taken);
            let state = driver.advance(step, driver.pace(step).unwrap_or(0.0));
            let moves = UncheckedMoves { step, moves: vec![TrafficMove { track: taken.track, state }] };
            taken.state = moves.check(step, std::slice::from_ref(&taken)).unwrap().moves()[0].state;
            taken.state
        };
        (0..40).map(step).collect()
    }

    #[test]
    fn a_trajectory_is_held_in_time_and_place() {
        let ways = road();
        // To the lane beside within 4 s, and slower.
        let share = |time: f64| (time / 4.0).min(1.0);
        let aside = |time: f64| 3.5 * share(time) * share(time) * (3.0 - 2.0 * share(time));
        let states = driven(&ways, 9.0, &poses(|time| (50.0 + 9.0 * time - 0.5 * time * time, aside(time), 0.0)));
        for (step, state) in states.iter().enumerate().skip(5) {
            let time = 0.1 * (step as f64 + 1.0);
            assert!((state.x - (50.0 + 9.0 * time - 0.5 * time * time)).abs() < 0.5, "step {step}: {state:?}");
            assert!((state.y - aside(time)).abs() < 0.4, "step {step}: {state:?}");
            assert!((state.z - (0.05 * state.x + 0.75)).abs() < 0.1, "it stays on the ground: {state:?}");
        }
    }

    #[test]
    fn who_is_to_stand_stands_and_backs_up_for_nobody() {
        let ways = road();
        let noise = |time: f64| 0.05 * libm::sin(40.0 * time);
        let stands = driven(&ways, 0.0, &poses(|time| (50.0 + noise(time), noise(time), noise(time))));
        assert!((stands[39].x - 50.0).abs() < 0.2 && stands[39].y == 0.0, "{:?}", stands[39]);
        let backs = driven(&ways, 1.0, &poses(|time| (50.0 - time, 0.0, 0.0)));
        assert!(backs.iter().all(|state| state.x >= 50.0) && backs[39].speed() < 0.01, "{:?}", backs[39]);
    }

    #[test]
    fn what_no_car_could_drive_is_no_trajectory() {
        let ways = road();
        let taken = taken(&ways, 9.0);
        let traveller =
            Traveller { kind: taken.kind, state: &taken.state, course: 0.0, own: &taken.way, way: &taken.way };
        let told = |poses: &[Pose]| Trajectory::new(0, poses, &traveller, &ways).is_some();
        let straight = poses(|time| (50.0 + 9.0 * time, 0.0, 0.0));
        assert!(told(&straight) && !told(&[]));
        for at in [0, 20, 49] {
            for nonsense in [
                Pose { x: f64::NAN, ..straight[at] },
                Pose { y: f64::INFINITY, ..straight[at] },
                Pose { heading: f64::NAN, ..straight[at] },
                Pose { y: 30.0, ..straight[at] },
            ] {
                let mut poses = straight.clone();
                poses[at] = nonsense;
                assert!(!told(&poses), "{at}: {nonsense:?}");
            }
        }
        let spins = |time: f64| (50.0 + 2.0 * libm::sin(4.0 * time), 2.0 - 2.0 * libm::cos(4.0 * time), 4.0 * time);
        let bends = |time: f64| (50.0 + (9.0 * time).min(12.0), (9.0 * time - 12.0).max(0.0), 0.0);
        assert!(!told(&poses(spins)) && !told(&poses(bends)));
    }

    #[test]
    fn whatever_it_says_the_moves_are_those_of_a_body() {
        let ways = road();
        let mut draw = Pcg32::new(1, 2);
        for round in 0..300 {
            let speed = draw.between(0.0, 20.0);
            let noise = [0.02, 0.2, 1.0, 4.0][round % 4];
            let turn = draw.between(-0.6, 0.6);
            let poses: Vec<Pose> = (1..=50)
                .map(|step| {
                    let driven = 0.1 * f64::from(step) * speed;
                    let mut near = || draw.between(-noise, noise);
                    let (x, y) = (driven * libm::cos(turn) + near(), driven * libm::sin(turn) + near());
                    Pose::new(50.0 + x, y, turn + near())
                })
                .collect();
            driven(&ways, speed, &poses);
        }
    }
}
