//! How the authors take a hundred points of however many there are.

use crate::frame::POINTS;

/// Element k is number ⌊k (n / 100)⌋ of `count`: in f64 and then cut, so that 58 points give number 28 for k = 50, not 29.
pub(super) fn sampled<T>(count: usize, element: impl Fn(usize) -> T) -> [T; POINTS] {
    let step = count as f64 / POINTS as f64;
    std::array::from_fn(|k| element(((k as f64 * step) as usize).min(count.saturating_sub(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_cut_as_floats_are() {
        let numbers = sampled(58, |at| at);
        assert_eq!((numbers[0], numbers[50], numbers[99]), (0, 28, 57));
        assert_eq!(sampled(300, |at| at)[99], 297);
        assert_eq!(sampled(1, |at| at), [0; POINTS]);
    }
}
