//! Generated scenes: small, hand-composed, twenty seconds each, made from a seed.
//!
//! They go through the writer and the reader, so that what is driven is what a file would hold.
//!
//! | module | what |
//! | --- | --- |
//! | `families` | the scenes themselves, a file each |
//! | `roads`, `junction` | maps |
//! | `curve`, `motion`, `stage` | how actors move, and how that becomes tracks |
//! | `pcg` | random numbers from a seed |

mod curve;
mod families;
mod junction;
#[cfg(test)]
mod laws;
mod motion;
mod pcg;
mod roads;
mod stage;

use world::scene::{SceneError, SceneParts};

use crate::womd;
pub(crate) use pcg::Pcg32;

pub use families::FAMILIES;

/// Steps of a generated scene: 20 s.
pub(crate) const STEPS: usize = 200;

/// A kind of scene, composed anew for each seed.
#[derive(Debug)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// What happens in it.
    pub about: &'static str,
    compose: fn(&mut Pcg32) -> SceneParts,
}

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

    /// Scene `index` of `seed` as the payload of a WOMD record, under the name `id`.
    ///
    /// # Errors
    /// [`SceneError`] if `id` cannot be a scene's name.
    pub fn payload(&self, id: &str, seed: u64, index: u32) -> Result<Vec<u8>, SceneError> {
        let parts = (self.compose)(&mut Pcg32::new(seed, u64::from(index)));
        let (scene, _) = SceneParts { id: id.to_owned(), ..parts }.check()?;
        Ok(womd::write(&scene))
    }
}
