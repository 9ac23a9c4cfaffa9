//! One drive through one scene: what is seen at a step, what a plan makes of it, what the judges say.
//!
//! Pure: no bus, no clock, no files. The same scene, protocol and plans give the same bits.
//!
//! | module | what |
//! | --- | --- |
//! | [`course`] | what stays the same over an episode; the reading of the AV against it; the human's own reading |
//! | [`traffic`] | the other road users, step by step |
//! | [`driver`] | driving an episode in one process |

pub mod course;
pub mod driver;
mod referee;
pub mod traffic;

use std::sync::Arc;

use thiserror::Error;
use wire::proto::{self, EndReason};
use world::geometry::{Point, angle_difference};
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, Plan, STEP_SECONDS};
use world::route::{Route, RouteError, RouteStyle};
use world::scene::{AgentState, Scene};
use world::vehicle::{BicycleModel, Limits, VehicleState};

use self::course::{Course, Human, Reader};
use self::referee::{Moment, Referee};
use crate::judges::Body;
use crate::metrics::{self, Drive};
use crate::protocol::{Motion, Protocol, SettingError, StrictSettings};
use crate::tracker;

/// Why a scene cannot be driven under a protocol.
#[derive(Debug, Error)]
pub enum Undrivable {
    /// The log ends before there is a step to drive.
    #[error("it has {steps} logged steps, but the first step driven needs log index {needed}")]
    TooShort {
        /// Steps of the log.
        steps: usize,
        /// The log index that is needed.
        needed: usize,
    },
    /// The AV is not where the drive starts.
    #[error("the AV is not valid at log index {start}, where the drive starts")]
    AvMissing {
        /// The log index.
        start: usize,
    },
    /// No route follows the logged AV.
    #[error(transparent)]
    Route(#[from] RouteError),
    /// A setting of the protocol makes no sense.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Undrivable {
    /// The end of the episode that never began.
    #[must_use]
    pub fn end(&self, scene: &Scene, protocol: &Protocol) -> proto::EpisodeEnd {
        let metrics = named(metrics::nothing_measured());
        proto::EpisodeEnd {
            scene: scene.id().to_string(),
            protocol: protocol.name().to_owned(),
            reason: EndReason::Undrivable.into(),
            detail: self.to_string(),
            metrics,
            ..proto::EpisodeEnd::default()
        }
    }
}

/// What came of one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Advance {
    /// The AV after the step, and what the judges say.
    pub record: proto::StepRecord,
    /// What happened in the step.
    pub events: Vec<proto::Event>,
    /// Why the episode is over, if it is.
    pub ended: Option<EndReason>,
}

/// A finished episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How it ended, with all metrics. The counts of observations, plans and predictions are the caller's to fill in.
    pub end: proto::EpisodeEnd,
    /// A record a step.
    pub records: Vec<proto::StepRecord>,
    /// Everything that happened.
    pub events: Vec<proto::Event>,
}

/// One drive through one scene.
#[derive(Clone, Debug)]
pub struct Episode {
    scene: Arc<Scene>,
    protocol: Protocol,
    settings: StrictSettings,
    /// Steps that will be driven at most.
    horizon: u32,
    vehicle: BicycleModel,
    limits: Limits,
    course: Course,
    human: Human,
    reader: Reader,
    referee: Referee,
    av: Body,
    control: Control,
    /// Height (m) of the AV's centre above the route's ground, as logged at the start.
    height: f64,
    /// Nearest sample of the reference line.
    sample: usize,
    start_station: f64,
    step: u32,
    records: Vec<proto::StepRecord>,
    events: Vec<proto::Event>,
    advance: Advance,
    detail: String,
}

impl Episode {
    /// The episode of `scene` under `protocol`, before its first step.
    ///
    /// # Errors
    /// [`Undrivable`] says why there is nothing to drive.
    pub fn new(scene: Arc<Scene>, protocol: &Protocol) -> Result<Self, Undrivable> {
        protocol.check()?;
        let Protocol::Strict(settings) = protocol.clone();
        let start = settings.start as usize;
        let end = scene.steps().min(start.saturating_add(settings.horizon as usize).saturating_add(1));
        if end < start + 2 {
            return Err(Undrivable::TooShort { steps: scene.steps(), needed: start + 1 });
        }
        let state = scene.av().states[start].ok_or(Undrivable::AvMissing { start })?;
        let route = Route::of_log(&scene, RouteStyle::Strict)?;
        let course = Course::of(&scene, route, &settings);
        let human = Human::of(&scene, &course, start, end);
        let vehicle = settings.vehicle(state.length);
        let av = Body { speed: state.velocity().dot(Point::unit(state.heading)).max(0.0), ..Body::of(state) };
        let mut reader = Reader::default();
        let reading = reader.read(&course, start, &av);
        let height = state.z - course.level.height(state.position()).unwrap_or(state.z);
        let horizon = (end - 1 - start) as u32;
        Ok(Self {
            control: Control { acceleration: 0.0, steering: logged_steering(&scene, start, &vehicle) },
            referee: Referee::new(&scene, &course.traffic, vehicle.wheelbase),
            limits: settings.limits(),
            protocol: protocol.clone(),
            start_station: reading.station,
            sample: reading.sample,
            records: Vec::with_capacity(horizon as usize),
            events: Vec::new(),
            advance: Advance::default(),
            detail: String::new(),
            step: 0,
            scene,
            settings,
            horizon,
            vehicle,
            course,
            human,
            reader,
            av,
            height,
        })
    }

    fn log_index(&self) -> usize {
        (self.settings.start + self.step) as usize
    }

    fn agents_at(&self, log_index: usize) -> Vec<ObservedAgent> {
        let others = self.scene.tracks().iter().enumerate().filter(|(index, _)| *index != self.scene.av_index());
        let seen = others.filter_map(|(_, track)| {
            let state = track.states[log_index]?;
            Some(ObservedAgent { track: track.id, kind: track.kind, state })
        });
        seen.collect()
    }

    /// What a driver is told before the first step.
    #[must_use]
    pub fn briefing(&self) -> Briefing {
        let history = (0..self.settings.start as usize).filter_map(|log_index| {
            let av = self.scene.av().states[log_index]?;
            Some(HistoryStep { log_index: log_index as u32, av, agents: self.agents_at(log_index) })
        });
        Briefing {
            scene: self.scene.id().clone(),
            protocol: self.protocol.name().to_owned(),
            start: self.settings.start,
            horizon: self.horizon,
            wheelbase: self.vehicle.wheelbase,
            map: Arc::clone(self.scene.map()),
            route: self.course.route.lanes.clone(),
            reference_line: Arc::clone(&self.course.route.line),
            history: history.collect(),
        }
    }

    /// What is to be seen now.
    #[must_use]
    pub fn observe(&self) -> Observation {
        let log_index = self.log_index();
        let signals = self.scene.signals(log_index);
        Observation {
            step: self.step,
            log_index: log_index as u32,
            av: self.av.state,
            control: self.control,
            agents: self.agents_at(log_index),
            signals: signals.to_vec(),
            window: self.course.route.window(self.sample, signals),
        }
    }

    /// Why the episode is over, if it is.
    #[must_use]
    pub fn ended(&self) -> Option<EndReason> {
        self.advance.ended
    }

    /// Drives one step of `plan`. After the end nothing more happens.
    pub fn advance(&mut self, plan: &Plan) -> &Advance {
        if self.advance.ended.is_some() {
            return &self.advance;
        }
        let before = self.av;
        self.drive(plan);
        let log_index = self.log_index() + 1;
        let reading = self.reader.read(&self.course, log_index, &self.av);
        self.sample = reading.sample;
        self.advance.events.clear();
        let yaw_rate = angle_difference(before.state.heading, self.av.state.heading) / STEP_SECONDS;
        self.advance.record = proto::StepRecord {
            step: self.step,
            log_index: log_index as u32,
            av: Some((&self.av.state).into()),
            control: Some(self.control.into()),
            yaw_rate,
            position_error: self
                .human
                .body(log_index)
                .map(|human| human.outline.center.distance(self.av.outline.center)),
            ..proto::StepRecord::default()
        };
        let (course, human, av) = (&self.course, &self.human, &self.av);
        let moment = Moment { course, human, log_index, av, reading: &reading };
        self.referee.judge(&moment, &mut self.advance);
        self.step += 1;
        self.advance.ended = self.reason_to_end();
        self.advance.record.events = self.advance.events.len() as u32;
        self.records.push(self.advance.record);
        self.events.extend_from_slice(&self.advance.events);
        &self.advance
    }

    fn reason_to_end(&self) -> Option<EndReason> {
        let record = &self.advance.record;
        let collision = match self.settings.ending_collision {
            crate::protocol::EndingCollision::AtFault => record.at_fault_collision,
            crate::protocol::EndingCollision::Any => record.collision,
            crate::protocol::EndingCollision::None => false,
        };
        if collision {
            Some(EndReason::Collision)
        } else if record.off_route {
            Some(EndReason::OffRoute)
        } else if self.step == self.settings.horizon {
            Some(EndReason::Horizon)
        } else if self.step == self.horizon {
            Some(EndReason::LogEnd)
        } else {
            None
        }
    }

    /// Moves the AV by one step.
    fn drive(&mut self, plan: &Plan) {
        let state = self.av.state;
        let now = VehicleState { x: state.x, y: state.y, heading: state.heading, speed: self.av.speed };
        let next = match self.settings.motion {
            Motion::Bicycle => {
                let steering = self.control.steering;
                let wanted = plan.controls().and_then(|controls| controls.first().copied());
                let wanted =
                    wanted.unwrap_or_else(|| tracker::track(&now, steering, self.vehicle.wheelbase, plan.states()));
                self.control = self.limits.apply(wanted, steering, STEP_SECONDS);
                let next = self.vehicle.step(now, self.control, STEP_SECONDS);
                // What braking did, where the AV came to a stop within the step.
                self.control.acceleration = (next.speed - now.speed) / STEP_SECONDS;
                next
            }
            Motion::Playback => {
                let first = plan.states()[0];
                let next = VehicleState { x: first.x, y: first.y, heading: first.heading, speed: first.speed.max(0.0) };
                self.control = control_between(&now, &next, self.vehicle.wheelbase);
                next
            }
        };
        self.av = self.body_at(&next);
    }

    fn body_at(&self, vehicle: &VehicleState) -> Body {
        let forward = Point::unit(vehicle.heading);
        let place = Point::new(vehicle.x, vehicle.y);
        let ground = self.course.level.height(place);
        let state = AgentState {
            x: vehicle.x,
            y: vehicle.y,
            z: ground.map_or(self.av.state.z, |ground| ground + self.height),
            heading: vehicle.heading,
            velocity_x: forward.x * vehicle.speed,
            velocity_y: forward.y * vehicle.speed,
            ..self.av.state
        };
        Body { speed: vehicle.speed, ..Body::of(state) }
    }

    /// Ends the episode: the driver failed for `reason`.
    pub fn fail(&mut self, reason: String) -> &Advance {
        if self.advance.ended.is_none() {
            self.advance.ended = Some(EndReason::DriverFailed);
            self.advance.events.clear();
            self.advance.events.push(proto::Event {
                step: self.step,
                kind: proto::event::Kind::DriverFailed.into(),
                text: format!("the driver failed: {reason}"),
                ..proto::Event::default()
            });
            self.events.extend_from_slice(&self.advance.events);
            self.detail = reason;
        }
        &self.advance
    }

    /// The outcome of what was driven.
    #[must_use]
    pub fn finish(self) -> Outcome {
        let first = self.settings.start as usize + 1;
        let human: Vec<_> = (first..first + self.records.len())
            .map(|log_index| self.human.body(log_index).map(|body| body.state.pose()))
            .collect();
        let measured = metrics::measure(&Drive {
            records: &self.records,
            events: &self.events,
            at_fault: self.referee.at_fault(),
            human: &human,
            start_station: self.start_station,
            human_route_progress: self.human.route_progress(),
        });
        let end = proto::EpisodeEnd {
            scene: self.scene.id().to_string(),
            protocol: self.protocol.name().to_owned(),
            reason: self.advance.ended.unwrap_or_default().into(),
            detail: self.detail,
            steps: self.step,
            metrics: named(measured),
            records: self.records.len() as u32,
            events: self.events.len() as u32,
            ..proto::EpisodeEnd::default()
        };
        Outcome { end, records: self.records, events: self.events }
    }
}

fn named(values: Vec<Option<f64>>) -> Vec<proto::Metric> {
    let metric =
        |(metric, value): (&metrics::Metric, Option<f64>)| proto::Metric { name: metric.name.to_owned(), value };
    metrics::METRICS.iter().zip(values).map(metric).collect()
}

/// The control that leads from one state to the next.
fn control_between(now: &VehicleState, next: &VehicleState, wheelbase: f64) -> Control {
    let yaw_rate = angle_difference(now.heading, next.heading) / STEP_SECONDS;
    Control {
        acceleration: (next.speed - now.speed) / STEP_SECONDS,
        steering: steering_of(yaw_rate, next.speed, wheelbase),
    }
}

/// The steering angle (rad) at which a vehicle at `speed` (m/s) turns at `yaw_rate` (rad/s); 0 for one that hardly moves.
fn steering_of(yaw_rate: f64, speed: f64, wheelbase: f64) -> f64 {
    if speed < 0.5 { 0.0 } else { libm::atan(wheelbase * yaw_rate / speed) }
}

/// How the wheels stand when the drive starts, read from the log of the last half second.
fn logged_steering(scene: &Scene, start: usize, vehicle: &BicycleModel) -> f64 {
    let states = &scene.av().states;
    let Some((now, before)) = states[start].zip(start.checked_sub(5).and_then(|index| states[index])) else {
        return 0.0;
    };
    let yaw_rate = angle_difference(before.heading, now.heading) / (5.0 * STEP_SECONDS);
    let speed = 0.5 * (now.speed() + before.speed());
    steering_of(yaw_rate, speed, vehicle.wheelbase).clamp(-vehicle.steering_clip, vehicle.steering_clip)
}
