//! The ground under some frames in a row: drawn once, and cut to what each of them shows.

use scenarios::picture::{Ground, PngError, View};
use world::geometry::Point;
use world::map::Map;

/// The most pixels of a block: 64 MiB of memory. A drive that needs more has several, one after the other.
const MOST_PIXELS: i64 = 16 << 20;

/// What a picture shows, in whole pixels of the plane: x to the right, y down, at a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    pub left: i64,
    pub top: i64,
    pub width: i64,
    pub height: i64,
}

impl Window {
    pub fn around(center: Point, scale: f64, width: u32, height: u32) -> Self {
        let corner = |middle: f64, side: u32| (middle - 0.5 * f64::from(side)).round() as i64;
        let (left, top) = (corner(scale * center.x, width), corner(-scale * center.y, height));
        Self { left, top, width: width.into(), height: height.into() }
    }

    /// The smallest that holds both.
    fn with(self, other: Self) -> Self {
        let (left, top) = (self.left.min(other.left), self.top.min(other.top));
        let right = (self.left + self.width).max(other.left + other.width);
        let bottom = (self.top + self.height).max(other.top + other.height);
        Self { left, top, width: right.saturating_sub(left), height: bottom.saturating_sub(top) }
    }

    fn holds(self, other: Self) -> bool {
        self.with(other) == self
    }
}

/// A drawn part of the ground.
pub struct Block {
    ground: Ground,
    window: Window,
}

impl Block {
    /// Under the first window and as many of those that follow as there is room for.
    pub fn draw(
        map: &Map,
        mut windows: impl Iterator<Item = Window>,
        scale: f64,
        seen_width: u32,
    ) -> Result<Self, PngError> {
        let mut window = windows.next().unwrap_or(Window { left: 0, top: 0, width: 1, height: 1 });
        for next in windows {
            let both = window.with(next);
            if both.width.saturating_mul(both.height) > MOST_PIXELS {
                break;
            }
            window = both;
        }
        let size = [window.width, window.height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let middle = |start: i64, side: i64| (start as f64 + 0.5 * side as f64) / scale;
        let center = Point::new(middle(window.left, window.width), -middle(window.top, window.height));
        Ok(Self { ground: Ground::draw(map, &View { center, scale, size, seen_width })?, window })
    }

    pub fn holds(&self, window: Window) -> bool {
        self.window.holds(window)
    }

    /// Copies what a window shows, which the block holds.
    pub fn copy(&self, window: Window, to: &mut [u8]) {
        let row_bytes = 4 * window.width as usize;
        let (across, down) = ((window.left - self.window.left) as usize, (window.top - self.window.top) as usize);
        let stride = 4 * self.ground.width() as usize;
        let rows = self.ground.rgba().chunks_exact(stride).skip(down);
        for (to, from) in to.chunks_exact_mut(row_bytes).zip(rows) {
            to.copy_from_slice(&from[4 * across..4 * across + row_bytes]);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_block_holds_as_many_windows_as_there_is_room_for() {
        let at = |x: f64| Window::around(Point::new(x, 0.0), 10.0, 64, 32);
        let block = Block::draw(&Map::default(), [at(0.0), at(5.0), at(1e6)].into_iter(), 10.0, 64).unwrap();
        assert!(block.holds(at(0.0)) && block.holds(at(5.0)) && !block.holds(at(1e6)) && !block.holds(at(6.0)));
        let mut pixels = vec![0; 4 * 64 * 32];
        block.copy(at(5.0), &mut pixels);
        assert!(pixels.chunks(4).all(|pixel| pixel[3] == 255));
    }
}
