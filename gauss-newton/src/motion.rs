//! The rollout of the controls, and its first and second derivatives.
//!
//! A change of the controls moves the later poses through a chain: acceleration changes speed, speed and steering change
//! heading, all change the position. [`Stage`] holds the chain's link at one step, so that a product with the Jacobian (forward
//! along the chain) or with its transpose (backward) takes a few operations a step, and no Jacobian is ever written out.

#![allow(clippy::needless_range_loop, reason = "a step's index goes through several arrays at once")]

use world::vehicle::{BicycleModel, StepDerivatives, UpdateOrder, VehicleState};

use super::constants::{DT, STEPS};
use super::controls::Controls;

/// One step's link in the chain, as products that the sweeps need.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stage {
    /// Position by speed.
    pub forward_x: f64,
    pub forward_y: f64,
    /// Position by heading.
    pub side_x: f64,
    pub side_y: f64,
    /// Heading by speed.
    pub turn: f64,
    /// Heading by steering angle.
    pub steering: f64,
    /// Speed by acceleration.
    pub acceleration: f64,
    /// Speed by the speed before.
    pub speed: f64,
}

/// A change of the state, or a gradient by it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StateChange {
    /// Of x.
    pub x: f64,
    /// Of y.
    pub y: f64,
    /// Of the heading.
    pub heading: f64,
    /// Of the speed.
    pub speed: f64,
}

impl Stage {
    #[inline(always)]
    fn new(d: &StepDerivatives) -> Self {
        Self {
            forward_x: DT * d.cos * d.moving_gain,
            forward_y: DT * d.sin * d.moving_gain,
            side_x: -DT * d.moving * d.sin,
            side_y: DT * d.moving * d.cos,
            turn: d.turn * d.moving_gain,
            steering: d.moving * d.turn_slope,
            acceleration: d.acceleration_gain,
            speed: d.speed_gain,
        }
    }

    /// The change after the step, of that before it and of the control's.
    #[inline(always)]
    pub fn push(&self, order: UpdateOrder, s: &mut StateChange, acceleration: f64, steering: f64) {
        let (speed_before, heading_before) = (s.speed, s.heading);
        s.speed = self.speed * s.speed + self.acceleration * acceleration;
        let moving = if order == UpdateOrder::FromUpdated { s.speed } else { speed_before };
        s.heading += self.turn * moving + self.steering * steering;
        let direction = if order == UpdateOrder::FromUpdated { s.heading } else { heading_before };
        s.x += self.forward_x * moving + self.side_x * direction;
        s.y += self.forward_y * moving + self.side_y * direction;
    }

    /// The gradient by the state before and by the control, of that by the state after.
    #[inline(always)]
    pub fn pull(&self, order: UpdateOrder, s: &mut StateChange) -> (f64, f64) {
        let by_direction = self.side_x * s.x + self.side_y * s.y;
        if order == UpdateOrder::FromUpdated {
            s.heading += by_direction;
        }
        let by_moving = self.forward_x * s.x + self.forward_y * s.y + self.turn * s.heading;
        let steering = self.steering * s.heading;
        let by_speed = if order == UpdateOrder::FromUpdated { s.speed + by_moving } else { s.speed };
        let acceleration = self.acceleration * by_speed;
        s.speed = self.speed * by_speed;
        if order == UpdateOrder::FromBefore {
            s.heading += by_direction;
            s.speed += by_moving;
        }
        (acceleration, steering)
    }
}

/// The rollout of controls under a vehicle model. State `t` is that after the control of step `t`.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The states.
    pub states: [VehicleState; STEPS],
    pub(super) stages: [Stage; STEPS],
    pub(super) derivatives: [StepDerivatives; STEPS],
    pub(super) order: UpdateOrder,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            states: [VehicleState::default(); STEPS],
            stages: [Stage::default(); STEPS],
            derivatives: [StepDerivatives::default(); STEPS],
            order: UpdateOrder::FromUpdated,
        }
    }
}

impl Motion {
    /// Drives the controls from `start`.
    #[inline(always)]
    pub fn roll_out(&mut self, model: &BicycleModel, start: VehicleState, controls: &Controls) {
        self.order = model.order;
        let Controls { acceleration, steering } = controls;
        model.roll_out_all(start, acceleration, steering, DT, &mut self.states, &mut self.derivatives);
        for (stage, derivatives) in self.stages.iter_mut().zip(&self.derivatives) {
            *stage = Stage::new(derivatives);
        }
    }

    /// How the states change with the controls.
    pub fn push_forward(&self, controls: &Controls, states: &mut [StateChange; STEPS]) {
        let mut s = StateChange::default();
        for t in 0..STEPS {
            self.stages[t].push(self.order, &mut s, controls.acceleration[t], controls.steering[t]);
            states[t] = s;
        }
    }

    /// Adds the gradient by the controls, of that by the states.
    #[inline(always)]
    pub fn pull_back(&self, states: &[StateChange; STEPS], controls: &mut Controls) {
        let mut s = StateChange::default();
        for t in (0..STEPS).rev() {
            s.x += states[t].x;
            s.y += states[t].y;
            s.heading += states[t].heading;
            s.speed += states[t].speed;
            let (acceleration, steering) = self.stages[t].pull(self.order, &mut s);
            controls.acceleration[t] += acceleration;
            controls.steering[t] += steering;
        }
    }

    /// Adds the gradient by the controls of `sum of gradient . (change of the states along direction)`: what the curvature of the
    /// rollout makes of a direction. `change` is [`Motion::push_forward`] of it. `direct` is added to the gradient by the
    /// states, for what depends on them beside the rollout.
    pub fn pull_back_curvature(
        &self,
        direction: &Controls,
        change: &[StateChange; STEPS],
        gradient: &[StateChange; STEPS],
        direct: &[StateChange; STEPS],
        controls: &mut Controls,
    ) {
        let updated = self.order == UpdateOrder::FromUpdated;
        // `first` is the gradient by the changed state; `second` that by the state itself.
        let mut first = StateChange::default();
        let mut second = StateChange::default();
        for t in (0..STEPS).rev() {
            let (stage, d) = (&self.stages[t], &self.derivatives[t]);
            first.x += gradient[t].x;
            first.y += gradient[t].y;
            first.heading += gradient[t].heading;
            second.x += direct[t].x;
            second.y += direct[t].y;
            second.heading += direct[t].heading;
            let before = if t == 0 { StateChange::default() } else { change[t - 1] };
            let (speed, heading) =
                if updated { (change[t].speed, change[t].heading) } else { (before.speed, before.heading) };
            let moving = d.moving_gain * speed;
            // By the direction moved in and by the speed moved with, of the change of the position at this step.
            let by_direction = DT
                * (first.x * (-d.sin * moving - d.moving * d.cos * heading)
                    + first.y * (d.cos * moving - d.moving * d.sin * heading));
            let position_by_moving = DT * heading * (first.y * d.cos - first.x * d.sin);
            if updated {
                second.heading += by_direction;
            }
            // The gradient by the changed heading, once what the position takes of it is in.
            let heading_gradient =
                if updated { first.heading + stage.side_x * first.x + stage.side_y * first.y } else { first.heading };
            let bent = d.turn_slope * moving + d.moving * d.turn_curvature * direction.steering[t];
            let by_steering = heading_gradient * bent;
            let by_moving = position_by_moving + heading_gradient * d.turn_slope * direction.steering[t];
            if updated {
                second.speed += d.moving_gain * by_moving;
            }
            let (acceleration, steering) = stage.pull(self.order, &mut second);
            if !updated {
                second.heading += by_direction;
                second.speed += d.moving_gain * by_moving;
            }
            controls.acceleration[t] += acceleration;
            controls.steering[t] += steering + by_steering;
            stage.pull(self.order, &mut first);
        }
    }
}
