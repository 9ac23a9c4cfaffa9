//! Points of the map: lanes and crosswalks, each distinct point encoded once (`network.md` 5.2, 5.3, 5.9).
//!
//! A lane's points enter by ten numbers and seven codes, and nothing but sums lies between those and the first activation: one
//! map of the numbers and a table for each code is all that is left of five layers and seven embeddings.

use super::aligned::Aligned;
use super::product::{End, Linear, Rows};
use super::source::Source;
use crate::constants::{CROSSWALK_ROW, LANE_HIDDEN, LANE_NUMBERS, LANE_ROW, WIDTH};
use crate::weights::WeightsError;
use crate::weights::layout::EMBEDDINGS;

/// Points that are encoded at once: what lies between their layers stays in the cache.
const TOGETHER: usize = 96;

/// The distinct ones of some rows, in the order in which they came.
#[derive(Debug)]
pub(super) struct Distinct<const N: usize> {
    rows: Vec<[f32; N]>,
    /// Places in `rows` plus one, by hash.
    table: Vec<u32>,
}

impl<const N: usize> Distinct<N> {
    /// Room for as many rows.
    pub fn new(most: usize) -> Self {
        Self { rows: Vec::with_capacity(most + TOGETHER), table: vec![0; (2 * most).next_power_of_two()] }
    }

    pub fn clear(&mut self) {
        self.rows.clear();
        self.table.fill(0);
    }

    pub fn rows(&self) -> &[[f32; N]] {
        &self.rows
    }

    /// The place of a row, which is a new one if no row before had the same bits.
    pub fn place(&mut self, row: &[f32; N]) -> u32 {
        let same = |other: &[f32; N]| row.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits());
        let hash = row.iter().fold(0_u64, |hash, value| {
            (hash.rotate_left(5) ^ u64::from(value.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        let mask = self.table.len() - 1;
        let mut slot = (hash >> 32) as usize & mask;
        loop {
            match self.table[slot] {
                0 => break,
                place if same(&self.rows[place as usize - 1]) => return place - 1,
                _ => slot = (slot + 1) & mask,
            }
        }
        self.rows.push(*row);
        self.table[slot] = self.rows.len() as u32;
        self.rows.len() as u32 - 1
    }
}

/// The encoder of lane points, folded.
#[derive(Debug)]
pub(super) struct LaneEncoder {
    /// From the ten numbers; the bias is in [`LaneEncoder::codes`].
    numbers: Linear,
    bias: [f32; LANE_HIDDEN],
    /// For each code its column and a row for each of its values.
    codes: Vec<(usize, Vec<[f32; LANE_HIDDEN]>)>,
    second: Linear,
    hidden: usize,
}

impl LaneEncoder {
    pub fn new(source: Source<'_>) -> Result<Self, WeightsError> {
        let tensor = |name: &str| source.tensor(&format!("lane_net.{name}"));
        let (first, first_bias) = (tensor("pointnet.0.weight")?, tensor("pointnet.0.bias")?);
        // In double precision: these sums are rounded once.
        let through = |row: usize, start: usize, inner: &dyn Fn(usize) -> f32, width: usize| -> f64 {
            (0..width).map(|j| f64::from(first[row * 512 + start + j]) * f64::from(inner(j))).sum()
        };
        let parts = [("self_line", 0, 3), ("left_line", 128, 3), ("right_line", 256, 3), ("speed_limit", 384, 1)];
        let mut map = vec![[0.0; LANE_NUMBERS]; LANE_HIDDEN];
        let mut bias = [0.0; LANE_HIDDEN];
        for row in 0..LANE_HIDDEN {
            let mut total = f64::from(first_bias[row]);
            let mut column = 0;
            for (name, start, inputs) in parts {
                let (weight, own) = (tensor(&format!("{name}.weight"))?, tensor(&format!("{name}.bias"))?);
                total += through(row, start, &|j| own[j], own.len());
                for input in 0..inputs {
                    map[row][column] = through(row, start, &|j| weight[j * inputs + input], own.len()) as f32;
                    column += 1;
                }
            }
            bias[row] = total as f32;
        }
        let mut codes = Vec::new();
        for (name, values, column) in EMBEDDINGS {
            let table = tensor(&format!("{name}.weight"))?;
            let row =
                |value: usize| std::array::from_fn(|row| through(row, 448, &|j| table[value * 64 + j], 64) as f32);
            codes.push((column, (0..values).map(row).collect()));
        }
        let numbers = Linear::new(source.kernel, (LANE_HIDDEN, LANE_NUMBERS), |n, k| map[n][k], |_| 0.0);
        let second = source.linear("lane_net.pointnet.2")?;
        Ok(Self { numbers, bias, codes, second, hidden: LANE_HIDDEN })
    }

    /// Multiply-adds of a point.
    pub fn multiply_adds(&self) -> u64 {
        self.numbers.multiply_adds() + self.second.multiply_adds()
    }

    /// Encodes points, a row each.
    pub fn run(&self, points: &[[f32; LANE_ROW]], hidden: &mut Aligned, encoded: &mut [f32]) {
        let mut base = [0.0; LANE_HIDDEN];
        let mut last = None;
        let (flat, size) = (points.as_flattened(), self.hidden);
        // The last points' rows, where four are not there.
        let mut end = [0.0; 4 * LANE_ROW];
        for (index, together) in points.chunks(TOGETHER).enumerate() {
            for (point, row) in together.iter().zip(hidden.chunks_exact_mut(size)) {
                let codes = self.codes_of(point);
                if last != Some(codes) {
                    base = self.bias;
                    for ((_, table), code) in self.codes.iter().zip(codes) {
                        base.iter_mut().zip(&table[code]).for_each(|(base, value)| *base += value);
                    }
                    last = Some(codes);
                }
                row.copy_from_slice(&base);
            }
            let start = index * TOGETHER;
            let (whole, rest) = (together.len() / 4 * 4, together.len() % 4);
            let rows = Rows { numbers: &flat[start * LANE_ROW..], stride: LANE_ROW };
            self.numbers.add(rows, whole, hidden, size, End::Relu);
            if rest > 0 {
                end[..rest * LANE_ROW].copy_from_slice(together[whole..].as_flattened());
                let rows = Rows { numbers: &end, stride: LANE_ROW };
                self.numbers.add(rows, rest, &mut hidden[whole * size..], size, End::Relu);
            }
            self.second.apply_packed(hidden, together.len(), &mut encoded[start * WIDTH..], End::Relu);
        }
    }

    /// Which value each code has. What no table has a row for gets the last one's.
    fn codes_of(&self, point: &[f32; LANE_ROW]) -> [usize; EMBEDDINGS.len()] {
        std::array::from_fn(|index| {
            let (column, table) = &self.codes[index];
            (point[*column] as usize).min(table.len() - 1)
        })
    }
}

/// The encoder of crosswalk points.
#[derive(Debug)]
pub(super) struct CrosswalkEncoder {
    layers: [Linear; 3],
}

impl CrosswalkEncoder {
    pub fn new(source: Source<'_>) -> Result<Self, WeightsError> {
        let layer = |index: usize| source.linear(&format!("crosswalk_net.point_net.{index}"));
        Ok(Self { layers: [layer(0)?, layer(2)?, layer(4)?] })
    }

    /// Multiply-adds of a point.
    pub fn multiply_adds(&self) -> u64 {
        self.layers.iter().map(Linear::multiply_adds).sum()
    }

    /// Encodes points, a row each.
    pub fn run(&self, points: &[[f32; CROSSWALK_ROW]], hidden: &mut Aligned, encoded: &mut [f32]) {
        let mut three = [[0.0; CROSSWALK_ROW]; TOGETHER];
        let [first, second, third] = &self.layers;
        for (index, together) in points.chunks(TOGETHER).enumerate() {
            three[..together.len()].copy_from_slice(together);
            let (one, two) = hidden.split_at_mut(TOGETHER * first.stride());
            first.apply_packed(three.as_flattened(), together.len(), one, End::Relu);
            second.apply_packed(one, together.len(), two, End::Relu);
            third.apply_packed(two, together.len(), &mut encoded[index * TOGETHER * WIDTH..], End::Relu);
        }
    }
}

/// Room between the layers of either encoder.
pub(super) fn hidden() -> Aligned {
    Aligned::new(TOGETHER * LANE_HIDDEN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_rows_have_one_place_and_minus_zero_is_another_than_zero() {
        let mut distinct = Distinct::<2>::new(8);
        let places: Vec<u32> = [[1.0, 2.0], [3.0, 4.0], [1.0, 2.0], [0.0, 0.0], [-0.0, 0.0], [3.0, 4.0]]
            .iter()
            .map(|row| distinct.place(row))
            .collect();
        assert_eq!(places, [0, 1, 0, 2, 3, 1]);
        distinct.clear();
        assert_eq!((distinct.place(&[3.0, 4.0]), distinct.rows().len()), (0, 1));
    }
}
