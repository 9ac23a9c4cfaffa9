//! The rules of `strict`: a bicycle model, oriented boxes, every agent, whose fault it was; what the logged AV does wrong too
//! does not count.
//!
//! | module | what |
//! | --- | --- |
//! | [`course`] | what stays the same over an episode; the reading of the AV against it |
//! | [`human`] | the logged AV's own reading, and what is netted because of it |
//! | [`traffic`] | the other road users, step by step |
//! | `referee` | readings become a step's record and events |

pub mod course;
pub mod human;
mod referee;
pub mod traffic;

use std::collections::BTreeSet;
use std::ops::Range;

use wire::proto::{self, EndReason};
use world::geometry::{Point, Pose, angle_difference};
use world::plan::{Control, PlanState, STEP_SECONDS};
use world::reference_line::ReferenceWindow;
use world::route::follow::Followed;
use world::route::{Route, RouteStyle};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Judgement, Scene, Unjudged};
use world::signal::Signal;
use world::vehicle::{BicycleModel, Limits, VehicleState};

use self::course::{Course, Reader};
use self::human::Human;
use self::referee::{Moment, Referee};
use self::traffic::Traffic;
use crate::advance::{Advance, Undrivable, control_between, steering_of};
use crate::guidance::{Aged, Guidance, STEP_US};
use crate::judges::Body;
use crate::metrics::{self, Counted, Drive, Start};
use crate::protocol::{EndingCollision, Motion, StrictSettings};
use crate::tracker;
use crate::traffic::company::Sight;

/// An AV under these rules.
#[derive(Clone, Debug)]
pub(super) struct Strict {
    settings: StrictSettings,
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
    /// Where it is on the reference line.
    place: Followed,
    begun: Start,
    /// The log index after the last step.
    end: usize,
    /// What the scene does not allow to judge.
    unjudged: BTreeSet<Judgement>,
}

impl Strict {
    /// The AV in `state` at the start of a drive that ends before log index `end`.
    pub(super) fn new(
        bridged: &Bridged,
        settings: StrictSettings,
        state: AgentState,
        end: usize,
    ) -> Result<Self, Undrivable> {
        let scene: &Scene = bridged.judged();
        let start = settings.start as usize;
        let route = Route::of_log(scene, RouteStyle::Strict)?;
        let vehicle = settings.vehicle(state.length)?;
        let course = Course::of(bridged, route, &settings, vehicle.wheelbase);
        let human = Human::of(bridged, &course, start, end);
        let av = Body { speed: state.velocity().dot(Point::unit(state.heading)).max(0.0), ..Body::of(state) };
        let mut reader = Reader::following(human.at_start());
        let place = reader.follow(&course, state.pose(), state.z - 0.5 * state.height);
        let reading = reader.read(&course, &av, place);
        let height = state.z - course.route.line.z[place.sample];
        let steering = logged_steering(scene, start, &vehicle);
        let begun = Start {
            station: reading.station,
            speed: av.speed,
            heading: state.heading,
            yaw_rate: vehicle.yaw_rate(av.speed, steering),
        };
        Ok(Self {
            control: Control { acceleration: 0.0, steering },
            referee: Referee::new(scene, &course.traffic, vehicle.wheelbase, end.saturating_sub(start)),
            limits: settings.limits(),
            begun,
            end,
            unjudged: bridged.unjudged().iter().map(Unjudged::judgement).collect(),
            place,
            settings,
            vehicle,
            course,
            human,
            reader,
            av,
            height,
        })
    }

    pub(super) fn wheelbase(&self) -> f64 {
        self.vehicle.wheelbase
    }

    pub(super) fn route(&self) -> &Route {
        &self.course.route
    }

    pub(super) fn av(&self) -> &AgentState {
        &self.av.state
    }

    /// What there is to see when agents are taken over for `step`.
    pub(super) fn sight(&self, step: u32, log_index: usize) -> Sight<'_> {
        let (line, sample) = (&*self.course.route.line, self.place.sample);
        Sight { step, log_index, av: self.av, line, sample, traffic: &self.course.traffic }
    }

    /// The other road users, as the judges see them.
    pub(super) fn traffic_mut(&mut self) -> &mut Traffic {
        &mut self.course.traffic
    }

    pub(super) fn control(&self) -> Control {
        self.control
    }

    pub(super) fn window(&self, signals: &[Signal]) -> ReferenceWindow {
        self.course.route.window(self.place.sample, signals)
    }

    /// Judges the AV at `log_index`, and says whether that ends the episode.
    pub(super) fn judge(&mut self, log_index: usize, advance: &mut Advance) -> Option<EndReason> {
        let reading = self.reader.read(&self.course, &self.av, self.place);
        let in_one_lane = self.reader.in_one_lane(&self.course);
        let (course, human, av) = (&self.course, &self.human, &self.av);
        let moment = Moment { course, human, log_index, av, reading: &reading, in_one_lane };
        self.referee.judge(&moment, advance);
        let record = &advance.record;
        let collision = match self.settings.ending_collision {
            EndingCollision::AtFault => record.at_fault_collision,
            EndingCollision::Any => record.collision,
            EndingCollision::None => false,
        };
        if collision {
            Some(EndReason::Collision)
        } else if record.off_route {
            Some(EndReason::OffRoute)
        } else {
            None
        }
    }

    /// The metrics of what was driven, beside the `human` at the same log indices.
    pub(super) fn measure(
        &self,
        records: &[proto::StepRecord],
        events: &[proto::Event],
        human: &[Option<Pose>],
        counted: Counted<'_>,
    ) -> Vec<Option<f64>> {
        metrics::measure(&Drive {
            records,
            events,
            counted,
            at_fault: self.referee.at_fault(),
            human,
            start: self.begun,
            wheelbase: self.vehicle.wheelbase,
            driven: &self.reader.settle(&self.course),
            human_stations: self.human.stations(),
            horizon: self.end,
            unjudged: &self.unjudged,
            netted: self.referee.netted_steps(),
        })
    }

    /// Moves the AV by one step.
    pub(super) fn drive(&mut self, guidance: &Guidance<'_>) {
        if let (Motion::Playback, Some(plan)) = (self.settings.motion, guidance.now) {
            return self.put(&plan.states(0)[0], None);
        }
        let state = self.av.state;
        let now = VehicleState { x: state.x, y: state.y, heading: state.heading, speed: self.av.speed };
        let mut next = now;
        if guidance.since_us > 0 {
            next = self.follow(&next, guidance.before, 0..guidance.since_us);
        }
        next = self.follow(&next, guidance.now, guidance.since_us..STEP_US);
        // What braking did, where the AV came to a stop within the step.
        self.control.acceleration = (next.speed - now.speed) / STEP_SECONDS;
        self.arrive(&next);
    }

    /// Where the AV is that follows a plan for a part of a step (us). Without a plan it keeps its speed and its wheels as they are.
    fn follow(&mut self, now: &VehicleState, plan: Option<Aged<'_>>, part: Range<u32>) -> VehicleState {
        let steering = self.control.steering;
        let seconds = f64::from(part.end.saturating_sub(part.start)) / 1e6;
        let hold = Control { acceleration: 0.0, steering };
        let wanted = plan.map_or(hold, |plan| match plan.control() {
            Some(control) => control.unwrap_or(hold),
            None => tracker::track_for(seconds, now, steering, self.vehicle.wheelbase, &plan.states(part.start)),
        });
        self.control = self.limits.apply(wanted, steering, seconds);
        self.vehicle.step(*now, self.control, seconds)
    }

    /// Puts the AV on a state a step later, wherever that is. What brought it there is `control`, or what a car would have needed.
    pub(super) fn put(&mut self, state: &PlanState, control: Option<Control>) {
        let before = self.av.state;
        let now = VehicleState { x: before.x, y: before.y, heading: before.heading, speed: self.av.speed };
        let next = VehicleState { x: state.x, y: state.y, heading: state.heading, speed: state.speed.max(0.0) };
        self.control = control.unwrap_or_else(|| control_between(&now, &next, self.vehicle.wheelbase));
        self.arrive(&next);
    }

    fn arrive(&mut self, next: &VehicleState) {
        let ground = self.av.state.z - self.height;
        self.place = self.reader.follow(&self.course, next.pose(), ground);
        self.av = self.body_at(next);
    }

    fn body_at(&self, vehicle: &VehicleState) -> Body {
        let forward = Point::unit(vehicle.heading);
        let state = AgentState {
            x: vehicle.x,
            y: vehicle.y,
            z: self.course.route.line.z[self.place.sample] + self.height,
            heading: vehicle.heading,
            velocity_x: forward.x * vehicle.speed,
            velocity_y: forward.y * vehicle.speed,
            ..self.av.state
        };
        Body { speed: vehicle.speed, ..Body::of(state) }
    }
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
