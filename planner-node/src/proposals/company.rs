//! Who else is on the road, and where each is expected: boxes, and the stretch of the line that each takes.

use world::geometry::{OrientedBox, Point, Pose, angle_difference};
use world::observation::{Observation, ObservedAgent};
use world::plan::{Future, PLAN_STEPS, PredictedTrajectory, Prediction, STEP_SECONDS};
use world::scene::{AgentKind, TrackId};

use crate::idm::{Corridor, Footprint};

/// Steps from one look at the others to the next.
pub const LOOK_STEPS: usize = 2;

/// Looks: now, and every 0.2 s up to 5 s.
pub const LOOKS: usize = PLAN_STEPS / LOOK_STEPS + 1;

/// The most futures that are looked at: the likeliest.
pub const FUTURES: usize = 3;

/// What is this much above or below the line (m) is on another level.
const OTHER_LEVEL: f64 = 3.5;

/// Who stays farther from the line than this (m) meets nobody on it.
const REACH: f64 = 12.0;

/// Below this (m/s) an agent stands: what is logged is noise.
const STANDING: f64 = 0.3;

/// Beyond this distance from one look to the next (m) the nearest sample is looked for anew.
const STRIDE: f64 = 3.0;

/// Where somebody is expected at a look.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    pub outline: OrientedBox,
    /// Speed (m/s).
    pub speed: f64,
    /// The same along the line.
    pub along: f64,
    pub footprint: Footprint,
}

/// Somebody else.
#[derive(Clone, Copy, Debug)]
pub struct Other {
    pub track: TrackId,
    pub kind: AgentKind,
    /// Of the centre above the ground (m).
    pub z: f64,
    /// Radius around the box (m).
    pub radius: f64,
    /// Whether it is expected otherwise in each future; else alike in all.
    differs: bool,
    /// Its first place.
    first: usize,
}

/// The likeliest futures, at most so many, the likeliest first; of equals the first.
pub fn likeliest(prediction: Option<&Prediction>, most: usize) -> [Option<&Future>; FUTURES] {
    let all = prediction.map_or(&[][..], Prediction::futures);
    let mut chosen: [Option<&Future>; FUTURES] = [None; FUTURES];
    for place in 0..most.min(FUTURES) {
        let rest = all
            .iter()
            .filter(|future| !chosen[..place].iter().flatten().any(|one| std::ptr::eq::<Future>(*one, *future)));
        chosen[place] = rest.reduce(|best, future| if future.probability > best.probability { future } else { best });
    }
    chosen
}

/// Everybody who may be met. Buffers are kept from step to step.
#[derive(Clone, Debug, Default)]
pub struct Company {
    others: Vec<Other>,
    places: Vec<Expected>,
    probabilities: Vec<f64>,
}

impl Company {
    /// Takes in who is seen, and where each is expected: by the prediction, else at constant velocity. The AV is at sample `own`.
    pub fn fill(
        &mut self,
        corridor: &Corridor,
        own: usize,
        observation: &Observation,
        prediction: Option<&Prediction>,
        most: usize,
    ) {
        self.others.clear();
        self.places.clear();
        let futures = likeliest(prediction, most);
        self.probabilities.clear();
        self.probabilities.extend(futures.iter().flatten().map(|future| future.probability));
        if self.probabilities.is_empty() {
            // One, of which nothing is known.
            self.probabilities.push(1.0);
        }
        let sum: f64 = self.probabilities.iter().sum();
        let count = self.probabilities.len() as f64;
        self.probabilities.iter_mut().for_each(|p| *p = if sum > 0.0 { *p / sum } else { 1.0 / count });
        for agent in &observation.agents {
            let predicted = futures.map(|future| future.and_then(|future| of(future, agent.track)));
            self.add(corridor, own, agent, predicted);
        }
    }

    fn add(
        &mut self,
        corridor: &Corridor,
        own: usize,
        agent: &ObservedAgent,
        predicted: [Option<&PredictedTrajectory>; FUTURES],
    ) {
        let state = &agent.state;
        let sample = corridor.nearest_pass(state.position(), own);
        if (state.z - corridor.height(sample)).abs() > OTHER_LEVEL {
            return;
        }
        let standing = state.speed() < STANDING;
        let away = corridor.project(state.position(), sample).lateral.abs();
        if away > REACH + if standing { 0.0 } else { 1.2 * state.speed() * PLAN_STEPS as f64 * STEP_SECONDS } {
            return;
        }
        let (half_length, half_width) = (0.5 * state.length, 0.5 * state.width);
        let differs = !standing && self.probabilities.len() > 1 && predicted.iter().any(Option::is_some);
        let first = self.places.len();
        let futures = if differs { self.probabilities.len() } else { 1 };
        for predicted in &predicted[..futures] {
            let mut hint = sample;
            let mut before = state.pose();
            for look in 0..LOOKS {
                let pose = if look == 0 || standing {
                    state.pose()
                } else if let Some(trajectory) = predicted {
                    trajectory.poses[look * LOOK_STEPS - 1]
                } else {
                    let ahead = state.velocity() * (look as f64 * LOOK_STEPS as f64 * STEP_SECONDS);
                    Pose::new(state.x + ahead.x, state.y + ahead.y, state.heading)
                };
                let moved = pose.position().distance(before.position());
                let speed = match look {
                    _ if standing => 0.0,
                    0 => state.speed(),
                    _ => moved / (LOOK_STEPS as f64 * STEP_SECONDS),
                };
                if moved > STRIDE {
                    hint = corridor.nearest_pass(pose.position(), hint);
                }
                let place = corridor.project(pose.position(), hint);
                hint = place.sample;
                let turn = angle_difference(corridor.heading(place.sample), pose.heading);
                let forward = Point::unit(pose.heading);
                let (cos, sin) = (corridor.direction(place.sample).dot(forward), libm::sin(turn));
                let along = cos.abs() * half_length + sin.abs() * half_width;
                let across = sin.abs() * half_length + cos.abs() * half_width;
                self.places.push(Expected {
                    outline: OrientedBox { center: pose.position(), forward, half_length, half_width },
                    speed,
                    along: speed * cos,
                    footprint: Footprint {
                        stations: (place.station - along, place.station + along),
                        laterals: (place.lateral - across, place.lateral + across),
                    },
                });
                before = pose;
            }
        }
        let radius = (half_length * half_length + half_width * half_width).sqrt();
        self.others.push(Other { track: agent.track, kind: agent.kind, z: state.z, radius, differs, first });
    }

    pub fn others(&self) -> &[Other] {
        &self.others
    }

    /// The probability of each future; they sum to 1.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// Where somebody is at a look who brakes by `deceleration` (m/s^2) from now on, on the way that the likeliest future says.
    pub fn braking(&self, other: &Other, look: usize, deceleration: f64) -> Expected {
        let places = self.places(other, 0);
        let seconds = (look * LOOK_STEPS) as f64 * STEP_SECONDS;
        let speed = places[0].speed;
        let driven = seconds.min(speed / deceleration);
        let mut way = speed * driven - 0.5 * deceleration * driven * driven;
        let slowed = (speed - deceleration * seconds).max(0.0);
        for pair in places[..=look.max(1)].windows(2) {
            let length = pair[0].outline.center.distance(pair[1].outline.center);
            if way <= length {
                let share = if length > 0.0 { way / length } else { 0.0 };
                let mut place = pair[0];
                place.outline.center = place.outline.center + (pair[1].outline.center - pair[0].outline.center) * share;
                place.speed = slowed;
                return place;
            }
            way -= length;
        }
        Expected { speed: slowed, ..places[look] }
    }

    /// Where somebody is expected in a future, look by look.
    pub fn places(&self, other: &Other, future: usize) -> &[Expected] {
        let first = other.first + if other.differs { future * LOOKS } else { 0 };
        &self.places[first..first + LOOKS]
    }
}

fn of(future: &Future, track: TrackId) -> Option<&PredictedTrajectory> {
    future.trajectories.iter().find(|trajectory| trajectory.track == track)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use world::observation::ObservedAgent;
    use world::plan::{Future, UncheckedPrediction};

    use super::*;
    use crate::gauss_newton_planner::tests::Road;

    /// Someone ahead who drives at this speed (m/s), and is expected on such a way: what is driven and turned in each step (m, rad).
    fn road(speed: f64, futures: &[(f64, Vec<(f64, f64)>)]) -> Road {
        let mut road = Road::new(0.5, 5.0, "strict").with_standing_car(20.0);
        let agent = &mut road.observation.agents[0];
        let velocity = Point::unit(agent.state.heading) * speed;
        (agent.state.velocity_x, agent.state.velocity_y) = (velocity.x, velocity.y);
        let track = agent.track;
        let future = |(probability, way): &(f64, Vec<(f64, f64)>)| {
            let mut pose = agent.state.pose();
            let poses = way.iter().map(|(length, turn)| {
                let place = pose.position() + Point::unit(pose.heading) * *length;
                pose = Pose::new(place.x, place.y, pose.heading + turn);
                pose
            });
            let trajectories = vec![PredictedTrajectory { track, poses: poses.collect() }];
            Future { probability: *probability, trajectories, controls: vec![] }
        };
        let futures = futures.iter().map(future).collect();
        road.prediction = UncheckedPrediction { futures, ..UncheckedPrediction::default() };
        road
    }

    fn company(road: &Road, most: usize) -> Company {
        let mut corridor = Corridor::new(&road.briefing.reference_line);
        assert_eq!(corridor.move_to(&road.observation.window), Some(()));
        let mut company = Company::default();
        let own = corridor.own(road.observation.av.position());
        road.step(|step| company.fill(&corridor, own, step.observation, step.prediction, most));
        company
    }

    fn straight(length: f64) -> Vec<(f64, f64)> {
        vec![(length, 0.0); PLAN_STEPS]
    }

    proptest! {
        #[test]
        fn who_brakes_stands_in_the_end_and_never_leaves_the_way(
            speed in 0.4_f64..15.0,
            way in prop::collection::vec((0.0..1.5, -0.1..0.1), PLAN_STEPS),
        ) {
            let road = road(speed, &[(1.0, way)]);
            let company = company(&road, 1);
            let other = company.others()[0];
            let places = company.places(&other, 0);
            let lengths = |places: &[Expected]| -> f64 {
                places.windows(2).map(|pair| pair[0].outline.center.distance(pair[1].outline.center)).sum()
            };
            let start = places[0].outline.center;
            let (mut before, mut stood) = (start, false);
            for look in 0..LOOKS {
                let there = company.braking(&other, look, 5.0);
                let seconds = (look * LOOK_STEPS) as f64 * STEP_SECONDS;
                let driven = 0.5 * speed * speed / 5.0;
                prop_assert!(there.outline.center.distance(start) <= lengths(&places[..=look]).min(driven) + 1e-9);
                prop_assert!((there.speed - (speed - 5.0 * seconds).max(0.0)).abs() < 1e-9);
                if stood {
                    // Where it stands it stays, as far as the way went then.
                    let further = there.outline.center.distance(before);
                    prop_assert!(further <= lengths(&places[look - 1..=look]) + 1e-9);
                }
                (before, stood) = (there.outline.center, there.speed == 0.0);
            }
            prop_assert_eq!(company.braking(&other, LOOKS - 1, 5.0).speed, 0.0);
        }
    }

    #[test]
    fn who_brakes_on_a_way_that_is_long_enough_comes_as_far_as_braking_takes() {
        let road = road(10.0, &[(1.0, straight(1.0))]);
        let company = company(&road, 1);
        let other = company.others()[0];
        let start = company.places(&other, 0)[0].outline.center;
        let way = |look: usize| company.braking(&other, look, 5.0).outline.center.distance(start);
        // After 1 s, after 2 s, and for ever.
        for (look, expected) in [(0, 0.0), (5, 7.5), (10, 10.0), (25, 10.0)] {
            assert!((way(look) - expected).abs() < 1e-9, "{look}: {}", way(look));
        }
    }

    #[test]
    fn only_the_likeliest_futures_are_looked_at_and_their_probabilities_sum_to_one() {
        let futures = [(0.1, straight(0.1)), (0.4, straight(0.4)), (0.2, straight(0.2)), (0.3, straight(0.3))];
        let road = road(4.0, &futures);
        for most in 1..=4 {
            let company = company(&road, most);
            assert_eq!(company.probabilities().len(), most.min(FUTURES));
            assert!((company.probabilities().iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let other = company.others()[0];
            for (future, speed) in [4.0, 3.0, 2.0].into_iter().enumerate().take(most) {
                assert!((company.places(&other, future)[LOOKS - 1].speed - speed).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn who_stands_stands_in_every_future() {
        let road = road(0.2, &[(0.6, straight(0.5)), (0.4, straight(1.0))]);
        let company = company(&road, 3);
        let other = company.others()[0];
        for future in 0..2 {
            let places = company.places(&other, future);
            assert!(places.iter().all(|there| there.speed == 0.0 && there.outline == places[0].outline));
        }
    }

    #[test]
    fn of_whom_nothing_is_told_keeps_its_velocity() {
        let mut road = road(6.0, &[(1.0, straight(0.1))]);
        road.prediction = UncheckedPrediction::default();
        let company = company(&road, 3);
        let places = company.places(&company.others()[0], 0);
        assert!((places[LOOKS - 1].outline.center.distance(places[0].outline.center) - 30.0).abs() < 1e-9);
        assert_eq!(company.probabilities(), [1.0]);
    }

    #[test]
    fn who_is_on_another_level_or_far_from_the_line_is_no_company() {
        let seen = |z: f64, left: f64| {
            let mut road = Road::new(0.0, 5.0, "strict").with_standing_car(20.0);
            let ObservedAgent { state, .. } = &mut road.observation.agents[0];
            (state.z, state.y) = (z, state.y + left);
            company(&road, 1).others().len()
        };
        assert_eq!([seen(0.0, 0.0), seen(5.0, 0.0), seen(0.0, 13.0), seen(0.0, -11.0)], [1, 0, 0, 1]);
    }
}
