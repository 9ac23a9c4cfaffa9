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
        let futures = self.likeliest(prediction, most.min(FUTURES));
        for agent in &observation.agents {
            let predicted = futures.map(|future| future.and_then(|future| of(future, agent.track)));
            self.add(corridor, own, agent, predicted);
        }
    }

    /// The likeliest futures; none at all is one, of which nothing is known.
    fn likeliest<'a>(&mut self, prediction: Option<&'a Prediction>, most: usize) -> [Option<&'a Future>; FUTURES] {
        let all = prediction.map_or(&[][..], Prediction::futures);
        let mut chosen = [None; FUTURES];
        self.probabilities.clear();
        let mut order: [usize; 16] = std::array::from_fn(|i| i);
        let count = all.len().min(16);
        order[..count].sort_by(|a, b| all[*b].probability.total_cmp(&all[*a].probability).then(a.cmp(b)));
        for (place, index) in chosen.iter_mut().zip(&order[..count.min(most)]) {
            *place = Some(&all[*index]);
            self.probabilities.push(all[*index].probability);
        }
        if self.probabilities.is_empty() {
            self.probabilities.push(1.0);
        }
        let sum: f64 = self.probabilities.iter().sum();
        let count = self.probabilities.len() as f64;
        self.probabilities.iter_mut().for_each(|p| *p = if sum > 0.0 { *p / sum } else { 1.0 / count });
        chosen
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
        let differs = !standing && self.probabilities.len() > 1 && predicted[0].is_some();
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
