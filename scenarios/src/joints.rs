//! Links between lanes of maps that do not say how they hang together: where one ends, the next begins.

use world::geometry::Point;
use world::map::Lane;

use crate::budget::{Budget, TooLarge};

/// How far apart they may be (m): the converters keep ends to the last bit, or cut them off.
const REACH: f64 = 0.1;

/// The least cosine of the angle between them: 60 degrees.
const LEAST_COSINE: f64 = 0.5;

/// Links lanes whose ends meet and which go on in about the same direction: those for cars with each other, and bike lanes with each other.
pub(crate) fn link(lanes: &mut [Lane], budget: &Budget) -> Result<(), TooLarge> {
    let mut begins: Vec<(Point, usize)> =
        lanes.iter().enumerate().filter_map(|(place, lane)| Some((lane.centerline.first()?.xy(), place))).collect();
    begins.retain(|(point, _)| point.x.is_finite());
    begins.sort_by(|one, other| one.0.x.total_cmp(&other.0.x).then(one.1.cmp(&other.1)));
    for place in 0..lanes.len() {
        let Some(end) = lanes[place].centerline.last().map(|point| point.xy()) else { continue };
        let first = begins.partition_point(|(begin, _)| begin.x < end.x - REACH);
        let mut nexts = Vec::new();
        for (begin, next) in begins[first..].iter().take_while(|(begin, _)| begin.x <= end.x + REACH) {
            budget.spend(1)?;
            let is_for_the_same = lanes[place].kind.is_drivable() == lanes[*next].kind.is_drivable();
            if *next != place
                && is_for_the_same
                && begin.distance(end) <= REACH
                && goes_on(&lanes[place], &lanes[*next])
            {
                nexts.push(*next);
            }
        }
        nexts.sort_unstable();
        for next in nexts {
            let (from, to) = (lanes[place].id, lanes[next].id);
            lanes[place].exits.push(to);
            lanes[next].entries.push(from);
        }
    }
    Ok(())
}

fn goes_on(lane: &Lane, next: &Lane) -> bool {
    let step = |from: Option<&world::geometry::Point3>, to: Option<&world::geometry::Point3>| {
        let (from, to) = (from?.xy(), to?.xy());
        Some(Point::new(to.x - from.x, to.y - from.y))
    };
    let (line, on) = (&lane.centerline, &next.centerline);
    let last = step(line.len().checked_sub(2).and_then(|place| line.get(place)), line.last());
    let (Some(last), Some(first)) = (last, step(on.first(), on.get(1))) else { return false };
    last.x * first.x + last.y * first.y > LEAST_COSINE * last.norm() * first.norm()
}
