//! Generated scenes: small, hand-composed, twenty seconds each, made from a seed.
//!
//! They go through the writer and the reader, so that what is driven is what a file would hold.
//!
//! | module | what |
//! | --- | --- |
//! | `families` | the scenes themselves, a file each |
//! | `parameters`, `draw` | what a user may narrow down; what a scene draws |
//! | `roads` | maps |
//! | `curve`, `motion`, `stage` | how actors move, and how that becomes tracks |
//! | `pcg` | random numbers from a seed |

#[allow(dead_code, reason = "the families that use it are on their way")]
mod curve;
mod draw;
mod families;
#[cfg(test)]
mod laws;
mod motion;
mod old_curve;
mod old_junction;
mod old_roads;
mod parameters;
mod pcg;
#[allow(dead_code, reason = "the families that use it are on their way")]
mod roads;
mod stage;

use world::scene::{SceneError, SceneParts};

use self::draw::Draw;
use crate::womd;
#[cfg(test)]
pub(crate) use pcg::Pcg32;

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
    compose: fn(&mut Draw) -> SceneParts,
}

impl PartialEq for Family {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Family {}

/// The word for all families.
pub const ALL: &str = "all";

impl Family {
    /// The families that `name` means: the one that is called so, or each for the word `all`; `None` if there is none.
    #[must_use]
    pub fn selected(name: &str) -> Option<Vec<&'static Self>> {
        if name == ALL { Some(FAMILIES.iter().collect()) } else { Some(vec![Self::named(name)?]) }
    }

    /// The family called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|family| family.name == name)
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
    /// [`SceneError`] if `id` cannot be a scene's name.
    pub fn payload(&self, id: &str, seed: u64, index: u32, parameters: &Parameters) -> Result<Vec<u8>, SceneError> {
        let parts = (self.compose)(&mut Draw::new(seed, index, self.all_parameters(), parameters));
        let (scene, _) = SceneParts { id: id.to_owned(), ..parts }.check()?;
        Ok(womd::write(&scene))
    }
}
