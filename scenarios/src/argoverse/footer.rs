//! What a Parquet table says of itself: which columns it has, and where their values lie.

use super::table::TableError;
use super::thrift::Fields;

/// The most rows: a scene of Argoverse's has 5,000 to 40,000.
pub(super) const MOST_ROWS: usize = 1_000_000;

/// The longest footer (bytes); pandas writes 10 kB.
const LONGEST_FOOTER: usize = 1 << 20;

/// How a table begins and ends.
const MAGIC: &[u8] = b"PAR1";

/// What a value is, as it lies in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    Int32,
    Int64,
    Float,
    Double,
    Bytes,
}

/// How pages are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Codec {
    Plain,
    Snappy,
    Zstd,
}

/// The values of a column in a group of rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chunk<'a> {
    /// Its pages, one behind the other.
    pub pages: &'a [u8],
    pub codec: Result<Codec, TableError>,
    pub rows: usize,
}

/// A column of a flat table.
#[derive(Debug)]
pub(super) struct Column<'a> {
    pub name: &'a [u8],
    /// None for what no column of a scene's is.
    pub kind: Option<Kind>,
    /// Whether a row may have nothing.
    pub is_optional: bool,
    pub chunks: Vec<Chunk<'a>>,
}

/// The columns of the table in `bytes`.
pub(super) fn columns(bytes: &[u8]) -> Result<Vec<Column<'_>>, TableError> {
    let cut_off = TableError::Damaged("it is cut off, or no Parquet table");
    let (rest, end) = bytes.split_last_chunk::<8>().ok_or(cut_off)?;
    let (length, magic) = end.split_first_chunk::<4>().ok_or(cut_off)?;
    let length = u32::from_le_bytes(*length) as usize;
    if !bytes.starts_with(MAGIC) || magic != MAGIC || length > rest.len() {
        return Err(cut_off);
    }
    if length > LONGEST_FOOTER {
        return Err(TableError::OutOfBounds("its footer is longer than 1 MiB"));
    }
    let (footer, _) =
        Fields::read(&rest[rest.len() - length..]).ok_or(TableError::Damaged("its footer is malformed"))?;
    let schema = footer.list(2);
    let Some((root, leaves)) = schema.split_first() else {
        return Err(TableError::Damaged("its footer has no schema"));
    };
    if root.int(5) != i64::try_from(leaves.len()).ok() {
        return Err(TableError::OutOfBounds("its columns are nested"));
    }
    let mut columns = leaves.iter().map(|leaf| column(leaf)).collect::<Result<Vec<_>, _>>()?;
    let mut rows = 0;
    for group in footer.list(4) {
        let chunks = group.list(1);
        let count = group.int(3).and_then(|count| usize::try_from(count).ok());
        let (Some(count), true) = (count, chunks.len() == columns.len()) else {
            return Err(TableError::Damaged("its row groups do not go with its schema"));
        };
        rows += count.min(MOST_ROWS + 1);
        if rows > MOST_ROWS {
            return Err(TableError::OutOfBounds("it has more than 1,000,000 rows"));
        }
        for (column, chunk) in columns.iter_mut().zip(chunks) {
            column.chunks.push(self::chunk(bytes, chunk, count)?);
        }
    }
    Ok(columns)
}

fn column<'a>(leaf: &Fields<'a>) -> Result<Column<'a>, TableError> {
    let is_optional = match leaf.int(3) {
        Some(0) => false,
        Some(1) => true,
        _ => return Err(TableError::OutOfBounds("its columns are nested")),
    };
    let kind = match leaf.int(1) {
        Some(0) => Some(Kind::Bool),
        Some(1) => Some(Kind::Int32),
        Some(2) => Some(Kind::Int64),
        Some(4) => Some(Kind::Float),
        Some(5) => Some(Kind::Double),
        Some(6) => Some(Kind::Bytes),
        _ => None,
    };
    let name = leaf.bytes(4).ok_or(TableError::Damaged("a column has no name"))?;
    Ok(Column { name, kind, is_optional, chunks: Vec::new() })
}

fn chunk<'a>(bytes: &'a [u8], chunk: &Fields<'a>, rows: usize) -> Result<Chunk<'a>, TableError> {
    let data = chunk.fields(3).ok_or(TableError::Damaged("a column has no place in the file"))?;
    // Its dictionary, where it has one, comes first.
    let begin = data.int(11).filter(|place| *place > 0).or(data.int(9)).and_then(|place| usize::try_from(place).ok());
    let length = data.int(7).and_then(|length| usize::try_from(length).ok());
    let pages = begin.zip(length).and_then(|(begin, length)| bytes.get(begin..begin.checked_add(length)?));
    let pages = pages.ok_or(TableError::Damaged("a column lies beyond the file's end"))?;
    let codec = match data.int(4) {
        Some(0) => Ok(Codec::Plain),
        Some(1) => Ok(Codec::Snappy),
        Some(6) => Ok(Codec::Zstd),
        _ => Err(TableError::OutOfBounds("it is packed by something else than Snappy or Zstandard")),
    };
    Ok(Chunk { pages, codec, rows })
}
