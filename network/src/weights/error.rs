//! Why a file of weights cannot be used.

use thiserror::Error;

/// What is wrong with a file of weights, by tensor.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WeightsError {
    /// It is no such file.
    #[error(
        "these are no weights in the safetensors format: {0}\n\
         hint: a PyTorch checkpoint is turned into one by safetensors.torch.save_file(state_dict, path)"
    )]
    Format(String),
    /// A tensor is not there.
    #[error("tensor {name} is missing: {shape:?} is expected\nhint: the names are those of the authors' state dict")]
    Missing {
        /// The tensor.
        name: String,
        /// Its shape.
        shape: Vec<usize>,
    },
    /// A tensor that the network does not have.
    #[error("tensor {name} is none of this network's\nhint: the names are those of the authors' state dict")]
    Unknown {
        /// The tensor.
        name: String,
    },
    /// A tensor of another shape.
    #[error("tensor {name} has the shape {got:?}: {expected:?} is expected")]
    Shape {
        /// The tensor.
        name: String,
        /// The network's.
        expected: Vec<usize>,
        /// The file's.
        got: Vec<usize>,
    },
    /// Numbers of a type that is not read.
    #[error("tensor {name} has numbers of type {got}: {expected} is expected")]
    Type {
        /// The tensor.
        name: String,
        /// What is read.
        expected: &'static str,
        /// The file's.
        got: String,
    },
    /// A weight that is no number to reckon with.
    #[error("tensor {name} holds {value} at place {place}: finite numbers are expected")]
    NotFinite {
        /// The tensor.
        name: String,
        /// Where in it, row by row.
        place: usize,
        /// What is there.
        value: f32,
    },
    /// A weight that half precision has no number for.
    #[error("tensor {name} holds {value} at place {place}, which is too large for half precision\nhint: write f32")]
    TooLarge {
        /// The tensor.
        name: String,
        /// Where in it, row by row.
        place: usize,
        /// What is there.
        value: f32,
    },
    /// Features that nobody makes.
    #[error("the metadata say that they were trained on features of the style {0:?}: authors or mended is expected")]
    Features(String),
    /// A constant of the architecture that is another one in the file.
    #[error("tensor {name} holds {got:?}: the architecture has {expected:?}")]
    Constant {
        /// The tensor.
        name: String,
        /// The architecture's.
        expected: Vec<i64>,
        /// The file's.
        got: Vec<i64>,
    },
}
