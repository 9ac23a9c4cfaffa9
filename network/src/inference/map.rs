//! What each agent makes of its map: lanes and crosswalks point by point, then all ten together in each mode
//! (`network.md` 5.5, 5.6).

use super::aligned::Aligned;
use super::attention::{FeedForward, SingleQuery};
use super::functions::{dot, softmax, softmax_of};
use super::points::Distinct;
use super::pooling::{HEAD_STRIDE, Scores};
use super::product::{Kernel, ROWS};
use super::source::Source;
use crate::constants::{AGENTS, FEED_FORWARD, HEADS, MAP_HEADS, POINTS, SLOTS, WIDTH};
use crate::frame::{Frame, Prediction};
use crate::weights::WeightsError;

/// The attention of agents to the points of one kind of slot.
#[derive(Debug)]
pub(super) struct PointAttention {
    kernel: Kernel,
    attention: SingleQuery,
    feed_forward: FeedForward,
    /// What a slot of zeros comes to, whoever asks: all its points are equal.
    empty: [f32; WIDTH],
}

/// What the attentions need.
#[derive(Debug)]
pub(super) struct Room {
    projected: Aligned,
    queries: Aligned,
    packed: Aligned,
    points: Aligned,
    scores: Aligned,
    shares: Vec<[f32; HEADS]>,
    pooled: Aligned,
    joined: Aligned,
    answers: Aligned,
    wide: Aligned,
    /// Frame, agent and slot of each row of `pooled`.
    asked: Vec<usize>,
}

impl Room {
    pub fn new(frames: usize) -> Self {
        let agents = (frames * AGENTS).next_multiple_of(ROWS);
        let slots = (frames * AGENTS * SLOTS).next_multiple_of(ROWS);
        Self {
            projected: Aligned::new(agents * WIDTH),
            queries: Aligned::new(agents * HEADS * WIDTH),
            packed: Aligned::new(Kernel::PACKED_HEADS),
            points: Aligned::new(POINTS * WIDTH),
            scores: Aligned::new(POINTS * HEAD_STRIDE),
            shares: vec![[0.0; HEADS]; POINTS],
            pooled: Aligned::new(slots * HEADS * WIDTH),
            joined: Aligned::new(slots * WIDTH),
            answers: Aligned::new(slots * WIDTH),
            wide: Aligned::new(slots * FEED_FORWARD),
            asked: Vec::with_capacity(slots),
        }
    }

    /// Before the frames of a call.
    pub fn begin(&mut self, attention: &PointAttention, agents: &[f32], count: usize) {
        self.asked.clear();
        attention.attention.queries(agents, count, &mut self.projected, &mut self.queries);
    }

    /// How many slots were looked at.
    pub fn asked(&self) -> usize {
        self.asked.len()
    }
}

/// The slots of one kind: how many an agent has, and where among all its slots they begin.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub first: usize,
    pub count: usize,
}

impl PointAttention {
    pub fn new(source: Source<'_>, kind: &str, encode: impl Fn(&mut [f32])) -> Result<Self, WeightsError> {
        let attention = SingleQuery::new(source, &format!("agent_map.{kind}_attention.cross_attention"), HEADS)?;
        let feed_forward = FeedForward::new(source, &format!("agent_map.{kind}_attention.transformer"))?;
        let mut made = Self { kernel: source.kernel, attention, feed_forward, empty: [0.0; WIDTH] };
        let mut point = vec![0.0; WIDTH * ROWS];
        encode(&mut point);
        let mut pooled = vec![0.0; ROWS * HEADS * WIDTH];
        // A mean of equal rows, as the pooling would find it but for the rounding of its shares.
        pooled.chunks_exact_mut(WIDTH).take(HEADS).for_each(|row| row.copy_from_slice(&point[..WIDTH]));
        let (mut joined, mut answer) = (vec![0.0; ROWS * WIDTH], vec![0.0; ROWS * WIDTH]);
        made.attention.answers(&pooled, 1, &mut joined, &mut answer);
        made.feed_forward.run(&mut answer, 1, &mut vec![0.0; ROWS * FEED_FORWARD]);
        made.empty.copy_from_slice(&answer[..WIDTH]);
        Ok(made)
    }

    /// Multiply-adds of an agent's query, and of a slot.
    pub fn multiply_adds(&self) -> (u64, u64) {
        let (query, answer) = self.attention.multiply_adds();
        (query, answer + self.feed_forward.multiply_adds() + (2 * POINTS * HEADS * WIDTH) as u64)
    }

    /// Looks at one frame's slots: `points[agent][slot]` are 100 rows; those of slots that are not all zeros are put into `distinct`
    /// and encoded by `encode`, then each agent asks its own.
    pub fn look<const N: usize>(
        &self,
        (frame, kind): (usize, Kind),
        points: &[[[f32; N]; POINTS]],
        distinct: &mut Distinct<N>,
        (places, encoded): (&mut Vec<[u32; POINTS]>, &mut Aligned),
        encode: impl FnOnce(&[[f32; N]], &mut [f32]),
        room: &mut Room,
    ) {
        distinct.clear();
        places.clear();
        let begin = room.asked.len();
        for (index, slot) in points.iter().enumerate() {
            if slot.as_flattened().iter().all(|value| *value == 0.0) {
                continue;
            }
            let (agent, own) = (index / kind.count, index % kind.count);
            room.asked.push((frame * AGENTS + agent) * SLOTS + kind.first + own);
            let mut last = 0;
            places.push(std::array::from_fn(|point| {
                // Short sequences repeat their points.
                if point == 0 || slot[point] != slot[point - 1] {
                    last = distinct.place(&slot[point]);
                }
                last
            }));
        }
        encode(distinct.rows(), encoded);
        let encoded = encoded.as_chunks::<WIDTH>().0;
        let mut packed_for = usize::MAX;
        for (row, places) in (begin..room.asked.len()).zip(places) {
            let agent = room.asked[row] / SLOTS;
            if packed_for != agent {
                let heads = &room.queries[agent * HEADS * WIDTH..][..HEADS * WIDTH];
                self.kernel.pack_heads(heads, &mut room.packed);
                packed_for = agent;
            }
            for (point, place) in room.points.as_chunks_mut::<WIDTH>().0.iter_mut().zip(places.iter()) {
                *point = encoded[*place as usize];
            }
            self.kernel.scores(Scores {
                heads: &room.packed,
                points: &room.points,
                count: POINTS,
                scores: &mut room.scores,
            });
            let scores = room.scores.chunks_exact(HEAD_STRIDE);
            self.kernel.run(|| softmax(scores, &mut room.shares));
            self.kernel.pool(&room.shares, &room.points, &mut room.pooled[row * HEADS * WIDTH..][..HEADS * WIDTH]);
        }
    }

    /// After all frames of a call: every slot's row, `slots[frame][agent][slot]`.
    pub fn answer(&self, slots: &mut [f32], kind: Kind, room: &mut Room) {
        let empty = slots.as_chunks_mut::<WIDTH>().0.as_chunks_mut::<SLOTS>().0;
        for slot in empty.iter_mut().flat_map(|slots| &mut slots[kind.first..kind.first + kind.count]) {
            *slot = self.empty;
        }
        let count = room.asked.len();
        self.attention.answers(&room.pooled, count, &mut room.joined, &mut room.answers);
        self.feed_forward.run(&mut room.answers, count, &mut room.wide);
        for (slot, answer) in room.asked.iter().zip(room.answers.as_chunks::<WIDTH>().0) {
            slots[slot * WIDTH..][..WIDTH].copy_from_slice(answer);
        }
    }
}

/// The attention to all slots, one for each mode.
#[derive(Debug)]
pub(super) struct ModeAttention {
    kernel: Kernel,
    modes: Vec<SingleQuery>,
    feed_forward: FeedForward,
}

impl ModeAttention {
    pub fn new(source: Source<'_>) -> Result<Self, WeightsError> {
        let mode =
            |mode: usize| SingleQuery::new(source, &format!("agent_map.map_attention.attention.{mode}"), MAP_HEADS);
        let modes = (0..source.weights.variant().futures()).map(mode).collect::<Result<_, _>>()?;
        let feed_forward = FeedForward::new(source, "agent_map.map_attention.ffn")?;
        Ok(Self { kernel: source.kernel, modes, feed_forward })
    }

    pub fn futures(&self) -> usize {
        self.modes.len()
    }

    /// Multiply-adds of a frame.
    pub fn multiply_adds(&self) -> u64 {
        let agent = |mode: &SingleQuery| {
            let (query, answer) = mode.multiply_adds();
            query + answer + self.feed_forward.multiply_adds() + (2 * MAP_HEADS * SLOTS * WIDTH) as u64
        };
        AGENTS as u64 * self.modes.iter().map(agent).sum::<u64>()
    }

    /// `modes[mode][frame][agent]` from `slots[frame][agent][slot]`.
    pub fn run(
        &self,
        agents: &[f32],
        slots: &[f32],
        frames: &[&Frame],
        out: &mut [Prediction],
        room: &mut Room,
        modes: &mut [f32],
    ) {
        let count = frames.len() * AGENTS;
        let slots = slots.as_chunks::<WIDTH>().0.as_chunks::<SLOTS>().0;
        for (index, mode) in self.modes.iter().enumerate() {
            mode.queries(agents, count, &mut room.projected, &mut room.queries);
            let queries = room.queries.as_chunks::<WIDTH>().0.as_chunks::<MAP_HEADS>().0;
            let pooled = room.pooled.as_chunks_mut::<WIDTH>().0.as_chunks_mut::<MAP_HEADS>().0;
            let rows = queries.iter().zip(slots).zip(pooled).take(count).enumerate();
            for (row, ((queries, slots), pooled)) in rows {
                let present = &frames[row / AGENTS].presence.slots[row % AGENTS];
                let means = &mut out[row / AGENTS].attention.map[index][row % AGENTS];
                self.kernel.run(|| look(queries, slots, present, pooled, means));
            }
            let answers = &mut modes[index * count * WIDTH..];
            mode.answers(&room.pooled, count, &mut room.joined, &mut room.answers);
            answers[..count * WIDTH].copy_from_slice(&room.answers[..count * WIDTH]);
        }
        self.feed_forward.run(modes, self.modes.len() * count, &mut room.wide);
    }
}

/// One agent's look at its slots. The first is never masked, so that there is one.
#[inline(always)]
fn look(
    queries: &[[f32; WIDTH]; MAP_HEADS],
    slots: &[[f32; WIDTH]; SLOTS],
    present: &[bool; SLOTS],
    pooled: &mut [[f32; WIDTH]; MAP_HEADS],
    means: &mut [f32; SLOTS],
) {
    *means = [0.0; SLOTS];
    for (query, pooled) in queries.iter().zip(pooled) {
        let mut shares = [f32::NEG_INFINITY; SLOTS];
        let seen = || (0..SLOTS).filter(|slot| *slot == 0 || present[*slot]);
        for slot in seen() {
            shares[slot] = dot(query, &slots[slot]);
        }
        softmax_of(&mut shares);
        *pooled = [0.0; WIDTH];
        for slot in seen() {
            pooled.iter_mut().zip(&slots[slot]).for_each(|(sum, value)| *sum += shares[slot] * value);
            means[slot] += shares[slot] / MAP_HEADS as f32;
        }
    }
}
