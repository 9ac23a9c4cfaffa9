//! One of several processes that go through a list together: scenes of a run, or trainings. It is told which it is, or the scheduler says that started it.

mod scheduler;

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

pub use scheduler::{SchedulerError, ShardChoice};

/// A shard: each `of`-th place of a list, from the `number`-th on. Its neighbours have the others, so that what takes long and stands together is spread over all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    number: u32,
    of: u32,
}

/// Numbers that are no shard.
#[derive(Debug, Error)]
#[error("{0:?} is no shard: I/N is meant, with I from 1 to N, as 3/8")]
pub struct NoShard(pub String);

impl Shard {
    /// The shard `number` of `of`, counted from 1.
    ///
    /// # Errors
    /// [`NoShard`] where there is none of that number.
    pub fn new(number: u32, of: u32) -> Result<Self, NoShard> {
        if (1..=of).contains(&number) { Ok(Self { number, of }) } else { Err(NoShard(format!("{number}/{of}"))) }
    }

    /// All shards of so many.
    pub fn all(of: u32) -> impl Iterator<Item = Self> {
        (1..=of).map(move |number| Self { number, of })
    }

    /// Its number, from 1.
    #[must_use]
    pub fn number(self) -> u32 {
        self.number
    }

    /// How many there are.
    #[must_use]
    pub fn of(self) -> u32 {
        self.of
    }

    /// Whether what is at this place of the list, from 0, is its own.
    #[must_use]
    pub fn holds(self, place: usize) -> bool {
        place % self.of as usize == self.number as usize - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = NoShard;

    fn from_str(text: &str) -> Result<Self, NoShard> {
        let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        numbers.and_then(|(number, of)| Self::new(number, of).ok()).ok_or_else(|| NoShard(text.to_owned()))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_in_one_shard_and_shards_differ_by_one_place_at_most() {
        for of in 1..9 {
            let sizes = Shard::all(of).map(|shard| (0..20).filter(|place| shard.holds(*place)).count());
            let sizes: Vec<_> = sizes.collect();
            assert_eq!(sizes.iter().sum::<usize>(), 20);
            assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
        }
    }

    #[test]
    fn a_shard_is_written_as_it_is_read_and_nothing_else_is_one() {
        assert_eq!("3/8".parse::<Shard>().unwrap().to_string(), "3/8");
        for text in ["", "3", "0/8", "9/8", "1/0", "-1/8", "1/8/8", "a/b"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
