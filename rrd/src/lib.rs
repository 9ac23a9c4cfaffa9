//! Rerun's files, from Rerun's own crates below its SDK: the SDK batches by the clock and names things at random, which would make
//! every file another; and it brings a hundred packages more.
//!
//! | module | what |
//! | --- | --- |
//! | [`store`] | a recording or a blueprint while it is written, with counted numbers: the same bytes for the same content |
//! | [`layout`] | a blueprint of views and containers |

pub mod layout;
pub mod store;

pub use layout::Layout;
pub use store::{APPLICATION, RrdError, Standing, Store, columns_chunk, encoder};

use re_sdk_types::components::Color;

/// Red, green, blue, opacity as Rerun takes them.
#[must_use]
pub fn color([red, green, blue, opacity]: [u8; 4]) -> Color {
    Color::from_unmultiplied_rgba(red, green, blue, opacity)
}
