//! Parquet files: the same rows are the same bytes, and they are read back for tables.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt32Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use thiserror::Error;

use crate::files::{FileError, at, write_whole};

/// Rows that are compressed together.
const ROW_GROUP: usize = 1 << 17;

/// A results file that cannot be written or used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ParquetError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{}: {source}", path.display())]
    Format { path: PathBuf, source: parquet::errors::ParquetError },
    #[error("rows do not fit together: {0}")]
    Rows(#[from] arrow_schema::ArrowError),
    #[error("the part of {0} is missing")]
    Part(String),
    #[error("{} has no column {column} of the right type\nhint: another version wrote it; run it again", path.display())]
    Column { path: PathBuf, column: String },
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
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_max_row_group_row_count(Some(ROW_GROUP))
        // The library's version must not change the bytes of a result.
        .set_created_by("reloop".to_owned())
        .build();
    let mut failed = None;
    let written = write_whole(path, |file| {
        let mut writer = ArrowWriter::try_new(file, schema, Some(properties)).map_err(io::Error::other)?;
        for batch in batches {
            match batch {
                Ok(batch) => writer.write(&batch).map_err(io::Error::other)?,
                Err(error) => {
                    failed = Some(error);
                    return Err(io::Error::other("rows are missing"));
                }
            }
        }
        writer.close().map(drop).map_err(io::Error::other)
    });
    failed.map_or_else(|| written.map_err(ParquetError::from), Err)
}

/// A table, read whole.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    batches: Vec<RecordBatch>,
}

impl Table {
    /// Reads `path`.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn read(path: &Path) -> Result<Self, ParquetError> {
        let file = File::open(path).map_err(at("open", path))?;
        let format = |source| ParquetError::Format { path: path.to_owned(), source };
        let reader = ParquetRecordBatchReaderBuilder::try_new(file).map_err(format)?.build().map_err(format)?;
        let batches = reader.collect::<Result<Vec<_>, _>>()?;
        Ok(Self { path: path.to_owned(), batches })
    }

    /// All rows together; none where it has no row.
    ///
    /// # Errors
    /// [`ParquetError::Rows`].
    pub fn whole(&self) -> Result<Option<RecordBatch>, ParquetError> {
        let Some(first) = self.batches.first() else { return Ok(None) };
        Ok(Some(arrow_select::concat::concat_batches(&first.schema(), &self.batches)?))
    }

    /// A column of text.
    ///
    /// # Errors
    /// [`ParquetError::Column`].
    pub fn text(&self, name: &str) -> Result<Vec<String>, ParquetError> {
        let owned = |value: Option<&str>| value.unwrap_or_default().to_owned();
        self.column(name, &DataType::Utf8, |array| array.as_string::<i32>().iter().map(owned).collect())
    }

    /// A column of flags.
    ///
    /// # Errors
    /// [`ParquetError::Column`].
    pub fn flags(&self, name: &str) -> Result<Vec<bool>, ParquetError> {
        self.column(name, &DataType::Boolean, |array| array.as_boolean().iter().map(|v| v == Some(true)).collect())
    }

    /// A column of counts.
    ///
    /// # Errors
    /// [`ParquetError::Column`].
    pub fn counts(&self, name: &str) -> Result<Vec<u32>, ParquetError> {
        self.column(name, &DataType::UInt32, |array| array.as_primitive::<UInt32Type>().values().to_vec())
    }

    /// All columns of numbers, by name.
    ///
    /// # Errors
    /// [`ParquetError::Column`].
    pub fn numbers(&self) -> Result<BTreeMap<String, Vec<Option<f64>>>, ParquetError> {
        let Some(first) = self.batches.first() else { return Ok(BTreeMap::new()) };
        let schema = first.schema();
        let fields = schema.fields().iter().filter(|field| *field.data_type() == DataType::Float64);
        let values = |array: &dyn Array| array.as_primitive::<Float64Type>().iter().collect();
        fields.map(|f| Ok((f.name().clone(), self.column(f.name(), &DataType::Float64, values)?))).collect()
    }

    fn column<T>(
        &self,
        name: &str,
        kind: &DataType,
        values: impl Fn(&dyn Array) -> Vec<T>,
    ) -> Result<Vec<T>, ParquetError> {
        let wrong = || ParquetError::Column { path: self.path.clone(), column: name.to_owned() };
        let mut all = Vec::new();
        for batch in &self.batches {
            let array = batch.column_by_name(name).filter(|array| array.data_type() == kind).ok_or_else(wrong)?;
            all.extend(values(array.as_ref()));
        }
        Ok(all)
    }
}
