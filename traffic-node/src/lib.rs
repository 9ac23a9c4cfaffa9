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
//! Or they follow one of the joint futures that the prediction network foresees ([`Foreseen`]); whoever is in none is driven as `idm`.
//!
//! | module | what |
//! | --- | --- |
//! | [`idm`] | the intelligent driver model, and whose parameters |
//! | [`character`] | how somebody drives; who is whom |
//! | `choice` | which of it all, as it is typed |
//! | `scenery` | everybody at a step, and where each will be |
//! | `driver` | one agent from step to step |
//! | `ahead` | what one follows, and how much room it is given |
//! | `gap_acceptance` | who crosses, and who goes first |
//! | `collision` | the last resort: whom one would drive into within a second and a half |
//! | `signals` | where one stops at red |
//! | `mobil` | changes of lane |
//! | `motion` | from an acceleration to the next state |
//! | `futures` | which of the network's futures is driven, and for how long |
//! | `trajectory` | somebody's part of it, made drivable |
//!
//! The same seed, scene and observations give the same bits, in whatever order agents are told.

mod ahead;
pub mod character;
mod choice;
mod collision;
mod driver;
mod futures;
mod gap_acceptance;
pub mod idm;
mod mobil;
mod motion;
mod scenery;
mod signals;
mod trajectory;

use std::sync::Arc;

use predictor_node::Network;
use wire::node::{StepInput, Traffic, TrafficFactory};
use world::observation::{Briefing, Observation};
use world::traffic::{Taken, TrafficMove, UncheckedMoves, Ways};

pub use ahead::Heed;
pub use character::{Cast, Character};
pub use choice::{Choice, TrafficError, TrafficName, has_network, names};

use crate::driver::Driver;
use crate::futures::Futures;
use crate::scenery::Scenery;
use crate::signals::Lights;

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
        Ok(Box::new(self.company(briefing)))
    }
}

impl Characters {
    /// Those of the episode of `briefing`.
    #[must_use]
    pub fn company(&self, briefing: &Briefing) -> Company {
        Company::new(*self, briefing)
    }
}

/// Traffic that follows the futures of the prediction network.
#[derive(Clone)]
pub struct Foreseen {
    /// Who foresees.
    pub network: Arc<Network>,
    /// Which future is drawn is drawn from this, the scene's name and the step.
    pub seed: u64,
    /// What who follows a future heeds of the others.
    pub heed: Heed,
}

impl Foreseen {
    /// By this network.
    #[must_use]
    pub fn new(network: Network, seed: u64) -> Self {
        Self { network: Arc::new(network), seed, heed: Heed::LastResort }
    }

    /// The agents of the episode of `briefing`.
    #[must_use]
    pub fn company(&self, briefing: &Briefing) -> Company {
        let company = Company::new(Characters { cast: Cast::Idm, seed: self.seed }, briefing);
        let seed = self.seed ^ character::fnv1a(&company.scene);
        let futures = Futures::new(self.network.foresight(briefing), seed);
        Company { futures: Some(futures), heed: self.heed, ..company }
    }
}

impl TrafficFactory for Foreseen {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Traffic>, String> {
        Ok(Box::new(self.company(briefing)))
    }
}

/// The agents of an episode.
pub struct Company {
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
    /// What they follow; none where each drives by himself.
    futures: Option<Futures>,
    /// What who follows one heeds of the others.
    heed: Heed,
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
            futures: None,
            heed: Heed::Everybody,
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

    /// Tells the drivers what they are to follow: all of them where another future is drawn, else those who were met just now.
    fn foresee(&mut self, observation: &Observation) {
        let Some(futures) = &mut self.futures else { return };
        let step = observation.step;
        let is_another = futures.see(observation, !self.drivers.is_empty());
        for driver in self.drivers.iter_mut().filter(|driver| is_another || driver.is_new) {
            driver.follow(step, futures.of(driver.track, step), &self.ways);
        }
    }
}

impl Traffic for Company {
    fn moves(&mut self, step: &StepInput<'_>, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        Ok(self.next(step.observation, taken))
    }
}

impl Company {
    /// Where each of `taken` is a step after `observation`.
    pub fn next(&mut self, observation: &Observation, taken: &[Taken]) -> UncheckedMoves {
        self.meet(taken);
        self.foresee(observation);
        self.scenery.see(observation, &self.drivers);
        self.lights.see(&observation.signals);
        self.wishes.clear();
        for index in 0..self.drivers.len() {
            let room = (self.heed, &mut self.near);
            let wish = self.drivers[index].decide(observation.step, &self.scenery, &self.lights, &self.ways, room);
            self.wishes.push(wish);
        }
        let moves = self
            .drivers
            .iter_mut()
            .zip(&self.wishes)
            .map(|(driver, wish)| TrafficMove { track: driver.track, state: driver.advance(observation.step, *wish) });
        UncheckedMoves { step: observation.step, moves: moves.collect() }
    }
}
