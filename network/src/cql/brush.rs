//! Fills polygons with smooth edges: of each place, the part that is covered, exactly.
//!
//! As font rasterisers do it (Raph Levien's font-rs, `raster.rs`): each edge leaves in the places that it crosses by how much what is covered changes
//! there, and the sum along a row is how much is. Places that no edge crosses are then as covered as the one to their left: they are passed over, or
//! filled, without a sum. So a polygon costs what its edges and its area do, not what the picture does.

use super::picture::{CHANNELS, SIDE};

/// Places of a row that one number tells about.
const BITS: usize = u64::BITS as usize;

/// Before any edge.
const NO_ROWS: [usize; 2] = [SIDE, 0];

/// Room for one polygon of many outlines.
#[derive(Clone, Debug)]
pub(super) struct Brush {
    /// How much more is covered than in the place to the left, row by row; nought between polygons.
    changes: Vec<f32>,
    /// In which places of a row that may be other than nought.
    crossed: Vec<[u64; SIDE / BITS]>,
    /// The first of the rows that have such places, and the one after the last.
    rows: [usize; 2],
}

impl Brush {
    pub(super) fn new() -> Self {
        Self { changes: vec![0.0; SIDE * SIDE], crossed: vec![[0; SIDE / BITS]; SIDE], rows: NO_ROWS }
    }

    /// Adds an outline, closed by itself: its corners, each across and down (places). What lies outside the picture does no harm.
    pub(super) fn outline(&mut self, corners: impl Iterator<Item = [f32; 2]>) {
        let mut corners = corners.peekable();
        let Some(first) = corners.peek().copied() else { return };
        let mut before = first;
        for corner in corners {
            self.edge(before, corner);
            before = corner;
        }
        self.edge(before, first);
    }

    /// Raises a channel to `shade` where the outlines go around a place, however often and either way, and forgets them.
    pub(super) fn fill(&mut self, picture: &mut [u8], channel: usize, shade: u8) {
        let [first, end] = std::mem::replace(&mut self.rows, NO_ROWS);
        for row in first..end {
            let changes = &mut self.changes[row * SIDE..][..SIDE];
            let places = &mut picture.as_chunks_mut::<CHANNELS>().0[row * SIDE..][..SIDE];
            let (mut sum, mut start, mut part) = (0.0_f32, 0, 0);
            for (word, crossed) in self.crossed[row].iter_mut().enumerate() {
                while *crossed != 0 {
                    let column = word * BITS + crossed.trailing_zeros() as usize;
                    *crossed &= *crossed - 1;
                    raise(&mut places[start..column], channel, shade, part);
                    sum += std::mem::take(&mut changes[column]);
                    (start, part) = (column, (sum.abs().min(1.0) * 255.0 + 0.5) as u32);
                }
            }
            raise(&mut places[start..], channel, shade, part);
        }
    }

    fn edge(&mut self, from: [f32; 2], to: [f32; 2]) {
        let (way, [x, top], [_, bottom]) = if from[1] < to[1] { (1.0, from, to) } else { (-1.0, to, from) };
        let slope = (to[0] - from[0]) / (to[1] - from[1]);
        let (first, last) = (top.max(0.0), bottom.min(SIDE as f32));
        // A level edge changes nothing, and neither does one that is nowhere.
        if !slope.is_finite() || first >= last {
            return;
        }
        let (start, end) = (first as usize, last.ceil() as usize);
        self.rows = [self.rows[0].min(start), self.rows[1].max(end)];
        for row in start..end {
            let (upper, lower) = (first.max(row as f32), last.min(row as f32 + 1.0));
            self.piece(row, way * (lower - upper), [upper, lower].map(|y| x + (y - top) * slope));
        }
    }

    /// The piece of an edge within a row: how far it goes down, and between where.
    fn piece(&mut self, row: usize, height: f32, [one, other]: [f32; 2]) {
        let (left, right) = if one < other { (one, other) } else { (other, one) };
        if right <= 0.0 {
            self.change(row, 0, height);
            return;
        }
        let mut from = left.max(0.0);
        let mut column = from as usize;
        if left >= 0.0 && right <= (column + 1) as f32 {
            self.share(row, column, height, 0.5 * (left + right));
            return;
        }
        let steepness = height / (right - left);
        if left < 0.0 {
            self.change(row, 0, -left * steepness);
        }
        while from < right && column < SIDE {
            let to = right.min((column + 1) as f32);
            self.share(row, column, (to - from) * steepness, 0.5 * (from + to));
            (from, column) = (to, column + 1);
        }
    }

    /// What goes down within a place, `middle` across, covers what of the place is to its right, and all that comes after.
    fn share(&mut self, row: usize, column: usize, height: f32, middle: f32) {
        let after = height * (middle - column as f32);
        self.change(row, column, height - after);
        self.change(row, column + 1, after);
    }

    fn change(&mut self, row: usize, column: usize, by: f32) {
        if column < SIDE {
            self.changes[row * SIDE + column] += by;
            self.crossed[row][column / BITS] |= 1 << (column % BITS);
        }
    }
}

/// To `shade` where places are covered (`part` 255), and so much of the way there where they are in part.
fn raise(places: &mut [[u8; CHANNELS]], channel: usize, shade: u8, part: u32) {
    if part == 0 {
        return;
    }
    for value in places.iter_mut().map(|place| &mut place[channel]) {
        let brighter = (*value).max(shade);
        // Rounded up, and exact for all and nothing.
        *value = (u32::from(*value) * (255 - part) + u32::from(brighter) * part).div_ceil(256) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(outlines: &[&[[f32; 2]]]) -> Vec<u8> {
        let (mut brush, mut picture) = (Brush::new(), vec![0; SIDE * SIDE * CHANNELS]);
        outlines.iter().for_each(|corners| brush.outline(corners.iter().copied()));
        brush.fill(&mut picture, 1, 255);
        let clean =
            brush.changes.iter().all(|change| *change == 0.0) && brush.crossed.iter().flatten().all(|bits| *bits == 0);
        assert!(clean, "nothing of it is left for the next");
        picture.as_chunks::<CHANNELS>().0.iter().map(|place| place[1]).collect()
    }

    fn area(outlines: &[&[[f32; 2]]]) -> f64 {
        filled(outlines).iter().map(|value| f64::from(*value)).sum::<f64>() / 255.0
    }

    #[test]
    fn a_place_has_the_part_that_is_covered() {
        let picture = filled(&[&[[10.25, 20.5], [12.75, 20.5], [12.75, 22.0], [10.25, 22.0]]]);
        let row = |row: usize| picture[row * SIDE + 9..][..5].to_vec();
        assert_eq!(row(19), [0; 5]);
        assert_eq!(row(20), [0, 96, 128, 96, 0]);
        assert_eq!(row(21), [0, 191, 255, 191, 0]);
        assert_eq!(row(22), [0; 5]);
    }

    #[test]
    fn the_parts_of_a_triangle_are_its_area_either_way_around() {
        let corners = [[10.3, 7.1], [200.6, 31.9], [77.7, 240.2]];
        let turned: Vec<[f32; 2]> = corners.into_iter().rev().collect();
        let exact = 0.5 * (190.3 * 233.1 - 67.4 * 24.8);
        assert!((area(&[&corners]) - exact).abs() < 2.0, "{} {exact}", area(&[&corners]));
        assert_eq!(filled(&[&corners]), filled(&[&turned]));
    }

    #[test]
    fn tiny_skia_covers_the_same_but_for_its_samples() {
        use tiny_skia::{FillRule, Paint, PathBuilder, Pixmap, Transform};
        use world::pcg::Pcg32;

        let mut draw = Pcg32::new(7, 0);
        for _ in 0..100 {
            let corners = [(); 3].map(|()| [draw.between(-60.0, 320.0) as f32, draw.between(-60.0, 320.0) as f32]);
            let mut path = PathBuilder::new();
            path.move_to(corners[0][0], corners[0][1]);
            corners[1..].iter().for_each(|[x, y]| path.line_to(*x, *y));
            path.close();
            let mut pixels = Pixmap::new(SIDE as u32, SIDE as u32).unwrap();
            let (paint, path) = (Paint { anti_alias: true, ..Paint::default() }, path.finish().unwrap());
            pixels.fill_path(&path, &paint, FillRule::Winding, Transform::identity(), None);
            let theirs = pixels.pixels().iter().map(|pixel| pixel.alpha());
            let differences: Vec<u8> =
                filled(&[&corners]).into_iter().zip(theirs).map(|(own, other)| own.abs_diff(other)).collect();
            let mean =
                differences.iter().map(|difference| f64::from(*difference)).sum::<f64>() / differences.len() as f64;
            // It takes four samples down a place and sixteen across.
            assert!(mean < 0.5 && differences.iter().all(|difference| *difference < 90), "{corners:?}: {mean}");
        }
    }

    #[test]
    fn what_lies_outside_is_cut_off() {
        let (low, high) = (-1000.5, 3000.25);
        assert!(filled(&[&[[low, low], [high, low], [high, high], [low, high]]]).iter().all(|value| *value == 255));
        assert_eq!(area(&[&[[low, 0.0], [-1.0, 0.0], [-1.0, 256.0], [low, 256.0]]]), 0.0);
        assert_eq!(area(&[&[[256.0, 0.0], [high, 0.0], [high, 256.0], [256.0, 256.0]]]), 0.0);
        // Half of the picture, by an edge far longer than it.
        assert!((area(&[&[[-744.0, -744.0], [1000.0, 1000.0], [-744.0, 1000.0]]]) - 32768.0).abs() < 2.0);
    }

    #[test]
    fn what_overlaps_is_covered_once() {
        let square = |x: f32| [[x, 10.0], [x + 20.0, 10.0], [x + 20.0, 30.0], [x, 30.0]];
        assert_eq!(area(&[&square(10.0), &square(20.0)]), 600.0);
    }

    #[test]
    fn corners_that_are_no_numbers_draw_nothing() {
        assert_eq!(area(&[&[[f32::NAN, 1.0], [f32::NAN, 9.0], [f32::NAN, 5.0]]]), 0.0);
        assert_eq!(area(&[&[[1.0, f32::NAN], [9.0, f32::INFINITY], [5.0, f32::NAN]]]), 0.0);
    }
}
