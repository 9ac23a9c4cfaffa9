//! Where a street's lanes are cut across: all of them at once, in stretches about as long as real maps' are.

use super::net::NetStreet;
use world::pcg::Pcg32;

/// Lengths (m) of sections, at even shares of all of them. With the ways through junctions, which are neither short nor long, the lanes
/// of a map come out as real ones: half of them below 17 m, a quarter above 36 m.
const LENGTHS: [f64; 9] = [4.5, 6.5, 8.0, 10.0, 13.0, 18.0, 36.0, 75.0, 140.0];

/// How far a pocket is from its stop line where it begins as a lane of its own, and how long its lane needs to get beside the others.
const SOLID: (f64, f64) = (25.0, 48.0);
const TAPER: (f64, f64) = (17.0, 22.0);

/// So many streets of one lane each way, on which nobody changes lanes, are not cut at all.
const WHOLE: f64 = 0.25;

/// And so many of the others only before their stop lines.
const UNCUT: f64 = 0.1;

/// The cuts of a street.
#[derive(Clone, Debug)]
pub(super) struct Sections {
    /// Stations on the middle, from the first stop line to the last.
    pub(super) cuts: Vec<f64>,
    /// How many sections at each end lie before (or behind) a stop line, with solid lines; with a pocket, the next one is its taper.
    pub(super) solid: [usize; 2],
}

impl Sections {
    pub(super) fn new(street: &NetStreet, random: &mut Pcg32) -> Self {
        let (from, to) = street.reach();
        let length = to - from;
        let is_narrow = street.street.forward.max(street.street.backward) == 1 && !street.lot;
        if is_narrow && street.pocket == [false; 2] && random.between(0.0, 1.0) < WHOLE {
            return Self { cuts: vec![from, to], solid: street.stop.map(usize::from) };
        }
        let tapers = [0, 1].map(|end| if street.pocket[end] { random.between(TAPER.0, TAPER.1) } else { 0.0 });
        let mut solids = [0, 1].map(|end| if street.stop[end] { random.between(SOLID.0, SOLID.1) } else { 0.0 });
        let room = (length - tapers[0] - tapers[1] - 4.0).max(1.0);
        let wanted = solids[0] + solids[1];
        if wanted > room {
            solids = solids.map(|solid| solid * room / wanted);
        }
        let mut cuts = vec![from];
        let mut cut = |at: f64| {
            if cuts.last().is_none_or(|last| at > last + 1.0) && at < to - 1.0 {
                cuts.push(at);
            }
        };
        if solids[0] > 0.0 {
            cut(from + solids[0]);
        }
        if tapers[0] > 0.0 {
            cut(from + solids[0] + tapers[0]);
        }
        let (first, last) = (from + solids[0] + tapers[0], to - solids[1] - tapers[1]);
        let mut at = first;
        if random.between(0.0, 1.0) > UNCUT {
            at += draw(random);
            while at <= last - 4.0 {
                cut(at);
                at += draw(random);
            }
        }
        if tapers[1] > 0.0 {
            cut(to - solids[1] - tapers[1]);
        }
        if solids[1] > 0.0 {
            cut(to - solids[1]);
        }
        cuts.push(to);
        let count = cuts.len() - 1;
        let solid = [0, 1].map(|end| usize::from(solids[end] > 0.0).min(count));
        Self { cuts, solid }
    }

    /// The same as seen the other way.
    pub(super) fn reversed(&self, length: f64) -> Self {
        let cuts = self.cuts.iter().rev().map(|cut| length - cut).collect();
        Self { cuts, solid: [self.solid[1], self.solid[0]] }
    }

    pub(super) fn count(&self) -> usize {
        self.cuts.len() - 1
    }

    pub(super) fn span(&self, section: usize) -> (f64, f64) {
        (self.cuts[section], self.cuts[section + 1])
    }

    /// The first section before the stop line at the end, in which no lane is changed.
    pub(super) fn first_solid(&self) -> usize {
        self.count() - self.solid[1]
    }

    /// The sections that a stretch lies in.
    pub(super) fn within(&self, from: f64, to: f64) -> impl Iterator<Item = usize> + '_ {
        (0..self.count()).filter(move |section| self.cuts[*section] < to && self.cuts[section + 1] > from)
    }
}

fn draw(random: &mut Pcg32) -> f64 {
    let at = random.between(0.0, (LENGTHS.len() - 1) as f64);
    let index = (at as usize).min(LENGTHS.len() - 2);
    LENGTHS[index] + (at - index as f64) * (LENGTHS[index + 1] - LENGTHS[index])
}
