//! Numbers one after another, little endian, and how they are read again from bytes that may be anything.

use super::error::FileProblem;

/// Writes.
#[derive(Debug, Default)]
pub(super) struct Writer(pub Vec<u8>);

impl Writer {
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn u16(&mut self, value: u16) {
        self.0.extend(value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    pub fn i32(&mut self, value: i32) {
        self.0.extend(value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.0.extend(value.to_le_bytes());
    }

    pub fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.0.extend(value.to_le_bytes()));
    }

    /// Its length, and the text.
    pub fn text(&mut self, text: &str) {
        self.u32(text.len() as u32);
        self.0.extend(text.as_bytes());
    }
}

/// Reads.
#[derive(Debug)]
pub(super) struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], FileProblem> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(FileProblem::CutShort)?;
        self.0 = rest;
        Ok(taken)
    }

    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], FileProblem> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(FileProblem::CutShort)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub fn u8(&mut self) -> Result<u8, FileProblem> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub fn u16(&mut self) -> Result<u16, FileProblem> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, FileProblem> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn i32(&mut self) -> Result<i32, FileProblem> {
        self.array().map(i32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, FileProblem> {
        self.array().map(u64::from_le_bytes)
    }

    /// Fills `values`, which are finite.
    pub fn floats(&mut self, values: &mut [f32]) -> Result<(), FileProblem> {
        let bytes = self.take(4 * values.len())?;
        for (value, bytes) in values.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *value = f32::from_le_bytes(*bytes);
        }
        if values.iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(FileProblem::Impossible("a number that is none"))
        }
    }

    /// A text of at most `most` bytes.
    pub fn text(&mut self, most: usize) -> Result<String, FileProblem> {
        let length = self.u32()? as usize;
        if length > most {
            return Err(FileProblem::Impossible("a text that is too long"));
        }
        let text = str::from_utf8(self.take(length)?);
        text.map(ToOwned::to_owned).map_err(|_| FileProblem::Impossible("a text that is none"))
    }

    /// How many of something follow; each takes at least `bytes`, so a wrong number is found before there is room made for it.
    pub fn count(&mut self, bytes: usize) -> Result<usize, FileProblem> {
        let count = self.u32()? as usize;
        if count > self.0.len() / bytes { Err(FileProblem::CutShort) } else { Ok(count) }
    }

    /// Nothing is left.
    pub fn end(&self) -> Result<(), FileProblem> {
        if self.0.is_empty() { Ok(()) } else { Err(FileProblem::Impossible("more bytes than it says")) }
    }
}
