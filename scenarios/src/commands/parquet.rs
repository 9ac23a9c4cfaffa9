//! Parquet files: the same rows are the same bytes; what is not known is null.

use std::io;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, RecordBatch};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use super::Failure;
use super::whole_file::write_whole;

/// Writes these columns to `path`; all of one length.
pub fn write(path: &Path, columns: Vec<(&str, ArrayRef)>) -> Result<(), Failure> {
    let bytes =
        encoded(columns).map_err(|error| Failure::Write { path: path.to_owned(), source: io::Error::other(error) })?;
    write_whole(path, &bytes)
}

fn encoded(columns: Vec<(&str, ArrayRef)>) -> Result<Vec<u8>, ParquetError> {
    let batch = RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, array)| (name, array, true)))?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // The library's version must not change the bytes.
        .set_created_by("reloop".to_owned())
        .build();
    let mut writer = ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.into_inner()
}

/// A column of text.
pub fn text(values: impl IntoIterator<Item = String>) -> ArrayRef {
    Arc::new(arrow_array::StringArray::from_iter_values(values))
}

/// A column of numbers.
pub fn numbers(values: impl IntoIterator<Item = Option<f64>>) -> ArrayRef {
    Arc::new(values.into_iter().collect::<arrow_array::Float64Array>())
}

/// A column of counts.
pub fn counts(values: impl IntoIterator<Item = u64>) -> ArrayRef {
    Arc::new(arrow_array::UInt64Array::from_iter_values(values))
}
