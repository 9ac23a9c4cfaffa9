//! Parquet files: the same rows are the same bytes, and they are read back for tables.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt32Type};
use arrow_array::{Array, BooleanArray, RecordBatch};
use arrow_schema::DataType;
use arrow_select::filter::filter_record_batch;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use thiserror::Error;

use crate::files::{FileError, at};
use crate::trace::TraceError;

pub use writer::{Writer, write};

mod scratch;
mod writer;

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
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("the part of {0} is missing")]
    Part(String),
    #[error("{}: the rows of {scene} do not stand in the order of the run's scenes\nhint: the file was changed; drive the run again into another folder with --out", path.display())]
    Order { path: PathBuf, scene: String },
    #[error("{} has no column {column} of the right type\nhint: another version wrote it; run it again", path.display())]
    Column { path: PathBuf, column: String },
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
        let batches = reader_of(path, None)?.collect::<Result<Vec<_>, _>>()?;
        Ok(Self { path: path.to_owned(), batches })
    }

    /// Reads these columns of `path`, in the rows of these scenes alone: a file of steps is large. A column that is not there is
    /// missed when it is asked for.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn read_of(path: &Path, columns: &[&str], scenes: &BTreeSet<&str>) -> Result<Self, ParquetError> {
        let reader = reader_of(path, Some(columns))?;
        let mut table = Self { path: path.to_owned(), batches: Vec::new() };
        for batch in reader {
            let batch = batch?;
            let one = Self { path: path.to_owned(), batches: vec![batch] };
            let wanted: Vec<bool> = one.text("scene")?.iter().map(|scene| scenes.contains(scene.as_str())).collect();
            if wanted.contains(&true) {
                let kept =
                    one.batches.iter().map(|batch| filter_record_batch(batch, &BooleanArray::from(wanted.clone())));
                table.batches.extend(kept.collect::<Result<Vec<_>, _>>()?);
            }
        }
        Ok(table)
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
        self.number_columns().into_iter().map(|name| Ok((name.clone(), self.number(&name)?))).collect()
    }

    /// The names of the columns of numbers.
    #[must_use]
    pub fn number_columns(&self) -> Vec<String> {
        let Some(first) = self.batches.first() else { return Vec::new() };
        let schema = first.schema();
        let fields = schema.fields().iter().filter(|field| *field.data_type() == DataType::Float64);
        fields.map(|field| field.name().clone()).collect()
    }

    /// A column of numbers.
    ///
    /// # Errors
    /// [`ParquetError::Column`].
    pub fn number(&self, name: &str) -> Result<Vec<Option<f64>>, ParquetError> {
        self.column(name, &DataType::Float64, |array| array.as_primitive::<Float64Type>().iter().collect())
    }

    pub(crate) fn column<T>(
        &self,
        name: &str,
        kind: &DataType,
        values: impl Fn(&dyn Array) -> Vec<T>,
    ) -> Result<Vec<T>, ParquetError> {
        let mut all = Vec::new();
        for batch in &self.batches {
            let array = batch.column_by_name(name).filter(|array| array.data_type() == kind);
            let array = array.ok_or_else(|| missing(&self.path, name))?;
            all.extend(values(array.as_ref()));
        }
        Ok(all)
    }
}

fn missing(path: &Path, column: &str) -> ParquetError {
    ParquetError::Column { path: path.to_owned(), column: column.to_owned() }
}

/// Reads these columns and the scene's; all where none are named.
fn reader_of(path: &Path, columns: Option<&[&str]>) -> Result<ParquetRecordBatchReader, ParquetError> {
    let file = File::open(path).map_err(at("open", path))?;
    let format = |source| ParquetError::Format { path: path.to_owned(), source };
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(format)?;
    let mask = match columns {
        Some(columns) => {
            let named = std::iter::once("scene").chain(columns.iter().copied());
            ProjectionMask::columns(builder.parquet_schema(), named)
        }
        None => ProjectionMask::all(),
    };
    builder.with_projection(mask).build().map_err(format)
}

/// A file's rows scene by scene, as they lie one after the other: a file of steps is never in memory whole.
pub struct ByScene {
    path: PathBuf,
    reader: ParquetRecordBatchReader,
    /// What is read and not yet told.
    rest: Option<RecordBatch>,
}

impl ByScene {
    /// These columns of the file under `path`. A column that is not there is missed when it is asked for.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn open(path: &Path, columns: &[&str]) -> Result<Self, ParquetError> {
        Ok(Self { path: path.to_owned(), reader: reader_of(path, Some(columns))?, rest: None })
    }

    /// All columns of the file under `path`.
    ///
    /// # Errors
    /// [`ParquetError`].
    pub fn open_whole(path: &Path) -> Result<Self, ParquetError> {
        Ok(Self { path: path.to_owned(), reader: reader_of(path, None)?, rest: None })
    }

    fn following(&mut self) -> Result<Option<(String, Table)>, ParquetError> {
        let mut table = Table { path: self.path.clone(), batches: Vec::new() };
        let mut told: Option<String> = None;
        loop {
            let batch = match self.rest.take() {
                Some(batch) => batch,
                None => match self.reader.next().transpose()? {
                    Some(batch) => batch,
                    None => return Ok(told.map(|scene| (scene, table))),
                },
            };
            let names = batch.column_by_name("scene").and_then(|names| names.as_string_opt::<i32>());
            let names = names.ok_or_else(|| missing(&self.path, "scene"))?;
            if names.is_empty() {
                continue;
            }
            let scene = told.get_or_insert_with(|| names.value(0).to_owned());
            let rows = (0..names.len()).take_while(|row| names.value(*row) == scene).count();
            if rows > 0 {
                table.batches.push(batch.slice(0, rows));
            }
            if rows < names.len() {
                self.rest = Some(batch.slice(rows, names.len() - rows));
                return Ok(told.map(|scene| (scene, table)));
            }
        }
    }
}

impl Iterator for ByScene {
    type Item = Result<(String, Table), ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.following().transpose()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::{ArrayRef, Float64Array, StringArray};

    use super::*;

    #[test]
    fn of_some_scenes_some_columns_are_read() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("steps.parquet");
        // Many batches, as a reader hands them out.
        let scenes: Vec<String> = (0..5_000).map(|row| format!("s{}", row % 50)).collect();
        let numbers = || -> ArrayRef { Arc::new(Float64Array::from_iter_values((0..5_000).map(f64::from))) };
        let columns: [(&str, ArrayRef); 3] =
            [("scene", Arc::new(StringArray::from(scenes))), ("x", numbers()), ("y", numbers())];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        write(&path, batch.schema(), [Ok(batch)]).unwrap();
        let table = Table::read_of(&path, &["y", "nowhere"], &BTreeSet::from(["s7", "s49", "no"])).unwrap();
        assert_eq!(table.text("scene").unwrap()[..3], ["s7", "s49", "s7"]);
        let read = table.numbers().unwrap();
        assert_eq!(read.keys().collect::<Vec<_>>(), ["y"]);
        assert_eq!((read["y"].len(), read["y"][2]), (200, Some(57.0)));
        assert!(matches!(table.flags("nowhere"), Err(ParquetError::Column { .. })));
    }
    #[test]
    fn scene_by_scene_each_has_its_rows_wherever_batches_end() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("steps.parquet");
        // Readers hand out 1,024 rows at a time: scenes of 700 lie across that.
        let scenes: Vec<String> = (0..3_500).map(|row| format!("s{}", row / 700)).collect();
        let numbers: ArrayRef = Arc::new(Float64Array::from_iter_values((0..3_500).map(f64::from)));
        let columns: [(&str, ArrayRef); 2] = [("scene", Arc::new(StringArray::from(scenes))), ("x", numbers)];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        write(&path, batch.schema(), [Ok(batch)]).unwrap();
        let read: Vec<_> = ByScene::open(&path, &["x"]).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), 5);
        for (at, (scene, table)) in read.iter().enumerate() {
            let x = &table.numbers().unwrap()["x"];
            assert_eq!((scene.as_str(), x.len(), x[0]), (&*format!("s{at}"), 700, Some(700.0 * at as f64)));
        }
    }
}
