//! NumPy's types and arrays.

use super::problem::PickleProblem;
use super::value::{Pickle, Value};

/// The type of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NumberType {
    /// NumPy's letter: `f`, `i`, `u`, `b`; any other is carried along and never looked into.
    kind: u8,
    /// Bytes of one.
    bytes: usize,
    big_endian: bool,
}

impl NumberType {
    /// `f4`, `<f8`, `b1`, `?` ...
    pub(super) fn named(name: &str) -> Result<Self, PickleProblem> {
        let unknown = || PickleProblem::ArrayType(name.chars().take(40).collect());
        let (order, rest) = match name.as_bytes() {
            [order @ (b'<' | b'>' | b'=' | b'|'), ..] => (*order, &name[1..]),
            _ => (b'<', name),
        };
        let (kind, bytes) = match rest {
            "?" => (b'b', 1),
            _ => {
                let kind = rest.bytes().next().filter(u8::is_ascii_alphabetic).ok_or_else(unknown)?;
                (kind, rest[1..].parse().map_err(|_| unknown())?)
            }
        };
        let known = match kind {
            b'f' => matches!(bytes, 2 | 4 | 8),
            b'i' | b'u' => matches!(bytes, 1 | 2 | 4 | 8),
            b'b' => bytes == 1,
            // Texts, objects, dates: their sizes are counted in various units.
            b'U' | b'S' | b'O' | b'M' | b'm' => bytes <= 1 << 20,
            _ => false,
        };
        if known { Ok(Self { kind, bytes, big_endian: order == b'>' }) } else { Err(unknown()) }
    }

    /// The same with the order of bytes that its state says.
    pub(super) fn ordered(self, order: &str) -> Self {
        Self { big_endian: order == ">", ..self }
    }

    fn is_number(self) -> bool {
        matches!(self.kind, b'f' | b'i' | b'u' | b'b')
    }

    /// The number in `bytes`, of which there are as many as it has.
    #[allow(clippy::cast_precision_loss, reason = "integers of scenes are small")]
    fn number(self, bytes: &[u8]) -> f64 {
        let mut little = [0; 8];
        let filled = &mut little[..self.bytes.min(8)];
        filled.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        if self.big_endian {
            filled.reverse();
        }
        let bits = u64::from_le_bytes(little);
        match (self.kind, self.bytes) {
            (b'f', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'f', 2) => half(bits as u16),
            (b'f', _) => f64::from_bits(bits),
            (b'i', 1) => f64::from(bits as u8 as i8),
            (b'i', 2) => f64::from(bits as u16 as i16),
            (b'i', 4) => f64::from(bits as u32 as i32),
            (b'i', _) => bits as i64 as f64,
            _ => bits as f64,
        }
    }

    /// A single number.
    pub(super) fn scalar<'a>(self, bytes: &[u8]) -> Result<Value<'a>, PickleProblem> {
        if !self.is_number() || bytes.len() != self.bytes {
            return Err(PickleProblem::ArrayBytes { shape: Vec::new(), item: self.bytes, bytes: bytes.len() });
        }
        let number = self.number(bytes);
        Ok(match self.kind {
            b'f' => Value::Float(number),
            b'b' => Value::Bool(number != 0.0),
            _ => Value::Int(number as i64),
        })
    }
}

/// A half-precision number.
fn half(bits: u16) -> f64 {
    let (sign, exponent, fraction) = (bits >> 15, i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let two_to = |power: i32| f64::from_bits(((1023 + power) as u64) << 52);
    let size = match exponent {
        0 => fraction * two_to(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * two_to(exponent - 25),
    };
    if sign == 1 { -size } else { size }
}

/// An array: a shape, a type and bytes.
#[derive(Clone, Debug)]
pub struct Array<'a> {
    shape: Vec<usize>,
    number: Option<NumberType>,
    /// The first index runs fastest.
    fortran: bool,
    data: Value<'a>,
}

impl<'a> Array<'a> {
    /// One that has nothing yet.
    pub(super) fn empty() -> Self {
        Self { shape: vec![0], number: None, fortran: false, data: Value::None }
    }

    /// One of `shape` and `number` in `data`, which holds `bytes`; of one of other things than numbers the data are not looked at.
    pub(super) fn new(
        shape: Vec<usize>,
        number: NumberType,
        fortran: bool,
        data: Value<'a>,
        bytes: Option<usize>,
    ) -> Result<Self, PickleProblem> {
        if number.is_number() {
            let count = shape.iter().try_fold(1_usize, |count, length| count.checked_mul(*length));
            let wanted = count.and_then(|count| count.checked_mul(number.bytes));
            let bytes = bytes.ok_or(PickleProblem::Call { class: "numpy.ndarray" })?;
            if wanted != Some(bytes) {
                return Err(PickleProblem::ArrayBytes { shape, item: number.bytes, bytes });
            }
        }
        Ok(Self { shape, number: Some(number), fortran, data })
    }

    /// Its numbers, if it has such, as rows.
    pub(super) fn numbers<'d>(&'d self, pickle: &'d Pickle<'a>) -> Option<Numbers<'d>> {
        let number = self.number.filter(|number| number.is_number())?;
        let rows = self.shape.first().copied().unwrap_or(1);
        let columns = self.shape.iter().skip(1).try_fold(1_usize, |all, length| all.checked_mul(*length))?;
        // Of three axes and more only those that count as rows of something are met with.
        let fortran = self.fortran && self.shape.len() == 2;
        (!self.fortran || self.shape.len() <= 2).then(|| Numbers {
            rows,
            columns,
            number,
            fortran,
            bytes: pickle.bytes(self.data).unwrap_or_default(),
        })
    }
}

/// An array's numbers as rows: a single axis is a column, more than two axes are rows of all that is below the first.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'d> {
    /// Number of rows.
    pub rows: usize,
    /// Numbers in a row.
    pub columns: usize,
    number: NumberType,
    fortran: bool,
    bytes: &'d [u8],
}

impl Numbers<'_> {
    /// The number in a row and column; not a number where there is none.
    #[must_use]
    pub fn at(&self, row: usize, column: usize) -> f64 {
        if row >= self.rows || column >= self.columns {
            return f64::NAN;
        }
        let place = if self.fortran { column * self.rows + row } else { row * self.columns + column };
        let begin = place * self.number.bytes;
        self.bytes.get(begin..begin + self.number.bytes).map_or(f64::NAN, |bytes| self.number.number(bytes))
    }
}
