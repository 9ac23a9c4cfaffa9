//! The network's answer to a frame, in f32 (paper III-B).
//!
//! ```text
//! histories ─ motion ─ interaction ──┬────────────────────────────────┐
//! lane points ─ encoder ─ attention ─┴┐                               │
//! crosswalks ── encoder ─ attention ──┴─ map rows ─ modal attention ──┴─ decoders: plans, predictions, scores
//! ```
//!
//! What it spares, exactly: points that many agents look at are encoded once; slots that stand for nobody are one row; empty lanes and
//! crosswalks are constants of the weights; `map` and `attention` have the algebra. Rows do not depend on the rows beside them,
//! so that a frame has the same answer alone and among others.

mod attention;
mod interaction;
mod linear;
mod map;
mod motion;

use pulp::{Simd, WithSimd};

use crate::activation::{Elus, exp, softmax};
use crate::frame::{AGENTS, Agent, CROSSWALKS, Frame, LANES, Motion, NEIGHBORS, POINTS, SLOTS, Sequence};
use crate::gemm::{Begin, Finish, Left, Multiplier, Right};
use crate::weights::Weights;
use crate::weights::layout::WIDTH;

use self::attention::{Attention, pool};
use self::interaction::{Interaction, InteractionMemory, dot};
use self::linear::{Block, Linear};
use self::map::{CrosswalkEncoder, LaneEncoder};
use self::motion::{MotionEncoder, MotionMemory};

/// Futures that are told apart.
pub const MODES: usize = 3;
/// Steps of 0.1 s ahead.
pub const STEPS: usize = 50;

/// Heads of the attention to points.
const POINT_HEADS: usize = 8;
/// Heads of the attention to lanes and crosswalks.
const SLOT_HEADS: usize = 4;

/// x, y, heading in the AV's frame, step by step.
pub type Trajectory = [[f32; 3]; STEPS];

/// The network's answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// For each future the AV's acceleration (m/s²) and steering (rad), step by step; without limits.
    pub plans: [[[f32; 2]; STEPS]; MODES],
    /// For each future and neighbor where it will be.
    pub predictions: Vec<[Trajectory; NEIGHBORS]>,
    /// Logits of the futures.
    pub scores: [f32; MODES],
    /// Weights of the planner's cost, of the model and not of the frame.
    pub cost_weights: [f32; 9],
    /// For each agent how much it attends to each of its lanes and crosswalks, mean over futures and heads.
    pub slot_attention: [[f32; SLOTS]; AGENTS],
    /// For each agent how much it attends to each agent in the second layer, mean over heads.
    pub agent_attention: [[f32; AGENTS]; AGENTS],
}

impl Default for Forecast {
    fn default() -> Self {
        Self {
            plans: [[[0.0; 2]; STEPS]; MODES],
            predictions: vec![[[[0.0; 3]; STEPS]; NEIGHBORS]; MODES],
            scores: [0.0; MODES],
            cost_weights: [0.0; 9],
            slot_attention: [[0.0; SLOTS]; AGENTS],
            agent_attention: [[0.0; AGENTS]; AGENTS],
        }
    }
}

impl Forecast {
    /// The futures' probabilities.
    #[must_use]
    pub fn probabilities(&self) -> [f32; MODES] {
        let mut probabilities = self.scores;
        softmax(&mut probabilities, |_| true);
        probabilities
    }
}

/// The network, ready to be asked.
#[derive(Clone, Debug)]
pub struct Network {
    motion: [MotionEncoder; 3],
    interaction: [Interaction; 2],
    lane: LaneEncoder,
    crosswalk: CrosswalkEncoder,
    lane_attention: MapAttention,
    crosswalk_attention: MapAttention,
    modal: [Attention; MODES],
    modal_block: Block,
    plan: [Linear; 2],
    predict: [Linear; 2],
    reduce: Linear,
    score: [Linear; 2],
    /// What the motion of a slot that stands for nobody is encoded by.
    blank: Vec<f32>,
    cost_weights: [f32; 9],
}

/// Attention to the points of one kind of slot, and what follows it.
#[derive(Clone, Debug)]
struct MapAttention {
    attention: Attention,
    block: Block,
    /// The row of an empty slot.
    empty: Vec<f32>,
}

/// All memory that an answer takes; kept between answers, so that nothing is allocated once the largest frame was seen.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    multiplier: Multiplier,
    motion: MotionMemory,
    interaction: InteractionMemory,
    masked: Vec<bool>,
    actors: Vec<f32>,
    points: Points,
    slots: Vec<f32>,
    pooled: Vec<f32>,
    projected: Vec<f32>,
    queries: Vec<f32>,
    modal: Vec<f32>,
    modes: Vec<f32>,
    hidden: Vec<f32>,
    features: Vec<f32>,
    decoded: Vec<f32>,
}

/// Memory of the attention to points.
#[derive(Clone, Debug, Default)]
struct Points {
    hidden: [Vec<f32>; 2],
    encoded: Vec<f32>,
    queries: Vec<f32>,
    projected: Vec<f32>,
    right: Right,
    nothing: Vec<f32>,
    scores: Vec<f32>,
    weights: Vec<[f32; POINT_HEADS]>,
    pooled: Vec<f32>,
    rows: Vec<f32>,
}

impl Network {
    /// The network with these weights.
    #[must_use]
    pub fn of(weights: &Weights) -> Self {
        let mut memory = Memory::default();
        let multiplier = &mut memory.multiplier;
        let motion = ["vehicle_net", "pedestrian_net", "cyclist_net"].map(|net| MotionEncoder::of(weights, net));
        let mut blank = Vec::new();
        let nobody = Agent::default().history;
        motion[0].encode(multiplier, &mut memory.motion, std::iter::once(&nobody), |_, row| blank.extend(row));
        let (lane, crosswalk) = (LaneEncoder::of(weights), CrosswalkEncoder::of(weights));
        let Points { hidden, encoded, .. } = &mut memory.points;
        lane.encode(multiplier, &[[0.0; 17]], &mut hidden[0], encoded);
        let lane_attention = MapAttention::of(weights, "lane_attention", multiplier, encoded);
        crosswalk.encode(multiplier, &[[0.0; 3]], hidden, encoded);
        let crosswalk_attention = MapAttention::of(weights, "crosswalk_attention", multiplier, encoded);
        let linears = |names: [&str; 2]| names.map(|name| Linear::of(weights, name));
        Self {
            motion,
            interaction: [0, 1].map(|layer| Interaction::of(weights, layer)),
            lane,
            crosswalk,
            lane_attention,
            crosswalk_attention,
            modal: std::array::from_fn(|mode| {
                Attention::of(weights, &format!("agent_map.map_attention.attention.{mode}"), SLOT_HEADS)
            }),
            modal_block: Block::of(weights, "agent_map.map_attention.ffn"),
            plan: linears(["plan.control.1", "plan.control.3"]),
            predict: linears(["predict.decode.1", "predict.decode.3"]),
            reduce: Linear::of(weights, "score.reduce.1"),
            score: linears(["score.decode.1", "score.decode.3"]),
            blank,
            cost_weights: cost_weights(weights),
        }
    }

    /// The weights of the planner's cost: they depend on no frame.
    #[must_use]
    pub fn cost_weights(&self) -> [f32; 9] {
        self.cost_weights
    }

    /// The answer to `frame`.
    pub fn forecast(&self, frame: &Frame, memory: &mut Memory, forecast: &mut Forecast) {
        let rows = Rows::of(frame);
        self.encode_agents(frame, &rows, memory);
        self.encode_map(frame, &rows, memory);
        self.attend_to_slots(frame, &rows, memory, forecast);
        self.decode(frame, &rows, memory, forecast);
        forecast.cost_weights = self.cost_weights;
        let Memory { interaction, .. } = memory;
        let count = rows.count();
        for (agent, attention) in forecast.agent_attention.iter_mut().enumerate() {
            for (key, attention) in attention.iter_mut().enumerate() {
                let weight = interaction.weights[rows.of_agent[agent] * count + rows.of_agent[key]];
                *attention = weight / POINT_HEADS as f32;
            }
        }
    }

    /// Motion, and the interaction of agents: `memory.actors`.
    fn encode_agents(&self, frame: &Frame, rows: &Rows, memory: &mut Memory) {
        let Memory { multiplier, motion, interaction, masked, actors, .. } = memory;
        actors.clear();
        actors.resize(rows.count() * WIDTH, 0.0);
        for (kind, encoder) in [Motion::Vehicle, Motion::Pedestrian, Motion::Cyclist].into_iter().zip(&self.motion) {
            let (mut own, mut count) = ([0; AGENTS], 0);
            for (row, agent) in rows.agents().enumerate() {
                if frame.agents[agent].motion == kind {
                    own[count] = row;
                    count += 1;
                }
            }
            let own = &own[..count];
            let histories = own.iter().map(|row| &frame.agents[rows.agent_of[*row]].history);
            encoder.encode(multiplier, motion, histories, |index, encoded| {
                actors[own[index] * WIDTH..][..WIDTH].copy_from_slice(encoded);
            });
        }
        if rows.has_blank {
            actors[rows.agents * WIDTH..].copy_from_slice(&self.blank);
        }
        masked.clear();
        masked.extend(rows.agents().map(|agent| frame.agents[agent].masked));
        masked.extend(rows.has_blank.then_some(true));
        for layer in &self.interaction {
            layer.apply(multiplier, interaction, masked, actors);
        }
    }

    /// A row for each lane and crosswalk of each agent: `memory.slots`.
    fn encode_map(&self, frame: &Frame, rows: &Rows, memory: &mut Memory) {
        let Memory { multiplier, actors, points, slots, .. } = memory;
        slots.resize(rows.count() * SLOTS * WIDTH, 0.0);
        for slots in slots.chunks_exact_mut(SLOTS * WIDTH) {
            for (slot, row) in slots.chunks_exact_mut(WIDTH).enumerate() {
                let kind = if slot < LANES { &self.lane_attention } else { &self.crosswalk_attention };
                row.copy_from_slice(&kind.empty);
            }
        }
        self.lane.encode(multiplier, &frame.lane_points, &mut points.hidden[0], &mut points.encoded);
        let lanes = rows.agents().map(|agent| &frame.agents[agent].lanes[..]);
        self.lane_attention.attend(multiplier, points, &actors[..rows.agents * WIDTH], lanes, 0, slots);
        self.crosswalk.encode(multiplier, &frame.crosswalk_points, &mut points.hidden, &mut points.encoded);
        let crosswalks = rows.agents().map(|agent| &frame.agents[agent].crosswalks[..]);
        self.crosswalk_attention.attend(multiplier, points, &actors[..rows.agents * WIDTH], crosswalks, LANES, slots);
    }

    /// For each future a row for each agent, of what it makes of its lanes and crosswalks: `memory.modes`.
    fn attend_to_slots(&self, frame: &Frame, rows: &Rows, memory: &mut Memory, forecast: &mut Forecast) {
        let Memory { multiplier, actors, slots, pooled, projected, queries, modal, modes, hidden, .. } = memory;
        let arch = multiplier.arch();
        modes.clear();
        let mut attention = [[0.0_f32; SLOTS]; AGENTS];
        for mode in &self.modal {
            mode.queries(multiplier, actors, projected, queries);
            pooled.resize(queries.len(), 0.0);
            let of_row = |row: usize| (row < rows.agents).then(|| &frame.agents[rows.agent_of[row]]);
            let queries = queries.chunks_exact(SLOT_HEADS * WIDTH).zip(pooled.chunks_exact_mut(SLOT_HEADS * WIDTH));
            for (row, (queries, pooled)) in queries.enumerate() {
                let slots = &slots[row * SLOTS * WIDTH..][..SLOTS * WIDTH];
                let agent = of_row(row);
                let attended = std::array::from_fn(|slot| is_attended(agent, slot));
                let weights = arch.dispatch(SlotWeights { queries, slots, attended });
                for (weights, sum) in weights.iter().zip(&mut attention[row]) {
                    *sum += weights.iter().sum::<f32>();
                }
                pool(arch, slots, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], &weights, pooled);
            }
            mode.project(multiplier, pooled, projected, modal);
            modes.extend_from_slice(modal);
        }
        self.modal_block.apply(multiplier, modes, hidden);
        for (agent, told) in forecast.slot_attention.iter_mut().enumerate() {
            *told = attention[rows.of_agent[agent]].map(|sum| sum / (MODES * SLOT_HEADS) as f32);
        }
    }

    fn decode(&self, frame: &Frame, rows: &Rows, memory: &mut Memory, forecast: &mut Forecast) {
        let Memory { multiplier, actors, slots, modes, hidden, features, decoded, .. } = memory;
        let arch = multiplier.arch();
        let count = rows.count();
        let join = |mode: usize, row: usize, features: &mut Vec<f32>| {
            features.extend_from_slice(&modes[(mode * count + row) * WIDTH..][..WIDTH]);
            features.extend_from_slice(&actors[row * WIDTH..][..WIDTH]);
        };
        let mut run = |layers: &[Linear; 2], features: &[f32], multiplier: &mut Multiplier, decoded: &mut Vec<f32>| {
            layers[0].apply(multiplier, Left::dense(features, 2 * WIDTH), Finish::Plain, hidden);
            arch.dispatch(Elus(hidden));
            layers[1].apply(multiplier, Left::dense(hidden, layers[0].bias.len()), Finish::Plain, decoded);
        };
        features.clear();
        (0..MODES).for_each(|mode| join(mode, 0, features));
        run(&self.plan, features, multiplier, decoded);
        forecast.plans.as_flattened_mut().as_flattened_mut().copy_from_slice(decoded);
        features.clear();
        (0..MODES).for_each(|mode| (1..count).for_each(|row| join(mode, row, features)));
        run(&self.predict, features, multiplier, decoded);
        for (mode, predictions) in forecast.predictions.iter_mut().enumerate() {
            for (neighbor, trajectory) in predictions.iter_mut().enumerate() {
                let row = mode * (count - 1) + rows.of_agent[neighbor + 1] - 1;
                let now = &frame.agents[neighbor + 1].history[crate::frame::HISTORY - 1];
                let offsets = decoded[row * 3 * STEPS..][..3 * STEPS].as_chunks::<3>().0;
                for (pose, offset) in trajectory.iter_mut().zip(offsets) {
                    *pose = std::array::from_fn(|axis| now[axis] + offset[axis]);
                }
            }
        }
        // Scores: the greatest of each column over all slots, agents and modes; slots that stand for nobody take part.
        let greatest = |rows: &[f32], out: &mut [f32]| {
            out.fill(f32::MIN);
            for row in rows.chunks_exact(WIDTH) {
                out.iter_mut().zip(row).for_each(|(most, value)| *most = if *value > *most { *value } else { *most });
            }
        };
        features.clear();
        features.resize(2 * WIDTH, 0.0);
        greatest(slots, &mut features[..WIDTH]);
        greatest(actors, &mut features[WIDTH..]);
        self.reduce.apply(multiplier, Left::dense(features, 2 * WIDTH), Finish::Plain, decoded);
        arch.dispatch(Elus(decoded));
        features.clear();
        for mode in 0..MODES {
            features.extend_from_slice(decoded);
            let begin = features.len();
            features.resize(begin + WIDTH, 0.0);
            greatest(&modes[mode * count * WIDTH..][..count * WIDTH], &mut features[begin..]);
        }
        run(&self.score, features, multiplier, decoded);
        forecast.scores.copy_from_slice(decoded);
    }
}

/// Whether an agent attends to a slot; to its first lane always, for somebody must be attended to.
fn is_attended(agent: Option<&Agent>, slot: usize) -> bool {
    let is_open = |sequence: &Option<Sequence>| sequence.as_ref().is_some_and(|sequence| !sequence.masked);
    slot == 0
        || agent.is_some_and(|agent| match slot.checked_sub(LANES) {
            None => is_open(&agent.lanes[slot]),
            Some(crosswalk) => is_open(&agent.crosswalks[crosswalk]),
        })
}

/// Which agents have rows of their own. The AV's is the first; slots that stand for nobody share the last.
struct Rows {
    /// How many agents have one.
    agents: usize,
    has_blank: bool,
    /// For each row its agent.
    agent_of: [usize; AGENTS],
    /// For each agent its row.
    of_agent: [usize; AGENTS],
}

impl Rows {
    fn of(frame: &Frame) -> Self {
        let mut rows = Self { agents: 0, has_blank: false, agent_of: [0; AGENTS], of_agent: [usize::MAX; AGENTS] };
        for (index, agent) in frame.agents.iter().enumerate() {
            if index > 0 && agent.is_blank() {
                rows.has_blank = true;
            } else {
                rows.agent_of[rows.agents] = index;
                rows.of_agent[index] = rows.agents;
                rows.agents += 1;
            }
        }
        let blank = rows.agents;
        rows.of_agent.iter_mut().filter(|row| **row == usize::MAX).for_each(|row| *row = blank);
        rows
    }

    fn count(&self) -> usize {
        self.agents + usize::from(self.has_blank)
    }

    fn agents(&self) -> impl Iterator<Item = usize> + Clone {
        self.agent_of[..self.agents].iter().copied()
    }
}

impl MapAttention {
    /// `nothing` is the encoding of a point of an empty slot.
    fn of(weights: &Weights, name: &str, multiplier: &mut Multiplier, nothing: &[f32]) -> Self {
        let attention = Attention::of(weights, &format!("agent_map.{name}.cross_attention"), POINT_HEADS);
        let block = Block::of(weights, &format!("agent_map.{name}.transformer"));
        // All points are the same, so there is nothing to choose from.
        let pooled = nothing.repeat(POINT_HEADS);
        let (mut memory, mut empty) = (Vec::new(), Vec::new());
        attention.project(multiplier, &pooled, &mut memory, &mut empty);
        block.apply(multiplier, &mut empty, &mut memory);
        Self { attention, block, empty }
    }

    /// What `agents` make of their `sequences` of points, whose encodings are in `points`; to the places from `first` on of each
    /// agent in `slots`.
    fn attend<'a>(
        &self,
        multiplier: &mut Multiplier,
        points: &mut Points,
        agents: &[f32],
        sequences: impl Iterator<Item = &'a [Option<Sequence>]> + Clone,
        first: usize,
        slots: &mut [f32],
    ) {
        let Points { hidden, encoded, queries, projected, right, nothing, scores, weights, pooled, rows } = points;
        pooled.clear();
        if !encoded.is_empty() {
            // How much each agent's heads attend to each point, of whomever's lane it is: one product.
            self.attention.queries(multiplier, agents, projected, queries);
            let columns = queries.len() / WIDTH;
            right.pack(queries, WIDTH, columns);
            nothing.resize(columns, 0.0);
            scores.resize(encoded.len() / WIDTH * columns, 0.0);
            let left = Left::dense(encoded, WIDTH);
            multiplier.multiply(left, right, Begin::Bias(nothing), Finish::Plain, scores, columns);
            weights.resize(POINTS, [0.0; POINT_HEADS]);
            let arch = multiplier.arch();
            for (agent, sequences) in sequences.clone().enumerate() {
                for sequence in sequences.iter().flatten() {
                    let points = &sequence.points;
                    arch.dispatch(PointWeights { points, scores, columns, agent, weights });
                    let begin = pooled.len();
                    pooled.resize(begin + POINT_HEADS * WIDTH, 0.0);
                    pool(arch, encoded, &sequence.points, weights, &mut pooled[begin..]);
                }
            }
        }
        if pooled.is_empty() {
            return;
        }
        self.attention.project(multiplier, pooled, projected, rows);
        self.block.apply(multiplier, rows, &mut hidden[0]);
        let mut made = rows.chunks_exact(WIDTH);
        for (agent, sequences) in sequences.enumerate() {
            for (slot, _) in sequences.iter().enumerate().filter(|(_, sequence)| sequence.is_some()) {
                let Some(row) = made.next() else { return };
                slots[(agent * SLOTS + first + slot) * WIDTH..][..WIDTH].copy_from_slice(row);
            }
        }
    }
}

/// The weights of a sequence's points for each head of `agent`, of the scores (a row a point, `columns` wide).
struct PointWeights<'a> {
    points: &'a [u16; POINTS],
    scores: &'a [f32],
    columns: usize,
    agent: usize,
    weights: &'a mut [[f32; POINT_HEADS]],
}

impl WithSimd for PointWeights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { points, scores, columns, agent, weights } = self;
        let of_point = |point: u16| &scores[usize::from(point) * columns + agent * POINT_HEADS..][..POINT_HEADS];
        let mut greatest = [f32::MIN; POINT_HEADS];
        for point in points {
            for (most, score) in greatest.iter_mut().zip(of_point(*point)) {
                *most = if *score > *most { *score } else { *most };
            }
        }
        let mut sums = [0.0_f32; POINT_HEADS];
        for (point, weights) in points.iter().zip(weights.iter_mut()) {
            let terms = weights.iter_mut().zip(of_point(*point)).zip(&greatest).zip(&mut sums);
            for (((weight, score), most), sum) in terms {
                *weight = exp(*score - *most);
                *sum += *weight;
            }
        }
        for weights in weights {
            weights.iter_mut().zip(&sums).for_each(|(weight, sum)| *weight /= sum);
        }
    }
}

/// The weights of an agent's slots for each head of its queries.
struct SlotWeights<'a> {
    queries: &'a [f32],
    slots: &'a [f32],
    attended: [bool; SLOTS],
}

impl WithSimd for SlotWeights<'_> {
    type Output = [[f32; SLOT_HEADS]; SLOTS];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut weights = [[0.0; SLOT_HEADS]; SLOTS];
        for (head, query) in self.queries.chunks_exact(WIDTH).enumerate() {
            let mut scores = [0.0; SLOTS];
            for (score, slot) in scores.iter_mut().zip(self.slots.chunks_exact(WIDTH)) {
                *score = dot(query, slot);
            }
            softmax(&mut scores, |slot| self.attended[slot]);
            weights.iter_mut().zip(scores).for_each(|(weights, score)| weights[head] = score);
        }
        weights
    }
}

/// Nine weights of the cost: seven of a softmax over nine, scaled, and two constants (paper's code).
fn cost_weights(weights: &Weights) -> [f32; 9] {
    const SCALE: [f64; 7] = [1.0, 1.0, 1.0, 1.0, 1.0, 10.0, 100.0];
    const CONSTANT: f32 = 10.0;
    let get = |name: &str| weights.get(&format!("plan.cost.{name}")).iter().map(|value| f64::from(*value));
    let hidden: Vec<f64> = get("0.weight").zip(get("0.bias")).map(|(w, b)| (w + b).max(0.0)).collect();
    let rows: Vec<f64> = get("2.weight").collect();
    let logits = rows.chunks_exact(hidden.len().max(1)).zip(get("2.bias"));
    let logits = logits.map(|(row, bias)| row.iter().zip(&hidden).fold(bias, |sum, (w, value)| sum + w * value));
    let shares: Vec<f64> = logits.map(libm::exp).collect();
    let all: f64 = shares.iter().sum();
    let mut values = [CONSTANT; 9];
    for ((value, share), scale) in values.iter_mut().zip(&shares).zip(SCALE) {
        *value = (share / all * scale) as f32;
    }
    values
}

const _: () = assert!(LANES + CROSSWALKS == SLOTS);
