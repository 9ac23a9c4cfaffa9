//! Towns that families take place in: a place where it happens, and streets around it that go on for a while.

use std::f64::consts::{FRAC_PI_2, PI};

use world::geometry::Point;

use super::curve::{Piece, straight, turn};
use super::draw::Draw;
use super::roads::{Control, Lot, Middle, Node, Street, Town};

/// The arms of [`crossroads`], by how they lie to somebody who comes along the first: streets of the same numbers.
pub(super) const FROM: usize = 0;
pub(super) const RIGHT: usize = 1;
pub(super) const AHEAD: usize = 2;
pub(super) const LEFT: usize = 3;

/// A town, and which of its streets are the arms of the place where it happens ([`FROM`] ...).
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) town: Town,
    pub(super) arms: [Option<usize>; 4],
}

/// How large a street is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// Lanes each way.
    pub(super) lanes: usize,
    pub(super) limit_mph: f64,
    /// Lanes of their own for those who turn left.
    pub(super) pockets: bool,
}

/// A wide street through a town.
pub(super) fn large(draw: &mut Draw) -> Size {
    let lanes = draw.pick(&[2, 3, 3, 3, 4]);
    Size { lanes, limit_mph: draw.pick(&[35.0, 40.0, 45.0, 45.0]), pockets: true }
}

/// A street of one lane each way.
pub(super) fn small(draw: &mut Draw) -> Size {
    let lanes = 1 + usize::from(draw.chance(0.35));
    Size { lanes, limit_mph: draw.pick(&[25.0, 25.0, 30.0]), pockets: false }
}

/// Something between.
pub(super) fn medium(draw: &mut Draw) -> Size {
    let lanes = draw.pick(&[1, 2, 2, 2, 3]);
    Size { lanes, limit_mph: draw.pick(&[25.0, 30.0, 35.0]), pockets: false }
}

/// A street of a size, with what streets of such a size have.
pub(super) fn street(from: usize, to: usize, size: Size, major: bool, draw: &mut Draw) -> Street {
    let lane_width = draw.between(3.3, 3.7);
    let middle = match size.pockets {
        true if draw.chance(0.6) => Middle::Raised(3.4),
        true => Middle::Painted(3.4),
        false if size.lanes > 1 && draw.chance(0.3) => Middle::Raised(1.6),
        false => Middle::Line,
    };
    Street {
        from,
        to,
        bend: None,
        forward: size.lanes,
        backward: size.lanes,
        lane_width,
        speed_limit_mph: size.limit_mph,
        middle,
        left_pocket: size.pockets,
        bike_lane: size.limit_mph > 30.0 && draw.chance(0.35),
        parking: size.limit_mph <= 30.0 && draw.chance(0.75),
        walks: draw.chance(0.9),
        major,
        crosswalks: Vec::new(),
    }
}

/// Turns and shifts the whole town, as real ones lie.
pub(super) fn laid_out(mut town: Town, draw: &mut Draw) -> Town {
    let turn = draw.between(-PI, PI);
    let (sine, cosine) = libm::sincos(turn);
    let shift = Point::new(draw.between(-4000.0, 4000.0), draw.between(-4000.0, 4000.0));
    for node in &mut town.nodes {
        let Point { x, y } = node.at;
        node.at = Point::new(cosine * x - sine * y, sine * x + cosine * y) + shift;
    }
    for street in &mut town.streets {
        if let Some((heading, _)) = &mut street.bend {
            *heading += turn;
        }
    }
    town
}

/// How the place where it happens is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossroads {
    pub(super) control: Control,
    /// The street that the AV comes along, and the one across.
    pub(super) own: Size,
    pub(super) across: Size,
    /// Which of the two goes first where signs rule.
    pub(super) own_is_major: bool,
    /// Which arms there are besides the first: right, ahead, left.
    pub(super) arms: [bool; 3],
    /// Length of the AV's arm (m).
    pub(super) approach: f64,
}

/// Four streets that meet (or three), and at the far end of each a smaller junction, with streets that go on.
///
/// All arms lead away from it: who comes to it drives backward on them.
pub(super) fn crossroads(place: Crossroads, draw: &mut Draw) -> Place {
    let mut town = Town::default();
    town.nodes.push(Node { at: Point::default(), control: place.control });
    let headings = [-FRAC_PI_2, 0.0, FRAC_PI_2, PI];
    let there = [true, place.arms[0], place.arms[1], place.arms[2]];
    let jitter = |draw: &mut Draw| draw.normal(0.0, 0.05).clamp(-0.12, 0.12);
    let (mut ends, mut arms) = (Vec::new(), [None; 4]);
    for (arm, heading) in headings.into_iter().enumerate() {
        if !there[arm] {
            continue;
        }
        let heading = heading + jitter(draw);
        let along = arm % 2 == 0;
        let size = if along { place.own } else { place.across };
        let length = if arm == FROM { place.approach } else { draw.between(100.0, 170.0) };
        let node = town.nodes.len();
        town.nodes.push(Node { at: Point::unit(heading) * length, control: Control::MinorStop });
        arms[arm] = Some(town.streets.len());
        let mut next = street(0, node, size, along == place.own_is_major, draw);
        let (pieces, turned) = sway(length, draw);
        next.bend = Some((heading, pieces));
        town.nodes[node].at = end_of(Point::default(), heading, next.bend.as_ref());
        town.streets.push(next);
        ends.push((node, heading + turned, size));
    }
    for (node, heading, size) in ends {
        go_on(&mut town, node, heading, size, draw);
    }
    add_lots(&mut town, draw);
    Place { town: laid_out(town, draw), arms }
}

/// No street is quite straight; some bend. The pieces, and how far they turn (rad).
fn sway(length: f64, draw: &mut Draw) -> (Vec<Piece>, f64) {
    let side = if draw.chance(0.5) { 1.0 } else { -1.0 };
    let angle = if draw.chance(0.35) { draw.between(0.25, 0.7) } else { draw.between(0.02, 0.12) };
    // As wide a bend as fits, after some way that is straight.
    let (before, after) = (draw.between(0.3, 0.4) * length, 0.2 * length);
    let radius = (length - before - after) / (1.4 * angle);
    (bend(before, side * angle, radius, after), side * angle)
}

/// Where a bent street ends.
fn end_of(from: Point, heading: f64, bend: Option<&(f64, Vec<Piece>)>) -> Point {
    bend.map_or(from, |(_, pieces)| {
        super::curve::Curve::new(world::geometry::Pose::new(from.x, from.y, heading), pieces).end().position()
    })
}

/// At the far node of a street: side streets, and the street's continuation.
pub(super) fn go_on(town: &mut Town, node: usize, heading: f64, size: Size, draw: &mut Draw) {
    let lights = size.lanes > 1 && draw.chance(0.8);
    let first = town.streets.len();
    let at = town.nodes[node].at;
    let ways: &[(f64, bool)] = match draw.below(6) {
        0 => &[(0.0, true)],
        1 => &[(0.0, true), (FRAC_PI_2, false)],
        2 => &[(0.0, true), (-FRAC_PI_2, false)],
        _ => &[(0.0, true), (FRAC_PI_2, false), (-FRAC_PI_2, false)],
    };
    for (turned, is_same) in ways {
        let end = town.nodes.len();
        let length = if *is_same { draw.between(80.0, 140.0) } else { draw.between(40.0, 80.0) };
        let direction = heading + turned + draw.normal(0.0, 0.03).clamp(-0.08, 0.08);
        let side = if *is_same { size } else { small(draw) };
        let mut next = street(node, end, side, *is_same, draw);
        next.bend = Some((direction, sway(length, draw).0));
        let end = end_of(at, direction, next.bend.as_ref());
        town.nodes.push(Node { at: end, control: Control::Free });
        town.streets.push(next);
    }
    town.nodes[node].control = if lights { Control::Signals } else { Control::MinorStop };
    for street in &mut town.streets {
        if street.from == node || street.to == node {
            street.major |= street.to == node;
        }
    }
    debug_assert!(first < town.streets.len(), "streets go on");
}

/// Parking lots beside some streets, such as are nearly straight.
fn add_lots(town: &mut Town, draw: &mut Draw) {
    let turned =
        |pieces: &[Piece]| pieces.iter().map(|piece| 0.5 * (piece.from + piece.to) * piece.length).sum::<f64>();
    for index in 0..town.streets.len().min(5) {
        let street = &town.streets[index];
        let is_straight = street.bend.as_ref().is_none_or(|(_, pieces)| turned(pieces).abs() < 0.13);
        if draw.chance(0.3) && is_straight {
            let (aisles, bays) = (1 + draw.below(2), 6 + draw.below(8));
            town.lots.push(Lot {
                street: index,
                along: draw.between(0.45, 0.62),
                right: draw.chance(0.5),
                aisles,
                bays,
            });
        }
    }
}

/// A long street with bends, and side streets that give way to it. Street 0 leads to the first node behind the first bend, and so on.
pub(super) fn winding(bends: &[Vec<Piece>], size: Size, draw: &mut Draw) -> Place {
    let mut town = Town::default();
    let mut heading = FRAC_PI_2;
    town.nodes.push(Node { at: Point::default(), control: Control::Free });
    for pieces in bends {
        let from = town.nodes.len() - 1;
        let turned: f64 = pieces.iter().map(|piece| 0.5 * (piece.from + piece.to) * piece.length).sum();
        let end = super::curve::Curve::new(
            world::geometry::Pose::new(town.nodes[from].at.x, town.nodes[from].at.y, heading),
            pieces,
        )
        .end();
        town.nodes.push(Node { at: end.position(), control: Control::Free });
        let mut next = street(from, from + 1, size, true, draw);
        next.bend = Some((heading, pieces.clone()));
        next.left_pocket = false;
        town.streets.push(next);
        heading += turned;
    }
    let last = town.nodes.len() - 1;
    go_on(&mut town, last, heading, size, draw);
    go_on(&mut town, 0, -FRAC_PI_2, size, draw);
    // The first street comes out of its node.
    town.nodes[0].control = Control::MinorStop;
    add_lots(&mut town, draw);
    same_look(&mut town, bends.len());
    Place { town: laid_out(town, draw), arms: [Some(0), None, (bends.len() > 1).then_some(1), None] }
}

/// The first `count` streets are one: they look alike.
fn same_look(town: &mut Town, count: usize) {
    let first = town.streets[0].clone();
    for street in &mut town.streets[1..count] {
        (street.lane_width, street.middle) = (first.lane_width, first.middle);
        (street.bike_lane, street.parking, street.walks) = (first.bike_lane, first.parking, first.walks);
    }
}

/// A straight of `length`, then a turn by `angle` at `radius`, and some more straight.
pub(super) fn bend(length: f64, angle: f64, radius: f64, after: f64) -> Vec<Piece> {
    // The clothoids take as much as the arc leaves.
    let ramp = (0.4 * angle.abs() * radius).min(60.0);
    let mut pieces = vec![straight(length)];
    pieces.extend(turn(angle, radius, ramp));
    pieces.push(straight(after));
    pieces
}
