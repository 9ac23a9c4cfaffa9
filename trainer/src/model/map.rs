//! What agents see of lanes and crosswalks (`network.md` 5.2, 5.3, 5.5).

use network::constants::{CROSSWALK_ROW, CROSSWALKS, HEADS, LANE_NUMBERS, LANE_ROW, LANES, POINTS, SLOTS, WIDTH};

use crate::tape::{Activation, Part, Scalar, Slot, Var};
use crate::windows::Sketch;

use super::Net;
use super::crew::Crew;

/// Codes of a lane point: table, rows, column, and whether row 0 is padding, which is zero and stays so.
const CODES: [(&str, usize, usize, bool); 7] = [
    ("self_type", 4, 10, true),
    ("left_type", 11, 11, true),
    ("right_type", 11, 12, true),
    ("traffic_light_type", 9, 13, true),
    ("interpolating", 2, 15, false),
    ("stop_sign", 2, 16, false),
    ("stop_point", 2, 14, false),
];
/// A point's numbers, then a place for each value of each code, then one for the bias.
const INPUTS: usize = LANE_NUMBERS + 41 + 1;
/// Columns of the lane layers side by side: three lines, the speed limit, the sum of the codes.
const LINE: usize = 128;
const LIMIT: usize = 64;

/// What was seen.
pub(super) struct Seen {
    /// What each look at a lane or a crosswalk said; rows for those that are not there too.
    pub answers: Var,
    /// For each row of the crew those of its ten slots.
    pub all: Vec<Vec<u32>>,
    /// The same without what is masked.
    pub unmasked: Vec<Vec<u32>>,
}

impl<'a, T: Scalar> Net<'_, 'a, T> {
    /// What everybody sees of the map.
    pub(super) fn map(&mut self, crew: &Crew, sketches: &[&Sketch], agents: Var) -> Seen {
        let lanes = self.lane_points(sketches);
        let crosswalks = self.crosswalk_points(sketches);
        let starts = |count: fn(&Sketch) -> usize| {
            let ends = sketches.iter().scan(0, move |end, sketch| {
                *end += count(sketch);
                Some(*end)
            });
            std::iter::once(0).chain(ends).map(|start| start as u32).collect::<Vec<u32>>()
        };
        let lane_starts = starts(|sketch| sketch.lane_points.len());
        let crosswalk_starts = starts(|sketch| sketch.crosswalk_points.len());
        // The point after all others is the empty one; nobody in particular looks at it.
        let nothing = |starts: &[u32]| Slot { query: 0, rows: vec![starts[starts.len() - 1]; POINTS] };
        let mut looks = [vec![nothing(&lane_starts)], vec![nothing(&crosswalk_starts)]];
        let mut all: Vec<[Option<u32>; SLOTS]> = Vec::with_capacity(crew.rows.len());
        for (row, who) in crew.rows.iter().enumerate() {
            let Some(agent) = who.agent else {
                all.push([None; SLOTS]);
                continue;
            };
            let sketch = sketches[who.sample];
            all.push(std::array::from_fn(|slot| {
                let (kind, points, start) = if slot < LANES {
                    (0, &sketch.lanes[agent * LANES + slot], lane_starts[who.sample])
                } else {
                    (1, &sketch.crosswalks[agent * CROSSWALKS + slot - LANES], crosswalk_starts[who.sample])
                };
                let rows = points.as_ref()?.iter().map(|point| start + u32::from(*point)).collect();
                looks[kind].push(Slot { query: row, rows });
                Some(looks[kind].len() as u32 - 1)
            }));
        }
        let [lane_looks, crosswalk_looks] = looks;
        let second = lane_looks.len() as u32;
        let answers =
            [("lane", lanes, lane_looks), ("crosswalk", crosswalks, crosswalk_looks)].map(|(kind, points, looks)| {
                let name = format!("agent_map.{kind}_attention");
                let heard = self.attention(&format!("{name}.cross_attention"), HEADS, agents, points, looks);
                self.feed_forward(&format!("{name}.transformer"), heard)
            });
        let answers = self.tape.stack(answers.to_vec());
        let row_of = |slot: usize, look: &Option<u32>| look.unwrap_or(0) + if slot < LANES { 0 } else { second };
        let rows = |all: &[Option<u32>; SLOTS]| {
            all.iter().enumerate().map(|(slot, look)| row_of(slot, look)).collect::<Vec<u32>>()
        };
        let all: Vec<Vec<u32>> = all.iter().map(rows).collect();
        let unmasked = crew.rows.iter().zip(&all).map(|(who, all)| {
            // The first lane is never masked, or there would be nothing to look at.
            let is_there = |slot: usize| {
                slot == 0 || who.agent.is_some_and(|agent| sketches[who.sample].presence.slots[agent][slot])
            };
            (0..SLOTS).filter(|slot| is_there(*slot)).map(|slot| all[slot]).collect()
        });
        Seen { answers, unmasked: unmasked.collect(), all }
    }

    /// All different lane points, encoded; the last is an empty one.
    fn lane_points(&mut self, sketches: &[&Sketch]) -> Var {
        let points: Vec<&[f32; LANE_ROW]> =
            sketches.iter().flat_map(|sketch| &sketch.lane_points).chain([&[0.0; LANE_ROW]]).collect();
        let mut x = vec![T::ZERO; points.len() * INPUTS];
        for (x, point) in x.chunks_exact_mut(INPUTS).zip(&points) {
            x[..LANE_NUMBERS].iter_mut().zip(&point[..]).for_each(|(x, value)| *x = T::of(f64::from(*value)));
            let mut from = LANE_NUMBERS;
            for (_, rows, column, _) in CODES {
                x[from + (point[column] as usize).min(rows - 1)] = T::ONE;
                from += rows;
            }
            x[INPUTS - 1] = T::ONE;
        }
        let x = self.tape.constant(points.len(), INPUTS, x);
        // No function lies between the layers of the lane's parts and the next: they are multiplied first.
        let mut parts = Vec::new();
        let mut part = |net: &mut Self, name: &str, at: (usize, usize), transposed: bool, first_is_fixed: bool| {
            let var = net.parameter(&format!("lane_net.{name}"));
            parts.push(Part { var, at, transposed, first_is_fixed });
        };
        for (index, line) in ["self_line", "left_line", "right_line"].iter().enumerate() {
            part(self, &format!("{line}.weight"), (index * LINE, 3 * index), false, false);
            part(self, &format!("{line}.bias"), (index * LINE, INPUTS - 1), true, false);
        }
        part(self, "speed_limit.weight", (3 * LINE, LANE_NUMBERS - 1), false, false);
        part(self, "speed_limit.bias", (3 * LINE, INPUTS - 1), true, false);
        let mut from = LANE_NUMBERS;
        for (name, rows, _, is_padded) in CODES {
            part(self, &format!("{name}.weight"), (3 * LINE + LIMIT, from), true, is_padded);
            from += rows;
        }
        let inner = self.tape.assembled(3 * LINE + 2 * LIMIT, INPUTS, parts);
        let weight = self.parameter("lane_net.pointnet.0.weight");
        let folded = self.tape.product(weight, inner);
        let bias = self.parameter("lane_net.pointnet.0.bias");
        let hidden = self.tape.linear(x, folded, Some(bias), Activation::Relu);
        self.linear("lane_net.pointnet.2", hidden, Activation::Relu)
    }

    /// All different points of crosswalks, encoded; the last is an empty one.
    fn crosswalk_points(&mut self, sketches: &[&Sketch]) -> Var {
        let points = sketches.iter().flat_map(|sketch| &sketch.crosswalk_points).chain([&[0.0; CROSSWALK_ROW]]);
        let x: Vec<T> = points.flatten().map(|value| T::of(f64::from(*value))).collect();
        let mut x = self.tape.constant(x.len() / CROSSWALK_ROW, CROSSWALK_ROW, x);
        for layer in [0, 2, 4] {
            x = self.linear(&format!("crosswalk_net.point_net.{layer}"), x, Activation::Relu);
        }
        debug_assert_eq!(self.tape.value(x).columns, WIDTH);
        x
    }
}
