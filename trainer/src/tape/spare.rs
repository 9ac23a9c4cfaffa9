//! Memory that is used again: fresh pages are cleared by the system when they are first touched, which takes a sixth of a step.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::Scalar;

/// Shorter ones are left to the allocator.
const LEAST: usize = 1 << 12;
/// What so many tapes did not use is let go: the next batch has other sizes.
const IDLE: u32 = 1;

/// Buffers that nobody needs any more, by what they can hold; the last that came is the first to go.
#[derive(Debug, Default)]
pub struct Spare<T> {
    buffers: BTreeMap<usize, Vec<(u32, Vec<T>)>>,
    /// How many tapes there were.
    tapes: u32,
}

impl<T: Scalar> Spare<T> {
    /// So many numbers, of no meaning: they are to be written before they are read.
    pub(super) fn any(&mut self, count: usize) -> Vec<T> {
        if count < LEAST {
            return vec![T::ZERO; count];
        }
        // One that is much longer would be missed elsewhere.
        let found = self.buffers.range_mut(count..=count + count / 2).find_map(|(_, buffers)| buffers.pop());
        let Some((_, mut buffer)) = found else {
            let mut fresh = vec![T::ZERO; rounded(count)];
            fresh.truncate(count);
            return fresh;
        };
        buffer.resize(count, T::ZERO);
        if cfg!(debug_assertions) {
            buffer.fill(T::of(f64::NAN));
        }
        buffer
    }

    /// So many zeros.
    pub fn zeros(&mut self, count: usize) -> Vec<T> {
        let mut buffer = self.any(count);
        buffer.fill(T::ZERO);
        buffer
    }

    /// The same numbers once more.
    pub(super) fn copied(&mut self, numbers: &[T]) -> Vec<T> {
        let mut buffer = self.any(numbers.len());
        buffer.copy_from_slice(numbers);
        buffer
    }

    /// Nobody needs it any more.
    pub fn keep(&mut self, buffer: Vec<T>) {
        if buffer.capacity() >= LEAST {
            self.buffers.entry(buffer.capacity()).or_default().push((self.tapes, buffer));
        }
    }

    /// A tape is done.
    pub(super) fn end(&mut self) {
        self.tapes = self.tapes.wrapping_add(1);
        let tapes = self.tapes;
        self.buffers.retain(|_, buffers| {
            buffers.retain(|(since, _)| tapes.wrapping_sub(*since) <= IDLE);
            !buffers.is_empty()
        });
    }
}

/// At most a quarter more: batches have other sizes each time, and a buffer that is let go and asked for anew leaves a gap.
fn rounded(count: usize) -> usize {
    count.next_multiple_of((count.next_power_of_two() / 8).max(1))
}

/// The memory of several tapes: each takes one part, and brings it back.
#[derive(Debug, Default)]
pub struct Spares<T>(Mutex<Vec<Spare<T>>>);

impl<T: Scalar> Spares<T> {
    /// That of a tape before, if there was one.
    pub fn take(&self) -> Spare<T> {
        // Whoever panicked left nothing half done.
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Brings it back.
    pub fn bring(&self, spare: Spare<T>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(spare);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_used_again_and_what_is_idle_goes() {
        let mut spare = Spare::<f32>::default();
        let long = spare.zeros(2 * LEAST);
        let place = long.as_ptr();
        spare.keep(long);
        let short = spare.any(LEAST);
        assert_ne!(short.as_ptr(), place, "it is much longer");
        let again = spare.zeros(2 * LEAST - 5);
        assert_eq!((again.as_ptr(), again.len()), (place, 2 * LEAST - 5));
        assert!(again.iter().all(|value| *value == 0.0));
        spare.keep(again);
        spare.keep(vec![0.0; LEAST - 1]);
        (0..IDLE).for_each(|_| spare.end());
        assert_eq!(spare.buffers.len(), 1);
        spare.end();
        assert!(spare.buffers.is_empty());
    }
}
