//! From a town to its roads: first where everything lies, then streets, then what joins them.

use super::builder::Builder;
use super::net::Net;
use super::streets::Side;
use super::{Laid, Roads, Town, junctions, streets};

/// Lays a town. The same town gives the same roads, to the last bit.
pub(in crate::generated) fn lay(town: &Town) -> Roads {
    let mut net = Net::new(town);
    net.arrange();
    let mut builder = Builder::default();
    let streets = net.streets.iter().enumerate();
    let sides: Vec<[Side; 2]> = streets.map(|(index, street)| streets::lay(&mut builder, index, street)).collect();
    for node in 0..net.nodes.len() {
        junctions::lay(&mut builder, &net, node, &sides);
    }
    let laid = |[forward, backward]: &[Side; 2]| Laid {
        forward: forward.slots.clone(),
        backward: backward.slots.clone(),
        bikes: [forward.bikes.clone(), backward.bikes.clone()],
    };
    builder.roads.streets = sides.iter().take(town.streets.len()).map(laid).collect();
    builder.roads
}
