//! How windows are cut out of scenes.

use network::features::Settings;
use serde::{Deserialize, Serialize};

/// What makes a window what it is, beside its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recipe {
    /// Whose features.
    pub features: Whose,
    /// Steps of 0.1 s from one window of a scene to the next.
    pub stride: u32,
    /// Also windows that are driven by other vehicles that move.
    pub others: bool,
}

/// Whose features, and whose zeros for what was not seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Whose {
    /// The authors', to the number, with all their quirks
    Authors,
    /// The same, with what is plainly a bug mended
    #[default]
    Mended,
}

impl From<Whose> for Settings {
    fn from(whose: Whose) -> Self {
        match whose {
            Whose::Authors => Self::Authors,
            Whose::Mended => Self::Mended,
        }
    }
}
