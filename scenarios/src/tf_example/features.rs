//! TensorFlow's `Example`: lists of numbers or bytes by name. Only what is asked for is decoded.
//!
//! | message | fields |
//! | --- | --- |
//! | `Example` | 1 `Features` |
//! | `Features` | 1 entries: 1 name, 2 `Feature` |
//! | `Feature` | 1 bytes, 2 floats, 3 whole numbers, each a message with its values in field 1, packed or not |

use std::collections::BTreeMap;

use super::ExampleError;
use crate::budget::Budget;
use crate::wire::{self, Field};

/// Names by which the data set's records are known.
const FAMILIES: [&[u8]; 4] = [b"state/", b"roadgraph_samples/", b"traffic_light_state/", b"scenario/"];

/// Whether a payload that begins with `start` is an `Example` of the data set.
pub(crate) fn looks_like_example(start: &[u8]) -> bool {
    entries(start).is_some_and(|(_, rest)| Entry::of(rest).is_some_and(|entry| entry.is_ours()))
}

/// Behind the head of the entries that a payload begins with: how many bytes they have, and what follows.
pub(crate) fn entries(payload: &[u8]) -> Option<(u64, &[u8])> {
    let mut rest = payload;
    let head = (wire::varint(&mut rest)?, wire::varint(&mut rest)?);
    (head.0 == LISTED).then_some((head.1, rest))
}

/// The key of field 1 with so many bytes, and of field 2.
const LISTED: u64 = 1 << 3 | 2;
const VALUE: u64 = 2 << 3 | 2;

/// The beginning of an entry, which may be cut off.
pub(crate) struct Entry<'a> {
    /// How many bytes it has, its head included.
    pub bytes: u64,
    pub name: &'a [u8],
    /// What is behind its name.
    rest: &'a [u8],
}

impl<'a> Entry<'a> {
    pub fn of(bytes: &'a [u8]) -> Option<Self> {
        let mut rest = bytes;
        if wire::varint(&mut rest)? != LISTED {
            return None;
        }
        let length = wire::varint(&mut rest)?;
        let head = (bytes.len() - rest.len()) as u64;
        if wire::varint(&mut rest)? != LISTED {
            return None;
        }
        let name = wire::varint(&mut rest)?;
        let (name, rest) = rest.split_at_checked(usize::try_from(name).ok()?)?;
        Some(Self { bytes: head.checked_add(length)?, name, rest })
    }

    fn is_ours(&self) -> bool {
        FAMILIES.iter().any(|family| self.name.starts_with(family))
    }

    /// The one value of bytes, as the scene's id is written.
    pub fn text(&self) -> Option<&'a [u8]> {
        let mut rest = self.rest;
        for key in [VALUE, LISTED, LISTED] {
            if wire::varint(&mut rest)? != key {
                return None;
            }
            let length = usize::try_from(wire::varint(&mut rest)?).ok()?;
            rest = rest.get(..length)?;
        }
        Some(rest)
    }
}

/// The features of a payload by name, undecoded.
pub(super) struct Features<'a> {
    by_name: BTreeMap<&'a [u8], &'a [u8]>,
    budget: Budget,
}

fn malformed(name: &str) -> ExampleError {
    ExampleError::Malformed(name.to_owned())
}

/// The fields of a message, of which one that is malformed is none.
fn all(message: &[u8]) -> Option<Vec<(u64, Field<'_>)>> {
    wire::fields(message).collect::<Result<_, _>>().ok()
}

impl<'a> Features<'a> {
    pub fn of(payload: &'a [u8]) -> Result<Self, ExampleError> {
        let mut by_name = BTreeMap::new();
        for (number, field) in all(payload).ok_or_else(|| malformed("the record"))? {
            let (1, Field::Bytes(features)) = (number, field) else { continue };
            for (number, entry) in all(features).ok_or_else(|| malformed("the list of features"))? {
                let (1, Field::Bytes(entry)) = (number, entry) else { continue };
                let (mut name, mut feature) = (&[][..], &[][..]);
                for field in all(entry).ok_or_else(|| malformed("a feature"))? {
                    match field {
                        (1, Field::Bytes(bytes)) => name = bytes,
                        (2, Field::Bytes(bytes)) => feature = bytes,
                        _ => {}
                    }
                }
                if by_name.insert(name, feature).is_some() {
                    return Err(ExampleError::Twice(String::from_utf8_lossy(name).chars().take(100).collect()));
                }
            }
        }
        Ok(Self { by_name, budget: Budget::of_a_scene() })
    }

    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    pub fn has(&self, name: &str) -> bool {
        self.by_name.contains_key(name.as_bytes())
    }

    /// The values of a feature, each in a field of its own or several in one.
    fn fields(&self, name: &str, kind: u64) -> Result<Vec<Field<'a>>, ExampleError> {
        let feature = self.by_name.get(name.as_bytes()).ok_or_else(|| ExampleError::Missing(name.to_owned()))?;
        let mut values = Vec::new();
        for (number, list) in all(feature).ok_or_else(|| malformed(name))? {
            let Field::Bytes(list) = list else { continue };
            if number != kind {
                return Err(ExampleError::Kind(name.to_owned()));
            }
            for field in wire::fields(list) {
                let (1, value) = field.map_err(|_| malformed(name))? else { continue };
                self.budget.spend(1)?;
                values.push(value);
            }
        }
        Ok(values)
    }

    /// The one text of a feature.
    pub fn text(&self, name: &str) -> Result<String, ExampleError> {
        match self.fields(name, 1)?[..] {
            [Field::Bytes(text)] => Ok(String::from_utf8_lossy(text).chars().take(200).collect()),
            _ => Err(malformed(name)),
        }
    }

    pub fn floats(&self, name: &str) -> Result<Vec<f64>, ExampleError> {
        let mut floats = Vec::new();
        for field in self.fields(name, 2)? {
            match field {
                Field::Fixed32(bytes) => floats.push(f64::from(f32::from_le_bytes(bytes))),
                Field::Bytes(packed) => {
                    let (chunks, []) = packed.as_chunks::<4>() else { return Err(malformed(name)) };
                    self.budget.spend(chunks.len())?;
                    floats.extend(chunks.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))));
                }
                _ => return Err(malformed(name)),
            }
        }
        Ok(floats)
    }

    /// Whole numbers, which some features have as such and others as floats.
    pub fn ints(&self, name: &str) -> Result<Vec<i64>, ExampleError> {
        let mut ints = Vec::new();
        let fields = match self.fields(name, 3) {
            Err(ExampleError::Kind(_)) => {
                return Ok(self.floats(name)?.into_iter().map(|float| float as i64).collect());
            }
            fields => fields?,
        };
        for field in fields {
            match field {
                Field::Varint(value) => ints.push(value as i64),
                Field::Bytes(mut packed) => {
                    while !packed.is_empty() {
                        self.budget.spend(1)?;
                        ints.push(wire::varint(&mut packed).ok_or_else(|| malformed(name))? as i64);
                    }
                }
                _ => return Err(malformed(name)),
            }
        }
        Ok(ints)
    }
}
