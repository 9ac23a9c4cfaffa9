//! Whose features they are.

/// Whose features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Settings {
    /// The authors', to the number, with all their quirks: what their weights were trained on.
    Authors,
    /// With what is plainly a bug mended (`network.md` 4.6): presence is carried instead of read from zeros, histories are filled
    /// in with sizes and types, a lane starts at its nearest point, the nearest lanes come first, single lanes are no
    /// duplicates of each other, a light is shown to its own lane alone, headings wrap, and nothing is rounded before the end.
    #[default]
    Mended,
}

impl Settings {
    /// What files and options call them.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Authors => "authors",
            Self::Mended => "mended",
        }
    }

    /// Those of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Authors, Self::Mended].into_iter().find(|settings| settings.name() == name)
    }
}
