//! Agents that react to the AV and to one another, by character.
//!
//! An episode takes agents over from the log ([`world::traffic`]); here is who drives them from then on. Each goes along its own way, faster
//! or slower by the intelligent driver model, yields where ways cross, stops at red, gives an AV that is partly in its lane room, and changes
//! lanes where that gains something. How, is its [`Character`].
//!
//! ```text
//! observation ─▶ Scenery: everybody's box, where each will be ─┐
//! taken ───────▶ Driver: way, station, speed, character ───────┴─▶ ahead, crossing, signals ─▶ acceleration ─▶ motion ─▶ moves
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`idm`] | the intelligent driver model, and whose parameters |
//! | [`character`] | how somebody drives; who is whom |
//! | `scenery` | everybody at a step, and where each will be |
//! | `driver` | one agent from step to step |
//! | `ahead` | what one follows, and how much room it is given |
//! | `gap_acceptance` | who crosses, and who goes first |
//! | `collision` | the last resort: whom one would drive into within a second and a half |
//! | `signals` | where one stops at red |
//! | `mobil` | changes of lane |
//! | `motion` | from an acceleration to the next state |
//!
//! The same seed, scene and observations give the same bits, in whatever order agents are told.

mod ahead;
pub mod character;
mod collision;
mod driver;
mod gap_acceptance;
pub mod idm;
mod mobil;
mod motion;
mod scenery;
mod signals;

use world::observation::{Briefing, Observation};
use world::traffic::{Taken, TrafficMove, UncheckedMoves, Ways};

pub use character::{Cast, Character};

use crate::driver::Driver;
use crate::scenery::Scenery;
use crate::signals::Lights;

/// Drives agents through one episode.
pub trait Traffic: Send {
    /// Where each of `taken` is a step after `observation`.
    ///
    /// # Errors
    /// A sentence on why that cannot be told; the episode ends as failed with it.
    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String>;
}

/// Makes traffic for each episode.
pub trait TrafficFactory: Send + Sync {
    /// Traffic for the episode of `briefing`.
    ///
    /// # Errors
    /// A sentence on why there can be none; the episode ends as failed with it.
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String>;
}

/// Traffic of characters.
#[derive(Clone, Copy, Debug)]
pub struct Characters {
    /// Who drives.
    pub cast: Cast,
    /// What is drawn is drawn from this, the scene's name and the track's number.
    pub seed: u64,
}

impl TrafficFactory for Characters {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String> {
        Ok(Box::new(Company::new(*self, briefing)))
    }
}

/// The agents of an episode.
struct Company {
    characters: Characters,
    scene: String,
    ways: Ways,
    scenery: Scenery,
    lights: Lights,
    /// In ascending order of track.
    drivers: Vec<Driver>,
    /// The acceleration of each, decided before anybody moves.
    wishes: Vec<f64>,
    /// Room for those whom a driver looks at.
    near: Vec<(f64, usize)>,
}

impl Company {
    fn new(characters: Characters, briefing: &Briefing) -> Self {
        Self {
            characters,
            scene: briefing.scene.to_string(),
            ways: Ways::on(&briefing.map),
            scenery: Scenery::new(&briefing.reference_line),
            lights: Lights::default(),
            drivers: Vec::new(),
            wishes: Vec::new(),
            near: Vec::new(),
        }
    }

    /// Knows the drivers of `taken`, and those alone.
    fn meet(&mut self, taken: &[Taken]) {
        self.drivers.iter_mut().for_each(|driver| driver.is_present = false);
        for agent in taken {
            match self.drivers.binary_search_by_key(&agent.track, |driver| driver.track) {
                Ok(place) => self.drivers[place].see(agent),
                Err(place) => {
                    let character = self.characters.cast.of(self.characters.seed, &self.scene, agent.track);
                    self.drivers.insert(place, Driver::new(agent, character, &self.ways));
                }
            }
        }
        self.drivers.retain(|driver| driver.is_present);
    }
}

impl Traffic for Company {
    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        self.meet(taken);
        self.scenery.see(observation, &self.drivers);
        self.lights.see(&observation.signals);
        self.wishes.clear();
        for index in 0..self.drivers.len() {
            let wish =
                self.drivers[index].decide(observation.step, &self.scenery, &self.lights, &self.ways, &mut self.near);
            self.wishes.push(wish);
        }
        let moves = self
            .drivers
            .iter_mut()
            .zip(&self.wishes)
            .map(|(driver, wish)| TrafficMove { track: driver.track, state: driver.advance(observation.step, *wish) });
        Ok(UncheckedMoves { step: observation.step, moves: moves.collect() })
    }
}
