//! How somebody drives, and who is whom. All that is drawn is drawn from the run's seed, the scene's name and the track's number: never from the
//! order in which agents are met.

use std::fmt;

use world::pcg::Pcg32;
use world::scene::TrackId;

use crate::idm::Idm;

/// Steps by which anybody reacts late, at most.
pub(crate) const LATEST: usize = 15;

/// How somebody drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Character {
    /// How it follows.
    pub idm: Idm,
    /// Speed that is aimed at, as a share of the lane's limit.
    pub eagerness: f64,
    /// Sideways acceleration that is accepted in bends (m/s^2).
    pub lateral_acceleration: f64,
    /// Time that is left between oneself and who crosses (s).
    pub margin: f64,
    /// How far it moves aside for somebody who is partly in its lane (m).
    pub room: f64,
    /// MOBIL's politeness: what others' loss counts.
    pub politeness: f64,
    /// MOBIL's threshold: what a change of lane must gain (m/s^2); infinite for who never changes.
    pub threshold: f64,
    /// Steps by which it reacts late.
    pub delay: usize,
}

/// Who drives the agents that are taken over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cast {
    /// nuPlan's reactive agents.
    #[default]
    Idm,
    /// Waymax's.
    Waymax,
    /// Slow, far behind, patient.
    Cautious,
    /// Fast, close, impatient.
    Assertive,
    /// Late: it reacts to what was there a second and more ago.
    Distracted,
    /// Everybody somebody else.
    Mixed,
}

/// All of them, with the names that they go by.
pub const CASTS: [(&str, Cast); 6] = [
    ("idm", Cast::Idm),
    ("waymax", Cast::Waymax),
    ("cautious", Cast::Cautious),
    ("assertive", Cast::Assertive),
    ("distracted", Cast::Distracted),
    ("mixed", Cast::Mixed),
];

impl fmt::Display for Cast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = CASTS.iter().find(|(_, cast)| cast == self).map_or("", |(name, _)| name);
        f.pad(name)
    }
}

impl Character {
    /// nuPlan's parameters. Politeness and threshold are those of Kesting, Treiber and Helbing, "General lane-changing model MOBIL for
    /// car-following models", 2007 (p between 0.2 and 0.5, threshold 0.1 m/s^2), sideways what passengers like.
    pub const IDM: Self = Self {
        idm: Idm::NUPLAN,
        eagerness: 1.0,
        lateral_acceleration: 2.5,
        margin: 1.0,
        room: 0.5,
        politeness: 0.3,
        threshold: 0.2,
        delay: 0,
    };

    /// Waymax's parameters.
    pub const WAYMAX: Self = Self { idm: Idm::WAYMAX, ..Self::IDM };

    /// Far behind and slow: a headway of 2.2 s is in the upper tenth of what is measured on roads, where 1 to 1.5 s is usual.
    pub const CAUTIOUS: Self = Self {
        idm: Idm { standstill_gap: 2.5, headway: 2.2, acceleration: 0.9, deceleration: 1.6, ..Idm::NUPLAN },
        eagerness: 0.85,
        lateral_acceleration: 1.8,
        margin: 1.8,
        room: 0.6,
        politeness: 0.5,
        threshold: f64::INFINITY,
        delay: 0,
    };

    /// Close and fast: a headway of 0.8 s is in the lower tenth.
    pub const ASSERTIVE: Self = Self {
        idm: Idm { standstill_gap: 1.0, headway: 0.8, acceleration: 2.0, deceleration: 3.0, ..Idm::NUPLAN },
        eagerness: 1.15,
        lateral_acceleration: 3.2,
        margin: 0.5,
        room: 0.3,
        politeness: 0.1,
        threshold: 0.1,
        delay: 0,
    };

    /// nuPlan's parameters, and late: how much is drawn for each, between 1 and 1.5 s.
    pub const DISTRACTED: Self = Self { delay: 10, threshold: f64::INFINITY, room: 0.2, ..Self::IDM };

    /// Who follows a future, and would drive into somebody there: it keeps gaps that nobody likes, and brakes late and hard, so that all else is
    /// left to the future.
    pub const GUARDED: Self = Self {
        idm: Idm { standstill_gap: 0.8, headway: 0.4, acceleration: 3.0, deceleration: 4.0, ..Idm::NUPLAN },
        margin: 0.3,
        room: 0.0,
        threshold: f64::INFINITY,
        ..Self::IDM
    };
}

impl Cast {
    /// The character of a track.
    #[must_use]
    pub fn of(self, seed: u64, scene: &str, track: TrackId) -> Character {
        let mut draw = Pcg32::new(seed ^ fnv1a(scene), u64::from(track.0.cast_unsigned()));
        match self {
            Self::Idm => Character::IDM,
            Self::Waymax => Character::WAYMAX,
            Self::Cautious => Character::CAUTIOUS,
            Self::Assertive => Character::ASSERTIVE,
            Self::Distracted => late(&mut draw),
            // Most people drive as usual; one in ten looks elsewhere.
            Self::Mixed => match draw.bits() % 20 {
                0..8 => Character::IDM,
                8..13 => Character::CAUTIOUS,
                13..18 => Character::ASSERTIVE,
                _ => late(&mut draw),
            },
        }
    }
}

fn late(draw: &mut Pcg32) -> Character {
    let delay = draw.between(10.0, 15.0) as usize;
    Character { delay: delay.min(LATEST), ..Character::DISTRACTED }
}

/// The hash of Fowler, Noll and Vo, 64 bits, variant 1a.
pub(crate) fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_whom_depends_on_seed_scene_and_track_alone() {
        let drawn = |seed, scene: &str| -> Vec<Character> {
            (0..200).map(|track| Cast::Mixed.of(seed, scene, TrackId(track))).collect()
        };
        let first = drawn(1, "a");
        assert_eq!(first, drawn(1, "a"));
        assert_ne!(first, drawn(2, "a"));
        assert_ne!(first, drawn(1, "b"));
        let of = |character: Character| first.iter().filter(|drawn| **drawn == character).count();
        assert!((50..110).contains(&of(Character::IDM)), "two in five: {}", of(Character::IDM));
        assert!((30..70).contains(&of(Character::CAUTIOUS)) && (30..70).contains(&of(Character::ASSERTIVE)));
    }

    #[test]
    fn the_distracted_are_a_second_to_a_second_and_a_half_late() {
        let delays = (0..500).map(|track| Cast::Distracted.of(3, "s", TrackId(track)).delay);
        assert!(delays.clone().all(|delay| (10..=15).contains(&delay)));
        assert!(delays.clone().min() != delays.max());
    }

    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(
            (fnv1a(""), fnv1a("a"), fnv1a("foobar")),
            (0xcbf2_9ce4_8422_2325, 0xaf63_dc4c_8601_ec8c, 0x8594_4171_f739_67e8)
        );
    }
}
