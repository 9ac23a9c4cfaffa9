//! Towns of all kinds, out of a seed.

use world::geometry::Point;

use super::super::*;
use crate::generated::curve::{straight, turn};
use world::pcg::Pcg32;

/// Towns of up to nine junctions in a grid that is out of square, with stubs that lead out of it.
pub(super) fn any_town(seed: u64) -> Town {
    let random = &mut Pcg32::new(seed, 1);
    let (columns, rows) = (random.between(1.0, 3.99) as usize, random.between(1.0, 3.99) as usize);
    let (pitch, jitter) = (random.between(85.0, 200.0), random.between(0.0, 16.0));
    let mut town = Town::default();
    let at = |random: &mut Pcg32, column: f64, row: f64| {
        let off = |random: &mut Pcg32| random.between(-jitter, jitter + 1e-9);
        Point::new(column * pitch + off(random), row * pitch + off(random))
    };
    for row in 0..rows {
        for column in 0..columns {
            let at = at(random, column as f64, row as f64);
            let controls = [Control::Signals, Control::AllWayStop, Control::MinorStop, Control::MinorYield];
            town.nodes.push(Node { at, control: controls[random.between(0.0, 4.0) as usize] });
        }
    }
    let street = |random: &mut Pcg32, from: usize, to: usize| {
        let major = random.between(0.0, 1.0) < 0.5;
        let lanes = |random: &mut Pcg32| random.between(if major { 1.0 } else { 0.6 }, if major { 3.99 } else { 2.5 });
        let chance = |random: &mut Pcg32, share: f64| random.between(0.0, 1.0) < share;
        let middle = match random.between(0.0, 4.0) as usize {
            0 => Middle::Painted(random.between(2.8, 4.5)),
            1 => Middle::Raised(random.between(1.2, 6.0)),
            _ => Middle::Line,
        };
        let forward = lanes(random) as usize;
        let backward = if chance(random, 0.2) { lanes(random) as usize } else { forward };
        Street {
            from,
            to,
            bend: None,
            forward: if forward + backward == 0 { 1 } else { forward },
            backward,
            lane_width: random.between(3.0, 3.8),
            speed_limit_mph: 5.0 * random.between(5.0, 9.99).floor(),
            middle,
            left_pocket: chance(random, 0.7),
            bike_lane: chance(random, 0.3),
            parking: chance(random, 0.4),
            walks: chance(random, 0.7),
            major,
            crosswalks: if chance(random, 0.2) { vec![random.between(0.3, 0.7)] } else { Vec::new() },
        }
    };
    for row in 0..rows {
        for column in 0..columns {
            let node = row * columns + column;
            if column + 1 < columns && random.between(0.0, 1.0) < 0.9 {
                town.streets.push(street(random, node, node + 1));
            }
            if row + 1 < rows && random.between(0.0, 1.0) < 0.9 {
                town.streets.push(street(random, node, node + columns));
            }
            let ways = [
                (-0.6, 0.0, column == 0),
                (0.6, 0.0, column + 1 == columns),
                (0.0, -0.6, row == 0),
                (0.0, 0.6, row + 1 == rows),
            ];
            for (x, y, open) in ways {
                if open && random.between(0.0, 1.0) < 0.85 {
                    let end = at(random, column as f64 + x, row as f64 + y);
                    town.nodes.push(Node { at: end, control: Control::Free });
                    let end = town.nodes.len() - 1;
                    let inward = random.between(0.0, 1.0) < 0.5;
                    let mut stub = street(random, if inward { end } else { node }, if inward { node } else { end });
                    if !inward && columns * rows == 1 && random.between(0.0, 1.0) < 0.6 {
                        let heading = (town.nodes[end].at - town.nodes[node].at).heading();
                        let angle = random.between(0.3, 0.8) * if random.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
                        let mut pieces = vec![straight(40.0)];
                        pieces.extend(turn(angle, random.between(40.0, 90.0), 10.0));
                        pieces.push(straight(30.0));
                        stub.bend = Some((heading, pieces));
                    }
                    town.streets.push(stub);
                }
            }
        }
    }
    town
}

/// A street with nothing special.
fn plain(from: usize, to: usize) -> Street {
    Street {
        from,
        to,
        bend: None,
        forward: 1,
        backward: 1,
        lane_width: 3.5,
        speed_limit_mph: 25.0,
        middle: Middle::Line,
        left_pocket: false,
        bike_lane: false,
        parking: false,
        walks: false,
        major: false,
        crosswalks: Vec::new(),
    }
}

pub(super) fn any_roundabout(seed: u64) -> Town {
    let random = &mut Pcg32::new(seed, 2);
    let control = Control::Roundabout { radius: random.between(12.0, 20.0) };
    let mut town = Town::default();
    town.nodes.push(Node { at: Point::new(5.0, -3.0), control });
    let count = random.between(3.0, 4.99) as usize;
    let walks = random.between(0.0, 1.0) < 0.5;
    for arm in 0..count {
        let heading = (arm as f64 + random.between(-0.15, 0.15)) * std::f64::consts::TAU / count as f64;
        let at = town.nodes[0].at + Point::unit(heading) * random.between(90.0, 160.0);
        town.nodes.push(Node { at, control: Control::Free });
        let painted = Middle::Painted(random.between(0.5, 2.0));
        let middle = if random.between(0.0, 1.0) < 0.5 { painted } else { Middle::Line };
        let bike_lane = random.between(0.0, 1.0) < 0.3;
        let parking = random.between(0.0, 1.0) < 0.3;
        town.streets.push(Street { middle, bike_lane, parking, walks, ..plain(arm + 1, 0) });
    }
    town
}

pub(super) fn any_merge(seed: u64) -> Town {
    let random = &mut Pcg32::new(seed, 3);
    let heading = random.between(-3.0, 3.0);
    let at = |heading: f64, distance: f64| Node { at: Point::unit(heading) * distance, control: Control::Free };
    let mut town = Town::default();
    town.nodes.push(Node { at: Point::default(), control: Control::Merge });
    town.nodes.push(at(heading + std::f64::consts::PI, 200.0));
    town.nodes.push(at(heading, 200.0));
    town.nodes.push(at(heading + std::f64::consts::PI + random.between(0.1, 0.35), 220.0));
    let forward = random.between(1.0, 3.99) as usize;
    let backward = if random.between(0.0, 1.0) < 0.5 { 0 } else { forward };
    let middle = if backward == 0 { Middle::Line } else { Middle::Raised(3.0) };
    let road = |from, to| Street { forward, backward, middle, speed_limit_mph: 45.0, major: true, ..plain(from, to) };
    town.streets.extend([road(1, 0), road(0, 2)]);
    town.streets.push(Street { backward: 0, speed_limit_mph: 35.0, ..plain(3, 0) });
    town
}

pub(super) fn any_lots(seed: u64) -> Town {
    let mut town = any_town(seed);
    let random = &mut Pcg32::new(seed, 4);
    for street in 0..town.streets.len() {
        for _ in 0..random.between(0.0, 2.5) as usize {
            let along = random.between(0.2, 0.8);
            let (aisles, bays) = (random.between(1.0, 3.99) as usize, random.between(4.0, 14.0) as usize);
            town.lots.push(Lot { street, along, right: random.between(0.0, 1.0) < 0.5, aisles, bays });
        }
    }
    town
}

/// A kind of town by its name.
pub(super) type Kind = (&'static str, fn(u64) -> Town);
pub(super) const KINDS: [Kind; 4] =
    [("town", any_town), ("lots", any_lots), ("roundabout", any_roundabout), ("merge", any_merge)];
