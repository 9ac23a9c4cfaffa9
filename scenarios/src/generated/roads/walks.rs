//! Where people walk along the streets.

use super::builder::Builder;
use super::lots;
use super::net::{CROSSWALK, Net};
use super::profile::{Direction, WALK};

/// Sidewalks shorter than this (m) are none.
const SHORTEST: f64 = 8.0;

/// Lays the walks on both sides of a street of the town, outside the curbs: as far as to the crosswalks at its ends, and with gaps where
/// driveways cross them.
pub(super) fn lay(builder: &mut Builder, net: &Net, street: usize, lots: &[lots::Place]) {
    let parts = &net.parts[street];
    let (first, last) = (&net.streets[parts[0]], &net.streets[parts[parts.len() - 1]]);
    if !first.street.walks {
        return;
    }
    let beyond = |stop: bool| if stop { 0.5 * (CROSSWALK.0 + CROSSWALK.1) } else { 0.0 };
    let mut middle = first.middle.clone();
    for part in &parts[1..] {
        middle = middle.then(&net.streets[*part].middle);
    }
    let length = middle.length();
    let from = first.setback[0] - beyond(first.stop[0]);
    let to = length - last.setback[1] + beyond(last.stop[1]);
    for direction in Direction::BOTH {
        let (middle, from, to) = match direction {
            Direction::Forward => (middle.clone(), from, to),
            Direction::Backward => (middle.reversed(), length - to, length - from),
        };
        let mut gaps = lots::openings(lots, street, direction);
        if direction == Direction::Backward {
            gaps = gaps.into_iter().rev().map(|(start, end)| (length - end, length - start)).collect();
        }
        let offset = -first.profile(direction).curb() - WALK;
        let mut at = from;
        for (start, end) in gaps.into_iter().chain([(to, to)]) {
            if start - at > SHORTEST {
                builder.roads.walks.push(middle.strip(at, start, offset).into());
            }
            at = end;
        }
    }
}
