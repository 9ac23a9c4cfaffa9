//! Lines with as few points as a picture needs.

/// How far the drawn line may lie from the true one (m): less than a pixel wherever a whole car is in view.
const TOLERANCE: f32 = 0.05;

/// Stretches that are drawn each for itself (steps from point to point): what a line costs grows with its length then, whatever its shape.
const STRETCH: usize = 256;

/// The line without the points that do not show: of those left out none lies farther than the tolerance from what is left (Douglas
/// and Peucker). Ends stay.
#[must_use]
pub fn outline(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![points[0]];
    for from in (0..last).step_by(STRETCH) {
        keep(points, from, last.min(from + STRETCH), &mut kept);
    }
    kept
}

/// Keeps what shows of the stretch from a point that is kept already to another.
fn keep(points: &[[f32; 3]], from: usize, to: usize, kept: &mut Vec<[f32; 3]>) {
    match farthest(points, from, to) {
        Some(between) => {
            keep(points, from, between, kept);
            keep(points, between, to, kept);
        }
        None => kept.push(points[to]),
    }
}

/// The point between two that lies farthest from the straight line that joins them, if that is too far.
fn farthest(points: &[[f32; 3]], from: usize, to: usize) -> Option<usize> {
    let start = points[from];
    let minus = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let along = minus(points[to], start);
    let length = dot(along, along);
    let (mut at, mut most) = (None, TOLERANCE * TOLERANCE);
    for (index, point) in points.iter().enumerate().take(to).skip(from + 1) {
        let offset = minus(*point, start);
        let share = if length > 0.0 { (dot(offset, along) / length).clamp(0.0, 1.0) } else { 0.0 };
        let beside = minus(offset, along.map(|part| share * part));
        let distance = dot(beside, beside);
        if distance > most {
            (at, most) = (Some(index), distance);
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_straight_line_is_its_ends_and_corners_stay() {
        let straight: Vec<[f32; 3]> = (0..100).map(|x| [x as f32, 0.04 * (x % 2) as f32, 3.0]).collect();
        assert_eq!(outline(&straight), [straight[0], straight[99]]);
        let corner = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 9.0, 0.0], [0.0, 0.0, 0.0]];
        assert_eq!(outline(&corner), [corner[0], corner[2], corner[3], corner[4]]);
    }

    #[test]
    fn what_is_no_line_or_no_number_stays_within_its_bounds() {
        assert!(outline(&[]).is_empty());
        assert_eq!(outline(&[[1.0; 3]]), [[1.0; 3]]);
        assert_eq!(outline(&[[1.0; 3]; 9]), [[1.0; 3]; 2]);
        assert_eq!(outline(&[[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3]]).len(), 2);
        assert_eq!(outline(&[[1.0; 3]; 2 * STRETCH + 9]).len(), 4);
    }

    proptest! {
        #[test]
        fn no_point_lies_far_from_what_is_drawn(
            points in proptest::collection::vec(proptest::array::uniform3(-2.0_f32..2.0), 2..60),
        ) {
            let drawn = outline(&points);
            prop_assert_eq!((drawn[0], drawn[drawn.len() - 1]), (points[0], points[points.len() - 1]));
            for point in &points {
                let near = drawn.windows(2).any(|pair| farthest(&[pair[0], *point, pair[1]], 0, 2).is_none());
                prop_assert!(near, "{point:?} is far from {drawn:?}");
            }
        }
    }
}
