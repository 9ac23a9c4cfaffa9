//! Python's pickles, read without running anything. To Python a pickle is a program, which may call whatever is installed; here it is
//! data, in which the few classes that scenes need (`class`) are known by name, and every other is refused.
//!
//! | | |
//! | --- | --- |
//! | `machine` | the operations, protocols 0 to 5: bytes in, values out |
//! | `class` | which classes are known, and what calling them makes |
//! | `array` | NumPy's types and arrays |
//! | `value` | what comes out, and how to look into it |
//! | `problem` | what can be wrong, and at which byte |
//!
//! No crate does it: `serde-pickle` makes no NumPy objects, and the oldest scenes have values that hold themselves.

mod array;
mod class;
mod input;
mod machine;
mod problem;
mod value;

pub use array::Numbers;
pub use class::Class;
pub use problem::{PickleError, PickleProblem};
pub use value::{Pickle, Place, Value};

pub(crate) use machine::first_id;

/// The most values that a pickle may make: 20 times what the largest scene seen has. With it memory stays below some 600 MB.
pub const MAX_VALUES: usize = 8_000_000;

/// The most lists, tuples, dicts, sets, arrays and so on among them.
pub const MAX_OBJECTS: usize = 2_000_000;

/// How deep values may lie in one another while they are built.
pub const MAX_DEPTH: usize = 1000;
