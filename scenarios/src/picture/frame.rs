//! From metres of the log to pixels of a picture.

use world::geometry::Point;

/// A rectangle of pixels that shows a part of the plane. Its pixels count from its own upper left corner, x to the right and y down.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    center: Point,
    /// Unit vector that points up in the picture.
    up: Point,
    /// Pixels a metre.
    scale: f64,
    pub width: f64,
    pub height: f64,
    /// The thinnest line that is seen well (pixels).
    hair: f64,
}

/// A box in the frame's own axes: right and up (m), from the origin of the log.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub low: Point,
    pub high: Point,
}

impl Frame {
    /// A square of `width` pixels around `center` that shows `radius` metres to each side.
    pub fn around(center: Point, radius: f64, up: Point, width: f64) -> Self {
        Self { center, up, scale: width / (2.0 * radius), width, height: width, hair: hair(width) }
    }

    /// `width` by `height` pixels around `center`, north up, at `scale` pixels a metre; lines as in a picture of `seen` pixels across.
    pub fn scaled(center: Point, scale: f64, [width, height]: [f64; 2], seen: f64) -> Self {
        Self { center, up: Point::new(0.0, 1.0), scale, width, height, hair: hair(seen) }
    }

    /// As large as `bounds` need, within `width` by `height` pixels.
    pub fn fitting(bounds: Bounds, up: Point, width: f64, height: f64) -> Self {
        let size = bounds.high - bounds.low;
        let middle = (bounds.low + bounds.high) * 0.5;
        let right = Point::new(up.y, -up.x);
        let scale = (width / size.x).min(height / size.y);
        Self { center: right * middle.x + up * middle.y, up, scale, width, height, hair: hair(width) }
    }

    /// `point` of the log, in pixels.
    pub fn pixel(&self, point: Point) -> Point {
        let offset = point - self.center;
        let (right, up) = (-self.up.cross(offset), self.up.dot(offset));
        Point::new(0.5 * self.width + self.scale * right, 0.5 * self.height - self.scale * up)
    }

    /// The point of the log that is seen at `pixel`.
    pub fn log_point(&self, pixel: Point) -> Point {
        let (right, up) = (pixel.x - 0.5 * self.width, 0.5 * self.height - pixel.y);
        let right_way = Point::new(self.up.y, -self.up.x);
        self.center + (right_way * right + self.up * up) * (1.0 / self.scale)
    }

    /// `meters` in pixels, but at least `hairs` of the thinnest lines.
    pub fn at_least(&self, meters: f64, hairs: f64) -> f64 {
        (self.scale * meters).max(self.hair * hairs)
    }

    /// `meters` in pixels.
    pub fn pixels(&self, meters: f64) -> f64 {
        self.scale * meters
    }

    /// Thinnest lines in pixels.
    pub fn hairs(&self, number: f64) -> f64 {
        self.hair * number
    }

    /// Whether the box around two pixels touches the frame, or comes within `margin` pixels of it.
    pub fn sees(&self, one: Point, other: Point, margin: f64) -> bool {
        let overlaps = |a: f64, b: f64, size: f64| a.min(b) <= size + margin && a.max(b) >= -margin;
        overlaps(one.x, other.x, self.width) && overlaps(one.y, other.y, self.height)
    }

    /// Whether an area of these corners may be seen.
    pub fn sees_some(&self, corners: &[Point]) -> bool {
        corners.iter().zip(corners.iter().cycle().skip(1)).any(|(a, b)| self.sees(*a, *b, 0.0))
    }
}

impl Bounds {
    /// The smallest that hold all `points`, a margin around them; a place to stand on where there are none.
    pub fn of(points: impl Iterator<Item = Point>, up: Point) -> Self {
        let right = Point::new(up.y, -up.x);
        let turned = points.map(|point| Point::new(right.dot(point), up.dot(point)));
        let both = turned.fold(None, |bounds: Option<Self>, point| {
            let Self { low, high } = bounds.unwrap_or(Self { low: point, high: point });
            let low = Point::new(low.x.min(point.x), low.y.min(point.y));
            Some(Self { low, high: Point::new(high.x.max(point.x), high.y.max(point.y)) })
        });
        let Self { low, high } = both.unwrap_or(Self { low: Point::default(), high: Point::default() });
        let size = high - low;
        let margin = (0.02 * size.x.max(size.y)).max(8.0);
        let margin = Point::new(margin, margin);
        Self { low: low - margin, high: high + margin }
    }

    /// Height by width.
    pub fn aspect(&self) -> f64 {
        let size = self.high - self.low;
        size.y / size.x
    }
}

fn hair(width: f64) -> f64 {
    (width / 1000.0).max(0.7)
}
