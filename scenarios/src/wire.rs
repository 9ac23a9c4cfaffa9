//! Protobuf's wire format, as far as stepping over fields needs it.

use thiserror::Error;

/// What a field holds, undecoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Field<'a> {
    Varint(u64),
    Fixed64([u8; 8]),
    Bytes(&'a [u8]),
    /// Stepped over whole: no message of ours ever had one.
    Group,
    Fixed32([u8; 4]),
}

/// Bytes that are no fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the field at byte {offset} of the payload is malformed")]
pub(crate) struct Malformed {
    offset: usize,
}

/// The fields of a message in their order, with their numbers; after a [`Malformed`] none.
pub(crate) fn fields(message: &[u8]) -> impl Iterator<Item = Result<(u64, Field<'_>), Malformed>> {
    let mut rest = message;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let offset = message.len() - rest.len();
        Some(next_field(&mut rest).ok_or_else(|| {
            rest = &[];
            Malformed { offset }
        }))
    })
}

fn next_field<'a>(rest: &mut &'a [u8]) -> Option<(u64, Field<'a>)> {
    let key = varint(rest)?;
    let field = match key & 7 {
        0 => Field::Varint(varint(rest)?),
        1 => Field::Fixed64(*take(rest, 8)?.first_chunk()?),
        2 => {
            let length = usize::try_from(varint(rest)?).ok()?;
            Field::Bytes(take(rest, length)?)
        }
        START_GROUP => {
            skip_group(rest)?;
            Field::Group
        }
        5 => Field::Fixed32(*take(rest, 4)?.first_chunk()?),
        _ => return None,
    };
    Some((key >> 3, field))
}

const START_GROUP: u64 = 3;
const END_GROUP: u64 = 4;

/// Groups may hold groups: depth is counted, not recursed into, for a hostile file may nest them a million deep.
fn skip_group(rest: &mut &[u8]) -> Option<()> {
    let mut depth = 1_usize;
    while depth > 0 {
        let mut ahead = *rest;
        match varint(&mut ahead)? & 7 {
            START_GROUP => (*rest, depth) = (ahead, depth + 1),
            END_GROUP => (*rest, depth) = (ahead, depth - 1),
            _ => drop(next_field(rest)?),
        }
    }
    Some(())
}

pub(crate) fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..70).step_by(7) {
        let (byte, after) = rest.split_first()?;
        *rest = after;
        value |= u64::from(byte & 0x7f) << shift.min(63);
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, after) = rest.split_at_checked(count)?;
    *rest = after;
    Some(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wire_type_is_stepped_over_groups_within_groups_too() {
        let message = [
            &[0x08, 0x96, 0x01][..],                        // 1: varint 150
            &[0x11, 1, 2, 3, 4, 5, 6, 7, 8],                // 2: 64 bit
            &[0x1b, 0x23, 0x08, 0x05, 0x24, 0x10, 1, 0x1c], // 3: a group that holds a group and a varint
            &[0x22, 2, b'a', b'b'],                         // 4: bytes
            &[0x2d, 1, 2, 3, 4],                            // 5: 32 bit
        ]
        .concat();
        let found: Vec<(u64, Field<'_>)> = fields(&message).map(Result::unwrap).collect();
        let expected = [
            (1, Field::Varint(150)),
            (2, Field::Fixed64([1, 2, 3, 4, 5, 6, 7, 8])),
            (3, Field::Group),
            (4, Field::Bytes(b"ab")),
            (5, Field::Fixed32([1, 2, 3, 4])),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn the_malformed_field_is_named_by_its_offset_and_nothing_follows() {
        for broken in [&[0x22, 9, b'a'][..], &[0x1b, 0x08], &[0x0c], &[0xff; 11]] {
            let message = [&[0x08, 0x01], broken].concat();
            let found: Vec<_> = fields(&message).collect();
            assert_eq!(found, [Ok((1, Field::Varint(1))), Err(Malformed { offset: 2 })]);
        }
    }
}
