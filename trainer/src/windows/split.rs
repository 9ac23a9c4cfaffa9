//! Which scenes are trained on, and which validate: by scene, never by window.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

/// What a scene is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It is learned from.
    Training,
    /// It tells how well was learned.
    Validation,
}

/// Who decides.
#[derive(Clone, Debug, PartialEq)]
pub enum Split {
    /// A hash of the scene's id: about this share validates, the same scenes whatever others there are.
    Share(f64),
    /// A list; scenes that are not on it are left out.
    List(BTreeMap<String, Role>),
}

/// A list of scenes that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SplitError {
    #[error("{}: {source}\nhint: see that the path is right and can be read", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: the first line names no column {column}\nhint: begin with a line such as scenario_id,role", path.display())]
    Column { path: PathBuf, column: &'static str },
    #[error("{}: line {line}: {found:?} is no role\nhint: a scene's role is train or valid", path.display())]
    Role { path: PathBuf, line: usize, found: String },
    #[error("{}: line {line} has too few columns\nhint: each line names a scene and its role", path.display())]
    Short { path: PathBuf, line: usize },
    #[error("{}: line {line}: the scene {scene} has another role above\nhint: leave one of the lines out", path.display())]
    Twice { path: PathBuf, line: usize, scene: String },
}

/// Names of the column with the scene's id.
const SCENE: [&str; 3] = ["scenario_id", "scene_id", "scene"];

impl Split {
    /// The list in a CSV file with the columns `scenario_id` (or `scene`) and `role`, which is `train` or `valid`; no quotes.
    ///
    /// # Errors
    /// [`SplitError`].
    pub fn read(path: &Path) -> Result<Self, SplitError> {
        let text = std::fs::read_to_string(path).map_err(|source| SplitError::Io { path: path.into(), source })?;
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, SplitError> {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let head: Vec<&str> = lines.next().map_or(Vec::new(), |(_, line)| line.split(',').map(str::trim).collect());
        let column = |names: &[&str], column: &'static str| {
            let place = head.iter().position(|name| names.contains(name));
            place.ok_or_else(|| SplitError::Column { path: path.into(), column })
        };
        let (scene, role) = (column(&SCENE, SCENE[0])?, column(&["role"], "role")?);
        let mut list = BTreeMap::new();
        for (line, text) in lines.map(|(index, text)| (index + 1, text)) {
            let cells: Vec<&str> = text.split(',').map(str::trim).collect();
            let (Some(scene), Some(role)) = (cells.get(scene), cells.get(role)) else {
                return Err(SplitError::Short { path: path.into(), line });
            };
            let role = match *role {
                "train" | "training" => Role::Training,
                "valid" | "val" | "validation" => Role::Validation,
                other => {
                    return Err(SplitError::Role { path: path.into(), line, found: other.chars().take(40).collect() });
                }
            };
            if list.insert((*scene).to_owned(), role).is_some_and(|before| before != role) {
                return Err(SplitError::Twice { path: path.into(), line, scene: (*scene).to_owned() });
            }
        }
        Ok(Self::List(list))
    }

    /// What `scene` is for; none where it is left out.
    #[must_use]
    pub fn role(&self, scene: &str) -> Option<Role> {
        match self {
            Self::Share(share) => Some(if fraction(scene) < *share { Role::Validation } else { Role::Training }),
            Self::List(list) => list.get(scene).copied(),
        }
    }
}

/// From 0 to 1, by a hash of the scene's id.
fn fraction(scene: &str) -> f64 {
    let [a, b, c, d, ..] = <[u8; 32]>::from(Sha256::digest(scene.as_bytes()));
    f64::from(u32::from_be_bytes([a, b, c, d])) / 4_294_967_296.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Split, String> {
        Split::parse(Path::new("split.csv"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn about_the_share_validates_and_a_scene_keeps_its_role() {
        let split = Split::Share(0.1);
        let names: Vec<String> = (0..10_000).map(|n| format!("scene-{n}")).collect();
        let count = names.iter().filter(|name| split.role(name) == Some(Role::Validation)).count();
        assert!((900..1100).contains(&count), "{count}");
        let more = Split::Share(0.2);
        let stays = |name: &&String| split.role(name) == Some(Role::Validation);
        assert!(names.iter().filter(stays).all(|name| more.role(name) == Some(Role::Validation)));
        assert!(names.iter().all(|name| Split::Share(0.0).role(name) == Some(Role::Training)));
        assert!(names.iter().all(|name| Split::Share(1.0).role(name) == Some(Role::Validation)));
    }

    #[test]
    fn a_list_names_columns_in_any_order_and_leaves_out_what_it_does_not_name() {
        let split = parse("from,role,scenario_id\r\nx,train,a\r\nx,valid,b\r\n").unwrap();
        assert_eq!(split.role("a"), Some(Role::Training));
        assert_eq!(split.role("b"), Some(Role::Validation));
        assert_eq!(split.role("c"), None);
    }

    #[test]
    fn what_is_wrong_with_a_list_is_said_with_its_line() {
        assert!(parse("").unwrap_err().contains("scenario_id"));
        assert!(parse("scene\na").unwrap_err().contains("column role"));
        assert!(parse("scene,role\na").unwrap_err().contains("line 2 has too few"));
        assert!(parse("scene,role\n\na,test").unwrap_err().contains("line 3: \"test\" is no role"));
        assert!(parse("scene,role\na,train\na,valid").unwrap_err().contains("line 3: the scene a"));
    }
}
