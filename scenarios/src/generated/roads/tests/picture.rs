//! Roads for the eye.

use world::geometry::Point;

use super::super::*;
use super::towns::KINDS;

#[test]
#[ignore = "for the eye: writes KIND-SEED.svg into the folder for temporary files"]
fn picture() {
    for (kind, town) in KINDS {
        for seed in 0..40 {
            std::fs::write(std::env::temp_dir().join(format!("{kind}-{seed}.svg")), svg(&lay(&town(seed)))).unwrap();
        }
    }
}

fn svg(roads: &Roads) -> String {
    use std::fmt::Write;
    let points = || roads.map.lanes.iter().flat_map(|lane| &lane.centerline);
    let low = points().fold((f64::INFINITY, f64::INFINITY), |low, p| (low.0.min(p.x), low.1.min(-p.y)));
    let high = points().fold((f64::NEG_INFINITY, f64::NEG_INFINITY), |high, p| (high.0.max(p.x), high.1.max(-p.y)));
    let (width, height) = (high.0 - low.0 + 30.0, high.1 - low.1 + 30.0);
    let mut text = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='{} {} {width} {height}' width='{}' height='{}'><rect x='{}' y='{}' width='9999' height='9999' fill='white'/>\n",
        low.0 - 15.0,
        low.1 - 15.0,
        width * 6.0,
        height * 6.0,
        low.0 - 15.0,
        low.1 - 15.0,
    );
    let mut draw = |line: &[Point3], style: &str| {
        let path: Vec<String> = line.iter().map(|p| format!("{:.2},{:.2}", p.x, -p.y)).collect();
        writeln!(text, "<polyline points='{}' fill='none' {style}/>", path.join(" ")).unwrap();
    };
    for area in &roads.map.crosswalks {
        draw(&area.polygon, "style='fill:#cfe8ff;stroke:#88b;stroke-width:0.1'");
    }
    for area in &roads.map.driveways {
        draw(&area.polygon, "style='fill:#fde'");
    }
    for bay in &roads.bays {
        let (l, w) = (0.5 * bay.length, 0.5 * bay.width);
        let corners =
            [(l, w), (-l, w), (-l, -w), (l, -w), (l, w)].map(|(x, y)| flat(bay.pose.to_world(Point::new(x, y))));
        draw(&corners, "stroke='#999' stroke-width='0.15'");
    }
    for (lane, map) in roads.lanes.iter().zip(&roads.map.lanes) {
        let color = match (lane.bike, lane.way.map(|way| way.turn), lane.solid) {
            (true, ..) => "#2a2",
            (_, Some(Turn::Left), _) => "#d22",
            (_, Some(Turn::Right), _) => "#22d",
            (_, Some(Turn::Straight), _) => "#888",
            (_, None, true) => "#f80",
            _ => "#000",
        };
        draw(&map.centerline, &format!("stroke='{color}' stroke-width='0.2'"));
        let start = lane.course.start();
        draw(
            &[flat(start.to_world(Point::new(0.0, 0.7))), flat(start.to_world(Point::new(0.0, -0.7)))],
            "stroke='#000' stroke-width='0.15'",
        );
    }
    for line in &roads.map.road_lines {
        let name = format!("{:?}", line.kind);
        let color = if name.contains("Yellow") { "#da0" } else { "#bbb" };
        let dash = if name.contains("Broken") { "stroke-dasharray='1 1'" } else { "" };
        draw(&line.polyline, &format!("stroke='{color}' stroke-width='0.2' {dash}"));
    }
    for edge in &roads.map.road_edges {
        let color = if edge.kind == world::map::RoadEdgeKind::Median { "#a0a" } else { "#622" };
        draw(&edge.polyline, &format!("stroke='{color}' stroke-width='0.35'"));
    }
    for walk in &roads.walks {
        draw(&walk.polyline(), "stroke='#6cc' stroke-width='0.3'");
    }
    for crossing in &roads.crossings {
        draw(&crossing.course.polyline(), "stroke='#08f' stroke-width='0.2'");
    }
    for sign in &roads.map.stop_signs {
        let Point3 { x, y, .. } = sign.position;
        draw(&[Point3::new(x, y - 0.5, 0.0), Point3::new(x, y + 0.5, 0.0)], "stroke='#f00' stroke-width='1'");
    }
    text + "</svg>\n"
}
