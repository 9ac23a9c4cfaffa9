//! The surface of roads. Maps have no areas of asphalt: lanes are centre lines and road edges are lines, so what lies
//! between edges is filled, and lanes are widened.

use world::map::{Lane, LaneKind, Map};

use super::canvas::{Canvas, Path, Stroke};
use super::colours;
use super::course::{band, map_runs};
use super::frame::Frame;
use super::paved::paved;

/// As wide as lanes are drawn (m): a bit more than they are, so that no gap is left between two.
const LANE: f64 = 4.0;
const BIKE_LANE: f64 = 2.0;
/// How far lanes may have been drawn beyond an edge (m).
const OUTWARD: f64 = 1.4;
/// How far there is road beside its edge for sure (m): what was taken away from the other side of a narrow median.
const INWARD: f64 = 1.4;

pub fn draw(canvas: &mut Canvas, frame: &Frame, map: &Map) {
    // From the least exact to the most: what is drawn later is right where two disagree.
    canvas.fill(&paved(frame, map), colours::ASPHALT);
    let asphalt = Stroke::new(colours::ASPHALT, frame.at_least(LANE, 2.0));
    // Painted islands and gaps beside lanes are road too: what is painted lies on it.
    let mut painted = Path::default();
    for line in &map.road_lines {
        map_runs(frame, &line.polyline, asphalt.width).iter().for_each(|run| painted.line(run));
    }
    canvas.stroke(&painted, asphalt);
    // Where a lane goes on the next one may begin at an angle; where it does not the road is cut straight.
    let goes_on = |lane: &&Lane| !lane.entries.is_empty() && !lane.exits.is_empty();
    let cars = || map.lanes.iter().filter(|lane| lane.kind != LaneKind::BikeLane);
    canvas.stroke(&lanes(frame, cars().filter(goes_on), asphalt.width), asphalt.round());
    canvas.stroke(&lanes(frame, cars().filter(|lane| !goes_on(lane)), asphalt.width), asphalt);
    canvas.fill(&bands(frame, map, -OUTWARD), colours::GROUND);
    canvas.fill(&bands(frame, map, INWARD), colours::ASPHALT);
    let bikes = map.lanes.iter().filter(|lane| lane.kind == LaneKind::BikeLane);
    let green = Stroke::new(colours::BIKE_LANE, frame.at_least(BIKE_LANE, 1.0));
    canvas.stroke(&lanes(frame, bikes, green.width), green);
    for area in &map.driveways {
        let corners: Vec<_> = area.polygon.iter().map(|corner| frame.pixel(corner.xy())).collect();
        if frame.sees_some(&corners) {
            canvas.fill(&Path::of_area(&corners), colours::DRIVEWAY);
        }
    }
}

/// What lies within so many metres on the left of road edges; on the right where they are negative.
fn bands(frame: &Frame, map: &Map, meters: f64) -> Path {
    let mut path = Path::default();
    for edge in &map.road_edges {
        for run in map_runs(frame, &edge.polyline, frame.pixels(meters.abs())) {
            band(&run, frame.pixels(meters)).iter().for_each(|corners| path.area(corners));
        }
    }
    path
}

fn lanes<'a>(frame: &Frame, lanes: impl Iterator<Item = &'a Lane>, width: f64) -> Path {
    let mut path = Path::default();
    for lane in lanes {
        map_runs(frame, &lane.centerline, width).iter().for_each(|run| path.line(run));
    }
    path
}
