//! A Parquet file under construction, in bounded memory.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, DataType, FieldRef, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::{ArrowColumnWriter, ArrowRowGroupWriterFactory, compute_leaves};
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError as Encoding;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use rayon::prelude::*;

use super::ParquetError;
use super::scratch::{Pile, Scratch};
use crate::files::{WholeFile, at};

/// Rows that are compressed together.
const ROW_GROUP: usize = 1 << 17;

/// Batches that become one: most episodes have one row, and each array some 300 bytes of its own.
const PILE: usize = 64;

/// Rows that are enough for a pile, of however few batches.
const PILE_ROWS: usize = 1 << 11;

/// Columns that are encoded side by side: with each there are its values, and a dictionary.
const SIDE_BY_SIDE: usize = 2;

/// A file on its way, the same bytes for the same batches. The rows of the open row group wait in a scratch file, to be encoded a few columns
/// at a time when it is full: rows in memory need 40 MB, and encoders of all columns at once thrice that, each with a dictionary of its own.
pub struct Writer {
    path: PathBuf,
    file: SerializedFileWriter<WholeFile>,
    columns: ArrowRowGroupWriterFactory,
    schema: SchemaRef,
    /// Rows in the open row group.
    rows: usize,
    /// The last of them.
    fresh: Vec<Pile>,
    /// Those before.
    scratch: Option<Scratch>,
}

impl Writer {
    /// Begins the file `path`, of rows of this schema.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn create(path: &Path, schema: SchemaRef) -> Result<Self, ParquetError> {
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            // The library's version must not change the bytes of a result.
            .set_created_by("reloop".to_owned())
            .build();
        let writer = ArrowWriter::try_new(WholeFile::create(path)?, SchemaRef::clone(&schema), Some(properties));
        let writer = writer.and_then(ArrowWriter::into_serialized_writer);
        let (file, columns) = writer.map_err(|error| cannot_write(path, error))?;
        Ok(Self { path: path.to_owned(), file, columns, schema, rows: 0, fresh: Vec::new(), scratch: None })
    }

    /// Appends a batch.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn write(&mut self, batch: &RecordBatch) -> Result<(), ParquetError> {
        self.write_pieces(batch.clone(), vec![batch.num_rows()])
    }

    /// Appends batches of these lengths, which are one.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn write_pieces(&mut self, batches: RecordBatch, lengths: Vec<usize>) -> Result<(), ParquetError> {
        if batches.schema_ref().fields() != self.schema.fields() {
            return Err(ArrowError::SchemaError("they have other columns".to_owned()).into());
        }
        let mut rest = Pile { rows: batches, lengths };
        loop {
            let full = rest.rows.num_rows() >= ROW_GROUP - self.rows;
            let fit = rest.split_off(ROW_GROUP - self.rows);
            self.rows += fit.rows.num_rows();
            self.fresh.push(fit);
            if !full {
                break;
            }
            self.close_row_group()?;
        }
        if self.fresh.iter().map(|pile| pile.lengths.len()).sum::<usize>() >= PILE || self.fresh_rows() >= PILE_ROWS {
            let pile = Pile::of(&self.schema, &mut self.fresh)?;
            let kept = Scratch::keep(&mut self.scratch, &self.path, &self.schema, pile);
            kept.map_err(|error| cannot_write(&self.path, error))?;
        }
        Ok(())
    }

    /// Writes what waits, and gives the file its name.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn commit(mut self) -> Result<(), ParquetError> {
        if self.rows > 0 {
            self.close_row_group()?;
        }
        let file = self.file.into_inner().map_err(|error| cannot_write(&self.path, error))?;
        Ok(file.commit()?)
    }

    fn fresh_rows(&self) -> usize {
        self.fresh.iter().map(|pile| pile.rows.num_rows()).sum()
    }

    fn close_row_group(&mut self) -> Result<(), ParquetError> {
        let last = Pile::of(&self.schema, &mut self.fresh)?;
        self.encode(&last).map_err(|error| cannot_write(&self.path, error))?;
        self.rows = 0;
        Ok(())
    }

    fn encode(&mut self, last: &Pile) -> Result<(), Encoding> {
        let kept = self.scratch.take().map(Scratch::read).transpose()?;
        let mut encoders = self.columns.create_column_writers(self.file.flushed_row_groups().len())?.into_iter();
        let mut group = self.file.next_row_group()?;
        let of = |field| (field, encoders.by_ref().take(leaves(field)).collect::<Vec<_>>());
        let mut columns = self.schema.fields().iter().map(of).enumerate().peekable();
        while columns.peek().is_some() {
            let some = columns.by_ref().take(SIDE_BY_SIDE).map(|(column, (field, encoders))| {
                let mut pieces = kept.as_ref().map_or(Ok(Vec::new()), |kept| kept.column(column))?;
                pieces.push((Arc::clone(last.rows.column(column)), &last.lengths));
                Ok((field, encoders, pieces))
            });
            let some: Vec<_> = some.collect::<Result<_, Encoding>>()?;
            let encoded = some.into_par_iter().map(|(field, mut encoders, pieces)| {
                for (values, lengths) in pieces {
                    let mut from = 0;
                    for length in lengths {
                        for (leaf, encoder) in
                            compute_leaves(field, &values.slice(from, *length))?.iter().zip(&mut encoders)
                        {
                            encoder.write(leaf)?;
                        }
                        from += length;
                    }
                }
                encoders.into_iter().map(ArrowColumnWriter::close).collect::<Result<Vec<_>, Encoding>>()
            });
            for chunk in encoded.collect::<Result<Vec<_>, Encoding>>()?.into_iter().flatten() {
                chunk.append_to_row_group(&mut group)?;
            }
        }
        group.close()?;
        Ok(())
    }
}

/// How many columns of a file a field is.
fn leaves(field: &FieldRef) -> usize {
    match field.data_type() {
        DataType::List(member) => leaves(member),
        DataType::Struct(fields) => fields.iter().map(leaves).sum(),
        _ => 1,
    }
}

fn cannot_write(path: &Path, error: Encoding) -> ParquetError {
    at("write", path)(io::Error::other(error)).into()
}

/// Writes `batches`, all of `schema`, under `path`.
///
/// # Errors
/// [`ParquetError`].
pub fn write(
    path: &Path,
    schema: SchemaRef,
    batches: impl IntoIterator<Item = Result<RecordBatch, ParquetError>>,
) -> Result<(), ParquetError> {
    let mut writer = Writer::create(path, schema)?;
    batches.into_iter().try_for_each(|batch| writer.write(&batch?))?;
    writer.commit()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use arrow_array::{ArrayRef, BooleanArray, Float64Array, StringArray};
    use wire::proto::Agent;

    use super::*;
    use crate::moves;

    /// Rows of all kinds that hardly repeat, from the row `first` on.
    fn batch(first: usize, rows: usize) -> RecordBatch {
        let rows = first..first + rows;
        let text = |row: usize| if row.is_multiple_of(3) { String::new() } else { format!("row {row}") };
        let number = |row: usize| (!row.is_multiple_of(7)).then_some((row as f64).sqrt());
        let agents = |row: usize| {
            let agent =
                |track: usize| Agent { track: track as i32, state: Some(Default::default()), ..Agent::default() };
            (0..row % 4).map(agent).collect::<Vec<_>>()
        };
        let agents: Vec<Vec<Agent>> = rows.clone().map(agents).collect();
        let columns: [(&str, ArrayRef, bool); 4] = [
            ("lists", Arc::new(moves::column(agents.iter().map(Vec::as_slice))), false),
            ("text", Arc::new(StringArray::from_iter_values(rows.clone().map(text))), false),
            ("number", Arc::new(Float64Array::from_iter(rows.clone().map(number))), true),
            ("flag", Arc::new(BooleanArray::from(rows.map(|row| row.is_multiple_of(5)).collect::<Vec<_>>())), false),
        ];
        RecordBatch::try_from_iter_with_nullable(columns).unwrap()
    }

    /// Batches of these lengths, over and over, as long as there are rows.
    fn batches(lengths: &[usize], mut rows: usize) -> Vec<RecordBatch> {
        let mut batches = Vec::new();
        let mut first = 0;
        for length in lengths.iter().cycle() {
            let length = rows.min(*length);
            batches.push(batch(first, length));
            (first, rows) = (first + length, rows - length);
            if rows == 0 {
                break;
            }
        }
        batches
    }

    #[test]
    fn the_bytes_are_those_of_all_columns_encoded_at_once() {
        let root = tempfile::tempdir().unwrap();
        for (lengths, rows) in [
            (&[150, 1, 0, 149][..], ROW_GROUP + 1_000),
            (&[ROW_GROUP][..], 2 * ROW_GROUP),
            (&[3 * ROW_GROUP][..], 2 * ROW_GROUP + 7),
            (&[1][..], 3_000),
        ] {
            let batches = batches(lengths, rows);
            let schema = batches[0].schema();
            let [ours, theirs] = ["ours", "theirs"].map(|name| root.path().join(name));
            write(&ours, Arc::clone(&schema), batches.iter().cloned().map(Ok)).unwrap();
            let properties = WriterProperties::builder()
                .set_compression(Compression::ZSTD(ZstdLevel::default()))
                .set_max_row_group_row_count(Some(ROW_GROUP))
                .set_created_by("reloop".to_owned());
            let file = fs::File::create(&theirs).unwrap();
            let mut writer = ArrowWriter::try_new(file, schema, Some(properties.build())).unwrap();
            batches.iter().for_each(|batch| writer.write(batch).unwrap());
            writer.close().unwrap();
            assert!(fs::read(&ours).unwrap() == fs::read(&theirs).unwrap(), "batches of {lengths:?}");
            // And so are they where several come as one.
            let mut writer = Writer::create(&ours, batches[0].schema()).unwrap();
            for some in batches.chunks(7) {
                let lengths = some.iter().map(RecordBatch::num_rows).collect();
                let one = arrow_select::concat::concat_batches(&batches[0].schema(), some).unwrap();
                writer.write_pieces(one, lengths).unwrap();
            }
            writer.commit().unwrap();
            assert!(fs::read(ours).unwrap() == fs::read(theirs).unwrap(), "batches of {lengths:?} as one");
        }
    }

    #[test]
    fn rows_of_other_columns_are_refused_and_no_file_is_left() {
        let root = tempfile::tempdir().unwrap();
        let rows = batch(0, 3);
        let mut writer = Writer::create(&root.path().join("rows"), rows.schema()).unwrap();
        writer.write(&rows).unwrap();
        let error = writer.write(&rows.project(&[0, 2]).unwrap()).unwrap_err();
        assert_eq!(error.to_string(), "rows do not fit together: Schema error: they have other columns");
        drop(writer);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }
}
