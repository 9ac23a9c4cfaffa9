//! The network, fast: what is written here is the function of `network.md` 5, rearranged.
//!
//! ```text
//! histories ──▶ motion ──▶ interaction ──┬──────────────▶ queries ─┐                    ┌──▶ controls
//! lane points ──▶ points (each distinct one once) ──▶ lanes ──▶ attention ──▶ modes ────┼──▶ poses
//! crosswalk points ──▶ points ──▶ crosswalks ──────────▶ attention ─┘                   └──▶ scores
//! ```
//!
//! What saves work, all of it exact: only the LSTM of an agent's type runs; lane layers before the first activation are one
//! map and tables; a point that several agents or slots have is encoded once; a query takes the projection of the keys, and that of
//! the values comes after pooling; slots and histories of zeros are constants of the weights.
//!
//! **Bytes.** The same weights and frame give the same bytes in any batch and on any machine: every sum has a fixed order, products
//! add by fused multiply-adds (`product`), all else is plain arithmetic (`functions`). Where a machine has no such instruction,
//! the library's own is exact and some fifty times slower.
//!
//! | file | what |
//! | --- | --- |
//! | `product`, `pooling`, `aligned` | rows times packed weights; one query's scores and pools |
//! | `functions` | activations, softmax, norms |
//! | `motion`, `points`, `interaction`, `attention`, `map`, `heads` | the parts, in the order of the data |
//! | `source` | layers out of the weights |

mod aligned;
mod attention;
pub mod functions;
mod heads;
mod interaction;
mod map;
mod motion;
mod points;
mod pooling;
pub(crate) mod product;
#[cfg(test)]
mod reference;
mod source;
#[cfg(test)]
mod tests;

use aligned::Aligned;
use heads::{Heads, Known};
use interaction::InteractionLayer;
use map::{Kind, ModeAttention, PointAttention};
use motion::Motion;
use points::{CrosswalkEncoder, Distinct, LaneEncoder};
use product::{Kernel, ROWS};
use source::Source;

use crate::constants::{
    AGENTS, CROSSWALK_ROW, CROSSWALKS, FUTURES, HISTORY, LANE_ROW, LANES, POINTS, SLOTS, STATE, WIDTH,
};
use crate::frame::{Frame, Prediction};
use crate::weights::{Variant, Weights, WeightsError};

const LANE_SLOTS: Kind = Kind { first: 0, count: LANES };
const CROSSWALK_SLOTS: Kind = Kind { first: LANES, count: CROSSWALKS };

/// A network ready to answer; threads may share it, each with a [`Workspace`] of its own.
#[derive(Debug)]
pub struct Network {
    variant: Variant,
    /// Vehicles, pedestrians, cyclists.
    motions: [Motion; 3],
    /// What a vehicle's history of zeros comes to: that of an agent that is not there.
    still: [f32; WIDTH],
    lane_encoder: LaneEncoder,
    crosswalk_encoder: CrosswalkEncoder,
    interaction: [InteractionLayer; 2],
    lanes: PointAttention,
    crosswalks: PointAttention,
    modes: ModeAttention,
    heads: Heads,
}

/// What a call writes to on its way: made once, so that answering allocates nothing.
#[derive(Debug)]
pub struct Workspace {
    frames: usize,
    motion: motion::Room,
    interaction: interaction::Room,
    map: map::Room,
    heads: heads::Room,
    /// Rows of agents by type.
    of_type: [Vec<usize>; 3],
    present: Vec<[bool; AGENTS]>,
    agents: Aligned,
    slots: Aligned,
    modes: Aligned,
    lane_points: Distinct<LANE_ROW>,
    crosswalk_points: Distinct<CROSSWALK_ROW>,
    places: Vec<[u32; POINTS]>,
    encoded: Aligned,
    hidden: Aligned,
    work: Work,
}

/// How much there was to do in a call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Frames.
    pub frames: usize,
    /// Histories that went through an LSTM.
    pub histories: usize,
    /// Distinct lane points.
    pub lane_points: usize,
    /// Distinct crosswalk points.
    pub crosswalk_points: usize,
    /// Lane sequences with points.
    pub lane_slots: usize,
    /// Crosswalks with points.
    pub crosswalk_slots: usize,
}

impl Workspace {
    /// For calls of any number of frames, of which up to `frames` are worked on together: more of them share what is read of the
    /// weights, and need more memory (about 2 MB a frame, and 13 MB for any).
    #[must_use]
    pub fn new(frames: usize) -> Self {
        let frames = frames.max(1);
        let agents = frames * AGENTS;
        let rows = agents.next_multiple_of(ROWS);
        Self {
            frames,
            motion: motion::Room::new(agents.min(motion::TOGETHER)),
            interaction: interaction::Room::new(frames),
            map: map::Room::new(frames),
            heads: heads::Room::new(frames),
            of_type: [(); 3].map(|()| Vec::with_capacity(agents)),
            present: Vec::with_capacity(frames),
            agents: Aligned::new(rows * WIDTH),
            slots: Aligned::new(agents * SLOTS * WIDTH),
            modes: Aligned::new((FUTURES * agents).next_multiple_of(ROWS) * WIDTH),
            lane_points: Distinct::new(AGENTS * LANES * POINTS),
            crosswalk_points: Distinct::new(AGENTS * CROSSWALKS * POINTS),
            places: Vec::with_capacity(AGENTS * LANES),
            encoded: Aligned::new((AGENTS * LANES * POINTS).next_multiple_of(ROWS) * WIDTH),
            hidden: points::hidden(),
            work: Work::default(),
        }
    }

    /// How much there was to do in the last call.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }
}

impl Network {
    /// The network of these weights, laid out for this machine.
    ///
    /// # Errors
    /// None that [`Weights`] does not rule out.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        Self::for_kernel(weights, Kernel::new())
    }

    fn for_kernel(weights: &Weights, kernel: Kernel) -> Result<Self, WeightsError> {
        let source = Source { weights, kernel };
        let motion = |kind: &str| Motion::new(source, &format!("{kind}_net"));
        let motions = [motion("vehicle")?, motion("pedestrian")?, motion("cyclist")?];
        let mut still = [0.0; WIDTH];
        still.copy_from_slice(motions[0].run(&mut motion::Room::new(1), 1));
        let (lane_encoder, crosswalk_encoder) = (LaneEncoder::new(source)?, CrosswalkEncoder::new(source)?);
        let hidden = &mut points::hidden();
        let (mut lane, mut crosswalk) = (vec![0.0; ROWS * WIDTH], vec![0.0; ROWS * WIDTH]);
        lane_encoder.run(&[[0.0; LANE_ROW]], hidden, &mut lane);
        crosswalk_encoder.run(&[[0.0; CROSSWALK_ROW]], hidden, &mut crosswalk);
        Ok(Self {
            variant: weights.variant(),
            motions,
            still,
            interaction: [InteractionLayer::new(source, 0)?, InteractionLayer::new(source, 1)?],
            lanes: PointAttention::new(source, "lane", |row| row.copy_from_slice(&lane))?,
            crosswalks: PointAttention::new(source, "crosswalk", |row| row.copy_from_slice(&crosswalk))?,
            modes: ModeAttention::new(source)?,
            heads: Heads::new(source)?,
            lane_encoder,
            crosswalk_encoder,
        })
    }

    /// Which network it is.
    #[must_use]
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// Answers each frame, in its place in `out`; past the shorter of the two nothing is done. A frame's answer is the same whatever other
    /// frames are there. Allocates nothing.
    pub fn forward(&self, frames: &[&Frame], workspace: &mut Workspace, out: &mut [Prediction]) {
        workspace.work = Work::default();
        let together = workspace.frames;
        for (frames, out) in frames.chunks(together).zip(out.chunks_mut(together)) {
            let count = frames.len().min(out.len());
            self.answer(&frames[..count], workspace, &mut out[..count]);
        }
    }

    fn answer(&self, frames: &[&Frame], workspace: &mut Workspace, out: &mut [Prediction]) {
        self.histories(frames, workspace);
        self.interact(frames, workspace, out);
        self.look(frames, workspace, out);
        let Workspace { agents, slots, modes, heads, .. } = workspace;
        let known = Known { agents, modes, slots, futures: self.modes.futures() };
        self.heads.run(known, frames, out, heads);
        workspace.work.frames += frames.len();
    }

    fn histories(&self, frames: &[&Frame], workspace: &mut Workspace) {
        let Workspace { motion: room, of_type, agents, work, .. } = workspace;
        of_type.iter_mut().for_each(Vec::clear);
        let place = |row: usize| (frames[row / AGENTS], row % AGENTS);
        for row in 0..frames.len() * AGENTS {
            match place(row) {
                (_, 0) => of_type[0].push(row),
                (frame, agent) => {
                    let rows = &frame.neighbors[agent - 1];
                    let kind = rows[HISTORY - 1][STATE];
                    if kind as usize != 2 && kind as usize != 3 && rows.iter().all(|row| row[..STATE] == [0.0; STATE]) {
                        agents[row * WIDTH..][..WIDTH].copy_from_slice(&self.still);
                    } else {
                        of_type[if kind == 2.0 {
                            1
                        } else if kind == 3.0 {
                            2
                        } else {
                            0
                        }]
                        .push(row);
                    }
                }
            }
        }
        for (motion, all) in self.motions.iter().zip(of_type) {
            for together in all.chunks(motion::TOGETHER) {
                let stride = together.len().next_multiple_of(ROWS);
                for (index, row) in together.iter().enumerate() {
                    let (frame, agent) = place(*row);
                    for step in 0..HISTORY {
                        let state = match agent.checked_sub(1) {
                            None => &frame.ego[step],
                            Some(neighbor) => &frame.neighbors[neighbor][step][..STATE],
                        };
                        room.histories[(step * stride + index) * STATE..][..STATE].copy_from_slice(state);
                    }
                }
                let encoded = motion.run(room, together.len());
                for (row, encoded) in together.iter().zip(encoded.chunks_exact(WIDTH)) {
                    agents[row * WIDTH..][..WIDTH].copy_from_slice(encoded);
                }
                work.histories += together.len();
            }
        }
    }

    fn interact(&self, frames: &[&Frame], workspace: &mut Workspace, out: &mut [Prediction]) {
        let Workspace { interaction, present, agents, .. } = workspace;
        present.clear();
        present.extend(frames.iter().map(|frame| {
            let mut present = frame.presence.agents;
            // Somebody must be there to be looked at.
            present[0] |= !present.contains(&true);
            present
        }));
        for (index, layer) in self.interaction.iter().enumerate() {
            let shares = out.iter_mut().map(|prediction| &mut prediction.attention.agents[index]);
            layer.run(agents, present.iter(), shares, interaction);
        }
    }

    fn look(&self, frames: &[&Frame], workspace: &mut Workspace, out: &mut [Prediction]) {
        let Workspace { map, agents, slots, modes, lane_points, crosswalk_points, .. } = workspace;
        let Workspace { places, encoded, hidden, work, .. } = workspace;
        let rows = frames.len() * AGENTS;
        map.begin(&self.lanes, agents, rows);
        for (index, frame) in frames.iter().enumerate() {
            let encode = |points: &[[f32; LANE_ROW]], encoded: &mut [f32]| {
                work.lane_points += points.len();
                self.lane_encoder.run(points, hidden, encoded);
            };
            self.lanes.look((index, LANE_SLOTS), &frame.lanes, lane_points, (places, encoded), encode, map);
        }
        let slots = &mut slots[..rows * SLOTS * WIDTH];
        self.lanes.answer(slots, LANE_SLOTS, map);
        work.lane_slots += map.asked();
        map.begin(&self.crosswalks, agents, rows);
        for (index, frame) in frames.iter().enumerate() {
            let encode = |points: &[[f32; CROSSWALK_ROW]], encoded: &mut [f32]| {
                work.crosswalk_points += points.len();
                self.crosswalk_encoder.run(points, hidden, encoded);
            };
            let points = (&mut *places, &mut *encoded);
            self.crosswalks.look((index, CROSSWALK_SLOTS), &frame.crosswalks, crosswalk_points, points, encode, map);
        }
        self.crosswalks.answer(slots, CROSSWALK_SLOTS, map);
        work.crosswalk_slots += map.asked();
        self.modes.run(agents, slots, frames, out, map, modes);
    }

    /// Multiply-adds in the products of so much work; what remains of them after all that is saved.
    #[must_use]
    pub fn multiply_adds(&self, work: &Work) -> u64 {
        let frames = work.frames as u64;
        let points = |attention: &PointAttention, slots: usize| {
            let (query, slot) = attention.multiply_adds();
            AGENTS as u64 * frames * query + slots as u64 * slot
        };
        work.histories as u64 * self.motions[0].multiply_adds()
            + work.lane_points as u64 * self.lane_encoder.multiply_adds()
            + work.crosswalk_points as u64 * self.crosswalk_encoder.multiply_adds()
            + points(&self.lanes, work.lane_slots)
            + points(&self.crosswalks, work.crosswalk_slots)
            + frames * self.interaction.iter().map(InteractionLayer::multiply_adds).sum::<u64>()
            + frames * (self.modes.multiply_adds() + self.heads.multiply_adds(self.modes.futures()))
    }
}

/// For benches: a product of so many rows, inputs and outputs, to be run again and again; the rate that the machine reaches in it is the floor
/// that a network's multiply-adds are held to.
#[doc(hidden)]
pub fn bench_product(rows: usize, inputs: usize, outputs: usize) -> impl FnMut() {
    let linear = product::Linear::new(Kernel::new(), (outputs, inputs), |n, k| (n + k) as f32 * 1e-4, |_| 0.0);
    let rows = rows.next_multiple_of(ROWS);
    let (mut a, mut c) = (Aligned::new(rows * inputs), Aligned::new(rows * linear.stride()));
    a.fill(0.5);
    move || linear.apply_packed(&a, rows, &mut c, product::End::Relu)
}
