//! What every input must keep, in a function that a fuzzer calls; `fuzz/` does so by the million, a test here by the thousand.

use std::path::Path;

use crate::Npz;

/// Any bytes as an `.npz` file: no panic; an array that is read has as many numbers as its shape says.
///
/// # Panics
/// If that does not hold.
pub fn npz(bytes: &[u8]) {
    let Ok(npz) = Npz::parse(Path::new("fuzz.npz"), bytes) else { return };
    for (name, shape) in npz.shapes() {
        let open: Vec<Option<usize>> = shape.iter().map(|axis| Some(*axis)).collect();
        let numbers = npz.array(name, &open).map(<[f64]>::len).ok();
        assert_eq!(numbers, Some(shape.iter().product()), "{name}");
        let _ = (npz.number(name), npz.rows::<3>(name, &open));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_damaged_file_does_no_harm(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6), cut in 0..9_usize, stored: bool,
        ) {
            let mut bytes = crate::npz::tests::archive(stored);
            for (place, byte) in changes {
                let place = place.index(bytes.len());
                bytes[place] ^= byte;
            }
            bytes.truncate(bytes.len() - cut.saturating_sub(4));
            npz(&bytes);
        }
    }
}
