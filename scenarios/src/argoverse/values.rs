//! The values in a page.

use super::footer::{Chunk, Column, Kind};
use super::pages::{self, Content, DICTIONARY, OLD_DICTIONARY, PLAIN, Page, RUNS};
use super::table::TableError;
use crate::budget::Budget;

/// A value, of whatever width it is in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Int(i64),
    Float(f64),
    Bytes(&'a [u8]),
}

const TOO_FEW: TableError = TableError::Damaged("a column has fewer values than rows");

/// Gives `take` what each row of a column has, or nothing where there is nothing.
pub(super) fn each(
    column: &Column<'_>,
    kind: Kind,
    budget: &Budget,
    mut take: impl FnMut(Option<Value<'_>>),
) -> Result<(), TableError> {
    column.chunks.iter().try_for_each(|chunk| of_chunk(*chunk, kind, column.is_optional, budget, &mut take))
}

fn of_chunk(
    mut chunk: Chunk<'_>,
    kind: Kind,
    is_optional: bool,
    budget: &Budget,
    take: &mut impl FnMut(Option<Value<'_>>),
) -> Result<(), TableError> {
    let (mut left, mut first) = (chunk.rows, None);
    while left > 0 {
        let page = pages::next(&mut chunk, budget)?.ok_or(TOO_FEW)?;
        if page.content == Content::Dictionary {
            first = Some(page);
            break;
        }
        left = of_page(&page, kind, is_optional, &[], left, take)?;
    }
    let Some(page) = first else { return Ok(()) };
    let mut plain = Plain::new(&page.bytes, kind);
    let dictionary: Vec<Value<'_>> = (0..page.values).map_while(|_| plain.next()).collect();
    while left > 0 {
        let page = pages::next(&mut chunk, budget)?.ok_or(TOO_FEW)?;
        if page.content == Content::Dictionary {
            return Err(TableError::Damaged("a column has two dictionaries"));
        }
        left = of_page(&page, kind, is_optional, &dictionary, left, take)?;
    }
    Ok(())
}

/// Takes the values of a page for the rows that are `left`, and answers how many rows are left then.
fn of_page(
    page: &Page,
    kind: Kind,
    is_optional: bool,
    dictionary: &[Value<'_>],
    left: usize,
    take: &mut impl FnMut(Option<Value<'_>>),
) -> Result<usize, TableError> {
    let Content::Values { encoding, levels } = page.content else { return Ok(left) };
    let mut rest = &page.bytes[..];
    let levels = match levels {
        Some(length) => cut(&mut rest, length)?,
        None if is_optional => with_length(&mut rest)?,
        None => &[],
    };
    let mut there = Runs::new(levels, 1);
    let mut values: Box<dyn Iterator<Item = Value<'_>>> = match encoding {
        PLAIN => Box::new(Plain::new(rest, kind)),
        RUNS if kind == Kind::Bool => {
            Box::new(Runs::new(with_length(&mut rest)?, 1).map(|bit| Value::Int(i64::from(bit))))
        }
        DICTIONARY | OLD_DICTIONARY => {
            let width = cut(&mut rest, 1)?[0];
            if width > 32 {
                return Err(TableError::Damaged("a page's places in its dictionary are too wide"));
            }
            Box::new(Runs::new(rest, u32::from(width)).map_while(|place| dictionary.get(place as usize).copied()))
        }
        _ => return Err(TableError::OutOfBounds("its values are encoded in a way that is not known here")),
    };
    let rows = page.values.min(left);
    for _ in 0..rows {
        let is_there = !is_optional || there.next().ok_or(TOO_FEW)? == 1;
        take(if is_there { Some(values.next().ok_or(TOO_FEW)?) } else { None });
    }
    Ok(left - rows)
}

fn cut<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], TableError> {
    let (taken, after) = rest.split_at_checked(count).ok_or(TOO_FEW)?;
    *rest = after;
    Ok(taken)
}

/// So many bytes as the first four say.
fn with_length<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], TableError> {
    let length = cut(rest, 4)?.iter().rev().fold(0, |sum, byte| (sum << 8) | usize::from(*byte));
    cut(rest, length)
}

/// Values one behind the other.
struct Plain<'a> {
    rest: &'a [u8],
    kind: Kind,
    /// Of truths, eight to a byte, how many are taken of the first.
    bits: u32,
}

impl<'a> Plain<'a> {
    fn new(rest: &'a [u8], kind: Kind) -> Self {
        Self { rest, kind, bits: 0 }
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*taken)
    }
}

impl<'a> Iterator for Plain<'a> {
    type Item = Value<'a>;

    fn next(&mut self) -> Option<Value<'a>> {
        Some(match self.kind {
            Kind::Bool => {
                let bit = (self.rest.first()? >> self.bits) & 1;
                self.bits = (self.bits + 1) % 8;
                if self.bits == 0 {
                    self.rest = &self.rest[1..];
                }
                Value::Int(i64::from(bit))
            }
            Kind::Int32 => Value::Int(i64::from(i32::from_le_bytes(self.take()?))),
            Kind::Int64 => Value::Int(i64::from_le_bytes(self.take()?)),
            Kind::Float => Value::Float(f64::from(f32::from_le_bytes(self.take()?))),
            Kind::Double => Value::Float(f64::from_le_bytes(self.take()?)),
            Kind::Bytes => Value::Bytes(with_length(&mut self.rest).ok()?),
        })
    }
}

/// Small numbers of so many bits, in runs of one number and rows of packed ones.
struct Runs<'a> {
    rest: &'a [u8],
    width: u32,
    /// How often a number is still to come.
    repeats: u64,
    number: u32,
    /// Packed numbers, how many of them are still to come, and where the next begins (bits).
    packed: &'a [u8],
    to_come: u64,
    bit: usize,
}

impl<'a> Runs<'a> {
    fn new(rest: &'a [u8], width: u32) -> Self {
        Self { rest, width, repeats: 0, number: 0, packed: &[], to_come: 0, bit: 0 }
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (byte, rest) = self.rest.split_first()?;
            self.rest = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn unpacked(&mut self) -> Option<u32> {
        let (first, shift) = (self.bit / 8, self.bit % 8);
        let byte = |place: usize| self.packed.get(first + place).map_or(0, |byte| u64::from(*byte) << (8 * place));
        if self.width > 0 && self.bit + self.width as usize > 8 * self.packed.len() {
            return None;
        }
        let bits = (0..5).map(byte).fold(0, |sum, byte| sum | byte) >> shift;
        self.bit += self.width as usize;
        Some((bits & ((1 << self.width) - 1)) as u32)
    }
}

impl Iterator for Runs<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        loop {
            if self.repeats > 0 {
                self.repeats -= 1;
                return Some(self.number);
            }
            if self.to_come > 0 {
                self.to_come -= 1;
                return self.unpacked();
            }
            let header = self.varint()?;
            if header & 1 == 1 {
                // In rows of eight; the last row may be cut short.
                let bytes = usize::try_from((header >> 1).saturating_mul(u64::from(self.width))).ok()?;
                let (packed, rest) = self.rest.split_at(bytes.min(self.rest.len()));
                (self.packed, self.rest, self.bit) = (packed, rest, 0);
                self.to_come = (header >> 1).saturating_mul(8);
            } else {
                let number = cut(&mut self.rest, self.width.div_ceil(8) as usize).ok()?;
                self.number = number.iter().rev().fold(0, |sum, byte| (sum << 8) | u32::from(*byte));
                self.repeats = header >> 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_packed_rows_follow_each_other() {
        // Four times 5; eight numbers of three bits, 0 to 7; twice 1.
        let bytes = [8, 5, 3, 0b1000_1000, 0b1100_0110, 0b1111_1010, 4, 1];
        let found: Vec<u32> = Runs::new(&bytes, 3).collect();
        assert_eq!(found, [5, 5, 5, 5, 0, 1, 2, 3, 4, 5, 6, 7, 1, 1]);
        assert_eq!(Runs::new(&[6], 0).collect::<Vec<u32>>(), [0, 0, 0], "numbers without bits are 0");
        assert_eq!(Runs::new(&[3, 0xff], 3).collect::<Vec<u32>>(), [7, 7], "a row that is cut short ends");
        assert_eq!(Runs::new(&[0, 0, 0, 2], 3).next(), None);
    }

    #[test]
    fn values_of_every_kind_are_as_wide_as_they_are() {
        let all = |kind, bytes: &'static [u8]| Plain::new(bytes, kind).collect::<Vec<_>>();
        assert_eq!(all(Kind::Bool, &[0b101])[..3], [Value::Int(1), Value::Int(0), Value::Int(1)]);
        assert_eq!(all(Kind::Int32, &[0xfe, 0xff, 0xff, 0xff, 1, 0]), [Value::Int(-2)]);
        assert_eq!(all(Kind::Float, &[0, 0, 0x20, 0x40]), [Value::Float(2.5)]);
        assert_eq!(all(Kind::Bytes, &[1, 0, 0, 0, b'x', 9, 0, 0, 0]), [Value::Bytes(b"x")]);
    }
}
