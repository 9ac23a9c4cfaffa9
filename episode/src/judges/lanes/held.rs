//! The lanes that hold a point, and what is known of each while they are looked for.

/// cos 45 degrees: a lane points the AV's way if it points within that of where the AV looks.
const ALIGNED: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A point's place in a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) station: f64,
    /// Distance to the center line (m).
    pub(super) distance: f64,
    /// How far outside of the strip (m), 0 within.
    pub(super) outside: f64,
    /// Cosine of the angle between the lane and where the body looks.
    pub(super) alignment: f64,
}

impl Place {
    pub(super) fn is_aligned(&self) -> bool {
        self.alignment >= ALIGNED
    }
}

/// The lanes that hold a point: those that point the body's way first, the nearer before the farther; then the others, the better aligned
/// before the worse; then in the map's order.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    pub(super) lanes: Vec<(usize, Place)>,
    /// For each lane what is known of it; kept from point to point to spare an allocation.
    known: Vec<Known>,
    /// Number of the point: what is known of another is forgotten.
    point: u64,
}

/// A stretch of a lane, from whose segments the way downhill leads to one place.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    point: u64,
    first: usize,
    last: usize,
    /// That place holds the point: nothing more is to be known of the lane.
    is_held: bool,
}

impl Held {
    pub(super) fn contains(&self, lane: usize) -> bool {
        self.lanes.iter().any(|(held, _)| *held == lane)
    }

    /// Another point is looked for, in so many lanes.
    pub(super) fn forget(&mut self, lanes: usize) {
        self.lanes.clear();
        self.known.resize(lanes, Known::default());
        self.point += 1;
    }

    /// Whether it is known where the way downhill leads from a segment of a lane, or need not be known.
    pub(super) fn knows(&self, lane: usize, segment: usize) -> bool {
        let known = &self.known[lane];
        known.point == self.point && (known.is_held || (known.first..=known.last).contains(&segment))
    }

    /// The way downhill from a segment of a lane leads to the segment `nearest`, and that is the place that holds the point, if one does.
    pub(super) fn learn(&mut self, lane: usize, segment: usize, nearest: usize, place: Option<Place>) {
        let (first, last) = (segment.min(nearest), segment.max(nearest));
        self.known[lane] = Known { point: self.point, first, last, is_held: place.is_some() };
        self.lanes.extend(place.map(|place| (lane, place)));
    }

    /// The way downhill from a segment of a lane leads into the known stretch.
    pub(super) fn learn_more(&mut self, lane: usize, segment: usize) {
        let known = &mut self.known[lane];
        (known.first, known.last) = (known.first.min(segment), known.last.max(segment));
    }

    pub(super) fn sort(&mut self) {
        let rank = |place: &Place| if place.is_aligned() { (0_u8, place.distance) } else { (1, -place.alignment) };
        self.lanes.sort_by(|a, b| {
            let (one, other) = (rank(&a.1), rank(&b.1));
            one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)).then(a.0.cmp(&b.0))
        });
    }
}
