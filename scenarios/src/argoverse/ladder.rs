//! A lane's centre line, by its boundaries: the middles of the rungs of a ladder, whose ends are at equal shares of either boundary's length,
//! as Argoverse's own library has it.

use world::geometry::Point3;

/// Points of a centre line are at most so far apart (m).
const SPACING: f64 = 0.5;

/// How many points the centre line between two boundaries has, by their mean length. At least two, unless both are a single point.
pub(super) fn rungs(left: &[Point3], right: &[Point3]) -> f64 {
    let length = 0.5 * (length(left) + length(right));
    if length > 0.0 { (length / SPACING).ceil().max(1.0) + 1.0 } else { 1.0 }
}

/// The centre line of so many points.
pub(super) fn centerline(left: &[Point3], right: &[Point3], rungs: usize) -> Vec<Point3> {
    let middle = |(left, right): (Point3, Point3)| {
        Point3::new(0.5 * (left.x + right.x), 0.5 * (left.y + right.y), 0.5 * (left.z + right.z))
    };
    evenly(left, rungs).zip(evenly(right, rungs)).map(middle).collect()
}

/// `count` points of a line, at equal distances along it, its ends the first and last.
fn evenly(line: &[Point3], count: usize) -> impl Iterator<Item = Point3> {
    let whole = length(line);
    let (mut pair, mut begun) = (0, 0.0);
    let last_pair = line.len().saturating_sub(2);
    (0..count).filter_map(move |index| {
        let along = if count > 1 { whole * index as f64 / (count - 1) as f64 } else { 0.0 };
        let (from, mut to) = (line.get(pair)?, line.get(pair + 1).or(line.first())?);
        let mut from = *from;
        let mut step = distance(&from, to);
        while pair < last_pair && begun + step < along {
            (begun, pair) = (begun + step, pair + 1);
            (from, to) = (line[pair], &line[pair + 1]);
            step = distance(&from, to);
        }
        let share = if step > 0.0 { ((along - begun) / step).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |from: f64, to: f64| from + (to - from) * share;
        Some(Point3::new(mix(from.x, to.x), mix(from.y, to.y), mix(from.z, to.z)))
    })
}

fn length(line: &[Point3]) -> f64 {
    line.windows(2).map(|pair| distance(&pair[0], &pair[1])).sum()
}

fn distance(one: &Point3, other: &Point3) -> f64 {
    let (x, y, z) = (one.x - other.x, one.y - other.y, one.z - other.z);
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_an_arc_is_an_arc() {
        let arc = |radius: f64, count: usize| -> Vec<Point3> {
            let angle = |k: usize| std::f64::consts::FRAC_PI_2 * k as f64 / (count - 1) as f64;
            (0..count).map(|k| Point3::new(radius * libm::cos(angle(k)), radius * libm::sin(angle(k)), 0.0)).collect()
        };
        let (left, right) = (arc(8.0, 90), arc(12.0, 200));
        let rungs = rungs(&left, &right) as usize;
        assert_eq!(rungs, 33, "15.7 m in steps of half a metre");
        let line = centerline(&left, &right, rungs);
        assert!(line.iter().all(|point| (point.xy().norm() - 10.0).abs() < 1e-3));
        assert_eq!((line[0], line[32].y), (Point3::new(10.0, 0.0, 0.0), 10.0));
    }

    #[test]
    fn a_boundary_of_one_point_is_turned_about() {
        let centre = [Point3::default()];
        let line = [Point3::new(4.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0), Point3::new(0.0, 4.0, 2.0)];
        let rungs = rungs(&centre, &line) as usize;
        let middle = centerline(&centre, &line, rungs);
        assert_eq!((middle[0], middle[rungs - 1]), (Point3::new(2.0, 0.0, 0.0), Point3::new(0.0, 2.0, 1.0)));
        assert_eq!(centerline(&centre, &centre, super::rungs(&centre, &centre) as usize), centre);
        assert!(centerline(&[], &line, 3).is_empty());
    }
}
