//! Agents among each other: two post-norm encoder layers; absent agents are no keys, but ask (`network.md` 5.4).

use super::aligned::Aligned;
use super::functions::{Norm, softmax_of};
use super::product::{End, Kernel, Linear, ROWS};
use super::source::Source;
use crate::constants::{AGENTS, FEED_FORWARD, HEADS, WIDTH};
use crate::weights::WeightsError;

const SIZE: usize = WIDTH / HEADS;

/// One layer.
#[derive(Debug)]
pub(super) struct InteractionLayer {
    kernel: Kernel,
    projection: Linear,
    out: Linear,
    norms: [Norm; 2],
    widen: Linear,
    narrow: Linear,
}

/// What a layer needs.
#[derive(Debug)]
pub(super) struct Room {
    projected: Aligned,
    joined: Aligned,
    added: Aligned,
    wide: Aligned,
}

impl Room {
    pub fn new(frames: usize) -> Self {
        let rows = (frames * AGENTS).next_multiple_of(ROWS);
        let aligned = |width: usize| Aligned::new(rows * width);
        Self {
            projected: aligned(3 * WIDTH),
            joined: aligned(WIDTH),
            added: aligned(WIDTH),
            wide: aligned(FEED_FORWARD),
        }
    }
}

impl InteractionLayer {
    pub fn new(source: Source<'_>, index: usize) -> Result<Self, WeightsError> {
        let name = |part: &str| format!("agent_agent.interaction_net.layers.{index}.{part}");
        let tensor = |part: &str| source.tensor(&name(part));
        Ok(Self {
            kernel: source.kernel,
            projection: source.layer(tensor("self_attn.in_proj_weight")?, tensor("self_attn.in_proj_bias")?),
            out: source.linear(&name("self_attn.out_proj"))?,
            norms: [source.norm(&name("norm1"))?, source.norm(&name("norm2"))?],
            widen: source.linear(&name("linear1"))?,
            narrow: source.linear(&name("linear2"))?,
        })
    }

    /// Multiply-adds of a frame.
    pub fn multiply_adds(&self) -> u64 {
        let layers = [&self.projection, &self.out, &self.widen, &self.narrow].into_iter();
        (AGENTS as u64) * (layers.map(Linear::multiply_adds).sum::<u64>() + (2 * AGENTS * WIDTH) as u64)
    }

    /// The agents of each frame through the layer, in place. `present` and `shares` have an entry a frame.
    pub fn run<'a>(
        &self,
        agents: &mut [f32],
        present: impl ExactSizeIterator<Item = &'a [bool; AGENTS]>,
        shares: impl Iterator<Item = &'a mut [[f32; AGENTS]; AGENTS]>,
        room: &mut Room,
    ) {
        let rows = present.len() * AGENTS;
        self.projection.apply_packed(agents, rows, &mut room.projected, End::Sum);
        let frames = room.projected.chunks_exact(AGENTS * 3 * WIDTH).zip(room.joined.chunks_exact_mut(AGENTS * WIDTH));
        for ((present, shares), (projected, joined)) in present.zip(shares).zip(frames) {
            self.kernel.run(|| attend(projected, present, joined, shares));
        }
        self.out.apply_packed(&room.joined, rows, &mut room.added, End::Sum);
        self.add_and_norm(agents, &room.added, rows, 0);
        self.widen.apply_packed(agents, rows, &mut room.wide, End::Relu);
        self.narrow.apply_packed(&room.wide, rows, &mut room.added, End::Sum);
        self.add_and_norm(agents, &room.added, rows, 1);
    }

    fn add_and_norm(&self, agents: &mut [f32], added: &[f32], rows: usize, norm: usize) {
        self.kernel.run(|| {
            let rows = agents.as_chunks_mut::<WIDTH>().0.iter_mut().zip(added.as_chunks::<WIDTH>().0).take(rows);
            for (row, added) in rows {
                row.iter_mut().zip(added).for_each(|(value, added)| *value += added);
                self.norms[norm].apply(row);
            }
        });
    }
}

/// The attention of one frame: queries, keys and values of each agent in `projected`, answers in `joined`.
#[inline(always)]
fn attend(projected: &[f32], present: &[bool; AGENTS], joined: &mut [f32], means: &mut [[f32; AGENTS]; AGENTS]) {
    let scale = 1.0 / (SIZE as f32).sqrt();
    let part = |agent: usize, part: usize, head: usize| &projected[(3 * agent + part) * WIDTH + head * SIZE..][..SIZE];
    *means = Default::default();
    for head in 0..HEADS {
        for agent in 0..AGENTS {
            let query = part(agent, 0, head);
            let mut shares = [f32::NEG_INFINITY; AGENTS];
            for other in (0..AGENTS).filter(|other| present[*other]) {
                shares[other] = query.iter().zip(part(other, 1, head)).map(|(q, k)| q * scale * k).sum();
            }
            softmax_of(&mut shares);
            let answer = &mut joined[agent * WIDTH + head * SIZE..][..SIZE];
            answer.fill(0.0);
            for (other, share) in shares.iter().enumerate().filter(|(other, _)| present[*other]) {
                answer.iter_mut().zip(part(other, 2, head)).for_each(|(answer, value)| *answer += share * value);
                means[agent][other] += share / HEADS as f32;
            }
        }
    }
}
