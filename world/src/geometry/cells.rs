//! The cells of a uniform grid: which one a point is in, what each holds, and walking outwards from one in rings.

use super::Point;

/// Cells along either axis at most; beyond that they are made larger.
const MAX_CELLS_PER_AXIS: f64 = 512.0;

/// Cells for each thing at most: a walk over a huge map of a few points must not pass through a void cell by cell.
const MAX_CELLS_PER_THING: f64 = 16.0;

/// Members for each thing at most, on average; beyond that cells are made larger. A hostile map of long segments would fill all
/// cells otherwise.
const MAX_MEMBERS_PER_THING: usize = 16;

/// Members that any grid may have.
const FREE_MEMBERS: usize = 1 << 16;

/// Slack for the rounding of cell borders (m).
const HAIR: f64 = 1e-6;

/// A uniform grid whose cells hold numbers of things.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    origin: Point,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Where the members of each cell begin in `members`; one more than there are cells.
    starts: Vec<u32>,
    members: Vec<u32>,
}

/// A cell by its column and row.
pub(super) type Cell = (usize, usize);

/// Which thing was put into which cell.
pub(super) struct Placed {
    columns: usize,
    /// The thing that is being put.
    thing: u32,
    /// Number of a cell, and a thing in it.
    places: Vec<(u32, u32)>,
}

impl Placed {
    /// The thing is in this cell.
    pub(super) fn put(&mut self, (column, row): Cell) {
        self.places.push(((row * self.columns + column) as u32, self.thing));
    }
}

impl Cells {
    /// Cells of about `cell` metres over the bounds of `points`; `put` tells for each of `count` things the cells that it is in.
    pub(super) fn new(
        points: impl Iterator<Item = Point>,
        cell: f64,
        count: usize,
        put: impl Fn(&Self, usize, &mut Placed),
    ) -> Self {
        let (low, high) = bounds(points);
        let (width, height) = (high.x - low.x, high.y - low.y);
        let sparse = (width * height / (MAX_CELLS_PER_THING * (count + 1) as f64)).sqrt();
        let mut cell = cell.max(width.max(height) / MAX_CELLS_PER_AXIS).max(sparse).max(1e-3);
        let most_members = FREE_MEMBERS + MAX_MEMBERS_PER_THING * count;
        let (mut cells, placed) = loop {
            let cells_along = |low: f64, high: f64| ((high - low) / cell) as usize + 1;
            let (columns, rows) = (cells_along(low.x, high.x), cells_along(low.y, high.y));
            let cells = Self { origin: low, cell, columns, rows, starts: Vec::new(), members: Vec::new() };
            let mut placed = Placed { columns, thing: 0, places: Vec::with_capacity(count) };
            for thing in 0..count {
                placed.thing = thing as u32;
                put(&cells, thing, &mut placed);
                if placed.places.len() > most_members {
                    break;
                }
            }
            // In a single cell each thing is once.
            if placed.places.len() <= most_members || columns * rows == 1 {
                break (cells, placed.places);
            }
            cell *= 2.0;
        };
        // A counting sort: how many in each cell, then where each cell begins, then who.
        let mut starts = vec![0_u32; cells.columns * cells.rows + 1];
        placed.iter().for_each(|(cell, _)| starts[*cell as usize + 1] += 1);
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut members = vec![0; placed.len()];
        let mut next = starts.clone();
        for (cell, thing) in placed {
            let place = &mut next[cell as usize];
            members[*place as usize] = thing;
            *place += 1;
        }
        (cells.starts, cells.members) = (starts, members);
        cells
    }

    /// The cell of `point`; the nearest one, if it lies outside.
    pub(super) fn cell_of(&self, point: Point) -> Cell {
        (self.column(point.x), self.row(point.y))
    }

    // `as` saturates: what lies outside falls into the outermost cells, and what is not a number into the first.
    fn column(&self, x: f64) -> usize {
        (((x - self.origin.x) / self.cell) as usize).min(self.columns - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.origin.y) / self.cell) as usize).min(self.rows - 1)
    }

    /// What is in a cell, in ascending order.
    pub(super) fn members(&self, (column, row): Cell) -> &[u32] {
        let cell = row * self.columns + column;
        &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// The cells that the segment from `start` to `end` passes, row by row: a long diagonal is in few of the cells of its
    /// bounds.
    pub(super) fn for_each_along(&self, start: Point, end: Point, mut visit: impl FnMut(Cell)) {
        let (low, high) = if start.y <= end.y { (start, end) } else { (end, start) };
        let (first_row, last_row) = (self.row(low.y - HAIR), self.row(high.y + HAIR));
        let mut along = |row: usize, left: f64, right: f64| {
            for column in self.column(left.min(right) - HAIR)..=self.column(left.max(right) + HAIR) {
                visit((column, row));
            }
        };
        if first_row == last_row || high.y <= low.y {
            return (first_row..=last_row).for_each(|row| along(row, low.x, high.x));
        }
        let slope = (high.x - low.x) / (high.y - low.y);
        for row in first_row..=last_row {
            // The stretch within this row.
            let bottom = (self.origin.y + row as f64 * self.cell - HAIR).clamp(low.y, high.y);
            let top = (self.origin.y + (row + 1) as f64 * self.cell + HAIR).clamp(low.y, high.y);
            along(row, low.x + slope * (bottom - low.y), low.x + slope * (top - low.y));
        }
    }

    /// The cells within `radius` of `point`, and a few that are not.
    pub(super) fn for_each_within(&self, point: Point, radius: f64, mut visit: impl FnMut(Cell)) {
        let reach = radius + HAIR;
        let (first_column, first_row) = self.cell_of(Point::new(point.x - reach, point.y - reach));
        let (last_column, last_row) = self.cell_of(Point::new(point.x + reach, point.y + reach));
        for row in first_row..=last_row {
            for column in first_column..=last_column {
                visit((column, row));
            }
        }
    }

    /// Walks outwards from `point`, calling `visit` with the members of each cell. It returns the squared distance of the
    /// best found so far; the walk ends where nothing could be as near as that any more.
    pub(super) fn walk_outwards(&self, point: Point, mut best: f64, mut visit: impl FnMut(&[u32]) -> f64) {
        let beyond = self.distance(point);
        if beyond > 0.0 && beyond * beyond > best {
            return;
        }
        let (column, row) = self.cell_of(point);
        for ring in 0..self.columns.max(self.rows) {
            let reach = self.distance_to_ring(point, (column, row), ring);
            if ring > 0 && reach > 0.0 && reach * reach > best {
                return;
            }
            self.for_each_of_ring((column, row), ring, |cell| {
                if ring == 0 || self.is_as_near(cell, point, best) {
                    best = visit(self.members(cell));
                }
            });
        }
    }

    /// Whether a cell comes as near to `point` as the squared distance `best`.
    fn is_as_near(&self, (column, row): Cell, point: Point, best: f64) -> bool {
        let gap = |position: f64, origin: f64, cell: usize| {
            let begin = origin + cell as f64 * self.cell;
            ((begin - position).max(position - (begin + self.cell)) - HAIR).max(0.0)
        };
        let (x, y) = (gap(point.x, self.origin.x, column), gap(point.y, self.origin.y, row));
        x * x + y * y <= best
    }

    /// Distance from `point` to the grid along that axis along which it is farther.
    fn distance(&self, point: Point) -> f64 {
        let gap = |position: f64, origin: f64, cells: usize| {
            let end = origin + cells as f64 * self.cell;
            (origin - position).max(position - end)
        };
        gap(point.x, self.origin.x, self.columns).max(gap(point.y, self.origin.y, self.rows)) - HAIR
    }

    /// Distance from `point`, which belongs to the cell, to the nearest border that cells of this ring or of later ones lie
    /// behind. A side where the grid ends has none.
    fn distance_to_ring(&self, point: Point, (column, row): Cell, ring: usize) -> f64 {
        let gap = |position: f64, origin: f64, cell: usize, cells: usize| {
            let behind =
                if cell >= ring { position - (origin + (cell - ring + 1) as f64 * self.cell) } else { f64::INFINITY };
            let ahead =
                if cell + ring < cells { origin + (cell + ring) as f64 * self.cell - position } else { f64::INFINITY };
            behind.min(ahead)
        };
        let across = gap(point.x, self.origin.x, column, self.columns);
        across.min(gap(point.y, self.origin.y, row, self.rows)) - HAIR
    }

    fn for_each_of_ring(&self, (column, row): Cell, ring: usize, mut visit: impl FnMut(Cell)) {
        let (column, row, ring) = (column as isize, row as isize, ring as isize);
        let columns = (column - ring).max(0)..=(column + ring).min(self.columns as isize - 1);
        for y in (row - ring).max(0)..=(row + ring).min(self.rows as isize - 1) {
            if (y - row).abs() == ring {
                columns.clone().for_each(|x| visit((x as usize, y as usize)));
            } else {
                let sides = [column - ring, column + ring].into_iter().filter(|x| columns.contains(x));
                sides.for_each(|x| visit((x as usize, y as usize)));
            }
        }
    }

    #[cfg(test)]
    pub(super) fn member_count(&self) -> usize {
        self.members.len()
    }

    #[cfg(test)]
    pub(super) fn count(&self) -> usize {
        self.columns * self.rows
    }
}

fn bounds(points: impl Iterator<Item = Point>) -> (Point, Point) {
    let grow = |(low, high): (Point, Point), p: Point| {
        (Point::new(low.x.min(p.x), low.y.min(p.y)), Point::new(high.x.max(p.x), high.y.max(p.y)))
    };
    points.fold(None, |bounds, p| Some(grow(bounds.unwrap_or((p, p)), p))).unwrap_or_default()
}
