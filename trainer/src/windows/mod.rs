//! Examples to learn from: what was known at a step, the line to follow, and what all did in the five seconds after.
//!
//! ```text
//! SceneSet ──▶ cut (a scene's windows, or why not) ──▶ parts (a file a scene) ──▶ joined ──▶ Windows (by number)
//! ```
//!
//! | file | what |
//! | --- | --- |
//! | `window` | one example, and its map with each point written once |
//! | `recipe` | how windows are cut: whose features, how far apart, of whom; and what else such a file may hold |
//! | `transitions` | what the driver `cql` learns from, in files of the same form |
//! | `cut` | the windows of a scene |
//! | `line` | the reference line of a step, in the AV's frame |
//! | `future` | what all did after a step, in the AV's frame |
//! | `split` | which scenes are trained on, and which validate |
//! | `bytes`, `codec`, `head` | the file's layout: numbers, one window, what the file holds |
//! | `file` | windows by number, out of one file or several |
//! | `prepare`, `parts` | from a set of scenes to a file, with many threads, from where it was interrupted |
//! | `error` | what can be wrong with a file |

mod bytes;
mod codec;
mod cut;
mod error;
mod file;
mod future;
mod head;
mod line;
mod parts;
mod prepare;
mod recipe;
mod split;
mod transitions;
mod window;

pub use cut::{Cut, cut};
pub use error::{FileProblem, WindowsError};
pub use file::{Entry, Windows};
pub use head::{SceneRecord, Skipped};
pub use prepare::{Broken, Order, PrepareError, Prepared, prepare};
pub use recipe::{Cutting, Piece, Pieces, Recipe, Whose};
pub use split::{Role, Split, SplitError};
pub use transitions::{Drawn, Experience, Transition, Transitions};
pub use window::{Sketch, Window};

/// For fuzzers: any bytes as one window. What is read is written and read again the same.
pub(crate) fn any_window(bytes: &[u8]) {
    if let Ok(window) = codec::decode(bytes, "any", 20, 7) {
        assert_eq!(codec::decode(&codec::encode(&window), "any", 20, 7), Ok(window));
    }
}

/// For fuzzers: a file whose head has the checksum of what is in it, and so has each window that it names.
pub(crate) fn with_right_checksums(bytes: &[u8]) -> Vec<u8> {
    head::with_right_checksums(bytes)
}

#[cfg(test)]
mod tests;
