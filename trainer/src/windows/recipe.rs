//! How windows are cut out of scenes, and how whatever else is kept in such files is.

use std::collections::BTreeMap;

use network::features::Settings;
use serde::{Deserialize, Serialize};
use world::scene::Scene;

use super::codec;
use super::cut::cut;

/// What a file is made of: pieces of scenes.
pub trait Cutting: Sync {
    /// How, as TOML: files of other text are other files.
    fn text(&self) -> String;
    /// A scene's.
    fn pieces(&self, scene: &Scene) -> Pieces;
}

/// What a scene gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pieces {
    /// In the order of the file.
    pub pieces: Vec<Piece>,
    /// How many there would have been more, by the reason why not.
    pub skipped: BTreeMap<&'static str, u32>,
}

/// A piece as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// The step of the log that is now.
    pub step: u32,
    /// The track that is driven as the AV.
    pub av: i32,
    /// What it holds.
    pub bytes: Vec<u8>,
}

impl Cutting for Recipe {
    fn text(&self) -> String {
        toml::to_string(self).unwrap_or_default() // three plain values
    }

    fn pieces(&self, scene: &Scene) -> Pieces {
        let cut = cut(scene, self);
        let piece = |window: &super::Window| Piece { step: window.step, av: window.av, bytes: codec::encode(window) };
        Pieces { pieces: cut.windows.iter().map(piece).collect(), skipped: cut.skipped }
    }
}

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
