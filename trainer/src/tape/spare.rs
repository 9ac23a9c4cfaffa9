//! Memory that is used again: fresh pages are cleared by the system when they are first touched, which takes a sixth of a step.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::Scalar;

/// Shorter ones are left to the allocator.
const LEAST: usize = 1 << 12;

/// Buffers that nobody needs any more, by what they can hold.
#[derive(Debug, Default)]
pub struct Spare<T> {
    buffers: BTreeMap<usize, Vec<Vec<T>>>,
}

impl<T: Scalar> Spare<T> {
    /// So many numbers, of no meaning: they are to be written before they are read.
    pub(super) fn any(&mut self, count: usize) -> Vec<T> {
        // One that is much longer would be missed elsewhere.
        let found = self.buffers.range_mut(count..=count + count / 2).next();
        let Some((&capacity, buffers)) = found.filter(|_| count >= LEAST) else {
            if count >= LEAST {
                self.drop_below(count);
            }
            return vec![T::ZERO; count];
        };
        let mut buffer = buffers.pop().unwrap_or_default();
        if buffers.is_empty() {
            self.buffers.remove(&capacity);
        }
        buffer.resize(count, T::ZERO);
        if cfg!(debug_assertions) {
            buffer.fill(T::of(f64::NAN));
        }
        buffer
    }

    /// Lets the longest go that is too short for so many numbers: what is held would only grow.
    fn drop_below(&mut self, count: usize) {
        let Some((&capacity, buffers)) = self.buffers.range_mut(..count).next_back() else { return };
        buffers.pop();
        if buffers.is_empty() {
            self.buffers.remove(&capacity);
        }
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
            self.buffers.entry(buffer.capacity()).or_default().push(buffer);
        }
    }
}

/// The memory of several tapes: each takes one part, and brings it back.
#[derive(Debug, Default)]
pub struct Spares<T>(Mutex<Vec<Spare<T>>>);

impl<T: Scalar> Spares<T> {
    /// That of a tape before, if there was one.
    pub fn take(&self) -> Spare<T> {
        // Whoever panicked left nothing half done.
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or(Spare { buffers: BTreeMap::new() })
    }

    /// Brings it back.
    pub fn bring(&self, spare: Spare<T>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(spare);
    }
}
