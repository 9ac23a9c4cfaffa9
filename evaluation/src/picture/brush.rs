//! What moves, in metres of the log: lines, boxes and discs.

use scenarios::picture::colours;
use tiny_skia::{Color, FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform};
use world::geometry::{OrientedBox, Point};
use world::scene::AgentState;

use super::block::Window;

/// How a line is drawn.
#[derive(Clone, Copy)]
pub struct Line {
    colour: &'static str,
    /// Pixels.
    width: f64,
    opacity: f64,
}

impl Line {
    pub fn new(colour: &'static str, width: f64) -> Self {
        Self { colour, width, opacity: 1.0 }
    }

    pub fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }
}

/// Draws on a canvas that shows a window of the plane.
pub struct Brush<'c> {
    pub canvas: &'c mut Pixmap,
    /// Pixels a metre.
    scale: f64,
    window: Window,
}

/// A colour as the palette writes it: `#rrggbb`.
pub fn paint(colour: &str, opacity: f64) -> Paint<'static> {
    let part = |at: usize| colour.get(at..at + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok()).unwrap_or(0);
    let opacity = (255.0 * opacity.clamp(0.0, 1.0)).round() as u8;
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(Color::from_rgba8(part(1), part(3), part(5), opacity));
    paint
}

impl<'c> Brush<'c> {
    pub fn new(canvas: &'c mut Pixmap, scale: f64, window: Window) -> Self {
        Self { canvas, scale, window }
    }

    /// Pixels across and down.
    pub fn size(&self) -> [f64; 2] {
        [self.canvas.width(), self.canvas.height()].map(f64::from)
    }

    /// `meters` in pixels, at least so many.
    pub fn at_least(&self, meters: f64, pixels: f64) -> f64 {
        (self.scale * meters).max(pixels)
    }

    fn pixel(&self, point: Point) -> (f32, f32) {
        let x = self.scale * point.x - self.window.left as f64;
        let y = -self.scale * point.y - self.window.top as f64;
        (x as f32, y as f32)
    }

    /// Whether something of that size (pixels) around a point may be seen.
    fn sees(&self, point: Point, around: f64) -> bool {
        let (x, y) = self.pixel(point);
        let within = |at: f32, side: u32| f64::from(at) > -around && f64::from(at) < f64::from(side) + around;
        within(x, self.canvas.width()) && within(y, self.canvas.height())
    }

    /// An open line.
    pub fn line(&mut self, points: impl Iterator<Item = Point>, line: Line) {
        let mut path = PathBuilder::new();
        for (index, point) in points.enumerate() {
            let (x, y) = self.pixel(point);
            if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        let Some(path) = path.finish() else { return };
        let stroke = Stroke {
            width: line.width as f32,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        self.canvas.stroke_path(&path, &paint(line.colour, line.opacity), &stroke, Transform::identity(), None);
    }

    /// A disc of `radius` pixels.
    pub fn disc(&mut self, center: Point, radius: f64, colour: &str, rim: Option<&str>) {
        if !self.sees(center, 2.0 * radius) {
            return;
        }
        let (x, y) = self.pixel(center);
        let Some(path) = PathBuilder::from_circle(x, y, radius as f32) else { return };
        if let Some(rim) = rim {
            self.stroke(&path, rim, 2.0, 1.0, None);
        }
        self.fill(&path, colour, 1.0);
    }

    /// Somebody's body, with a mark at its front.
    pub fn body(&mut self, state: &AgentState, colour: &str, nose_colour: &str) {
        let body = Body::of(self, state);
        if !self.sees(state.position(), body.along + 4.0) {
            return;
        }
        let (Some(outline), nose) = (body.outline(), body.nose()) else { return };
        self.stroke(&outline, colours::PAPER, 2.0, 1.0, None);
        self.fill(&outline, colour, 1.0);
        if let Some(nose) = nose {
            self.fill(&nose, nose_colour, 0.9);
        }
    }

    /// Where somebody would be: an outline of dashes.
    pub fn ghost(&mut self, state: &AgentState) {
        if let Some(outline) = Body::of(self, state).outline() {
            let dash = StrokeDash::new(vec![5.0, 4.0], 0.0);
            self.stroke(&outline, colours::INK, 1.5, 0.75, dash);
        }
    }

    /// A rectangle of pixels.
    pub fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], colour: &str, opacity: f64) {
        if let Some(rectangle) = Rect::from_xywh(x as f32, y as f32, width as f32, height as f32) {
            self.canvas.fill_rect(rectangle, &paint(colour, opacity), Transform::identity(), None);
        }
    }

    pub fn fill(&mut self, path: &tiny_skia::Path, colour: &str, opacity: f64) {
        self.canvas.fill_path(path, &paint(colour, opacity), FillRule::Winding, Transform::identity(), None);
    }

    fn stroke(&mut self, path: &tiny_skia::Path, colour: &str, width: f32, opacity: f64, dash: Option<StrokeDash>) {
        let stroke = Stroke { width, dash, line_join: LineJoin::Round, ..Stroke::default() };
        self.canvas.stroke_path(path, &paint(colour, opacity), &stroke, Transform::identity(), None);
    }
}

/// A body's axes in pixels, and half of its sides.
struct Body {
    center: Point,
    forward: Point,
    left: Point,
    along: f64,
    across: f64,
}

impl Body {
    fn of(brush: &Brush<'_>, state: &AgentState) -> Self {
        let OrientedBox { forward, half_length, half_width, .. } = state.oriented_box();
        let (x, y) = brush.pixel(state.position());
        Self {
            center: Point::new(x.into(), y.into()),
            forward: Point::new(forward.x, -forward.y),
            left: Point::new(-forward.y, -forward.x),
            along: brush.at_least(half_length, 2.6),
            across: brush.at_least(half_width, 1.3),
        }
    }

    fn area(&self, corners: &[(f64, f64)]) -> Option<tiny_skia::Path> {
        let mut path = PathBuilder::new();
        for (index, (along, across)) in corners.iter().enumerate() {
            let Point { x, y } = self.center + self.forward * *along + self.left * *across;
            if index == 0 { path.move_to(x as f32, y as f32) } else { path.line_to(x as f32, y as f32) }
        }
        path.close();
        path.finish()
    }

    /// Corners are cut a little, as those of cars are round.
    fn outline(&self) -> Option<tiny_skia::Path> {
        let (along, across) = (self.along, self.across);
        let cut = 0.3 * across.min(along);
        self.area(&[
            (along, across - cut),
            (along - cut, across),
            (cut - along, across),
            (-along, across - cut),
            (-along, cut - across),
            (cut - along, -across),
            (along - cut, -across),
            (along, cut - across),
        ])
    }

    /// A wedge that points where it heads.
    fn nose(&self) -> Option<tiny_skia::Path> {
        let tip = self.along - 0.3 * self.across;
        let base = tip - (0.9 * self.across).min(0.8 * self.along);
        self.area(&[(tip, 0.0), (base, 0.6 * self.across), (base, -0.6 * self.across)])
    }
}
