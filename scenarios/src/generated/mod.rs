//! Generated scenes: traffic of twenty seconds, driven from a seed.
//!
//! ```text
//! family ──▶ towns (where) ──▶ roads (lanes, map) ──▶ stage (who) ──▶ traffic (driven) ──▶ perception (seen) ──▶ scene
//! ```
//!
//! They go through the writer and the reader, so that what is driven is what a file would hold. A scene in which something happened that must not
//! (somebody hit somebody) is driven anew with other random numbers.
//!
//! | module | what |
//! | --- | --- |
//! | `families` | what each family is about |
//! | `parameters`, `draw` | what a user may narrow down; what a scene draws |
//! | `towns`, `roads`, `curve` | towns that scenes take place in; how they are laid; the curves of it all |
//! | `stage` | sets a scene: the AV, the family's own actors, everybody else |
//! | `traffic`, `sizes` | how all of them move; how large they are |
//! | `perception` | what of it gets into the log |

mod curve;
mod draw;
mod families;
#[cfg(test)]
mod laws;
mod parameters;
mod perception;
mod roads;
mod sizes;
mod stage;
mod towns;
mod traffic;

use thiserror::Error;
use world::scene::{SceneError, SceneParts};

use self::draw::Draw;
pub use self::stage::Mishap;
use self::stage::Stage;
use self::towns::Place;
use crate::womd::{self, WomdError};
pub use families::FAMILIES;
pub use parameters::{COMMON, Parameter, ParameterError, Parameters};

/// Steps of a generated scene: 20 s.
pub(crate) const STEPS: usize = 200;

/// A kind of scene, composed anew for each seed.
#[derive(Debug)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// What happens in it.
    pub about: &'static str,
    /// What a user may narrow down, besides [`COMMON`].
    pub parameters: &'static [Parameter],
    /// Where it takes place.
    place: fn(&mut Draw) -> Place,
    /// Sends in the AV and the family's own actors.
    act: fn(&mut Stage<'_>),
}

/// The word for all families.
pub const ALL: &str = "all";

impl PartialEq for Family {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Family {}

impl Family {
    /// The family called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|family| family.name == name)
    }

    /// The families that `name` means: the one that is called so, or each for the word `all`; `None` if there is none.
    #[must_use]
    pub fn selected(name: &str) -> Option<Vec<&'static Self>> {
        if name == ALL { Some(FAMILIES.iter().collect()) } else { Some(vec![Self::named(name)?]) }
    }

    /// All that a user may narrow down: what every family has, then its own. Scenes draw them in this order.
    pub fn all_parameters(&self) -> impl Iterator<Item = &'static Parameter> {
        COMMON.iter().chain(self.parameters)
    }

    /// What scene `index` of `seed` is called, where nothing else is said.
    #[must_use]
    pub fn scene_id(&self, seed: u64, index: u32) -> String {
        format!("{}-{seed}-{index}", self.name)
    }

    /// Scene `index` of `seed` as the payload of a WOMD record, under the name `id`. The `parameters` should have been checked
    /// ([`Parameters::check`]): those that the family does not have change nothing, and what is beyond limits gives odd scenes.
    ///
    /// # Errors
    /// [`GeneratedError`] if `id` cannot be a scene's name, or the parameters leave no scene in which all goes well.
    pub fn payload(&self, id: &str, seed: u64, index: u32, parameters: &Parameters) -> Result<Vec<u8>, GeneratedError> {
        let draw = Draw::new(seed ^ self.key(), index, self.all_parameters(), parameters);
        let parts = self.compose(&draw).map_err(|mishap| GeneratedError::NoScene { family: self.name, mishap })?;
        let (scene, _) = SceneParts { id: id.to_owned(), ..parts }.check()?;
        Ok(womd::write(&scene))
    }

    /// A number of its own for each family (its name by FNV-1a), so that two families of one seed do not take place in the same towns.
    fn key(&self) -> u64 {
        let mix = |key: u64, byte: u8| (key ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        self.name.bytes().fold(0xcbf2_9ce4_8422_2325, mix)
    }

    /// The first attempt in which nothing happens that must not; else what happened last.
    fn compose(&self, draw: &Draw) -> Result<SceneParts, Mishap> {
        let mut mishap = Mishap::AvLeaves;
        for town in 0..TOWNS {
            let mut draw = draw.stream(town);
            let place = (self.place)(&mut draw);
            let roads = roads::lay(&place.town);
            for drive in 0..DRIVES {
                let mut stage = Stage::new(&place, &roads, draw.stream(drive));
                (self.act)(&mut stage);
                match stage.play() {
                    Ok(parts) => return Ok(parts),
                    Err(happened) => mishap = happened,
                }
            }
        }
        Err(mishap)
    }
}

/// Towns that are tried for a scene, and drives in each.
const TOWNS: u64 = 12;
const DRIVES: u64 = 6;

/// Why a scene could not be made.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum GeneratedError {
    #[error("with these parameters nothing came of {family} in {} drives; in the last {mishap}", TOWNS * DRIVES)]
    NoScene { family: &'static str, mishap: Mishap },
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Womd(#[from] WomdError),
}
