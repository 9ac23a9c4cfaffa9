//! A cubic spline through points of the plane, over the chord length along them.

use crate::geometry::{Point, angle_difference};

/// What the spline does at its first and its last point, where nothing says how it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ends {
    /// It straightens out: no curvature at the end, even inside a bend, which bends it over its first two or three pieces (the authors').
    Natural,
    /// It bends on: the curvature at the end is that at its neighbor.
    Continued,
}

/// x and y as cubics between knots.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spline {
    /// Chord length from the first point to each (m); ascending, not strictly.
    knots: Vec<f64>,
    pieces: Vec<Piece>,
}

/// Coefficients of one piece: a + b t + c t^2 + d t^3, t metres from its knot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    a: Point,
    b: Point,
    c: Point,
    d: Point,
}

/// The spline at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SplinePoint {
    pub(crate) position: Point,
    /// First derivative by the parameter.
    pub(crate) first: Point,
    /// Second derivative by the parameter.
    pub(crate) second: Point,
}

impl SplinePoint {
    /// Direction (rad).
    pub(crate) fn heading(&self) -> f64 {
        self.first.heading()
    }

    /// Curvature (1/m), positive to the left; 0 where the spline stands still.
    pub(crate) fn curvature(&self) -> f64 {
        let speed_squared = self.first.norm_squared();
        if speed_squared > 0.0 { self.first.cross(self.second) / (speed_squared * speed_squared.sqrt()) } else { 0.0 }
    }
}

impl Spline {
    /// The spline through `points`, or `None` for fewer than two. `padding` metres are added to each chord where the
    /// coefficients are made, not where they are used: 0, or the authors' 0.001, which allows points to repeat and moves
    /// the spline by up to about a millimetre at its knots. With 0 no point may repeat the one before it.
    pub(crate) fn new(points: &[Point], padding: f64, ends: Ends) -> Option<Self> {
        if points.len() < 2 {
            return None;
        }
        let chords: Vec<f64> = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
        let mut knots = vec![0.0];
        for chord in &chords {
            knots.push(knots[knots.len() - 1] + chord);
        }
        let steps: Vec<f64> = chords.iter().map(|chord| chord + padding).collect();
        let c = second_coefficients(points, &steps, ends);
        let piece = |i: usize| {
            let h = steps[i];
            let slope = (points[i + 1] - points[i]) * (1.0 / h);
            Piece {
                a: points[i],
                b: slope - (c[i + 1] + c[i] * 2.0) * (h / 3.0),
                c: c[i],
                d: (c[i + 1] - c[i]) * (1.0 / (3.0 * h)),
            }
        };
        Some(Self { pieces: (0..steps.len()).map(piece).collect(), knots })
    }

    /// The parameter at the last point (m).
    pub(crate) fn end(&self) -> f64 {
        self.knots[self.knots.len() - 1]
    }

    /// The piece that holds the parameter `s`: after the last knot that is not past it.
    pub(crate) fn piece_at(&self, s: f64) -> usize {
        self.knots.partition_point(|knot| *knot <= s).saturating_sub(1).min(self.pieces.len() - 1)
    }

    /// How far into its piece, from 0 to 1, the parameter `s` lies; with the piece.
    pub(crate) fn place(&self, s: f64) -> (usize, f64) {
        let piece = self.piece_at(s);
        let chord = self.knots[piece + 1] - self.knots[piece];
        let fraction = if chord > 0.0 { ((s - self.knots[piece]) / chord).clamp(0.0, 1.0) } else { 0.0 };
        (piece, fraction)
    }

    /// The spline at the parameter `s` (m).
    pub(crate) fn at(&self, s: f64) -> SplinePoint {
        let index = self.piece_at(s);
        let Piece { a, b, c, d } = self.pieces[index];
        let t = s - self.knots[index];
        SplinePoint {
            position: a + b * t + c * (t * t) + d * (t * t * t),
            first: b + c * (2.0 * t) + d * (3.0 * t * t),
            second: c * 2.0 + d * (6.0 * t),
        }
    }

    /// Parameters of points that lie `spacing` metres of arc apart, from the first point on.
    pub(crate) fn parameters_by_arc(&self, spacing: f64) -> Vec<f64> {
        let mut parameters = vec![0.0];
        let (mut arc, mut wanted) = (0.0, spacing);
        for pair in self.knots.windows(2) {
            // The arc as a chain of chords no longer than half a sample: within 1e-5 m of it on any street.
            let parts = ((pair[1] - pair[0]) / (0.5 * spacing)).ceil().max(1.0);
            let step = (pair[1] - pair[0]) / parts;
            let mut from = self.at(pair[0]).position;
            for part in 0..parts as usize {
                let begin = pair[0] + part as f64 * step;
                let to = self.at(begin + step).position;
                let length = from.distance(to);
                while arc + length >= wanted {
                    parameters.push(begin + step * ((wanted - arc) / length));
                    wanted += spacing;
                }
                (arc, from) = (arc + length, to);
            }
        }
        parameters
    }
}

/// Half the second derivatives at the knots.
fn second_coefficients(points: &[Point], steps: &[f64], ends: Ends) -> Vec<Point> {
    let n = points.len();
    let mut c = inner_coefficients(points, steps, [Point::default(); 2]);
    if ends == Ends::Natural || n < 3 {
        return c;
    }
    // How far the curve turns over its first and last piece: twice its share of the angle between the last two chords.
    let chord = |piece: usize| (points[piece + 1] - points[piece]).heading();
    let turn = |end: usize, inner: usize| {
        2.0 * angle_difference(chord(end), chord(inner)) * steps[end] / (steps[end] + steps[inner])
    };
    let turns = [turn(0, 1), turn(n - 2, n - 3)].map(Point::unit);
    // An end takes less than half of its neighbor's change back, so this settles.
    for _ in 0..SETTLING {
        let at_ends = [turned_back(c[1], turns[0]), turned_back(c[n - 2], turns[1])];
        c = inner_coefficients(points, steps, at_ends);
    }
    c
}

/// Rounds after which the ends have settled to the last bit that matters (2^-50).
const SETTLING: usize = 50;

/// `vector`, turned clockwise by the angle of the unit vector `by`.
fn turned_back(vector: Point, by: Point) -> Point {
    Point::new(by.dot(vector), by.cross(vector))
}

/// Half the second derivatives at the knots where those at the ends are given: a tridiagonal system, by elimination and back
/// substitution. It is diagonally dominant, so no pivoting is needed.
fn inner_coefficients(points: &[Point], steps: &[f64], ends: [Point; 2]) -> Vec<Point> {
    let n = points.len();
    let (mut ratio, mut right) = (vec![0.0; n], vec![Point::default(); n]);
    right[0] = ends[0];
    for i in 1..n - 1 {
        let (before, after) = (steps[i - 1], steps[i]);
        let bend = (points[i + 1] - points[i]) * (3.0 / after) - (points[i] - points[i - 1]) * (3.0 / before);
        let pivot = 2.0 * (before + after) - before * ratio[i - 1];
        ratio[i] = after / pivot;
        right[i] = (bend - right[i - 1] * before) * (1.0 / pivot);
    }
    let mut c = right;
    c[n - 1] = ends[1];
    for i in (1..n - 1).rev() {
        c[i] = c[i] - c[i + 1] * ratio[i];
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points so many metres of arc apart.
    fn circle(radius: f64, points: usize, spacing: f64) -> Vec<Point> {
        (0..points).map(|i| Point::unit(i as f64 * spacing / radius) * radius).collect()
    }

    #[test]
    fn a_spline_that_goes_on_has_the_circles_curvature_up_to_its_ends() {
        let error = |ends: Ends, radius: f64| {
            let spline = Spline::new(&circle(radius, 25, 5.0), 0.0, ends).unwrap();
            let bent = move |s: f64| (spline.at(s).curvature() * radius - 1.0).abs();
            let end = 24.0 * 2.0 * radius * libm::sin(2.5 / radius);
            move |from_end: f64| bent(from_end).max(bent(end - from_end))
        };
        let natural = error(Ends::Natural, 20.0);
        assert!(natural(0.0) > 0.99, "none at all");
        let reach = (0..300).map(|i| 0.1 * f64::from(i)).rfind(|from_end| natural(*from_end) > 0.03).unwrap();
        assert!((10.0..15.0).contains(&reach), "its bend is off by more than 3 % up to {reach} m in");
        for (radius, bound) in [(10.0, 0.03), (20.0, 0.007), (80.0, 0.001)] {
            let continued = error(Ends::Continued, radius);
            let worst = (0..300).map(|i| continued(0.1 * f64::from(i))).fold(0.0, f64::max);
            assert!(worst < bound, "radius {radius}: {worst}");
        }
    }

    #[test]
    fn a_long_last_piece_is_bent_by_no_more_than_the_one_before() {
        // 5 m apart on a bend, and then 60 m on: beyond its points nobody knows how it bends.
        let mut points = circle(20.0, 8, 5.0);
        let (last, before) = (points[7], points[6]);
        points.push(last + (last - before) * 12.0);
        let spline = Spline::new(&points, 0.0, Ends::Continued).unwrap();
        assert!((0..900).all(|i| spline.at(f64::from(i) * 0.1).curvature().abs() < 0.08));
        for few in 2..5 {
            let spline = Spline::new(&points[..few], 0.0, Ends::Continued).unwrap();
            assert!(spline.at(0.0).curvature().is_finite());
        }
    }

    #[test]
    fn points_on_a_circle_give_its_curvature_and_a_right_angle_to_the_radius() {
        let spline = Spline::new(&circle(20.0, 40, 2.0), 0.0, Ends::Natural).unwrap();
        let middle = spline.at(0.5 * spline.end());
        assert!((middle.curvature() - 0.05).abs() < 2e-4, "{}", middle.curvature());
        assert!((middle.position.norm() - 20.0).abs() < 1e-4);
        assert!(middle.position.dot(middle.first).abs() < 1e-3);
    }

    #[test]
    fn samples_by_arc_are_evenly_spaced() {
        let spline = Spline::new(&circle(5.0, 30, 0.5), 0.0, Ends::Natural).unwrap();
        let points: Vec<Point> = spline.parameters_by_arc(0.1).into_iter().map(|s| spline.at(s).position).collect();
        assert!(points.windows(2).all(|pair| (pair[0].distance(pair[1]) - 0.1).abs() < 1e-4));
        // The whole arc is sampled: 2.9 rad of 5 m.
        assert!((145..=146).contains(&points.len()));
    }

    #[test]
    fn the_spline_passes_its_points_without_padding_and_near_them_with_it() {
        let points = circle(20.0, 12, 2.0);
        for (padding, tolerance) in [(0.0, 1e-12), (0.001, 2e-3)] {
            let spline = Spline::new(&points, padding, Ends::Natural).unwrap();
            let mut s = 0.0;
            for pair in points.windows(2) {
                // Just before the knot, so that the piece before it is asked.
                s += pair[0].distance(pair[1]);
                assert!(spline.at(s - 1e-13).position.distance(pair[1]) < tolerance, "padding {padding}");
            }
        }
    }

    #[test]
    fn with_padding_points_may_repeat() {
        let (a, b) = (Point::new(0.0, 0.0), Point::new(10.0, 0.0));
        let spline = Spline::new(&[a, b, b, b, Point::new(20.0, 1.0)], 0.001, Ends::Natural).unwrap();
        for i in 0..200 {
            let at = spline.at(f64::from(i) * 0.1);
            assert!(at.position.x.is_finite() && at.curvature().is_finite());
        }
        assert!(Spline::new(&[a], 0.001, Ends::Natural).is_none());
    }
}
