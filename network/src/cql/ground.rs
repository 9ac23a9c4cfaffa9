//! What does not move, as outlines that are made once an episode, and how a picture's places lie over it.

use tiny_skia::{LineJoin, PathBuilder, PathSegment, Stroke};
use world::geometry::{Point, Pose};
use world::map::Map;
use world::reference_line::ReferenceLine;

use super::brush::Brush;
use super::picture::SIDE;

/// Places a metre.
const SCALE: f64 = 4.0;
/// Where the AV is: across and down.
const AV: [f64; 2] = [128.0, 192.0];
/// Points of a line are this far apart (m): on an arc of 10 m they leave it by 5 cm.
const SPACING: f64 = 2.0;
/// Corners of what stands for a disc: it leaves a disc of 1.5 m by a twentieth of a place.
const CORNERS: usize = 24;

/// Map and reference line.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    /// What outlines are relative to: single precision would be coarse far from the log's origin.
    pub(super) origin: Point,
    /// Corners of a disc of 1 m.
    disc: [Point; CORNERS],
    shapes: Vec<Shape>,
}

#[derive(Clone, Debug)]
struct Shape {
    shade: u8,
    /// Corners, east and north of the origin (m); each outline closed by itself.
    outlines: Vec<Vec<[f32; 2]>>,
    /// The middle of all corners' bounds, and how far they reach from it (m).
    middle: [f32; 2],
    reach: [f32; 2],
}

impl Ground {
    pub(super) fn new(map: &Map, line: &ReferenceLine) -> Self {
        let origin = map.lanes.iter().flat_map(|lane| lane.centerline.first()).map(|point| point.xy()).next();
        let turn = |corner: usize| Point::unit(std::f64::consts::TAU * corner as f64 / CORNERS as f64);
        let disc = std::array::from_fn(turn);
        let mut ground = Self { origin: origin.unwrap_or_default(), disc, shapes: Vec::new() };
        for lane in map.lanes.iter().filter(|lane| lane.kind.is_drivable()) {
            ground.line(lane.centerline.iter().map(|point| point.xy()), 3.5, 60);
        }
        for area in &map.crosswalks {
            let corners = area.polygon.iter().map(|corner| own(ground.origin, corner.xy())).collect();
            ground.shapes.extend(Shape::new(vec![corners], 90));
        }
        for edge in &map.road_edges {
            ground.line(edge.polyline.iter().map(|point| point.xy()), 0.4, 120);
        }
        for sign in &map.stop_signs {
            let corners = ground.disc(sign.position.xy(), 1.0).collect();
            ground.shapes.extend(Shape::new(vec![corners], 150));
        }
        ground.line((0..line.len()).map(|index| line.point(index)), 1.0, 180);
        ground
    }

    /// Draws what is seen of it.
    pub(super) fn draw(&self, view: &View, brush: &mut Brush, picture: &mut [u8]) {
        for shape in self.shapes.iter().filter(|shape| view.sees(shape)) {
            shape.outlines.iter().for_each(|corners| brush.outline(corners.iter().map(|corner| view.place(*corner))));
            brush.fill(picture, 0, shape.shade);
        }
    }

    /// Corners of a disc, relative to the origin.
    pub(super) fn disc(&self, center: Point, radius: f64) -> impl Iterator<Item = [f32; 2]> {
        self.disc.iter().map(move |corner| own(self.origin, center + *corner * radius))
    }

    /// Adds a line of so many metres across.
    fn line(&mut self, points: impl Iterator<Item = Point>, width: f32, shade: u8) {
        let mut builder = PathBuilder::new();
        let mut before: Option<Point> = None;
        let mut points = points.peekable();
        while let Some(point) = points.next() {
            let [x, y] = own(self.origin, point);
            match before {
                None => builder.move_to(x, y),
                Some(before) if points.peek().is_some() && before.distance(point) < SPACING => continue,
                Some(_) => builder.line_to(x, y),
            }
            before = Some(point);
        }
        let stroke = Stroke { width, line_join: LineJoin::Bevel, ..Stroke::default() };
        let Some(path) = builder.finish().and_then(|path| path.stroke(&stroke, 1.0)) else { return };
        let mut outlines: Vec<Vec<[f32; 2]>> = Vec::new();
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(to) => outlines.push(vec![[to.x, to.y]]),
                // Of lines with blunt joins and ends no curves come.
                PathSegment::LineTo(to) | PathSegment::QuadTo(_, to) | PathSegment::CubicTo(_, _, to) => {
                    outlines.last_mut().into_iter().for_each(|corners| corners.push([to.x, to.y]));
                }
                PathSegment::Close => {}
            }
        }
        self.shapes.extend(Shape::new(outlines, shade));
    }
}

impl Shape {
    /// None where there are no corners.
    fn new(outlines: Vec<Vec<[f32; 2]>>, shade: u8) -> Option<Self> {
        let mut corners = outlines.iter().flatten().copied();
        let first = corners.next()?;
        let [low, high] = corners.fold([first, first], |[low, high], corner| {
            let axes = [0, 1];
            [axes.map(|axis| low[axis].min(corner[axis])), axes.map(|axis| high[axis].max(corner[axis]))]
        });
        let [middle, reach] = [1.0, -1.0].map(|sign| [0, 1].map(|axis| 0.5 * (high[axis] + sign * low[axis])));
        Some(Self { shade, outlines, middle, reach })
    }
}

/// From metres beyond the origin to places: the AV heads up.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    sine: f32,
    cosine: f32,
    across: f32,
    down: f32,
}

impl View {
    pub(super) fn new(av: Pose, origin: Point) -> Self {
        let forward = Point::unit(av.heading) * SCALE;
        let offset = origin - av.position();
        let (across, down) = (AV[0] - forward.cross(offset), AV[1] - forward.dot(offset));
        Self { sine: forward.y as f32, cosine: forward.x as f32, across: across as f32, down: down as f32 }
    }

    /// Across and down (places).
    pub(super) fn place(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [self.sine * x - self.cosine * y + self.across, self.down - self.cosine * x - self.sine * y]
    }

    /// Whether a shape may be seen: the box around it, turned, has a box around it in turn.
    fn sees(&self, shape: &Shape) -> bool {
        let half = 0.5 * SIDE as f32;
        let middle = self.place(shape.middle);
        let (sine, cosine, [x, y]) = (self.sine.abs(), self.cosine.abs(), shape.reach);
        let reach = [sine * x + cosine * y, cosine * x + sine * y];
        (0..2).all(|axis| (middle[axis] - half).abs() < half + reach[axis])
    }
}

/// A point relative to the origin (m).
pub(super) fn own(origin: Point, point: Point) -> [f32; 2] {
    let Point { x, y } = point - origin;
    [x as f32, y as f32]
}
