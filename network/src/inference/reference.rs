//! The network once more, as `network.md` 5 says it: layer by layer, in double precision, nothing folded and nothing saved but that
//! slots of zeros are encoded once. What [`super::Network`] is held to.

use crate::constants::{
    AGENTS, CROSSWALKS, FUTURES, HEADS, HISTORY, LANES, MAP_HEADS, NEIGHBORS, POINTS, SLOTS, STATE, STEPS, WIDTH,
};
use crate::frame::Frame;
use crate::weights::Weights;

type Row = Vec<f64>;

/// What comes out, and some of what lies between.
pub(super) struct Answer {
    pub controls: Row,
    pub poses: Row,
    pub scores: Row,
    pub agents: Vec<Row>,
    pub slots: Vec<Row>,
    pub modes: Vec<Row>,
}

pub(super) struct Reference<'a>(pub &'a Weights);

impl Reference<'_> {
    fn tensor(&self, name: &str) -> &[f32] {
        self.0.tensor(name).unwrap()
    }

    fn linear(&self, name: &str, x: &[f64]) -> Row {
        affine(self.tensor(&format!("{name}.weight")), self.tensor(&format!("{name}.bias")), x)
    }

    fn norm(&self, name: &str, x: &[f64]) -> Row {
        let (weight, bias) = (self.tensor(&format!("{name}.weight")), self.tensor(&format!("{name}.bias")));
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let variance = x.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / x.len() as f64;
        let scale = 1.0 / (variance + 1e-5).sqrt();
        (0..x.len()).map(|i| (x[i] - mean) * scale * f64::from(weight[i]) + f64::from(bias[i])).collect()
    }

    fn feed_forward(&self, name: &str, x: &[f64]) -> Row {
        let wide = relu(self.linear(&format!("{name}.1"), &self.norm(&format!("{name}.0"), x)));
        self.norm(&format!("{name}.5"), &self.linear(&format!("{name}.4"), &wide))
    }

    /// Of one query over rows; `seen` are the places of those that are not masked.
    fn attention(&self, name: &str, heads: usize, query: &[f64], rows: &[Row], seen: &[usize]) -> Row {
        let (weight, bias) =
            (self.tensor(&format!("{name}.in_proj_weight")), self.tensor(&format!("{name}.in_proj_bias")));
        let part = |index: usize, x: &[f64]| {
            affine(&weight[index * WIDTH * WIDTH..][..WIDTH * WIDTH], &bias[index * WIDTH..][..WIDTH], x)
        };
        let query = part(0, query);
        let keys: Vec<Row> = seen.iter().map(|row| part(1, &rows[*row])).collect();
        let values: Vec<Row> = seen.iter().map(|row| part(2, &rows[*row])).collect();
        let size = WIDTH / heads;
        let mut joined = vec![0.0; WIDTH];
        for head in (0..WIDTH).step_by(size) {
            let scores = keys.iter().map(|key| dot(&query[head..head + size], &key[head..]) / (size as f64).sqrt());
            for (share, value) in softmax(scores.collect()).into_iter().zip(&values) {
                (head..head + size).for_each(|i| joined[i] += share * value[i]);
            }
        }
        self.linear(&format!("{name}.out_proj"), &joined)
    }

    fn motion(&self, kind: &str, rows: &[Row]) -> Row {
        let mut inputs = rows.to_vec();
        for layer in 0..2 {
            let tensor = |part: &str| self.tensor(&format!("{kind}_net.motion.{part}_l{layer}"));
            let (mut hidden, mut cell) = (vec![0.0; WIDTH], vec![0.0; WIDTH]);
            for input in &mut inputs {
                let from_input = affine(tensor("weight_ih"), tensor("bias_ih"), input);
                let from_hidden = affine(tensor("weight_hh"), tensor("bias_hh"), &hidden);
                let gate = |gate: usize, i: usize| from_input[gate * WIDTH + i] + from_hidden[gate * WIDTH + i];
                for i in 0..WIDTH {
                    let forget = sigmoid(gate(1, i)) * cell[i];
                    cell[i] = forget + sigmoid(gate(0, i)) * libm::tanh(gate(2, i));
                    hidden[i] = sigmoid(gate(3, i)) * libm::tanh(cell[i]);
                }
                input.clone_from(&hidden);
            }
        }
        inputs.pop().unwrap()
    }

    fn lane_point(&self, point: &[f32]) -> Row {
        let x: Row = point.iter().map(|v| f64::from(*v)).collect();
        let mut row = self.linear("lane_net.self_line", &x[..3]);
        row.extend(self.linear("lane_net.left_line", &x[3..6]));
        row.extend(self.linear("lane_net.right_line", &x[6..9]));
        row.extend(self.linear("lane_net.speed_limit", &x[9..10]));
        let mut sum = vec![0.0; 64];
        for (name, _, column) in crate::weights::layout::EMBEDDINGS {
            let table = self.tensor(&format!("lane_net.{name}.weight"));
            let code = x[column] as usize;
            (0..64).for_each(|i| sum[i] += f64::from(table[64 * code + i]));
        }
        row.extend(sum);
        relu(self.linear("lane_net.pointnet.2", &relu(self.linear("lane_net.pointnet.0", &row))))
    }

    fn crosswalk_point(&self, point: &[f32]) -> Row {
        let x: Row = point.iter().map(|v| f64::from(*v)).collect();
        [0, 2, 4].iter().fold(x, |x, index| relu(self.linear(&format!("crosswalk_net.point_net.{index}"), &x)))
    }

    fn interaction(&self, layer: usize, agents: &[Row], seen: &[usize]) -> Vec<Row> {
        let name = |part: &str| format!("agent_agent.interaction_net.layers.{layer}.{part}");
        let agent = |x: &Row| {
            let x = self.norm(&name("norm1"), &add(x, &self.attention(&name("self_attn"), HEADS, x, agents, seen)));
            let wide = relu(self.linear(&name("linear1"), &x));
            self.norm(&name("norm2"), &add(&x, &self.linear(&name("linear2"), &wide)))
        };
        agents.iter().map(agent).collect()
    }

    pub fn forward(&self, frame: &Frame) -> Answer {
        let state = |row: &[f32]| row[..STATE].iter().map(|v| f64::from(*v)).collect::<Row>();
        let mut agents = vec![self.motion("vehicle", &frame.ego.map(|row| state(&row)))];
        for rows in &frame.neighbors {
            let kind = match rows[HISTORY - 1][STATE] as usize {
                2 => "pedestrian",
                3 => "cyclist",
                _ => "vehicle",
            };
            agents.push(self.motion(kind, &rows.map(|row| state(&row))));
        }
        let seen: Vec<usize> = (0..AGENTS).filter(|agent| frame.presence.agents[*agent]).collect();
        for layer in 0..2 {
            agents = self.interaction(layer, &agents, &seen);
        }
        let slots = self.slots(frame, &agents);
        let modes = self.modes(frame, &agents, &slots);
        let (mut controls, mut poses, mut scores) = (Row::new(), Row::new(), Row::new());
        let feature =
            |mode: usize, agent: usize| [modes[mode * AGENTS + agent].clone(), agents[agent].clone()].concat();
        for mode in 0..modes.len() / AGENTS {
            let hidden = elu(self.linear("plan.control.1", &feature(mode, 0)));
            controls.extend(self.linear("plan.control.3", &hidden));
            if !self.0.variant().predicts() {
                continue;
            }
            for neighbor in 0..NEIGHBORS {
                let hidden = elu(self.linear("predict.decode.1", &feature(mode, neighbor + 1)));
                let now = &frame.neighbors[neighbor][HISTORY - 1];
                let offsets = self.linear("predict.decode.3", &hidden);
                poses.extend((0..3 * STEPS).map(|i| f64::from(now[i % 3]) + offsets[i]));
            }
            let pooled = [most(&slots), most(&agents)].concat();
            let reduced = elu(self.linear("score.reduce.1", &pooled));
            let both = [reduced, most(&modes[mode * AGENTS..(mode + 1) * AGENTS])].concat();
            scores.extend(self.linear("score.decode.3", &elu(self.linear("score.decode.1", &both))));
        }
        Answer { controls, poses, scores, agents, slots, modes }
    }

    /// `[agent][slot]`.
    fn slots(&self, frame: &Frame, agents: &[Row]) -> Vec<Row> {
        let all: Vec<usize> = (0..POINTS).collect();
        let look = |kind: &str, agent: &Row, points: &[Row]| {
            let name = format!("agent_map.{kind}_attention");
            let answer = self.attention(&format!("{name}.cross_attention"), HEADS, agent, points, &all);
            self.feed_forward(&format!("{name}.transformer"), &answer)
        };
        let empty_lane = look("lane", &agents[0], &vec![self.lane_point(&[0.0; 17]); POINTS]);
        let empty_crosswalk = look("crosswalk", &agents[0], &vec![self.crosswalk_point(&[0.0; 3]); POINTS]);
        let is_empty = |points: &[f32]| points.iter().all(|value| *value == 0.0);
        let mut slots = Vec::new();
        for (index, agent) in agents.iter().enumerate() {
            for points in &frame.lanes[index * LANES..][..LANES] {
                let encoded = || points.iter().map(|point| self.lane_point(point)).collect::<Vec<_>>();
                let is_empty = is_empty(points.as_flattened());
                slots.push(if is_empty { empty_lane.clone() } else { look("lane", agent, &encoded()) });
            }
            for points in &frame.crosswalks[index * CROSSWALKS..][..CROSSWALKS] {
                let encoded = || points.iter().map(|point| self.crosswalk_point(point)).collect::<Vec<_>>();
                let is_empty = is_empty(points.as_flattened());
                slots.push(if is_empty { empty_crosswalk.clone() } else { look("crosswalk", agent, &encoded()) });
            }
        }
        slots
    }

    /// `[mode][agent]`.
    fn modes(&self, frame: &Frame, agents: &[Row], slots: &[Row]) -> Vec<Row> {
        let mut modes = Vec::new();
        for mode in 0..self.0.variant().futures().min(FUTURES) {
            for (agent, query) in agents.iter().enumerate() {
                let present = &frame.presence.slots[agent];
                let seen: Vec<usize> = (0..SLOTS).filter(|slot| *slot == 0 || present[*slot]).collect();
                let name = format!("agent_map.map_attention.attention.{mode}");
                let answer = self.attention(&name, MAP_HEADS, query, &slots[agent * SLOTS..][..SLOTS], &seen);
                modes.push(self.feed_forward("agent_map.map_attention.ffn", &answer));
            }
        }
        modes
    }
}

fn affine(weight: &[f32], bias: &[f32], x: &[f64]) -> Row {
    let rows = weight.chunks_exact(x.len()).zip(bias);
    rows.map(|(row, bias)| f64::from(*bias) + row.iter().zip(x).map(|(w, x)| f64::from(*w) * x).sum::<f64>()).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(a: &[f64], b: &[f64]) -> Row {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

fn relu(x: Row) -> Row {
    x.into_iter().map(|v| v.max(0.0)).collect()
}

fn elu(x: Row) -> Row {
    x.into_iter().map(|v| if v > 0.0 { v } else { libm::expm1(v) }).collect()
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}

fn softmax(scores: Row) -> Row {
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Row = scores.iter().map(|score| libm::exp(score - most)).collect();
    let sum: f64 = shares.iter().sum();
    shares.into_iter().map(|share| share / sum).collect()
}

fn most(rows: &[Row]) -> Row {
    (0..WIDTH).map(|i| rows.iter().map(|row| row[i]).fold(f64::NEG_INFINITY, f64::max)).collect()
}
