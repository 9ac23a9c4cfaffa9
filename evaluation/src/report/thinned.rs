//! Polylines of the map without the points that nobody could tell are missing.

use world::geometry::Point;

/// `points` without those nearer than `tolerance` to the line drawn without them (Douglas and Peucker's method, by a stack of its own:
/// lines may be long).
#[must_use]
pub fn thinned(points: &[Point], tolerance: f64) -> Vec<Point> {
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![false; points.len()];
    (kept[0], kept[last]) = (true, true);
    let mut parts = vec![(0, last)];
    while let Some((from, to)) = parts.pop() {
        let way = points[to] - points[from];
        let length = way.norm();
        let off = |index: &usize| {
            let offset = points[*index] - points[from];
            if length > tolerance { way.cross(offset).abs() / length } else { offset.norm() }
        };
        let farthest = (from + 1..to).map(|index| (index, off(&index))).max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((index, distance)) = farthest
            && distance > tolerance
        {
            kept[index] = true;
            parts.extend([(from, index), (index, to)]);
        }
    }
    points.iter().zip(kept).filter(|(_, kept)| *kept).map(|(point, _)| *point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_straight_loses_its_middle_and_bends_stay() {
        let line: Vec<Point> = (0..100).map(|at| Point::new(f64::from(at), 0.0)).collect();
        assert_eq!(thinned(&line, 0.05), [line[0], line[99]]);
        let bend: Vec<Point> =
            (0..100).map(|at| Point::new(f64::from(at.min(50)), f64::from(0.max(at - 50)))).collect();
        assert_eq!(thinned(&bend, 0.05), [bend[0], bend[50], bend[99]]);
        assert_eq!(thinned(&[], 0.05), []);
    }
}
