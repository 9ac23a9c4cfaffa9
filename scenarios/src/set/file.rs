//! The scene-set TOML.

use serde::Deserialize;
use thiserror::Error;

use crate::generated::Parameters;

/// A scene set as a file says it. Paths are relative to that file's folder.
///
/// ```
/// let set = scenarios::SetFile::parse(r#"
///     files = ["town/training_20s.tfrecord-00014-of-01000", "more"]   # files, or folders to search through
///     globs = ["validation/*.tfrecord*"]
///     scenes = ["eb4b91b10ca94ff2", "following-7-0"]                  # keep these alone; without it, all
///     exclude = ["7b24d74b506c94ce"]                                  # and leave these out
///
///     [[generate]]
///     family = "following"
///     seed = 7
///     count = 3
///     name = "near"                                                   # ids are near-7-0 ..., not following-7-0 ...
///     parameters = { gap = 4.0, traffic = [0.5, 1.5] }                # a number, or a range that each scene draws from
/// "#).unwrap();
/// assert_eq!(set.generate[0].count, 3);
/// assert_eq!(set.generate[0].parameters.to_string(), "gap=4, traffic=0.5..1.5");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetFile {
    /// TFRecord files and folders of them.
    #[serde(default)]
    pub files: Vec<String>,
    /// Globs for such.
    #[serde(default)]
    pub globs: Vec<String>,
    /// Generated scenes.
    #[serde(default)]
    pub generate: Vec<Generate>,
    /// The ids to keep of all that; `None` keeps all.
    pub scenes: Option<Vec<String>>,
    /// The ids to leave out of what is kept.
    #[serde(default)]
    pub exclude: Vec<String>,
}

/// The most scenes of one `[[generate]]`, each of which has an entry in the set.
const MOST_GENERATED: u32 = 100_000;

/// Scenes of one family, or of all.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generate {
    /// The family's name, which `scenarios families` lists, or `all`.
    pub family: String,
    /// Where its random numbers start.
    #[serde(default)]
    pub seed: u64,
    /// How many scenes of each family, at most [`MOST_GENERATED`]; they are called `FAMILY-SEED-0`, `FAMILY-SEED-1` ...
    #[serde(default = "one")]
    pub count: u32,
    /// What they are called instead: `NAME-SEED-0` ...; those of all families `NAME-FAMILY-SEED-0` ...
    pub name: Option<String>,
    /// What is known of the scenes beforehand: a number, or a range that each draws from.
    #[serde(default)]
    pub parameters: Parameters,
}

fn one() -> u32 {
    1
}

/// The text is no scene set.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct TomlProblem(String);

impl SetFile {
    /// The scene set that `text` says.
    ///
    /// # Errors
    /// [`TomlProblem`] names the line.
    pub fn parse(text: &str) -> Result<Self, TomlProblem> {
        let set: Self = toml::from_str(text).map_err(|error| TomlProblem(error.to_string().trim_end().to_owned()))?;
        if set.files.is_empty() && set.globs.is_empty() && set.generate.is_empty() {
            return Err(TomlProblem("it names no scenes: give `files`, `globs` or `[[generate]]`".into()));
        }
        if let Some(wish) = set.generate.iter().find(|wish| wish.count > MOST_GENERATED) {
            let (count, family) = (wish.count, &wish.family);
            return Err(TomlProblem(format!(
                "`count` of {family} is {count}, more than the {MOST_GENERATED} there may be"
            )));
        }
        Ok(set)
    }
}
