//! What can be wrong with a pickle.

use thiserror::Error;

use super::{MAX_DEPTH, MAX_OBJECTS, MAX_VALUES};

/// Why a pickle cannot be read, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("byte {byte}: {problem}")]
pub struct PickleError {
    /// Where the operation begins that cannot be done.
    pub byte: usize,
    /// What is wrong.
    pub problem: PickleProblem,
}

/// What is wrong with a pickle.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PickleProblem {
    #[error("the pickle is cut off: {wanted} more bytes belong to it here")]
    CutOff { wanted: usize },
    #[error("the pickle calls for {module}.{name}, which no scene needs: it was not run")]
    Refused { module: String, name: String },
    #[error("the pickle calls {class} with what it does not take")]
    Call { class: &'static str },
    #[error("the pickle calls or builds what is no class")]
    NoClass,
    #[error("the pickle is of protocol {0}; those up to 5 are known")]
    Protocol(u8),
    #[error("{0:#04x} is no operation of pickles")]
    Operation(u8),
    #[error("the pickle holds {0}, which no scene needs")]
    Unwanted(&'static str),
    #[error("an operation takes more values than there are")]
    NoValue,
    #[error("an operation takes values up to a mark, and there is none")]
    NoMark,
    #[error("the pickle recalls value {0}, which it never stored")]
    Memo(u32),
    #[error("an operation adds to what is no {0}")]
    NoContainer(&'static str),
    #[error("a text is not UTF-8, or a number of it none")]
    Text,
    #[error("an integer has more than 64 bits")]
    LargeInteger,
    #[error("NumPy's type {0:?} is none that is known")]
    ArrayType(String),
    #[error("an array of shape {shape:?} and {item} bytes a number has {bytes} bytes")]
    ArrayBytes { shape: Vec<usize>, item: usize, bytes: usize },
    #[error("the pickle holds more than {MAX_VALUES} values")]
    TooManyValues,
    #[error("the pickle holds more than {MAX_OBJECTS} objects")]
    TooManyObjects,
    #[error("values lie more than {MAX_DEPTH} deep in one another")]
    TooDeep,
}

impl PickleProblem {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Refused { .. } | Self::NoClass | Self::Call { .. } => {
                "only NumPy's arrays and plain values are read: if you trust where the file is from, convert it by ScenarioNet of today"
            }
            Self::TooManyValues | Self::TooManyObjects | Self::TooDeep => {
                "it is no scene, or made to do harm: leave it out"
            }
            Self::Protocol(_) | Self::ArrayType(_) | Self::LargeInteger | Self::Unwanted(_) => {
                "write it again by Python's pickle.dump(scene, file, protocol=4), with plain values and NumPy's arrays"
            }
            _ => "the file is cut off, damaged or no pickle: fetch it again and compare its checksum",
        }
    }
}
