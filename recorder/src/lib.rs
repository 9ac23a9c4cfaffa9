//! Episodes as files: MCAP for machines, Foxglove and Lichtblick; Rerun for eyes.
//!
//! Nothing is judged here, and nothing decided: what was said on the bus is put in order and written down.
//!
//! ```text
//!   bus ──▶ Sequence ──▶ messages in canonical order ──┬──▶ mcap::EpisodeWriter ──▶ <scene>.mcap
//!            (any order of arrival)                    └──▶ rrd::Drawing ─────────▶ <scene>.rrd
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`message`], [`sequence`] | the product's messages, and their order whatever the order of arrival |
//! | [`mcap`] | the file that everything can be read back from; the same bytes for the same episode |
//! | [`rrd`] | the drawing and its layout |
//! | [`recording`], [`partial_file`] | an episode on its way into its files |
//! | [`desk`], [`record`] | the process on the bus |
//! | [`view`] | the same, into a viewer while it is driven |
//! | [`export`], [`info`] | from a file: the drawing, what it holds |
//! | [`fuzzing`] | what any input must keep |
//! | [`layers`], [`strokes`], [`outline`], [`contacts`], [`origin`], [`palette`] | what both kinds of file draw alike |

pub mod contacts;
pub mod desk;
pub mod export;
pub mod fuzzing;
pub mod info;
pub mod layers;
pub mod mcap;
pub mod message;
pub mod origin;
pub mod outline;
pub mod palette;
pub mod partial_file;
pub mod record;
pub mod recording;
pub mod rrd;
pub mod sequence;
pub mod strokes;
pub mod view;
