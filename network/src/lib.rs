//! The prediction network.

pub mod activation;
pub mod frame;
pub mod gemm;
pub mod inference;
pub mod weights;
