//! What is asked for, resolved; and the file that keeps it.

use std::collections::BTreeMap;

use scenarios::generated::{Family, Parameters};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::super::Failure;
use super::folder::Shard;
use crate::cli::GenerateArguments;

/// What is made.
#[derive(Debug)]
pub struct Settings {
    pub families: Vec<&'static Family>,
    /// Scenes of each family.
    pub count: u32,
    pub seed: u64,
    pub parameters: Parameters,
    /// Scenes in a shard.
    pub shard_size: u32,
    pub gzip: bool,
}

/// The settings as they lie in the folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Written {
    families: Vec<String>,
    count: u32,
    seed: u64,
    shard_size: u32,
    gzip: bool,
    parameters: Parameters,
    /// SHA-256 of each family's first scene: a build that makes other scenes of the same settings does not go on with these.
    first_scenes: BTreeMap<String, String>,
}

const HEAD: &str =
    "# What `scenarios generate` was asked for here. The same command goes on where it was interrupted.\n";

impl Settings {
    /// What `arguments` mean.
    ///
    /// # Errors
    /// [`Failure`] where there is no such family, or it has no such parameter.
    pub fn resolve(arguments: &GenerateArguments) -> Result<Self, Failure> {
        let mut families: Vec<&'static Family> = Vec::new();
        for name in &arguments.family {
            for family in Family::selected(name).ok_or_else(|| Failure::NoFamily(name.clone()))? {
                if !families.contains(&family) {
                    families.push(family);
                }
            }
        }
        let parameters = Parameters::read(&arguments.set)?;
        families.iter().try_for_each(|family| parameters.check(family))?;
        let GenerateArguments { count, seed, shard_size, gzip, .. } = *arguments;
        Ok(Self { families, count, seed, parameters, shard_size, gzip })
    }

    /// Scenes of all families.
    pub fn scenes(&self) -> usize {
        self.families.len() * self.count as usize
    }

    /// A scene as it is written.
    ///
    /// # Errors
    /// [`Failure::Scene`] if it cannot be made, a fault of the family.
    pub fn payload(&self, family: &'static Family, index: u32) -> Result<Vec<u8>, Failure> {
        let id = family.scene_id(self.seed, index);
        family.payload(&id, self.seed, index, &self.parameters).map_err(|problem| Failure::Scene { id, problem })
    }

    /// The settings as they are kept.
    ///
    /// # Errors
    /// As [`Settings::payload`].
    pub fn written(&self) -> Result<Written, Failure> {
        let first = |family: &&'static Family| {
            let digest = Sha256::digest(self.payload(family, 0)?);
            Ok((family.name.to_owned(), digest.iter().map(|byte| format!("{byte:02x}")).collect()))
        };
        Ok(Written {
            families: self.families.iter().map(|family| family.name.to_owned()).collect(),
            count: self.count,
            seed: self.seed,
            shard_size: self.shard_size,
            gzip: self.gzip,
            parameters: self.parameters.clone(),
            first_scenes: self.families.iter().map(first).collect::<Result<_, Failure>>()?,
        })
    }
}

impl Written {
    /// The shards, family by family.
    pub fn shards(&self) -> Vec<Shard> {
        let shards = self.count.div_ceil(self.shard_size.max(1));
        let packed = if self.gzip { ".gz" } else { "" };
        let shard = |family: &String, number: u32| {
            let first = number * self.shard_size;
            Shard {
                name: format!("{family}-{}.tfrecord-{number:05}-of-{shards:05}{packed}", self.seed),
                family: Family::named(family),
                first,
                count: self.shard_size.min(self.count - first),
            }
        };
        self.families.iter().flat_map(|family| (0..shards).map(move |number| shard(family, number))).collect()
    }

    /// The file's text.
    pub fn text(&self) -> String {
        // Every field is a number, text, or a table with text for keys: all that TOML can hold. Seeds are below 2^63.
        HEAD.to_owned() + &toml::to_string(self).unwrap_or_default()
    }

    /// What a file's text says.
    pub fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| error.message().to_owned())
    }

    /// In what this differs from what is `asked` now; nothing if it does not.
    pub fn differences(&self, asked: &Self) -> Vec<String> {
        let families = |written: &Self| written.families.join(",");
        let parameters = |written: &Self| match written.parameters.is_empty() {
            true => "none".to_owned(),
            false => written.parameters.to_string(),
        };
        let all = [
            ("family", families(self), families(asked)),
            ("count", self.count.to_string(), asked.count.to_string()),
            ("seed", self.seed.to_string(), asked.seed.to_string()),
            ("set", parameters(self), parameters(asked)),
            ("shard-size", self.shard_size.to_string(), asked.shard_size.to_string()),
            ("gzip", self.gzip.to_string(), asked.gzip.to_string()),
        ];
        let mut differences: Vec<String> = all
            .into_iter()
            .filter(|(_, there, asked)| there != asked)
            .map(|(name, there, asked)| format!("{name} {there}, not {asked}"))
            .collect();
        if differences.is_empty() && self != asked {
            differences.push("they are of another build of scenarios, which made other scenes of this seed".to_owned());
        }
        differences
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(count: u32, shard_size: u32) -> Written {
        Written {
            families: vec!["curve".into(), "gone".into()],
            count,
            seed: 7,
            shard_size,
            gzip: true,
            parameters: Parameters::read(&["gap=4..7"]).unwrap(),
            first_scenes: BTreeMap::new(),
        }
    }

    #[test]
    fn shards_hold_every_scene_once() {
        for (count, size) in [(1, 1), (10, 3), (9, 3), (2, 100), (100, 1)] {
            let shards = written(count, size).shards();
            let of_first: Vec<u32> = shards
                .iter()
                .filter(|shard| shard.name.starts_with("curve"))
                .flat_map(|shard| shard.first..shard.first + shard.count)
                .collect();
            assert_eq!(of_first, (0..count).collect::<Vec<u32>>(), "{count} by {size}");
        }
        assert_eq!(written(10, 3).shards()[5].name, "gone-7.tfrecord-00001-of-00004.gz");
    }

    #[test]
    fn what_is_written_is_read_again() {
        let written = written(10, 3);
        assert_eq!(Written::parse(&written.text()), Ok(written.clone()));
        insta::assert_snapshot!(written.text());
    }
}
