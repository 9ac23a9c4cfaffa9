//! Numbers as a page carries them: whole multiples of a quantum, as differences, deflated, in letters.
//!
//! A row of numbers is written as its order and then differences of that order: `[1, 100, 3, 3]` is 100, 103, 106, and
//! `[2, 100, 3, 0]` is the same. Whichever order makes the smaller numbers is taken: the second for what moves evenly, the first for
//! what trembles.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::compress_to_vec_zlib;

/// Of places of what moves (m).
pub const PLACE: f64 = 0.02;
/// Of places on the map (m).
pub const MAP: f64 = 0.05;
/// Of headings (rad): a tenth of a degree.
pub const HEADING: f64 = std::f64::consts::PI / 1800.0;
/// Of speeds and accelerations (m/s, m/s^2).
pub const RATE: f64 = 0.05;

/// How hard is tried to make it small; the most.
const LEVEL: u8 = 9;

/// The multiple of `quantum` that is nearest to `value`. What is no number is 0.
#[must_use]
pub fn quantised(value: f64, quantum: f64) -> i64 {
    (value / quantum).round() as i64
}

/// A row of numbers as differences, its order before them.
#[must_use]
pub fn coded(values: &[i64]) -> Vec<i64> {
    let first = differences(values);
    let second = differences(&first);
    let size = |row: &[i64]| row.iter().skip(2).map(|value| value.unsigned_abs()).sum::<u64>();
    let (order, row) = if size(&second) < size(&first) { (2, second) } else { (1, first) };
    std::iter::once(order).chain(row).collect()
}

/// Each number less the one before; the first as it is.
fn differences(values: &[i64]) -> Vec<i64> {
    let before = std::iter::once(0).chain(values.iter().copied());
    values.iter().zip(before).map(|(value, before)| value.wrapping_sub(before)).collect()
}

/// Bytes deflated (zlib), in letters (base64).
#[must_use]
pub fn letters(bytes: &[u8]) -> String {
    STANDARD.encode(compress_to_vec_zlib(bytes, LEVEL))
}

/// What [`coded`] was told. The page's script does the same.
#[cfg(test)]
pub(super) fn decoded(row: &[i64]) -> Vec<i64> {
    let [order, row @ ..] = row else { return Vec::new() };
    let mut values = row.to_vec();
    for _ in 0..*order {
        let mut sum = 0_i64;
        for value in &mut values {
            sum = sum.wrapping_add(*value);
            *value = sum;
        }
    }
    values
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn even_motion_is_nothing_but_zeros() {
        assert_eq!(coded(&[100, 103, 106, 109]), [2, 100, -97, 0, 0]);
        assert_eq!(coded(&[5, 6, 5, 6, 5]), [1, 5, 1, -1, 1, -1]);
        assert_eq!(coded(&[]), [1]);
    }

    proptest! {
        #[test]
        fn a_row_read_back_is_the_row(row in proptest::collection::vec(any::<i32>().prop_map(i64::from), 0..40)) {
            prop_assert_eq!(decoded(&coded(&row)), row);
        }

        #[test]
        fn a_number_read_back_is_off_by_half_a_quantum_at_most(value in -1e7..1e7_f64) {
            prop_assert!((quantised(value, PLACE) as f64 * PLACE - value).abs() <= 0.5 * PLACE + 1e-9);
        }
    }

    #[test]
    fn letters_are_read_back_by_whoever_knows_zlib_and_base64() {
        let bytes = b"the same again, the same again, the same again";
        let packed = STANDARD.decode(letters(bytes)).unwrap();
        assert_eq!(miniz_oxide::inflate::decompress_to_vec_zlib(&packed).unwrap(), bytes);
    }
}
