//! Thrift's compact protocol, which a table's footer and its pages' headers are written in. How many things a list may have is bounded, and
//! how deep they may lie in each other.

/// What is nested deeper than this is none of Parquet's.
const DEEPEST: usize = 16;

/// The longest list: a scene's table has some 20 columns and a few row groups.
const LONGEST_LIST: usize = 500;

/// A value, borrowed from the bytes that it is in.
#[derive(Debug)]
pub(super) enum Value<'a> {
    Int(i64),
    Bytes(&'a [u8]),
    List(Vec<Value<'a>>),
    Struct(Fields<'a>),
    /// Of no interest here: numbers with fractions, maps.
    Other,
}

/// Fields by their numbers.
#[derive(Debug, Default)]
pub(super) struct Fields<'a>(Vec<(i64, Value<'a>)>);

impl<'a> Fields<'a> {
    /// The struct at the beginning of `bytes`, and how many of them it takes; none where there is none, or it is out of bounds.
    pub fn read(bytes: &'a [u8]) -> Option<(Self, usize)> {
        let mut rest = bytes;
        let fields = Self::of(&mut rest, 0)?;
        Some((fields, bytes.len() - rest.len()))
    }

    fn of(rest: &mut &'a [u8], depth: usize) -> Option<Self> {
        let (mut fields, mut number) = (Vec::new(), 0_i64);
        loop {
            let header = byte(rest)?;
            if header == 0 {
                return Some(Self(fields));
            }
            number = match header >> 4 {
                0 => signed(rest)?,
                step => number.checked_add(i64::from(step))?,
            };
            let value = match header & 0xf {
                1 => Value::Int(1),
                2 => Value::Int(0),
                kind => Value::of(kind, rest, depth + 1)?,
            };
            // Readers might disagree on which of two holds.
            if fields.iter().any(|(known, _)| *known == number) {
                return None;
            }
            fields.push((number, value));
        }
    }

    fn find(&self, number: i64) -> Option<&Value<'a>> {
        self.0.iter().find(|(field, _)| *field == number).map(|(_, value)| value)
    }

    pub fn int(&self, number: i64) -> Option<i64> {
        if let Value::Int(int) = self.find(number)? { Some(*int) } else { None }
    }

    pub fn bytes(&self, number: i64) -> Option<&'a [u8]> {
        if let Value::Bytes(bytes) = self.find(number)? { Some(bytes) } else { None }
    }

    pub fn fields(&self, number: i64) -> Option<&Self> {
        self.find(number)?.fields()
    }

    /// The structs in a list; none of them where there is no such list, or something else in it.
    pub fn list(&self, number: i64) -> Vec<&Self> {
        let Some(Value::List(values)) = self.find(number) else { return Vec::new() };
        values.iter().map(Value::fields).collect::<Option<_>>().unwrap_or_default()
    }
}

impl<'a> Value<'a> {
    fn fields(&self) -> Option<&Fields<'a>> {
        if let Self::Struct(fields) = self { Some(fields) } else { None }
    }

    fn of(kind: u8, rest: &mut &'a [u8], depth: usize) -> Option<Self> {
        if depth > DEEPEST {
            return None;
        }
        Some(match kind {
            // Within lists a truth takes a byte.
            1..=3 => Self::Int(i64::from(byte(rest)?)),
            4..=6 => Self::Int(signed(rest)?),
            7 => take(rest, 8).map(|_| Self::Other)?,
            8 => {
                let length = usize::try_from(varint(rest)?).ok()?;
                Self::Bytes(take(rest, length)?)
            }
            9 | 10 => {
                let header = byte(rest)?;
                let length = match header >> 4 {
                    15 => usize::try_from(varint(rest)?).ok()?,
                    length => usize::from(length),
                };
                if length > LONGEST_LIST {
                    return None;
                }
                Self::List((0..length).map(|_| Self::of(header & 0xf, rest, depth + 1)).collect::<Option<_>>()?)
            }
            11 => {
                let length = varint(rest)?;
                let kinds = if length > 0 { byte(rest)? } else { 0 };
                if length > LONGEST_LIST as u64 {
                    return None;
                }
                for _ in 0..length {
                    Self::of(kinds >> 4, rest, depth + 1)?;
                    Self::of(kinds & 0xf, rest, depth + 1)?;
                }
                Self::Other
            }
            12 => Self::Struct(Fields::of(rest, depth)?),
            _ => return None,
        })
    }
}

fn byte(rest: &mut &[u8]) -> Option<u8> {
    take(rest, 1).map(|bytes| bytes[0])
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, after) = rest.split_at_checked(count)?;
    *rest = after;
    Some(taken)
}

fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = byte(rest)?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// Signs are folded into the lowest bit.
fn signed(rest: &mut &[u8]) -> Option<i64> {
    let value = varint(rest)?;
    Some((value >> 1) as i64 ^ -((value & 1) as i64))
}

/// A whole number as a field behind the one `step` before it.
#[cfg(test)]
pub(super) fn int(step: u8, value: i64) -> Vec<u8> {
    let (mut left, mut bytes) = (((value << 1) ^ (value >> 63)) as u64, vec![step << 4 | 5]);
    while left > 0x7f {
        bytes.push(left as u8 | 0x80);
        left >>= 7;
    }
    bytes.push(left as u8);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_they_are_written() {
        for value in [0, 1, -1, 63, 64, i64::MAX, i64::MIN] {
            let bytes = [int(2, value), vec![0]].concat();
            assert_eq!(Fields::read(&bytes).unwrap().0.int(2), Some(value));
        }
    }

    #[test]
    fn a_list_may_not_claim_more_than_there_is_and_nothing_be_too_deep() {
        let list = |length: &[u8]| [&[0x19, 0xf5][..], length, &[0; 600], &[0]].concat();
        assert!(Fields::read(&list(&[100])).is_some());
        assert!(Fields::read(&list(&[0xff, 0xff, 0xff, 0xff, 0x07])).is_none(), "2,147,483,647 numbers");
        assert!(Fields::read(&[0x1c; 100_000]).is_none(), "structs in structs");
        assert!(Fields::read(&[int(1, 1), vec![0x05, 0x02, 0x02], vec![0]].concat()).is_none(), "a field twice");
        assert!(Fields::read(&[int(1, 1), vec![0x18, 9, 1, 2]].concat()).is_none(), "bytes beyond the end");
    }
}
