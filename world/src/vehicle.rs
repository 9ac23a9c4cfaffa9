//! How the AV moves: the kinematic bicycle model of the paper (its equation 2).
//!
//! The authors' code holds three variants of it that differ in clips, in the tangent and in the order of the updates. All
//! are settings of the one [`BicycleModel`] here: [`BicycleModel::authors_planner`], [`BicycleModel::authors_training`] and
//! [`BicycleModel::authors_test`].

use std::f64::consts::TAU;

use crate::geometry::{Pose, wrap_angle};
use crate::plan::Control;
use crate::trigonometry::{sincos_all, tan_all};

/// Distance between the axles of the paper's AV (m).
pub const WHEELBASE: f64 = 3.089;

/// Where the vehicle is and how fast it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VehicleState {
    /// x (m).
    pub x: f64,
    /// y (m).
    pub y: f64,
    /// Heading (rad).
    pub heading: f64,
    /// Speed (m/s). Negative only under [`Braking::OwesDebt`]: the vehicle stands then, and this is what it owes.
    pub speed: f64,
}

impl VehicleState {
    /// Place and heading.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::new(self.x, self.y, self.heading)
    }
}

/// How steering turns the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turning {
    /// Yaw rate = v tan(steering) / wheelbase: the paper's equation.
    Tangent,
    /// Yaw rate = v steering / wheelbase: what the authors' planner and training compute.
    Linear,
}

/// Which values of a step the heading and the position are updated with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateOrder {
    /// Those from before the step: the paper's equation.
    FromBefore,
    /// The step's new speed for the heading, new speed and heading for the position: the authors' code.
    FromUpdated,
}

/// What braking past standstill does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Braking {
    /// The vehicle stands, and the next acceleration moves it.
    Stops,
    /// The vehicle stands, but the missing speed must be made good before it moves again: the authors clamp the running
    /// sum of accelerations at zero when they read it, not when they add to it.
    OwesDebt,
}

/// How heading is kept in range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadingRange {
    /// [-pi, pi).
    Wrapped,
    /// (-2 pi, 2 pi), with the sign of the unwrapped heading: C's `fmod` of the sum of all turns since the start, in the
    /// authors' code. [`Rollout`] carries that sum.
    Remainder,
}

/// What a vehicle can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest acceleration and deceleration (m/s^2).
    pub acceleration: f64,
    /// Largest steering angle to either side (rad).
    pub steering: f64,
    /// Fastest change of the steering angle (rad/s).
    pub steering_rate: f64,
}

impl Limits {
    /// Those of the `strict` protocol: the paper's bounds of its controls, and a steering rate of 0.5 rad/s: lock to
    /// lock in 2 s, as a brisk driver turns the wheel.
    pub const STRICT: Self = Self { acceleration: 5.0, steering: 0.5, steering_rate: 0.5 };

    /// `wanted`, as far as the vehicle can follow within `dt` seconds from the steering angle `previous_steering`.
    #[must_use]
    pub fn apply(&self, wanted: Control, previous_steering: f64, dt: f64) -> Control {
        let turn = self.steering_rate * dt;
        let reachable = wanted.steering.clamp(previous_steering - turn, previous_steering + turn);
        Control {
            acceleration: wanted.acceleration.clamp(-self.acceleration, self.acceleration),
            steering: reachable.clamp(-self.steering, self.steering),
        }
    }
}

/// How a step of [`BicycleModel`] depends on the state before it and on its control.
///
/// With w the speed, m the speed moved with (w of before or after the step, as [`UpdateOrder`] has it, but not below zero),
/// h the heading and p the direction moved in (h of before or after), a the acceleration and d the steering angle:
///
/// ```text
/// dw' = speed_gain dw + acceleration_gain da      dm = moving_gain (dw or dw')
/// dh' = dh + turn dm + moving turn_slope dd       dx' = dx + dt (cos dm - moving sin dp)
///                                                 dy' = dy + dt (sin dm + moving cos dp)
/// ```
///
/// At the end of a clip's range, and at zero speed, the derivative is that of the inside: the authors' convention.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepDerivatives {
    /// Speed moved with (m/s).
    pub moving: f64,
    /// Cosine of the direction moved in.
    pub cos: f64,
    /// Sine of the direction moved in.
    pub sin: f64,
    /// Of the new speed by the old.
    pub speed_gain: f64,
    /// Of the new speed by the acceleration (s).
    pub acceleration_gain: f64,
    /// Of the speed moved with by the speed that it comes from.
    pub moving_gain: f64,
    /// Of the new heading by the speed moved with (rad s/m).
    pub turn: f64,
    /// Of `turn` by the steering angle (s/m).
    pub turn_slope: f64,
    /// Of `turn_slope` by the steering angle (s/m/rad).
    pub turn_curvature: f64,
}

/// The kinematic bicycle model. It never reverses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BicycleModel {
    /// Distance between the axles (m).
    pub wheelbase: f64,
    /// Accelerations are clipped to this magnitude (m/s^2).
    pub acceleration_clip: f64,
    /// Steering angles are clipped to this magnitude (rad).
    pub steering_clip: f64,
    /// How steering turns the vehicle.
    pub turning: Turning,
    /// Which values a step's updates read.
    pub order: UpdateOrder,
    /// What braking past standstill does.
    pub braking: Braking,
    /// How heading is kept in range.
    pub heading: HeadingRange,
}

impl BicycleModel {
    /// The paper's equation 2 for a vehicle of this wheelbase (m), clipped at [`Limits::STRICT`].
    #[must_use]
    pub const fn new(wheelbase: f64) -> Self {
        Self {
            wheelbase,
            acceleration_clip: Limits::STRICT.acceleration,
            steering_clip: Limits::STRICT.steering,
            turning: Turning::Tangent,
            order: UpdateOrder::FromBefore,
            braking: Braking::Stops,
            heading: HeadingRange::Wrapped,
        }
    }

    const fn authors(steering_clip: f64, turning: Turning) -> Self {
        Self {
            steering_clip,
            turning,
            order: UpdateOrder::FromUpdated,
            braking: Braking::OwesDebt,
            heading: HeadingRange::Remainder,
            ..Self::new(WHEELBASE)
        }
    }

    /// The authors' planner: steering within 0.5 rad, no tangent. Its residuals are costed with this.
    #[must_use]
    pub const fn authors_planner() -> Self {
        Self::authors(0.5, Turning::Linear)
    }

    /// The authors' training: steering within 0.6 rad, no tangent. The trajectory of the training loss.
    #[must_use]
    pub const fn authors_training() -> Self {
        Self::authors(0.6, Turning::Linear)
    }

    /// The authors' tests: steering within 0.6 rad, with the tangent. The trajectory that is driven and measured.
    #[must_use]
    pub const fn authors_test() -> Self {
        Self::authors(0.6, Turning::Tangent)
    }

    /// The yaw rate (rad/s) at `speed` (m/s) with the front wheels at `steering` (rad).
    #[must_use]
    pub fn yaw_rate(&self, speed: f64, steering: f64) -> f64 {
        let steering = steering.clamp(-self.steering_clip, self.steering_clip);
        let slope = match self.turning {
            Turning::Tangent => libm::tan(steering),
            Turning::Linear => steering,
        };
        speed / self.wheelbase * slope
    }

    /// Where the vehicle is `dt` seconds later under `control`. For more than one step take [`BicycleModel::roll_out`].
    #[must_use]
    #[inline]
    pub fn step(&self, state: VehicleState, control: Control, dt: f64) -> VehicleState {
        self.roll_out(state).step(control, dt)
    }

    /// A drive from `start`.
    #[must_use]
    #[inline]
    pub fn roll_out(&self, start: VehicleState) -> Rollout<'_> {
        Rollout { model: self, state: start, turned: start.heading }
    }

    /// The drive of these controls from `start`, a step each: the states of [`Rollout::step_with_derivatives`] and its derivatives to
    /// the bit, sines and tangents all at once.
    #[inline(always)]
    pub fn roll_out_all<const N: usize>(
        &self,
        start: VehicleState,
        acceleration: &[f64; N],
        steering: &[f64; N],
        dt: f64,
        states: &mut [VehicleState; N],
        derivatives: &mut [StepDerivatives; N],
    ) {
        let mut slopes = steering.map(|steering| self.clip_steering(steering));
        if self.turning == Turning::Tangent {
            tan_all(&{ slopes }, &mut slopes);
        }
        let (mut state, mut turned) = (start, start.heading);
        let mut courses = [Course::default(); N];
        let mut directions = [0.0; N];
        for t in 0..N {
            courses[t] = self.course(&state, turned, acceleration[t], slopes[t], dt);
            (state.speed, state.heading, turned) = (courses[t].speed, courses[t].heading, courses[t].turned);
            directions[t] = courses[t].direction;
        }
        let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
        sincos_all(&directions, &mut sines, &mut cosines);
        let (mut x, mut y) = (start.x, start.y);
        for t in 0..N {
            let (course, control) = (&courses[t], Control { acceleration: acceleration[t], steering: steering[t] });
            derivatives[t] = self.derivatives(course, control, slopes[t], (sines[t], cosines[t]), dt);
            x += course.moving * cosines[t] * dt;
            y += course.moving * sines[t] * dt;
            states[t] = VehicleState { x, y, heading: course.heading, speed: course.speed };
        }
    }

    /// The step from `state`, whose heading is `turned` before it is brought into range: the new state, its heading before that, and
    /// the derivatives.
    #[inline]
    fn advance(
        &self,
        state: VehicleState,
        turned: f64,
        control: Control,
        dt: f64,
    ) -> (VehicleState, f64, StepDerivatives) {
        let steering = self.clip_steering(control.steering);
        let slope = match self.turning {
            Turning::Linear => steering,
            Turning::Tangent => libm::tan(steering),
        };
        let course = self.course(&state, turned, control.acceleration, slope, dt);
        let (sin, cos) = libm::sincos(course.direction);
        let Course { speed, heading, turned, moving, .. } = course;
        let next = VehicleState { x: state.x + moving * cos * dt, y: state.y + moving * sin * dt, heading, speed };
        (next, turned, self.derivatives(&course, control, slope, (sin, cos), dt))
    }

    #[inline(always)]
    fn clip_steering(&self, steering: f64) -> f64 {
        steering.clamp(-self.steering_clip, self.steering_clip)
    }

    /// What a step does to speed and heading, where `slope` is the steering angle's tangent, or what is taken for it.
    #[inline(always)]
    fn course(&self, state: &VehicleState, turned: f64, acceleration: f64, slope: f64, dt: f64) -> Course {
        let acceleration = acceleration.clamp(-self.acceleration_clip, self.acceleration_clip);
        let owed = state.speed + acceleration * dt;
        let (speed, speed_gain) = match self.braking {
            Braking::Stops => (owed.max(0.0), inside(owed >= 0.0)),
            Braking::OwesDebt => (owed, 1.0),
        };
        let moving_from = match self.order {
            UpdateOrder::FromBefore => state.speed,
            UpdateOrder::FromUpdated => speed,
        };
        let moving = moving_from.max(0.0);
        let turn = slope * dt / self.wheelbase;
        let turned = turned + turn * moving;
        let (heading, turned) = match self.heading {
            // Nobody sees how often it went round: the sum stays small.
            HeadingRange::Wrapped => {
                let heading = wrap_angle(turned);
                (heading, heading)
            }
            // The remainder of what is in range already is itself; the division is slow.
            HeadingRange::Remainder if turned.abs() < TAU => (turned, turned),
            HeadingRange::Remainder => (turned % TAU, turned),
        };
        let direction = match self.order {
            UpdateOrder::FromBefore => state.heading,
            UpdateOrder::FromUpdated => heading,
        };
        Course { speed, heading, turned, moving, direction, speed_gain, moving_gain: inside(moving_from >= 0.0), turn }
    }

    #[inline(always)]
    fn derivatives(
        &self,
        course: &Course,
        control: Control,
        slope: f64,
        (sin, cos): (f64, f64),
        dt: f64,
    ) -> StepDerivatives {
        let (rise, bend) = match self.turning {
            Turning::Linear => (1.0, 0.0),
            Turning::Tangent => {
                let rise = 1.0 + slope * slope;
                (rise, 2.0 * slope * rise)
            }
        };
        let steers = inside(control.steering.abs() <= self.steering_clip) * dt / self.wheelbase;
        StepDerivatives {
            moving: course.moving,
            cos,
            sin,
            speed_gain: course.speed_gain,
            acceleration_gain: course.speed_gain * inside(control.acceleration.abs() <= self.acceleration_clip) * dt,
            moving_gain: course.moving_gain,
            turn: course.turn,
            turn_slope: rise * steers,
            turn_curvature: bend * steers,
        }
    }
}

/// A step as far as it needs no sine.
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    /// After it.
    speed: f64,
    heading: f64,
    /// The heading before it is brought into range.
    turned: f64,
    /// Speed and direction moved with.
    moving: f64,
    direction: f64,
    /// As in [`StepDerivatives`].
    speed_gain: f64,
    moving_gain: f64,
    turn: f64,
}

/// A drive, step by step.
///
/// It carries the sum of all turns. Where headings are remainders of that sum, a vehicle that turns fully round and back has its first
/// heading again; with a remainder taken of each step's heading it would be a turn off from there on.
#[derive(Clone, Copy, Debug)]
pub struct Rollout<'a> {
    model: &'a BicycleModel,
    state: VehicleState,
    /// Heading before it is brought into range (rad).
    turned: f64,
}

impl Rollout<'_> {
    /// Where the vehicle is `dt` seconds later under `control`.
    #[inline]
    pub fn step(&mut self, control: Control, dt: f64) -> VehicleState {
        self.step_with_derivatives(control, dt).0
    }

    /// [`Rollout::step`], and how it depends on the state before and on the control.
    #[inline]
    pub fn step_with_derivatives(&mut self, control: Control, dt: f64) -> (VehicleState, StepDerivatives) {
        let derivatives;
        (self.state, self.turned, derivatives) = self.model.advance(self.state, self.turned, control, dt);
        (self.state, derivatives)
    }
}

/// The derivative of a clip: one within its range.
#[inline(always)]
fn inside(within: bool) -> f64 {
    if within { 1.0 } else { 0.0 }
}

impl Default for BicycleModel {
    fn default() -> Self {
        Self::new(WHEELBASE)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DT: f64 = 0.1;

    fn control(acceleration: f64, steering: f64) -> Control {
        Control { acceleration, steering }
    }

    fn drive(model: &BicycleModel, start: VehicleState, control: Control, steps: usize) -> VehicleState {
        let mut rollout = model.roll_out(start);
        (0..steps).fold(start, |_, _| rollout.step(control, DT))
    }

    #[test]
    fn straight_on_at_constant_acceleration() {
        let end =
            drive(&BicycleModel::default(), VehicleState { speed: 2.0, ..Default::default() }, control(1.0, 0.0), 50);
        // 2 t + t^2 / 2, less half a step of each gain: the step starts with the speed from before.
        assert!((end.x - (10.0 + 12.5 - 0.25)).abs() < 1e-9, "{end:?}");
        assert!((end.speed - 7.0).abs() < 1e-9 && end.y == 0.0 && end.heading == 0.0);
    }

    #[test]
    fn constant_steering_drives_a_circle_of_wheelbase_over_tangent() {
        let model = BicycleModel::default();
        let steering: f64 = 0.2;
        let radius = WHEELBASE / libm::tan(steering);
        // Fine steps: the circle's centre is on the left.
        let mut state = VehicleState { speed: 5.0, ..Default::default() };
        for _ in 0..10_000 {
            state = model.step(state, control(0.0, steering), 1e-3);
            let from_center = libm::hypot(state.x, state.y - radius);
            assert!((from_center - radius).abs() < 0.02, "{from_center} {radius}");
        }
    }

    #[test]
    fn braking_stops_the_vehicle_and_does_not_reverse_it() {
        let end =
            drive(&BicycleModel::default(), VehicleState { speed: 1.0, ..Default::default() }, control(-5.0, 0.3), 20);
        assert_eq!(end.speed, 0.0);
        let later = drive(&BicycleModel::default(), end, control(-5.0, 0.3), 20);
        assert_eq!(end, later);
        assert!(BicycleModel::default().step(later, control(1.0, 0.0), DT).speed > 0.0);
    }

    #[test]
    fn the_authors_vehicle_must_pay_back_what_it_braked_past_standstill() {
        let model = BicycleModel::authors_planner();
        let braked = drive(&model, VehicleState { speed: 0.5, ..Default::default() }, control(-5.0, 0.0), 2);
        assert_eq!(braked.speed, -0.5);
        let still = model.step(braked, control(4.0, 0.0), DT);
        assert_eq!((still.x, still.y), (braked.x, braked.y));
        assert!(model.step(still, control(5.0, 0.0), DT).x > still.x);
    }

    #[test]
    fn the_authors_variants_differ_in_clip_and_tangent() {
        let yaw_rate = |model: BicycleModel| model.yaw_rate(WHEELBASE, 1.0);
        assert_eq!(yaw_rate(BicycleModel::authors_planner()), 0.5);
        assert_eq!(yaw_rate(BicycleModel::authors_training()), 0.6);
        assert_eq!(yaw_rate(BicycleModel::authors_test()), libm::tan(0.6));
    }

    #[test]
    fn the_authors_update_position_with_the_new_speed_and_heading() {
        let state = BicycleModel::authors_test().step(VehicleState::default(), control(5.0, 0.5), DT);
        let heading = 0.5 / WHEELBASE * libm::tan(0.5) * DT;
        assert!((state.heading - heading).abs() < 1e-15);
        assert!(
            (state.x - 0.05 * libm::cos(heading)).abs() < 1e-15 && (state.y - 0.05 * libm::sin(heading)).abs() < 1e-15
        );
    }

    #[test]
    fn the_authors_heading_is_the_remainder_of_the_sum_and_comes_back_from_a_full_turn() {
        let models = [BicycleModel::authors_planner(), BicycleModel::authors_training(), BicycleModel::authors_test()];
        for (model, side) in models.into_iter().flat_map(|model| [(model, 1.0), (model, -1.0)]) {
            let start = VehicleState { heading: 0.3, speed: 15.0, ..Default::default() };
            let (there, back) = (control(0.0, side * 0.48), control(0.0, side * -0.4));
            let per_step = |c: Control| model.yaw_rate(15.0, c.steering) * DT;
            let mut rollout = model.roll_out(start);
            let (mut x, mut y, mut round) = (0.0, 0.0, false);
            for k in 1..=64 {
                let state = rollout.step(if k <= 32 { there } else { back }, DT);
                let sum = 0.3 + f64::from(k.min(32)) * per_step(there) + f64::from((k - 32).max(0)) * per_step(back);
                x += 15.0 * libm::cos(sum) * DT;
                y += 15.0 * libm::sin(sum) * DT;
                round |= sum.abs() > TAU;
                assert!((state.heading - sum % TAU).abs() < 1e-12, "{k}: {} {sum}", state.heading);
                assert!((state.x - x).abs() < 1e-11 && (state.y - y).abs() < 1e-11, "{k}: {state:?} {x} {y}");
            }
            assert!(round);
        }
    }

    #[test]
    fn steering_cannot_jump() {
        let limited = Limits::STRICT.apply(control(9.0, 0.4), 0.1, DT);
        assert_eq!(limited, control(5.0, 0.15000000000000002));
        assert_eq!(Limits::STRICT.apply(control(-9.0, -2.0), -0.49, DT), control(-5.0, -0.5));
    }

    fn any_model() -> impl Strategy<Value = BicycleModel> {
        prop_oneof![
            Just(BicycleModel::default()),
            Just(BicycleModel::authors_planner()),
            Just(BicycleModel::authors_training()),
            Just(BicycleModel::authors_test()),
        ]
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_the_step(
            model in any_model(), (a, s) in (-4.9..4.9, -0.49..0.49), (speed, heading) in (1.0..20.0, -3.0..3.0),
        ) {
            let at = |d_speed: f64, d_heading: f64, d_a: f64, d_s: f64| {
                let state = VehicleState { x: 1.0, y: 2.0, heading: heading + d_heading, speed: speed + d_speed };
                model.roll_out(state).step_with_derivatives(control(a + d_a, s + d_s), DT)
            };
            let (_, d) = at(0.0, 0.0, 0.0, 0.0);
            let updated = model.order == UpdateOrder::FromUpdated;
            let h = 1e-5;
            for k in 0..4 {
                let unit = |i: usize| if i == k { 1.0 } else { 0.0 };
                let [w, heading, da, ds] = [unit(0), unit(1), unit(2), unit(3)];
                let (low, low_d) = at(-h * w, -h * heading, -h * da, -h * ds);
                let (high, high_d) = at(h * w, h * heading, h * da, h * ds);
                let slope = |low: f64, high: f64| (high - low) / (2.0 * h);
                let dw = d.speed_gain * w + d.acceleration_gain * da;
                let dm = d.moving_gain * if updated { dw } else { w };
                let dh = heading + d.turn * dm + d.moving * d.turn_slope * ds;
                let dp = if updated { dh } else { heading };
                let turned = wrap_angle(high.heading - low.heading) / (2.0 * h);
                prop_assert!((slope(low.speed, high.speed) - dw).abs() < 1e-7);
                prop_assert!((turned - dh).abs() < 1e-7);
                prop_assert!((slope(low.x, high.x) - DT * (d.cos * dm - d.moving * d.sin * dp)).abs() < 1e-7);
                prop_assert!((slope(low.y, high.y) - DT * (d.sin * dm + d.moving * d.cos * dp)).abs() < 1e-7);
                prop_assert!((slope(low_d.turn, high_d.turn) - d.turn_slope * ds).abs() < 1e-7);
                prop_assert!((slope(low_d.turn_slope, high_d.turn_slope) - d.turn_curvature * ds).abs() < 1e-7);
            }
        }

        #[test]
        fn all_steps_at_once_are_those_one_by_one(
            model in any_model(), accelerations in prop::array::uniform32(-6.0..6.0), steering in prop::array::uniform32(-0.8..0.8),
            (speed, heading) in (0.0..20.0, -3.2..3.2), sharp in 0.0..1.0,
        ) {
            let steering = steering.map(|s| s * sharp);
            let start = VehicleState { x: 1.0, y: -2.0, heading, speed };
            let (mut states, mut derivatives) = ([VehicleState::default(); 32], [StepDerivatives::default(); 32]);
            model.roll_out_all(start, &accelerations, &steering, DT, &mut states, &mut derivatives);
            let mut rollout = model.roll_out(start);
            for t in 0..32 {
                let (state, derivative) = rollout.step_with_derivatives(control(accelerations[t], steering[t]), DT);
                prop_assert_eq!((states[t], derivatives[t]), (state, derivative));
            }
        }

        #[test]
        fn limits_hold_and_leave_what_is_within_them(
            (a, s) in (-20.0..20.0, -2.0..2.0), previous in -0.5..0.5,
        ) {
            let limited = Limits::STRICT.apply(control(a, s), previous, DT);
            prop_assert!(limited.acceleration.abs() <= 5.0 && limited.steering.abs() <= 0.5);
            prop_assert!((limited.steering - previous).abs() <= 0.05 + 1e-12);
            prop_assert_eq!(Limits::STRICT.apply(limited, previous, DT), limited);
        }

        #[test]
        fn where_the_world_lies_changes_no_drive(
            (x, y, turn) in (-100.0..100.0, -100.0..100.0, -3.0..3.0), (a, s) in (-5.0..5.0, -0.5..0.5), speed in 0.0..20.0,
        ) {
            let model = BicycleModel::default();
            let origin = drive(&model, VehicleState { speed, ..Default::default() }, control(a, s), 50);
            let moved = drive(&model, VehicleState { x, y, heading: turn, speed }, control(a, s), 50);
            let expected = Pose::new(x, y, turn).to_world(origin.pose().position());
            prop_assert!(expected.distance(moved.pose().position()) < 1e-9);
        }
    }
}
