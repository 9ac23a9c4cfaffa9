//! What points of lanes and crosswalks are encoded by (paper III-B), each point once a frame.
//!
//! Between a lane point's inputs and the first layer of its point network lies nothing but sums: they are one layer of ten columns
//! and a table for each code, made once.

use crate::frame::{CrosswalkPoint, LanePoint};
use crate::gemm::{Begin, Finish, Left, Multiplier, Right};
use crate::weights::Weights;

use super::linear::Linear;

/// Width of the first layer of the lanes' point network.
const FIRST: usize = 384;

/// Columns of a lane point that are numbers.
const NUMBERS: usize = 10;

/// Tables of the codes, in the order of their columns, and the rows of each.
const TABLES: [(&str, usize); 7] = [
    ("self_type", 4),
    ("left_type", 11),
    ("right_type", 11),
    ("traffic_light_type", 9),
    ("stop_point", 2),
    ("interpolating", 2),
    ("stop_sign", 2),
];

/// Encodes lane points.
#[derive(Clone, Debug)]
pub(super) struct LaneEncoder {
    numbers: Right,
    bias: Vec<f32>,
    /// A row of 384 for each code of each table.
    tables: [Vec<f32>; TABLES.len()],
    second: Linear,
}

impl LaneEncoder {
    pub(super) fn of(weights: &Weights) -> Self {
        let get = |name: &str| weights.get(&format!("lane_net.{name}"));
        let first = get("pointnet.0.weight");
        // The input of 512: three lines of 128, the speed limit's 64, and the sum of the codes' 64.
        let column = |row: usize, at: usize| f64::from(first[row * 512 + at]);
        let folded = |row: usize, begin: usize, weight: &[f32], columns: usize, of: usize| -> f64 {
            let terms = weight.chunks_exact(columns).enumerate();
            terms.map(|(k, weight)| column(row, begin + k) * f64::from(weight[of])).sum()
        };
        let parts = [("self_line", 0, 3), ("left_line", 128, 3), ("right_line", 256, 3), ("speed_limit", 384, 1)];
        let (mut numbers, mut bias) = (Vec::new(), Vec::new());
        for row in 0..FIRST {
            let mut shift = f64::from(get("pointnet.0.bias")[row]);
            for (name, begin, columns) in parts {
                let weight = get(&format!("{name}.weight"));
                numbers.extend((0..columns).map(|of| folded(row, begin, weight, columns, of) as f32));
                shift += folded(row, begin, get(&format!("{name}.bias")), 1, 0);
            }
            bias.push(shift as f32);
        }
        let tables = TABLES.map(|(name, _)| {
            let table = get(&format!("{name}.weight"));
            let row = |code: &[f32], row: usize| -> f64 {
                code.iter().enumerate().map(|(k, value)| column(row, 448 + k) * f64::from(*value)).sum()
            };
            table.chunks_exact(64).flat_map(|code| (0..FIRST).map(move |at| row(code, at) as f32)).collect()
        });
        let second = Linear::of(weights, "lane_net.pointnet.2");
        Self { numbers: Right::of_rows(&numbers, NUMBERS), bias, tables, second }
    }

    /// The encodings of `points`, a row of 256 each, in `output`; `hidden` is memory.
    pub(super) fn encode(
        &self,
        multiplier: &mut Multiplier,
        points: &[LanePoint],
        hidden: &mut Vec<f32>,
        output: &mut Vec<f32>,
    ) {
        hidden.resize(points.len() * FIRST, 0.0);
        {
            // Along a lane hardly a code changes.
            let (mut last, mut shift) = (None, [0.0; FIRST]);
            for (point, row) in points.iter().zip(hidden.chunks_exact_mut(FIRST)) {
                let codes: [usize; TABLES.len()] =
                    std::array::from_fn(|table| (point[NUMBERS + table] as usize).min(TABLES[table].1 - 1));
                if last.replace(codes) != Some(codes) {
                    shift.copy_from_slice(&self.bias);
                    for (table, code) in self.tables.iter().zip(codes) {
                        let added = &table[code * FIRST..(code + 1) * FIRST];
                        shift.iter_mut().zip(added).for_each(|(sum, term)| *sum += term);
                    }
                }
                row.copy_from_slice(&shift);
            }
        }
        let numbers =
            Left { values: points.as_flattened(), stride: points.first().map_or(1, |p| p.len()), rows: points.len() };
        multiplier.multiply(numbers, &self.numbers, Begin::Result, Finish::Relu, hidden, FIRST);
        self.second.apply(multiplier, Left::dense(hidden, FIRST), Finish::Relu, output);
    }
}

/// Encodes points of crosswalks.
#[derive(Clone, Debug)]
pub(super) struct CrosswalkEncoder([Linear; 3]);

impl CrosswalkEncoder {
    pub(super) fn of(weights: &Weights) -> Self {
        Self([0, 2, 4].map(|layer| Linear::of(weights, &format!("crosswalk_net.point_net.{layer}"))))
    }

    /// The encodings of `points`, a row of 256 each, in `output`; `hidden` is memory.
    pub(super) fn encode(
        &self,
        multiplier: &mut Multiplier,
        points: &[CrosswalkPoint],
        hidden: &mut [Vec<f32>; 2],
        output: &mut Vec<f32>,
    ) {
        let [first, second] = hidden;
        self.0[0].apply(multiplier, Left::dense(points.as_flattened(), 3), Finish::Relu, first);
        self.0[1].apply(multiplier, Left::dense(first, 64), Finish::Relu, second);
        self.0[2].apply(multiplier, Left::dense(second, 128), Finish::Relu, output);
    }
}
