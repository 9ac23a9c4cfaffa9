use resvg::tiny_skia::Pixmap;
use world::geometry::{Point, Point3};
use world::map::{Area, Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind, RoadLine, RoadLineKind, StopSign};
use world::scene::{AgentKind, AgentState, Scene, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

use super::frame::{Bounds, Frame};
use super::*;

const LOOK: Look = Look { width: 400, extent: Extent::Radius(40.0), av_up: false, trail: 2.0 };

fn straight(from: (f64, f64), to: (f64, f64)) -> Vec<Point3> {
    (0..=100)
        .map(|k| f64::from(k) / 100.0)
        .map(|s| Point3::new(from.0 + s * (to.0 - from.0), from.1 + s * (to.1 - from.1), 0.0))
        .collect()
}

fn square(x: f64, y: f64, width: f64, height: f64) -> Vec<Point3> {
    [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)].map(|(dx, dy)| Point3::new(x + dx, y + dy, 0.0)).to_vec()
}

/// Goes east, `speed` metres in each of 40 steps.
fn track(id: i32, kind: AgentKind, x: f64, y: f64, speed: f64) -> Track {
    let (length, width) = match kind {
        AgentKind::Pedestrian => (0.8, 0.8),
        AgentKind::Cyclist => (1.9, 0.8),
        _ => (4.6, 2.0),
    };
    let state = |step: u32| {
        let x = x + speed * f64::from(step);
        Some(AgentState { x, y, velocity_x: 10.0 * speed, length, width, height: 1.5, ..AgentState::default() })
    };
    Track { id: TrackId(id), kind, states: (0..40).map(state).collect() }
}

/// An east-bound road of two lanes and all that can be beside one; the AV is at the origin at step 20.
fn parts() -> SceneParts {
    let lane = |id: i64, y: f64, kind: LaneKind| {
        let centerline = straight((-100.0, y), (100.0, y));
        Lane { id: MapId(id), kind, centerline, ..Lane::default() }
    };
    let line = |id: i64, y: f64, kind: RoadLineKind| RoadLine {
        id: MapId(id),
        kind,
        polyline: straight((-100.0, y), (100.0, y)),
    };
    let edge = |id: i64, from: f64, to: f64, y: f64, kind: RoadEdgeKind| RoadEdge {
        id: MapId(id),
        kind,
        polyline: straight((from, y), (to, y)),
    };
    let area = |id: i64, polygon: Vec<Point3>| Area { id: MapId(id), polygon };
    let map = Map {
        lanes: vec![
            lane(1, 0.0, LaneKind::SurfaceStreet),
            lane(2, 3.6, LaneKind::SurfaceStreet),
            lane(3, -3.0, LaneKind::BikeLane),
        ],
        road_lines: vec![
            line(10, 1.8, RoadLineKind::BrokenSingleWhite),
            line(11, 5.4, RoadLineKind::SolidDoubleYellow),
        ],
        road_edges: vec![
            edge(20, -100.0, 100.0, -4.0, RoadEdgeKind::Boundary),
            edge(21, 100.0, -100.0, 6.0, RoadEdgeKind::Median),
        ],
        stop_signs: vec![StopSign { id: MapId(30), lanes: vec![MapId(1)], position: Point3::new(20.0, -6.0, 0.0) }],
        crosswalks: vec![area(40, square(22.0, -6.0, 3.0, 14.0))],
        speed_bumps: vec![area(50, square(-30.0, -4.0, 1.0, 10.0))],
        driveways: vec![area(60, square(-20.0, -10.0, 6.0, 6.0))],
    };
    let signal = |lane: i64, y: f64, state: SignalState| Signal {
        lane: MapId(lane),
        state,
        stop_point: Point3::new(21.0, y, 0.0),
    };
    SceneParts {
        id: "a-street".to_owned(),
        timestamps: (0..40).map(|step| f64::from(step) * 0.1).collect(),
        tracks: vec![
            track(7, AgentKind::Vehicle, -20.0, 0.0, 1.0),
            track(8, AgentKind::Vehicle, -10.0, 3.6, 0.8),
            track(9, AgentKind::Vehicle, -17.0, -7.0, 0.0),
            track(10, AgentKind::Pedestrian, 10.0, -5.0, 0.1),
            track(11, AgentKind::Cyclist, -25.0, -3.0, 0.5),
        ],
        av_index: 0,
        signals: vec![vec![signal(1, 0.0, SignalState::Stop), signal(2, 3.6, SignalState::FlashingCaution)]; 40],
        map,
        current_time_index: 20,
        objects_of_interest: vec![TrackId(8)],
        tracks_to_predict: Vec::new(),
    }
}

fn scene(change: impl FnOnce(&mut SceneParts)) -> Scene {
    let mut parts = parts();
    change(&mut parts);
    parts.check().unwrap().0
}

fn draw(scene: &Scene, look: Look) -> Picture {
    Picture::of(Moment::usual(scene), &look)
}

#[test]
fn all_that_is_in_a_scene_is_drawn() {
    let scene = scene(|_| ());
    let picture = draw(&scene, LOOK);
    let svg = picture.svg();
    let red = colours::signal(SignalState::Stop);
    let parts = [
        "<title>a-street</title>",
        colours::ASPHALT,
        colours::BIKE_LANE,
        colours::DRIVEWAY,
        colours::CENTERLINE,
        colours::WHITE_LINE,
        colours::YELLOW_LINE,
        colours::CURB,
        colours::MEDIAN,
        colours::BUMP,
        colours::STOP_SIGN,
        red,
        colours::signal(SignalState::Caution),
        colours::AV,
        colours::STATIONARY,
        colours::agent(AgentKind::Vehicle),
        colours::agent(AgentKind::Pedestrian),
        colours::agent(AgentKind::Cyclist),
        colours::INTEREST,
        "stroke-dasharray",
        "<linearGradient",
    ];
    assert_eq!(parts.into_iter().filter(|part| !svg.contains(part)).collect::<Vec<_>>(), Vec::<&str>::new());
    let without = |change: fn(&mut SceneParts)| draw(&self::scene(change), LOOK);
    assert!(!without(|parts| parts.signals.clear()).svg().contains(red));
    assert!(!without(|parts| parts.map.stop_signs.clear()).svg().contains(colours::STOP_SIGN));
    assert!(!without(|parts| parts.objects_of_interest.clear()).svg().contains(colours::INTEREST));
    let still = draw(&scene, Look { trail: 0.0, ..LOOK });
    assert!(!still.svg().contains("<linearGradient"));
}

#[test]
fn one_scene_gives_the_same_bytes_on_every_machine() {
    let scene = scene(|_| ());
    let small = Look { width: 240, extent: Extent::Radius(12.0), ..LOOK };
    assert_eq!(draw(&scene, small), draw(&scene, small));
    insta::assert_snapshot!(draw(&scene, small).svg());
}

#[test]
fn a_png_shows_things_where_they_are() {
    let scene = scene(|_| ());
    let picture = draw(&scene, LOOK);
    let pixels = Pixmap::decode_png(&picture.png().unwrap()).unwrap();
    assert_eq!((pixels.width(), pixels.height()), (picture.width(), picture.height()));
    assert_eq!(pixels.width(), 400);
    let at = |x: f64, y: f64| {
        let pixel = pixels.pixel((200.0 + 5.0 * x) as u32, (200.0 - 5.0 * y) as u32).unwrap();
        format!("#{:02x}{:02x}{:02x}", pixel.red(), pixel.green(), pixel.blue())
    };
    assert_eq!(at(-1.0, 0.0), colours::AV);
    assert_eq!(at(30.0, 3.0), colours::ASPHALT);
    assert_eq!(at(10.0, 30.0), colours::GROUND);
    assert_eq!(at(-15.0, -9.5), colours::DRIVEWAY);
    assert_eq!(at(-17.0, -7.0), colours::STATIONARY);
    assert_eq!(at(21.0, 0.0), colours::signal(SignalState::Stop));
}

#[test]
fn what_heads_up_is_the_av_where_that_is_wanted() {
    let north = scene(|parts| {
        for state in parts.tracks.iter_mut().flat_map(|track| &mut track.states).flatten() {
            (state.x, state.y, state.heading) = (-state.y, state.x, std::f64::consts::FRAC_PI_2);
        }
    });
    let frame = |scene: &Scene, av_up: bool| {
        let pose = Moment::usual(scene).av_pose();
        let up = if av_up { Point::unit(pose.heading) } else { Point::new(0.0, 1.0) };
        Frame::around(pose.position(), 40.0, up, 400.0).pixel(pose.to_world(Point::new(10.0, 0.0)))
    };
    let ahead = Point::new(200.0, 150.0);
    assert!(frame(&north, false).distance(ahead) < 1e-9 && frame(&north, true).distance(ahead) < 1e-9);
    let east = scene(|_| ());
    assert!(frame(&east, false).distance(Point::new(250.0, 200.0)) < 1e-9 && frame(&east, true).distance(ahead) < 1e-9);
    assert_ne!(draw(&east, LOOK), draw(&east, Look { av_up: true, ..LOOK }));
}

#[test]
fn a_pixel_leads_back_to_its_point() {
    let up = Point::unit(0.7);
    let bounds = Bounds::of([Point::new(1.0, 2.0), Point::new(30.0, -40.0)].into_iter(), up);
    for frame in [Frame::around(Point::new(3.0, 4.0), 20.0, up, 640.0), Frame::fitting(bounds, up, 640.0, 480.0)] {
        for point in [Point::new(1.0, 2.0), Point::new(-9.0, 17.0)] {
            assert!(frame.log_point(frame.pixel(point)).distance(point) < 1e-9);
        }
    }
}

#[test]
fn a_whole_map_is_as_high_as_it_needs_to_be() {
    let scene = scene(|_| ());
    let whole = Look { extent: Extent::Whole, ..LOOK };
    let picture = draw(&scene, whole);
    let square = draw(&scene, LOOK);
    // 200 m by 16 m: no lower than a third of its width.
    assert_eq!(square.height() - picture.height(), 400 - 133);
    assert!(picture.svg().contains(colours::BUMP));
}

#[test]
fn a_sheet_has_a_tile_for_each_scene() {
    let scene = scene(|_| ());
    let sheet = |columns: u32, tiles: usize| {
        let mut sheet = Sheet::new(columns, Look { width: 200, ..LOOK });
        (0..tiles).for_each(|_| sheet.add(Moment::usual(&scene)));
        sheet.finish()
    };
    let (one, five) = (sheet(3, 1), sheet(3, 5));
    assert_eq!(five.svg().matches("class=\"tile\"").count(), 5);
    assert_eq!((one.width(), five.width()), (5 + 205, 5 + 3 * 205));
    assert!(five.height() > one.height() + 200);
    let pixels = Pixmap::decode_png(&five.png().unwrap()).unwrap();
    assert_eq!((pixels.width(), pixels.height()), (five.width(), five.height()));
    assert_eq!(sheet(0, 0).width(), 5);
    assert_eq!([1, 2, 3, 4, 5, 9, 10, 100].map(Sheet::usual_columns), [1, 2, 2, 2, 3, 3, 4, 10]);
}

#[test]
fn a_step_past_the_end_is_refused_and_the_usual_one_is_where_drives_begin() {
    let scene = scene(|parts| parts.current_time_index = 0);
    assert_eq!(Moment::usual(&scene).step(), 19);
    let error = Moment::new(&scene, 40).unwrap_err();
    assert_eq!(error.to_string(), "scene a-street has the steps 0 to 39, so no step 40");
    assert_eq!(Moment::new(&scene, 39).unwrap().step(), 39);
}

#[test]
fn odd_scenes_are_drawn_as_well() {
    let nobody = scene(|parts| {
        parts.map = Map::default();
        parts.tracks.truncate(1);
        parts.tracks[0].states[10..].fill(None);
    });
    let far = scene(|parts| {
        let corners = [(-9.9e6, -9.9e6), (9.9e6, -9.9e6), (9.9e6, 9.9e6)];
        let polygon: Vec<Point3> = corners.map(|(x, y)| Point3::new(x, y, 0.0)).to_vec();
        parts.map.road_edges[0].polyline = polygon.clone();
        parts.map.crosswalks[0].polygon = polygon.clone();
        parts.map.road_lines[0].polyline = polygon;
        parts.tracks[1].states.iter_mut().flatten().for_each(|state| (state.x, state.y) = (9e6, -9e6));
    });
    let points = scene(|parts| {
        let point = vec![Point3::default()];
        parts.map.lanes[0].centerline = point.clone();
        parts.map.road_lines[0].polyline = point.clone();
        parts.map.road_edges[0].polyline = vec![Point3::default(); 5];
        parts.map.crosswalks[0].polygon = point.clone();
        parts.map.driveways[0].polygon = point;
        let sizes = [(0.0, 0.0), (f64::NAN, 2.0), (900.0, 0.0), (1e-9, 1e-9), (5.0, 900.0)];
        for (track, (length, width)) in parts.tracks.iter_mut().zip(sizes) {
            track.states.iter_mut().flatten().for_each(|state| (state.length, state.width) = (length, width));
        }
    });
    for scene in [&nobody, &far, &points] {
        for extent in [Extent::Radius(5.0), Extent::Radius(5000.0), Extent::Whole] {
            for width in [100, 900] {
                let picture = draw(scene, Look { width, extent, av_up: true, trail: 60.0 });
                assert!(!picture.svg().contains("NaN") && !picture.svg().contains("inf"), "{extent:?}");
                picture.png().unwrap();
            }
        }
    }
}

#[test]
fn a_png_has_a_largest_size() {
    let mut sheet = Sheet::new(10, Look { width: 10_000, ..LOOK });
    let scene = scene(|_| ());
    sheet.add(Moment::usual(&scene));
    sheet.add(Moment::usual(&scene));
    let error = sheet.finish().png().unwrap_err();
    assert!(matches!(error, PngError::TooLarge { width: 20_750, .. }), "{error}");
}
