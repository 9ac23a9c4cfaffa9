//! From a town to its roads: first where everything lies, then streets, then what joins them.

use super::builder::Builder;
use super::net::Net;
use super::streets::Side;
use super::{Laid, LaneIndex, Roads, Town, junctions, lots, streets, walks};

/// Lays a town. The same town gives the same roads, to the last bit.
pub(in crate::generated) fn lay(town: &Town) -> Roads {
    let mut net = Net::new(town);
    let places = lots::expand(&mut net, town);
    net.arrange();
    let mut builder = Builder::default();
    let streets = net.streets.iter().enumerate();
    let sides: Vec<[Side; 2]> = streets.map(|(index, street)| streets::lay(&mut builder, index, street)).collect();
    for node in 0..net.nodes.len() {
        junctions::lay(&mut builder, &net, node, &sides);
    }
    lots::lay(&mut builder, &places, &sides);
    for street in 0..town.streets.len() {
        walks::lay(&mut builder, &net, street, &places);
    }
    let laid = |street: usize| laid(&builder.roads, &net, street, &sides);
    builder.roads.streets = (0..net.streets.len()).map(laid).collect();
    builder.roads
}

/// A street with all its parts; those have nothing of their own.
fn laid(roads: &Roads, net: &Net, street: usize, sides: &[[Side; 2]]) -> Laid {
    let parts: &[usize] = match net.parts.get(street) {
        Some(parts) => parts,
        None if net.streets[street].part_of.is_some() => return Laid::default(),
        None => &[street],
    };
    let chain = |way: usize, lanes: &dyn Fn(&Side) -> Vec<LaneIndex>| {
        let parts: Vec<Vec<LaneIndex>> = match way {
            0 => parts.iter().map(|part| lanes(&sides[*part][0])).collect(),
            _ => parts.iter().rev().map(|part| lanes(&sides[*part][1])).collect(),
        };
        joined(roads, parts)
    };
    let slots = |way: usize| {
        let count = sides[street][way].slots.len();
        (0..count).map(|slot| chain(way, &|side| side.slots.get(slot).cloned().unwrap_or_default())).collect()
    };
    Laid { forward: slots(0), backward: slots(1) }
}

/// Lanes of one slot in driving order, with the ways across driveways between them.
fn joined(roads: &Roads, parts: Vec<Vec<LaneIndex>>) -> Vec<LaneIndex> {
    let mut all: Vec<LaneIndex> = Vec::new();
    for part in parts {
        if let (Some(last), Some(first)) = (all.last(), part.first()) {
            let leads = |way: &&LaneIndex| roads.lanes[**way].exits.contains(first);
            all.extend(roads.lanes[*last].exits.iter().find(leads).copied());
        }
        all.extend(part);
    }
    all
}
