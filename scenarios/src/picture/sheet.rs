//! Many scenes on one sheet, in rows of tiles.

use world::geometry::Point;

use super::canvas::{Canvas, Path, Stroke};
use super::caption::Legend;
use super::tile::Tile;
use super::{Look, Moment, Picture, caption, colours};

/// A sheet under way. Scenes are added one by one, so that none needs to stay in memory.
#[derive(Debug)]
pub struct Sheet {
    look: Look,
    columns: u32,
    tiles: u32,
    canvas: Canvas,
    /// One for all tiles.
    legend: Legend,
}

impl Sheet {
    /// An empty sheet of so many columns; 0 is taken as 1.
    #[must_use]
    pub fn new(columns: u32, look: Look) -> Self {
        Self { look, columns: columns.max(1), tiles: 0, canvas: Canvas::default(), legend: Legend::default() }
    }

    /// How many columns make `tiles` tiles nearly a square.
    #[must_use]
    pub fn usual_columns(tiles: usize) -> u32 {
        (1..=1000).find(|columns| columns * columns >= tiles).map_or(1000, |columns| columns as u32)
    }

    /// Adds a scene at its moment.
    pub fn add(&mut self, moment: Moment<'_>) {
        let tile = Tile::square(moment, &self.look);
        let (column, row) = (self.tiles % self.columns, self.tiles / self.columns);
        let gap = self.gap();
        let at = |place: u32, size: u32| f64::from(gap) + f64::from(place) * f64::from(size + gap);
        self.canvas.begin("tile", Point::new(at(column, tile.width()), at(row, tile.height())));
        tile.draw(&mut self.canvas, Some(&mut self.legend));
        self.canvas.stroke(&Path::of_rectangle(tile.width(), tile.height()), Stroke::new(colours::FRAME, 1.0));
        self.canvas.end();
        self.tiles += 1;
    }

    /// The sheet with all that was added.
    #[must_use]
    pub fn finish(mut self) -> Picture {
        let columns = self.columns.min(self.tiles);
        let rows = self.tiles.div_ceil(self.columns);
        let gap = self.gap();
        let size = |tiles: u32, tile: u32| tiles.saturating_mul(tile + gap).saturating_add(gap);
        let (width, height) =
            (size(columns, self.look.width), size(rows, self.look.width + caption::height(self.look.width)));
        let band = self.legend.height(self.look.width, width);
        if band > 0 {
            let corner = Point::new(f64::from(width.saturating_sub(gap)), f64::from(height.saturating_sub(gap)));
            self.legend.draw_band(&mut self.canvas, self.look.width, corner);
        }
        let title = if self.tiles == 1 { "1 scene".to_owned() } else { format!("{} scenes", self.tiles) };
        self.canvas.finish(&title, width, height.saturating_add(band.saturating_sub(gap)))
    }

    /// Room between tiles and around them (pixels).
    fn gap(&self) -> u32 {
        (self.look.width / 40).max(4)
    }
}
