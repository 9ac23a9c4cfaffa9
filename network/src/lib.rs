//! The prediction network of the DIPP paper (section III-B): from a step as a node knows it to three joint futures, the AV's own
//! plan in each, and the weights of the planner's cost. Pure: no file, no message, no learning framework.
//!
//! ```text
//! map, histories, signals ──features──▶ Frame ──inference──▶ Forecast
//!                                                  ▲
//!                            safetensors ──▶ Weights
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`features`] | what a node knows, as the network is asked it: once for logged windows and live drives |
//! | [`frame`] | the question; the paper's tensors, and back |
//! | [`weights`] | the parameters under the authors' names; safetensors |
//! | [`inference`] | the answer, number for number that of the authors' code |
//! | [`gemm`], [`activation`] | products and functions in f32 with the same bits on every machine |
//!
//! **Same bytes.** Every sum has a fixed order and every product is one fused multiply-add, whatever the width of the core's vectors;
//! exponentials are our own. So an answer is the same bytes on every machine, alone and among others. Without an FMA unit (x86-64
//! before 2013) the multiply-adds are computed by software: the same bytes, a hundred times slower.

pub mod activation;
pub mod features;
pub mod frame;
pub mod gemm;
pub mod inference;
pub mod weights;
