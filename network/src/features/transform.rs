//! From the log's frame to the AV's.

use std::f32::consts::{PI, TAU};

use world::geometry::Pose;

use super::Style;
use super::map::Vertex;
use crate::frame::AgentRow;

/// The AV's frame at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transform {
    style: Style,
    x: f64,
    y: f64,
    heading: f64,
    sine: f64,
    cosine: f64,
}

impl Transform {
    pub(super) fn to(pose: Pose, style: Style) -> Self {
        let (sine, cosine) = libm::sincos(pose.heading);
        Self { style, x: pose.x, y: pose.y, heading: pose.heading, sine, cosine }
    }

    /// A place. What is exactly 0 in the log's frame stands for nothing to the authors, and stays 0.
    fn place(&self, x: f64, y: f64) -> [f32; 2] {
        let (dx, dy) = (x - self.x, y - self.y);
        let place = [dx * self.cosine + dy * self.sine, dy * self.cosine - dx * self.sine];
        [self.kept(x, place[0] as f32), self.kept(y, place[1] as f32)]
    }

    fn kept(&self, before: f64, after: f32) -> f32 {
        if self.style == Style::Authors && before == 0.0 { 0.0 } else { after }
    }

    /// An angle, from -π to below π.
    fn turn(&self, heading: f64) -> f32 {
        match self.style {
            // In f32, as theirs.
            Style::Authors => (heading as f32 - self.heading as f32 + PI).rem_euclid(TAU) - PI,
            Style::Mended => {
                let (pi, tau) = (std::f64::consts::PI, std::f64::consts::TAU);
                ((heading - self.heading + pi).rem_euclid(tau) - pi) as f32
            }
        }
    }

    /// A row of an agent's history.
    pub(super) fn row(&self, values: &[f64; 8], valid: bool) -> AgentRow {
        if self.style == Style::Mended && !valid {
            return [0.0; 8];
        }
        let [x, y, heading, vx, vy, length, width, height] = *values;
        let [px, py] = self.place(x, y);
        let velocity = [vx * self.cosine + vy * self.sine, vy * self.cosine - vx * self.sine];
        [
            px,
            py,
            self.kept(heading, self.turn(heading)),
            self.kept(vx, velocity[0] as f32),
            self.kept(vy, velocity[1] as f32),
            length as f32,
            width as f32,
            height as f32,
        ]
    }

    /// A point of the map with its direction. To the authors, a boundary's direction of exactly 0 is none; a lane's is one.
    pub(super) fn vertex(&self, vertex: &Vertex, is_boundary: bool) -> [f32; 3] {
        // The authors hold the map in f32.
        let round = |value: f64| if self.style == Style::Authors { f64::from(value as f32) } else { value };
        let [x, y] = self.place(round(vertex.x), round(vertex.y));
        let turn = self.turn(round(vertex.heading));
        [x, y, if is_boundary { self.kept(vertex.heading, turn) } else { turn }]
    }
}
