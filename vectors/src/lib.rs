//! Numbers of other implementations, and how far ours are from them.
//!
//! An implementation of the same thing writes down what it computed: *vectors*, NumPy's `.npz` files in a folder, a file a
//! case. A `verify` command computes the same from the same inputs and reports, for each [`Quantity`], the worst deviation, where
//! it is, and whether it is within tolerance.
//!
//! ```text
//! folder ──▶ npz_files ──▶ Npz ──▶ the command's own comparison ──▶ worst_deviation ──▶ Report ──▶ a table
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | `npz` | NumPy's files |
//! | `report` | quantities, tolerances, and the table of the worst |
//! | `folder` | the files of a folder, and where a test finds its folder |
//! | [`fuzzing`] | what every input must keep |

mod folder;
pub mod fuzzing;
mod npz;
mod report;

pub use folder::{FolderError, npz_files, shared};
pub use npz::{Npz, NpzError};
pub use report::{Quantity, Report, absolute, relative, worst_deviation};
