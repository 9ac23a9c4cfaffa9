//! The bytes of a pickle, taken one after the other.

use super::problem::PickleProblem;

/// Bytes, and how far they were read.
#[derive(Clone, Debug)]
pub(super) struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Input<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// How many were read.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], PickleProblem> {
        let rest = &self.bytes[self.at..];
        let taken =
            rest.get(..count).ok_or_else(|| PickleProblem::CutOff { wanted: count.saturating_sub(rest.len()) })?;
        self.at += count;
        Ok(taken)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], PickleProblem> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(super) fn byte(&mut self) -> Result<u8, PickleProblem> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn two(&mut self) -> Result<u16, PickleProblem> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn four(&mut self) -> Result<u32, PickleProblem> {
        self.array().map(u32::from_le_bytes)
    }

    /// As many bytes as a length before them says, which has one, four or eight bytes itself.
    pub(super) fn counted(&mut self, length_bytes: usize) -> Result<&'a [u8], PickleProblem> {
        let length = self.take(length_bytes)?.iter().rev().try_fold(0_usize, |sum, byte| {
            let wrong = PickleProblem::CutOff { wanted: usize::MAX };
            Ok(sum.checked_mul(256).ok_or(wrong)? + usize::from(*byte))
        })?;
        self.take(length)
    }

    /// The bytes up to a line feed, which is taken too.
    pub(super) fn line(&mut self) -> Result<&'a [u8], PickleProblem> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|byte| *byte == b'\n').ok_or(PickleProblem::CutOff { wanted: 1 })?;
        self.at += end + 1;
        Ok(&rest[..end])
    }
}

/// `bytes` as text.
pub(super) fn text(bytes: &[u8]) -> Result<&str, PickleProblem> {
    std::str::from_utf8(bytes).map_err(|_| PickleProblem::Text)
}
