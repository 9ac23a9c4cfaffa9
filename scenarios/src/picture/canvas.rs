//! What is drawn on: SVG, written from the bottom up.

use std::collections::BTreeSet;
use std::fmt::Write;

use world::geometry::Point;

use super::{Picture, colours, text};

/// SVG under way.
#[derive(Debug, Default)]
pub struct Canvas {
    body: String,
    /// Rectangles to which groups are cut: width and height.
    clips: Vec<[u32; 2]>,
    /// Letters that are drawn, each by the outline that is written once.
    letters: BTreeSet<char>,
    /// Lines that fade, each by a gradient of its own.
    fades: u32,
}

/// A path, in pixels of its group.
#[derive(Clone, Debug, Default)]
pub struct Path(String);

/// How a path is stroked.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    pub colour: &'static str,
    /// Pixels.
    pub width: f64,
    pub opacity: f64,
    /// Lengths of dash and gap (pixels).
    pub dash: Option<[f64; 2]>,
    pub round: bool,
}

impl Stroke {
    pub fn new(colour: &'static str, width: f64) -> Self {
        Self { colour, width, opacity: 1.0, dash: None, round: false }
    }

    pub fn round(self) -> Self {
        Self { round: true, ..self }
    }

    pub fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    pub fn dashed(self, dash: [f64; 2]) -> Self {
        Self { dash: Some(dash), ..self }
    }
}

impl Path {
    /// Adds an open line.
    pub fn line(&mut self, points: &[Point]) {
        for (index, point) in points.iter().enumerate() {
            self.0.push(if index == 0 { 'M' } else { 'L' });
            self.point(*point);
        }
    }

    /// Adds a closed area.
    pub fn area(&mut self, corners: &[Point]) {
        self.line(corners);
        if !corners.is_empty() {
            self.0.push('Z');
        }
    }

    /// Adds a disc.
    pub fn disc(&mut self, center: Point, radius: f64) {
        let [left, right] = [-radius, radius].map(|aside| center + Point::new(aside, 0.0));
        self.0.push('M');
        self.point(left);
        for end in [right, left] {
            self.0.push('A');
            self.point(Point::new(radius, radius));
            self.0.push_str(" 0 1 1 ");
            self.point(end);
        }
        self.0.push('Z');
    }

    /// The path of one area.
    pub fn of_area(corners: &[Point]) -> Self {
        let mut path = Self::default();
        path.area(corners);
        path
    }

    /// The path of a rectangle from the origin.
    pub fn of_rectangle(width: u32, height: u32) -> Self {
        let (right, bottom) = (f64::from(width), f64::from(height));
        Self::of_area(&[(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)].map(|(x, y)| Point::new(x, y)))
    }

    /// The path of one line.
    pub fn of_line(points: &[Point]) -> Self {
        let mut path = Self::default();
        path.line(points);
        path
    }

    /// The path of one disc.
    pub fn of_disc(center: Point, radius: f64) -> Self {
        let mut path = Self::default();
        path.disc(center, radius);
        path
    }

    fn point(&mut self, point: Point) {
        number(&mut self.0, point.x);
        self.0.push(' ');
        number(&mut self.0, point.y);
    }
}

impl Canvas {
    /// Fills a path; areas that overlap are one if they turn the same way.
    pub fn fill(&mut self, path: &Path, colour: &str) {
        if !path.0.is_empty() {
            self.write(format_args!("<path fill=\"{colour}\" d=\"{}\"/>\n", path.0));
        }
    }

    /// Fills a path with white through which what is below is seen faintly.
    pub fn veil(&mut self, path: &Path) {
        self.write(format_args!("<path fill=\"{}\" fill-opacity=\"0.8\" d=\"{}\"/>\n", colours::PAPER, path.0));
    }

    /// Draws a path's lines.
    pub fn stroke(&mut self, path: &Path, stroke: Stroke) {
        if path.0.is_empty() {
            return;
        }
        let Stroke { colour, width, opacity, dash, round } = stroke;
        let mut text = format!("<path fill=\"none\" stroke=\"{colour}\" stroke-linejoin=\"round\" stroke-width=\"");
        number(&mut text, width);
        text.push('"');
        if round {
            text.push_str(" stroke-linecap=\"round\"");
        }
        if opacity < 1.0 {
            text.push_str(" stroke-opacity=\"");
            number(&mut text, opacity);
            text.push('"');
        }
        if let Some([dash, gap]) = dash {
            text.push_str(" stroke-dasharray=\"");
            number(&mut text, dash);
            text.push(' ');
            number(&mut text, gap);
            text.push('"');
        }
        self.write(format_args!("{text} d=\"{}\"/>\n", path.0));
    }

    /// Draws a path's lines, from nothing at `start` to `colour` at `end`.
    pub fn fade(&mut self, path: &Path, colour: &str, width: f64, [start, end]: [Point; 2]) {
        if path.0.is_empty() {
            return;
        }
        self.fades += 1;
        let id = self.fades;
        let mut gradient = format!("<linearGradient id=\"fade{id}\" gradientUnits=\"userSpaceOnUse\"");
        for (name, value) in [("x1", start.x), ("y1", start.y), ("x2", end.x), ("y2", end.y)] {
            let _ = write!(gradient, " {name}=\""); // a String takes all
            number(&mut gradient, value);
            gradient.push('"');
        }
        self.write(format_args!(
            "{gradient}><stop stop-color=\"{colour}\" stop-opacity=\"0\"/>\
             <stop offset=\"1\" stop-color=\"{colour}\" stop-opacity=\"0.75\"/></linearGradient>\n"
        ));
        let mut text =
            format!("<path fill=\"none\" stroke=\"url(#fade{id})\" stroke-linejoin=\"round\" stroke-width=\"");
        number(&mut text, width);
        self.write(format_args!("{text}\" d=\"{}\"/>\n", path.0));
    }

    /// Draws a line of text that begins at `at`, on its base line; `size` is what a font's size is (pixels).
    pub fn text(&mut self, at: Point, size: f64, colour: &str, line: &str) {
        let mut transform = String::from("translate(");
        number(&mut transform, at.x);
        transform.push(' ');
        number(&mut transform, at.y);
        self.write(format_args!("<g fill=\"{colour}\" transform=\"{transform}) scale({:.5})\">", size / text::EM));
        for (letter, x) in text::set(line) {
            self.letters.insert(letter);
            self.write(format_args!("<use href=\"#{}\" x=\"{x}\"/>", letter_id(letter)));
        }
        self.body.push_str("</g>\n");
    }

    /// Begins a group whose origin is `at`, named by `class`.
    pub fn begin(&mut self, class: &str, at: Point) {
        let mut transform = String::new();
        if at != Point::default() {
            transform.push_str(" transform=\"translate(");
            number(&mut transform, at.x);
            transform.push(' ');
            number(&mut transform, at.y);
            transform.push_str(")\"");
        }
        self.write(format_args!("<g class=\"{class}\"{transform}>\n"));
    }

    /// Begins a group that shows nothing beyond `width` by `height` pixels from its origin.
    pub fn begin_cut(&mut self, class: &str, width: u32, height: u32) {
        let size = [width, height];
        let place = self.clips.iter().position(|clip| *clip == size).unwrap_or_else(|| {
            self.clips.push(size);
            self.clips.len() - 1
        });
        self.write(format_args!("<g class=\"{class}\" clip-path=\"url(#cut{place})\">\n"));
    }

    /// Ends the group that was begun last.
    pub fn end(&mut self) {
        self.body.push_str("</g>\n");
    }

    /// The whole file.
    pub fn finish(self, title: &str, width: u32, height: u32) -> Picture {
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
             <title>{title}</title>\n<defs>\n"
        );
        for (place, [width, height]) in self.clips.iter().enumerate() {
            let rectangle = format!("<rect width=\"{width}\" height=\"{height}\"/>");
            svg.push_str(&format!("<clipPath id=\"cut{place}\">{rectangle}</clipPath>\n"));
        }
        for letter in self.letters {
            svg.push_str(&format!("<path id=\"{}\" d=\"{}\"/>\n", letter_id(letter), text::outline(letter)));
        }
        svg.push_str(&format!("</defs>\n<rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>\n", colours::PAPER));
        svg.push_str(&self.body);
        svg.push_str("</svg>\n");
        Picture { svg, width, height }
    }

    fn write(&mut self, text: std::fmt::Arguments<'_>) {
        let _ = self.body.write_fmt(text); // a String takes all
    }
}

fn letter_id(letter: char) -> String {
    format!("u{:x}", u32::from(letter))
}

/// Hundredths of a pixel, without zeros at the end.
fn number(text: &mut String, value: f64) {
    let start = text.len();
    let _ = write!(text, "{value:.2}"); // a String takes all
    let kept = text[start..].trim_end_matches('0').trim_end_matches('.').len();
    text.truncate(start + kept);
    if text[start..].eq("-0") {
        text.replace_range(start.., "0");
    }
}
