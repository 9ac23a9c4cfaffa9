//! Rows that wait on disk.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, SchemaRef};
use arrow_select::concat::concat_batches;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReaderBuilder};
use parquet::arrow::{ArrowWriter, ProjectionMask};
use parquet::errors::ParquetError as Encoding;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use crate::files::folder_of;

/// Batches one after the other, as one. Where each ends decides where pages end.
pub struct Pile {
    /// All rows.
    pub rows: RecordBatch,
    /// Of each batch.
    pub lengths: Vec<usize>,
}

impl Pile {
    /// Of these piles, which are taken.
    pub fn of(schema: &SchemaRef, piles: &mut Vec<Self>) -> Result<Self, ArrowError> {
        let piles = std::mem::take(piles);
        Ok(Self {
            rows: concat_batches(schema, piles.iter().map(|pile| &pile.rows))?,
            lengths: piles.into_iter().flat_map(|pile| pile.lengths).collect(),
        })
    }

    /// Takes the first rows, at most so many.
    pub fn split_off(&mut self, most: usize) -> Self {
        let fit = self.rows.num_rows().min(most);
        let (mut lengths, mut left) = (Vec::new(), fit);
        let mut rest = Vec::new();
        for length in self.lengths.drain(..) {
            let now = length.min(left);
            left -= now;
            lengths.extend((now > 0).then_some(now));
            rest.extend((length > now).then_some(length - now));
        }
        let rows = self.rows.slice(0, fit);
        self.rows = self.rows.slice(fit, self.rows.num_rows() - fit);
        self.lengths = rest;
        Self { rows, lengths }
    }
}

/// Piles in a file without a name, plain; a row group each.
pub struct Scratch {
    writer: ArrowWriter<File>,
    lengths: Vec<Vec<usize>>,
}

impl Scratch {
    /// Appends a pile to the file, which is made beside `path` if there is none.
    pub fn keep(scratch: &mut Option<Self>, path: &Path, schema: &SchemaRef, pile: Pile) -> Result<(), Encoding> {
        let scratch = match scratch {
            Some(scratch) => scratch,
            None => {
                let plain = WriterProperties::builder()
                    .set_dictionary_enabled(false)
                    .set_statistics_enabled(EnabledStatistics::None)
                    .set_data_page_size_limit(usize::MAX)
                    .build();
                let file = tempfile::tempfile_in(folder_of(path))?;
                let writer = ArrowWriter::try_new(file, SchemaRef::clone(schema), Some(plain))?;
                scratch.insert(Self { writer, lengths: Vec::new() })
            }
        };
        scratch.writer.write(&pile.rows)?;
        scratch.writer.flush()?;
        scratch.lengths.push(pile.lengths);
        Ok(())
    }

    /// All that was kept.
    pub fn read(mut self) -> Result<Kept, Encoding> {
        self.writer.finish()?;
        let file = self.writer.inner().try_clone()?;
        let metadata = ArrowReaderMetadata::load(&file, Default::default())?;
        Ok(Kept { file, metadata, lengths: self.lengths })
    }
}

/// Piles to be read back, a column at a time.
pub struct Kept {
    file: File,
    metadata: ArrowReaderMetadata,
    lengths: Vec<Vec<usize>>,
}

impl Kept {
    /// This column of each pile, and how long the pile's batches are.
    pub fn column(&self, column: usize) -> Result<Vec<(ArrayRef, &Vec<usize>)>, Encoding> {
        let mut pieces = Vec::with_capacity(self.lengths.len() + 1);
        for (pile, lengths) in self.lengths.iter().enumerate() {
            let reader =
                ParquetRecordBatchReaderBuilder::new_with_metadata(self.file.try_clone()?, self.metadata.clone());
            let mask = ProjectionMask::roots(reader.parquet_schema(), [column]);
            let rows = lengths.iter().sum();
            for read in reader.with_row_groups(vec![pile]).with_projection(mask).with_batch_size(rows).build()? {
                pieces.push((Arc::clone(read?.column(0)), lengths));
            }
        }
        Ok(pieces)
    }
}
