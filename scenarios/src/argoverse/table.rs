//! Columns of a flat Parquet table.
//!
//! A reader of our own, of what pandas and its like write: plain values and dictionaries, unpacked, Snappy or Zstandard. The library that
//! writes tables here takes what a file claims at its word, and gives up the process where it lies.

use std::collections::BTreeMap;

use thiserror::Error;

use super::footer::{self, Column};
use super::pages::MOST_BYTES;
use super::values::{self, Value};
use crate::budget::Budget;

/// The longest text that is read (bytes): names of tracks, types, scenes.
const LONGEST_TEXT: usize = 256;

/// Why a table, or a column of it, cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum TableError {
    #[error("{0}")]
    Damaged(&'static str),
    #[error("{0}, unlike any scene's")]
    OutOfBounds(&'static str),
    #[error("it has no column {0}")]
    Missing(&'static str),
    #[error("its column {column} has no {expected}")]
    Kind { column: &'static str, expected: &'static str },
    #[error("its column {column} has nothing in row {row}")]
    Nothing { column: &'static str, row: usize },
    #[error("its column {column} has a text of more than {LONGEST_TEXT} bytes, or one that is not UTF-8")]
    Text { column: &'static str },
}

/// A table in memory.
pub(super) struct Table<'a> {
    columns: Vec<Column<'a>>,
    /// How much may still be unpacked (bytes).
    budget: Budget,
}

/// Texts of a column: each once, in the order of their first rows, and for each row the place of its own.
pub(super) struct Texts {
    pub names: Vec<String>,
    pub rows: Vec<usize>,
}

impl<'a> Table<'a> {
    pub fn open(bytes: &'a [u8]) -> Result<Self, TableError> {
        Ok(Self { columns: footer::columns(bytes)?, budget: Budget::new(MOST_BYTES) })
    }

    pub fn has(&self, column: &'static str) -> bool {
        self.find(column).is_ok()
    }

    fn find(&self, column: &'static str) -> Result<&Column<'a>, TableError> {
        let found = self.columns.iter().find(|known| known.name == column.as_bytes());
        found.ok_or(TableError::Missing(column))
    }

    /// Numbers, whole or not; not a number where there is nothing.
    pub fn floats(&self, column: &'static str) -> Result<Vec<f64>, TableError> {
        let mut all = Vec::new();
        self.each(column, "numbers", |value| {
            let float = match value {
                Some(Value::Float(float)) => Some(float),
                Some(Value::Int(int)) => Some(int as f64),
                Some(Value::Bytes(_)) | None => None,
            };
            all.push(float.unwrap_or(f64::NAN));
            float.is_some() || value.is_none()
        })?;
        Ok(all)
    }

    /// Whole numbers, one in each row.
    pub fn ints(&self, column: &'static str) -> Result<Vec<i64>, TableError> {
        let mut all = Vec::new();
        self.each(column, "whole numbers", |value| {
            let int = if let Some(Value::Int(int)) = value { Some(int) } else { None };
            all.push(int);
            int.is_some() || value.is_none()
        })?;
        let there = |(row, value): (usize, Option<i64>)| value.ok_or(TableError::Nothing { column, row });
        all.into_iter().enumerate().map(there).collect()
    }

    /// Texts, one in each row.
    pub fn texts(&self, column: &'static str) -> Result<Texts, TableError> {
        let mut places = BTreeMap::<Vec<u8>, usize>::new();
        let mut texts = Texts { names: Vec::new(), rows: Vec::new() };
        let (mut wrong, mut nothing) = (false, None);
        self.each(column, "texts", |value| {
            let data = match value {
                Some(Value::Bytes(data)) => data,
                Some(_) => return false,
                None => {
                    nothing.get_or_insert(texts.rows.len());
                    &[]
                }
            };
            let next = texts.names.len();
            let place = places.get(data).copied().unwrap_or(next);
            if place == next {
                let text = std::str::from_utf8(data).ok().filter(|text| text.len() <= LONGEST_TEXT);
                wrong |= text.is_none();
                texts.names.push(text.unwrap_or_default().to_owned());
                places.insert(data[..data.len().min(LONGEST_TEXT)].to_vec(), place);
            }
            texts.rows.push(place);
            true
        })?;
        match nothing {
            _ if wrong => Err(TableError::Text { column }),
            Some(row) => Err(TableError::Nothing { column, row }),
            None => Ok(texts),
        }
    }

    /// Gives `take` each row's value, which says whether it is of the `expected` kind.
    fn each(
        &self,
        column: &'static str,
        expected: &'static str,
        mut take: impl FnMut(Option<Value<'_>>) -> bool,
    ) -> Result<(), TableError> {
        let found = self.find(column)?;
        let other = TableError::Kind { column, expected };
        let kind = found.kind.ok_or(other)?;
        let mut fits = true;
        values::each(found, kind, &self.budget, |value| fits &= take(value))?;
        if fits { Ok(()) } else { Err(other) }
    }
}
