//! The pages of a column, one by one, unpacked. What a page claims to unpack to is room for that much, and so is bounded.

use super::footer::{Chunk, Codec, MOST_ROWS};
use super::table::TableError;
use super::thrift::Fields;
use crate::budget::Budget;

/// The longest page (bytes, unpacked): 1 MiB is usual.
const LONGEST_PAGE: usize = 16 << 20;

/// All pages that are read of a table (bytes, unpacked).
pub(super) const MOST_BYTES: usize = 256 << 20;

/// What a page holds.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Values that others name by their places.
    Dictionary,
    /// Values of rows: in which way they are written, and how many bytes before them tell which rows have one; none where the page itself
    /// says so in its first four bytes.
    Values { encoding: i64, levels: Option<usize> },
}

/// A page.
#[derive(Debug)]
pub(super) struct Page {
    pub content: Content,
    /// How many values, those that are not there among them.
    pub values: usize,
    pub bytes: Vec<u8>,
}

const MALFORMED: TableError = TableError::Damaged("a page's header is malformed");

/// Takes the first page off `chunk`; none where there is none left.
pub(super) fn next(chunk: &mut Chunk<'_>, budget: &Budget) -> Result<Option<Page>, TableError> {
    while !chunk.pages.is_empty() {
        let (header, length) = Fields::read(chunk.pages).ok_or(MALFORMED)?;
        let size = |number| header.int(number).and_then(|size| usize::try_from(size).ok()).ok_or(MALFORMED);
        let (unpacked, packed) = (size(2)?, size(3)?);
        let (bytes, rest) = chunk.pages[length..].split_at_checked(packed).ok_or(MALFORMED)?;
        chunk.pages = rest;
        let Some((content, values)) = content(&header)? else { continue };
        if unpacked > LONGEST_PAGE || budget.spend(unpacked).is_err() {
            return Err(TableError::OutOfBounds("it unpacks to pages of more than 16 MiB, or to more than 256 MiB"));
        }
        // Levels before the values are never packed in pages that say how long they are.
        let plain = match content {
            Content::Values { levels: Some(levels), .. } => levels,
            _ => 0,
        };
        let is_packed = header.fields(8).and_then(|content| content.int(7)) != Some(0);
        let bytes = if is_packed { unpack(chunk.codec?, bytes, plain, unpacked)? } else { bytes.to_vec() };
        return Ok(Some(Page { content, values, bytes }));
    }
    Ok(None)
}

/// What a page holds, and how many values; none for what is of no interest.
fn content(header: &Fields<'_>) -> Result<Option<(Content, usize)>, TableError> {
    let count = |content: &Fields<'_>| {
        let values = content.int(1).and_then(|values| usize::try_from(values).ok()).ok_or(MALFORMED)?;
        if values > MOST_ROWS {
            Err(TableError::OutOfBounds("a page has more than 1,000,000 values"))
        } else {
            Ok(values)
        }
    };
    let unknown = TableError::OutOfBounds("its values are encoded in a way that is not known here");
    match header.int(1) {
        Some(0) => {
            let content = header.fields(5).ok_or(MALFORMED)?;
            if content.int(3) != Some(RUNS) {
                return Err(unknown);
            }
            let encoding = content.int(2).ok_or(MALFORMED)?;
            Ok(Some((Content::Values { encoding, levels: None }, count(content)?)))
        }
        Some(2) => {
            let content = header.fields(7).ok_or(MALFORMED)?;
            if !matches!(content.int(2), Some(PLAIN | OLD_DICTIONARY)) {
                return Err(unknown);
            }
            Ok(Some((Content::Dictionary, count(content)?)))
        }
        Some(3) => {
            let content = header.fields(8).ok_or(MALFORMED)?;
            let levels = content.int(5).and_then(|length| usize::try_from(length).ok()).ok_or(MALFORMED)?;
            if content.int(6) != Some(0) {
                return Err(unknown);
            }
            let encoding = content.int(4).ok_or(MALFORMED)?;
            Ok(Some((Content::Values { encoding, levels: Some(levels) }, count(content)?)))
        }
        _ => Ok(None),
    }
}

/// Numbers of encodings: values one behind the other; places in a dictionary, under two names; runs.
pub(super) const PLAIN: i64 = 0;
pub(super) const OLD_DICTIONARY: i64 = 2;
pub(super) const RUNS: i64 = 3;
pub(super) const DICTIONARY: i64 = 8;

/// The `unpacked` bytes that `bytes` unpack to, of which the first `plain` are as they are.
fn unpack(codec: Codec, bytes: &[u8], plain: usize, unpacked: usize) -> Result<Vec<u8>, TableError> {
    let wrong = TableError::Damaged("a page does not unpack to what it says");
    let (before, packed) = bytes.split_at_checked(plain).ok_or(wrong)?;
    let length = unpacked.checked_sub(plain).ok_or(wrong)?;
    let after = match codec {
        _ if length == 0 => Vec::new(),
        Codec::Plain => packed.to_vec(),
        Codec::Snappy => {
            if snap::raw::decompress_len(packed).ok() != Some(length) {
                return Err(wrong);
            }
            snap::raw::Decoder::new().decompress_vec(packed).map_err(|_| wrong)?
        }
        Codec::Zstd => zstd::bulk::decompress(packed, length).map_err(|_| wrong)?,
    };
    if after.len() != length {
        return Err(wrong);
    }
    Ok(if before.is_empty() { after } else { [before, &after].concat() })
}

#[cfg(test)]
mod tests {
    use super::super::thrift::int;
    use super::*;

    /// What a chunk of one page gives that claims this, and has four bytes.
    fn claimed(unpacked: i64, packed: i64, values: i64, codec: Codec) -> Result<usize, TableError> {
        let content = [int(1, values), int(1, PLAIN), int(1, RUNS), int(1, RUNS), vec![0]].concat();
        let pages = [int(1, 0), int(1, unpacked), int(1, packed), vec![0x2c], content, vec![0], vec![7; 4]].concat();
        let mut chunk = Chunk { pages: &pages, codec: Ok(codec), rows: 1 };
        let page = next(&mut chunk, &Budget::new(MOST_BYTES))?;
        Ok(page.map_or(0, |page| page.bytes.len()))
    }

    #[test]
    fn a_page_may_not_claim_more_than_it_can_have() {
        let plain = |unpacked, packed, values| claimed(unpacked, packed, values, Codec::Plain);
        assert_eq!(plain(4, 4, 1), Ok(4));
        let long = "it unpacks to pages of more than 16 MiB, or to more than 256 MiB";
        assert_eq!(plain(i64::from(i32::MAX), 4, 1), Err(TableError::OutOfBounds(long)));
        assert_eq!(plain(-1, 4, 1), Err(MALFORMED));
        assert_eq!(plain(4, 5, 1), Err(MALFORMED));
        assert_eq!(plain(4, 4, 1 << 30), Err(TableError::OutOfBounds("a page has more than 1,000,000 values")));
        let other = Err(TableError::Damaged("a page does not unpack to what it says"));
        assert_eq!(plain(5, 4, 1), other);
        for codec in [Codec::Snappy, Codec::Zstd] {
            assert_eq!(claimed(1 << 20, 4, 1, codec), other);
        }
    }

    #[test]
    fn all_pages_together_may_not_unpack_to_more_than_a_table_may() {
        let content = [int(1, 1), int(1, PLAIN), int(1, RUNS), int(1, RUNS), vec![0]].concat();
        let page = [int(1, 0), int(1, 4), int(1, 4), vec![0x2c], content, vec![0], vec![7; 4]].concat();
        let pages = page.repeat(3);
        let (mut chunk, budget) = (Chunk { pages: &pages, codec: Ok(Codec::Plain), rows: 3 }, Budget::new(10));
        let found: Vec<bool> = (0..3).map(|_| next(&mut chunk, &budget).is_ok()).collect();
        assert_eq!(found, [true, true, false]);
    }
}
