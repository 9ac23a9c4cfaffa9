//! Points in the cells of a uniform grid, so that the nearest one is found without looking at all of them.

use super::Point;
use super::cells::Cells;

/// A uniform grid over points, which are known by their number. Queries allocate nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct PointGrid {
    points: Vec<Point>,
    cells: Cells,
}

impl PointGrid {
    /// The grid over `points` in cells of about `cell` metres.
    #[must_use]
    pub fn new(points: Vec<Point>, cell: f64) -> Self {
        let cells = Cells::new(points.iter().copied(), cell, points.len(), |cells, index, placed| {
            placed.put(cells.cell_of(points[index]));
        });
        Self { points, cells }
    }

    /// The points, by number.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The point nearest to `point`, and its distance; the first of equals. `None` in an empty grid.
    #[must_use]
    pub fn nearest(&self, point: Point) -> Option<(usize, f64)> {
        self.nearest_where(point, f64::INFINITY, |_| true)
    }

    /// The nearest of the points within `radius` metres (inclusive) that are accepted; the first of those at equal *distance*, as a search by rounded
    /// distances in the order of their numbers would find it.
    #[must_use]
    pub fn nearest_where(&self, point: Point, radius: f64, accept: impl Fn(usize) -> bool) -> Option<(usize, f64)> {
        let (mut nearest, mut best) = (None, radius);
        self.search(point, &mut nearest, &mut best, accept);
        nearest.map(|index| (index, best))
    }

    /// Whether one of the points within `radius` metres (inclusive) is accepted.
    #[must_use]
    pub fn any_within(&self, point: Point, radius: f64, accept: impl Fn(usize) -> bool) -> bool {
        let mut found = false;
        // A hair more, so that rounding of the square keeps what is exactly as far.
        let reach = radius * radius * (1.0 + 1e-12);
        self.cells.walk_outwards(point, reach, |members| {
            let near = |index: usize| point.distance(self.points[index]) <= radius && accept(index);
            found = found || members.iter().any(|member| near(*member as usize));
            if found { f64::NEG_INFINITY } else { reach }
        });
        found
    }

    /// The same answer as [`PointGrid::nearest`], found faster where point number `hint` is nearly the nearest: nothing
    /// farther away than that is looked at.
    #[must_use]
    pub fn nearest_from(&self, point: Point, hint: usize) -> Option<(usize, f64)> {
        let (mut nearest, mut best) = (None, f64::INFINITY);
        if let Some(hinted) = self.points.get(hint) {
            (nearest, best) = (Some(hint), point.distance(*hinted));
        }
        self.search(point, &mut nearest, &mut best, |_| true);
        nearest.map(|index| (index, best))
    }

    fn search(&self, point: Point, nearest: &mut Option<usize>, best: &mut f64, accept: impl Fn(usize) -> bool) {
        self.cells.walk_outwards(point, *best * *best, |members| {
            for index in members.iter().map(|member| *member as usize) {
                let distance = point.distance(self.points[index]);
                let first = distance == *best && nearest.is_none_or(|nearest| index < nearest);
                if (distance < *best || first) && accept(index) {
                    (*nearest, *best) = (Some(index), distance);
                }
            }
            // A hair more, so that rounding of the square keeps what is equally far.
            *best * *best * (1.0 + 1e-12)
        });
    }

    /// Calls `visit` with the number of each point within `radius` metres of `point` (inclusive), in no order to rely on.
    pub fn for_each_near(&self, point: Point, radius: f64, mut visit: impl FnMut(usize)) {
        self.cells.for_each_within(point, radius, |cell| {
            let members = self.cells.members(cell).iter().map(|member| *member as usize);
            members.filter(|index| point.distance(self.points[*index]) <= radius).for_each(&mut visit);
        });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn brute(points: &[Point], point: Point, accept: impl Fn(usize) -> bool) -> Option<usize> {
        let accepted = (0..points.len()).filter(|index| accept(*index));
        accepted.min_by(|a, b| point.distance(points[*a]).total_cmp(&point.distance(points[*b])))
    }

    #[test]
    fn of_equally_near_points_the_first_is_taken() {
        let square = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
        let grid = PointGrid::new(square.iter().map(|(x, y)| Point::new(*x, *y)).collect(), 0.7);
        assert_eq!(grid.nearest(Point::default()).unwrap().0, 0);
        assert_eq!(grid.nearest_from(Point::default(), 3).unwrap().0, 0);
        assert_eq!(grid.nearest_where(Point::default(), 2.0, |index| index > 1).unwrap().0, 2);
    }

    #[test]
    fn an_empty_grid_has_no_nearest_point() {
        let empty = PointGrid::new(Vec::new(), 1.0);
        assert_eq!(empty.nearest(Point::default()), None);
        assert_eq!(empty.nearest_from(Point::default(), 7), None);
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_a_search_of_all_points_finds(
            // A coarse raster, so that ties occur.
            points in prop::collection::vec((-20_i32..20, -20_i32..20), 1..80),
            (x, y) in (-30_i32..30, -30_i32..30), cell in 0.3..15.0, hint in 0_usize..90, radius in 0.0..40.0, modulus in 1_usize..4,
        ) {
            let points: Vec<Point> = points.iter().map(|(x, y)| Point::new(f64::from(*x), f64::from(*y))).collect();
            let point = Point::new(f64::from(x) * 0.5, f64::from(y) * 0.5);
            let grid = PointGrid::new(points.clone(), cell);
            let index = |found: Option<(usize, f64)>| found.map(|(index, _)| index);
            prop_assert_eq!(index(grid.nearest(point)), brute(&points, point, |_| true));
            prop_assert_eq!(grid.nearest_from(point, hint), grid.nearest(point));
            let accept = |index: usize| index.is_multiple_of(modulus);
            let within = |index: usize| accept(index) && point.distance(points[index]) <= radius;
            prop_assert_eq!(index(grid.nearest_where(point, radius, accept)), brute(&points, point, within));
            prop_assert_eq!(grid.any_within(point, radius, accept), (0..points.len()).any(within));
            let mut near = Vec::new();
            grid.for_each_near(point, radius, |index| near.push(index));
            near.sort_unstable();
            let all: Vec<usize> = (0..points.len()).filter(|index| point.distance(points[*index]) <= radius).collect();
            prop_assert_eq!(near, all);
        }
    }
}
