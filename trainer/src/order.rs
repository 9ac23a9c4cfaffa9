//! In which order windows are seen: shuffled in each epoch, by seed and epoch alone.

use crate::draw::{Draw, Purpose};

/// `indices` as epoch `epoch` (from 0) has them.
#[must_use]
pub fn shuffled(indices: &[usize], seed: u64, epoch: usize) -> Vec<usize> {
    let mut order = indices.to_vec();
    let mut draw = Draw::new(seed, Purpose::Order, epoch as u64);
    // Fisher and Yates.
    for last in (1..order.len()).rev() {
        // A set of 4 billion windows would not fit on a disk.
        let other = draw.below(u32::try_from(last + 1).unwrap_or(u32::MAX));
        order.swap(last, other as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn seed_and_epoch_decide() {
        let indices: Vec<usize> = (0..100).collect();
        assert_eq!(shuffled(&indices, 42, 3), shuffled(&indices, 42, 3));
        assert_ne!(shuffled(&indices, 42, 3), shuffled(&indices, 42, 4));
        assert_ne!(shuffled(&indices, 42, 3), shuffled(&indices, 43, 3));
        assert_eq!(shuffled(&[], 42, 0), [0_usize; 0]);
    }

    proptest! {
        #[test]
        fn each_window_is_seen_once(count in 0..50_usize, seed in any::<u64>(), epoch in 0..100_usize) {
            let indices: Vec<usize> = (0..count).map(|index| 7 * index).collect();
            let mut order = shuffled(&indices, seed, epoch);
            order.sort_unstable();
            prop_assert_eq!(order, indices);
        }
    }
}
