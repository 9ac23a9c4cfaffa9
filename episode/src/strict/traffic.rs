//! The other road users of a scene, laid out step by step for the judges.

use world::geometry::Point;
use world::plan::STEP_SECONDS;
use world::scene::Scene;

use crate::judges::time_to_collision::{HORIZON_STEPS, TrafficAgent};

/// All valid agents but the AV, step after step. What the broad phase reads lies in columns of its own: one pass over a
/// step is a few kilobytes.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Where each log index begins; one more than there are.
    starts: Vec<usize>,
    x: Vec<f64>,
    y: Vec<f64>,
    /// How far from its centre an agent may matter within the projection of time to collision (m): the box's radius and
    /// what it can travel.
    reach: Vec<f64>,
    agents: Vec<TrafficAgent>,
}

impl Traffic {
    /// The traffic of all steps of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mut traffic = Self { starts: vec![0], ..Self::default() };
        for step in 0..scene.steps() {
            for (track, logged) in scene.tracks().iter().enumerate() {
                let Some(state) = logged.states[step].filter(|_| track != scene.av_index()) else { continue };
                let outline = state.oriented_box();
                let speed = state.speed();
                traffic.x.push(state.x);
                traffic.y.push(state.y);
                traffic.reach.push(outline.radius() + speed * HORIZON_STEPS as f64 * STEP_SECONDS);
                traffic.agents.push(TrafficAgent {
                    track,
                    kind: logged.kind,
                    outline,
                    z: state.z,
                    velocity: state.velocity(),
                    speed,
                });
            }
            traffic.starts.push(traffic.agents.len());
        }
        traffic
    }

    /// The largest number of agents at a step.
    #[must_use]
    pub fn most_agents(&self) -> usize {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }

    /// Calls `visit` with each agent at `log_index` whose reach and `reach` (m) around `center` meet, in the log's order.
    pub fn for_each_near(&self, log_index: usize, center: Point, reach: f64, mut visit: impl FnMut(&TrafficAgent)) {
        let Some(range) = self.starts.get(log_index).zip(self.starts.get(log_index + 1)) else { return };
        for index in *range.0..*range.1 {
            let (dx, dy) = (self.x[index] - center.x, self.y[index] - center.y);
            let both = self.reach[index] + reach;
            if dx * dx + dy * dy <= both * both {
                visit(&self.agents[index]);
            }
        }
    }
}
