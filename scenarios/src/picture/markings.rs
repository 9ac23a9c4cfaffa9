//! What is painted on roads, and where they end.

use world::geometry::Point;
use world::map::{Area, Map, RoadEdgeKind, RoadLine, RoadLineKind};

use super::canvas::{Canvas, Path, Stroke};
use super::colours;
use super::course::{bars, beside, map_runs};
use super::frame::Frame;

/// As wide as a painted line (m).
const LINE: f64 = 0.15;
/// Half of the way between the middles of a double line (m).
const HALF_DOUBLE: f64 = 0.15;
/// Dash and gap of a broken line (m).
const BROKEN: [f64; 2] = [3.0, 5.0];

pub fn draw(canvas: &mut Canvas, frame: &Frame, map: &Map) {
    let mut centers = Path::default();
    for lane in &map.lanes {
        map_runs(frame, &lane.centerline, 0.0).iter().for_each(|run| centers.line(run));
    }
    canvas.stroke(&centers, Stroke::new(colours::CENTERLINE, frame.hairs(0.8)));
    stripes(canvas, frame, &map.speed_bumps, colours::BUMP, 0.8);
    stripes(canvas, frame, &map.crosswalks, colours::STRIPE, 1.2);
    lines(canvas, frame, &map.road_lines);
    for (kinds, colour) in [
        ([RoadEdgeKind::Median, RoadEdgeKind::Median], colours::MEDIAN),
        ([RoadEdgeKind::Boundary, RoadEdgeKind::Unknown], colours::CURB),
    ] {
        let mut path = Path::default();
        for edge in map.road_edges.iter().filter(|edge| kinds.contains(&edge.kind)) {
            map_runs(frame, &edge.polyline, frame.hairs(2.0)).iter().for_each(|run| path.line(run));
        }
        canvas.stroke(&path, Stroke::new(colour, frame.at_least(0.15, 1.2)).round());
    }
}

/// Areas of bars, half of each `period` metres painted.
fn stripes(canvas: &mut Canvas, frame: &Frame, areas: &[Area], colour: &'static str, period: f64) {
    let period = frame.at_least(period, 3.5);
    let mut path = Path::default();
    for area in areas {
        let corners: Vec<Point> = area.polygon.iter().map(|corner| frame.pixel(corner.xy())).collect();
        if frame.sees_some(&corners) {
            bars(&corners, period).iter().for_each(|bar| path.line(bar));
        }
    }
    canvas.stroke(&path, Stroke::new(colour, 0.5 * period));
}

/// How one stripe of a road line is painted, and on which side of its middle.
type PaintedStripe = (bool, f64);

/// The stripes of a line, and whether they are yellow.
fn painted(kind: RoadLineKind) -> (&'static str, &'static [PaintedStripe]) {
    const SOLID: &[PaintedStripe] = &[(true, 0.0)];
    const BROKEN: &[PaintedStripe] = &[(false, 0.0)];
    const SOLIDS: &[PaintedStripe] = &[(true, -1.0), (true, 1.0)];
    const BROKENS: &[PaintedStripe] = &[(false, -1.0), (false, 1.0)];
    // Who may pass is not said: the left stripe is drawn solid.
    const PASSING: &[PaintedStripe] = &[(true, 1.0), (false, -1.0)];
    match kind {
        RoadLineKind::Unknown => (colours::UNKNOWN_LINE, SOLID),
        RoadLineKind::BrokenSingleWhite => (colours::WHITE_LINE, BROKEN),
        RoadLineKind::SolidSingleWhite => (colours::WHITE_LINE, SOLID),
        RoadLineKind::SolidDoubleWhite => (colours::WHITE_LINE, SOLIDS),
        RoadLineKind::BrokenSingleYellow => (colours::YELLOW_LINE, BROKEN),
        RoadLineKind::BrokenDoubleYellow => (colours::YELLOW_LINE, BROKENS),
        RoadLineKind::SolidSingleYellow => (colours::YELLOW_LINE, SOLID),
        RoadLineKind::SolidDoubleYellow => (colours::YELLOW_LINE, SOLIDS),
        RoadLineKind::PassingDoubleYellow => (colours::YELLOW_LINE, PASSING),
    }
}

fn lines(canvas: &mut Canvas, frame: &Frame, lines: &[RoadLine]) {
    let width = frame.at_least(LINE, 1.0);
    let aside = frame.at_least(HALF_DOUBLE, 0.9);
    // One path for each way to paint: a map has hundreds of lines.
    for colour in [colours::UNKNOWN_LINE, colours::WHITE_LINE, colours::YELLOW_LINE] {
        for solid in [false, true] {
            let mut path = Path::default();
            for line in lines {
                let (of, stripes) = painted(line.kind);
                for (_, side) in stripes.iter().filter(|stripe| of == colour && stripe.0 == solid) {
                    for run in map_runs(frame, &line.polyline, 2.0 * aside) {
                        path.line(&beside(&run, side * aside));
                    }
                }
            }
            let stroke = Stroke::new(colour, width);
            canvas.stroke(
                &path,
                if solid { stroke } else { stroke.dashed(BROKEN.map(|meters| frame.at_least(meters, 3.0))) },
            );
        }
    }
}
