//! Looking into a scene's pickle: what is where, errors that say so, and a bound on what is made of it.

use std::fmt;

use thiserror::Error;
use world::geometry::Point3;

use super::ScenarioNetError;
use super::pickle::{Numbers, Pickle, Value};
use crate::budget::Budget;

/// What is wrong with a part of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Wrong {
    #[error("it is missing")]
    Missing,
    #[error("it is {got}, where {expected} should be")]
    Kind { expected: &'static str, got: &'static str },
    #[error("it has {rows} rows of {columns} numbers, where {expected} should be")]
    Shape { expected: &'static str, rows: usize, columns: usize },
    #[error("there is no track {0}")]
    NoTrack(String),
}

/// A pickle, what was taken of it so far, and the place in it for messages.
pub(super) struct Layout<'p> {
    pub pickle: &'p Pickle<'p>,
    /// Values may be shared in a pickle: what is made of them is bounded.
    pub budget: Budget,
}

/// A number a row, or several.
#[derive(Clone, Copy)]
pub(super) enum Rows<'p> {
    Array(Numbers<'p>),
    Items(&'p Pickle<'p>, &'p [Value<'p>]),
}

impl<'p> Layout<'p> {
    pub fn new(pickle: &'p Pickle<'p>) -> Self {
        Self { pickle, budget: Budget::of_a_scene() }
    }

    /// Counts `parts` that are about to be made.
    pub fn spend(&self, parts: usize) -> Result<(), ScenarioNetError> {
        Ok(self.budget.spend(parts)?)
    }

    /// What `dict` has under the first of `keys` that it has, unless that is None.
    pub fn find(&self, dict: Value<'p>, keys: &[&str]) -> Option<Value<'p>> {
        keys.iter().find_map(|key| self.pickle.get(dict, key)).filter(|value| *value != Value::None)
    }

    pub fn int(&self, dict: Value<'p>, keys: &[&str]) -> Option<i64> {
        self.find(dict, keys).and_then(|value| self.pickle.int(value))
    }

    pub fn float(&self, dict: Value<'p>, keys: &[&str]) -> Option<f64> {
        self.find(dict, keys).and_then(|value| self.pickle.float(value))
    }

    pub fn text(&self, dict: Value<'p>, keys: &[&str]) -> Option<&'p str> {
        self.find(dict, keys).and_then(|value| self.pickle.text(value))
    }

    pub fn items(&self, dict: Value<'p>, keys: &[&str]) -> &'p [Value<'p>] {
        self.find(dict, keys).and_then(|value| self.pickle.items(value)).unwrap_or_default()
    }

    pub fn wrong(at: impl fmt::Display, wrong: Wrong) -> ScenarioNetError {
        let at: String = at.to_string().chars().take(200).collect();
        ScenarioNetError::Layout { at, wrong }
    }

    pub fn kind(&self, at: impl fmt::Display, expected: &'static str, value: Value<'p>) -> ScenarioNetError {
        Self::wrong(at, Wrong::Kind { expected, got: self.pickle.kind(value) })
    }

    /// Numbers in rows: an array, or a list of numbers or of lists of such.
    pub fn rows(&self, at: impl fmt::Display, value: Value<'p>) -> Result<Rows<'p>, ScenarioNetError> {
        let array = self.pickle.numbers(value).map(Rows::Array);
        let items = || self.pickle.items(value).map(|items| Rows::Items(self.pickle, items));
        array.or_else(items).ok_or_else(|| self.kind(at, "numbers", value))
    }

    /// Points (m) of two or three coordinates; without a third it is 0.
    pub fn points(&self, at: impl fmt::Display, value: Value<'p>) -> Result<Vec<Point3>, ScenarioNetError> {
        let rows = self.rows(&at, value)?;
        let (count, columns) = (rows.len(), rows.columns());
        if count > 0 && !(2..=3).contains(&columns) {
            let expected = "rows of 2 or 3";
            return Err(Self::wrong(at, Wrong::Shape { expected, rows: count, columns }));
        }
        self.spend(count)?;
        let height = |row| if columns == 3 { rows.at(row, 2) } else { 0.0 };
        Ok((0..count).map(|row| Point3::new(rows.at(row, 0), rows.at(row, 1), height(row))).collect())
    }

    /// A single point (m), by its coordinates in a list or an array.
    pub fn point(&self, value: Value<'p>) -> Option<Point3> {
        let rows = self.rows("", value).ok()?;
        let height = if rows.len() > 2 { rows.at(2, 0) } else { 0.0 };
        (rows.len() >= 2).then(|| Point3::new(rows.at(0, 0), rows.at(1, 0), height))
    }
}

impl Rows<'_> {
    pub fn len(&self) -> usize {
        match self {
            Self::Array(numbers) => numbers.rows,
            Self::Items(_, items) => items.len(),
        }
    }

    /// How many numbers a row has, by the first.
    pub fn columns(&self) -> usize {
        match self {
            Self::Array(numbers) => numbers.columns,
            Self::Items(pickle, items) => {
                let row = |first: &Value<'_>| match pickle.numbers(*first) {
                    Some(numbers) => numbers.rows,
                    None => pickle.items(*first).map_or(1, <[_]>::len),
                };
                items.first().map_or(0, row)
            }
        }
    }

    /// The number in a row and column; not a number where there is none.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        match self {
            Self::Array(numbers) => numbers.at(row, column),
            Self::Items(pickle, items) => {
                let Some(item) = items.get(row).copied() else { return f64::NAN };
                let of_row = || match pickle.numbers(item) {
                    Some(numbers) => numbers.at(column, 0),
                    None => pickle.items(item).and_then(|row| pickle.float(*row.get(column)?)).unwrap_or(f64::NAN),
                };
                pickle.float(item).filter(|_| column == 0).unwrap_or_else(of_row)
            }
        }
    }
}
