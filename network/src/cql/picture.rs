//! The scene around the AV from above: 256 x 256 places of 0.25 m, three numbers of a byte each.
//!
//! The AV heads up, 64 m are seen: 48 ahead, 16 behind, 32 to each side. Of what lies over something else in one channel, the brighter is seen:
//!
//! | channel | what | brightness |
//! | --- | --- | --- |
//! | 0 | lanes, 3.5 m wide (none for bicycles) | 60 |
//! | | crosswalks | 90 |
//! | | road edges, 0.4 m wide | 120 |
//! | | stop signs, discs of 1 m | 150 |
//! | | the reference line, 1 m wide | 180 |
//! | | where signals stop, discs of 1.5 m | go 200, caution 225, stop 255; what is unknown is not drawn |
//! | 1 | all others as boxes, now and 0.5 s and 1 s before | 255, and 12 less for each step of 0.1 s that has passed |
//! | 2 | the AV as a box, now and 0.2, 0.5, 1 and 1.5 s before | the same |
//!
//! Edges are smooth: a place that is covered in part has a part of the brightness. Drawn by [`tiny_skia`], in pure arithmetic: the same bytes everywhere.

use tiny_skia::{BlendMode, FillRule, LineJoin, Paint, Path, PathBuilder, PixmapMut, Stroke, Transform};
use world::geometry::{OrientedBox, Point, Pose};
use world::map::Map;
use world::observation::HistoryStep;
use world::reference_line::ReferenceLine;
use world::scene::AgentState;
use world::signal::{Signal, SignalState};

/// Places to a side of a picture.
pub const SIDE: usize = 256;
/// Numbers of a place.
pub const CHANNELS: usize = 3;
/// Numbers of a picture.
pub const PICTURE: usize = SIDE * SIDE * CHANNELS;
/// How many steps before now the AV is shown.
pub const AGES: [u32; 5] = [15, 10, 5, 2, 0];

/// How many steps before now others are shown.
const AGES_OF_OTHERS: [u32; 3] = [10, 5, 0];
/// Places a metre.
const SCALE: f64 = 4.0;
/// Where the AV is: across and down.
const AV: [f64; 2] = [128.0, 192.0];
/// Nothing farther from the AV is seen (m).
const REACH: f64 = 58.0;
/// Points of a line are this far apart (m): on an arc of 10 m they leave it by 5 cm.
const SPACING: f64 = 2.0;
/// Somebody whose size the log does not say has this (m).
const LEAST_SIZE: f64 = 0.6;

/// Draws the pictures of one episode.
#[derive(Clone, Debug)]
pub struct Painter {
    /// What paths are relative to: single precision would be coarse far from the log's origin.
    origin: Point,
    /// What does not move, and how bright it is.
    ground: Vec<(Path, u8)>,
    /// Red, green, blue, opacity.
    pixels: Vec<u8>,
    picture: Vec<u8>,
}

impl Painter {
    /// For a map and the line along the route.
    #[must_use]
    pub fn new(map: &Map, line: &ReferenceLine) -> Self {
        let origin = map.lanes.iter().flat_map(|lane| lane.centerline.first()).map(|point| point.xy()).next();
        let mut painter = Self {
            origin: origin.unwrap_or_default(),
            ground: Vec::new(),
            pixels: vec![0; SIDE * SIDE * 4],
            picture: vec![0; PICTURE],
        };
        for lane in map.lanes.iter().filter(|lane| lane.kind.is_drivable()) {
            painter.line(lane.centerline.iter().map(|point| point.xy()), 3.5, 60);
        }
        for area in &map.crosswalks {
            let corners: Vec<[f32; 2]> = area.polygon.iter().map(|corner| painter.own(corner.xy())).collect();
            painter.ground.extend(polygon(&corners).map(|path| (path, 90)));
        }
        for edge in &map.road_edges {
            painter.line(edge.polyline.iter().map(|point| point.xy()), 0.4, 120);
        }
        for sign in &map.stop_signs {
            painter.ground.extend(painter.disc(sign.position.xy(), 1.0).map(|path| (path, 150)));
        }
        painter.line((0..line.len()).map(|index| line.point(index)), 1.0, 180);
        painter
    }

    /// The picture at the last of `steps`, in which earlier ones are found by their log index. Rows from the front to the back, in each from left to
    /// right, all channels of a place together. Black where there is no step.
    pub fn paint<'h>(
        &mut self,
        steps: impl DoubleEndedIterator<Item = &'h HistoryStep>,
        signals: impl Iterator<Item = Signal>,
    ) -> &[u8] {
        self.pixels.as_chunks_mut::<4>().0.fill([0, 0, 0, 255]);
        self.draw(steps, signals);
        let pixels = self.pixels.as_chunks::<4>().0;
        for (place, [red, green, blue, _]) in self.picture.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(pixels) {
            *place = [*red, *green, *blue];
        }
        &self.picture
    }

    fn draw<'h>(
        &mut self,
        steps: impl DoubleEndedIterator<Item = &'h HistoryStep>,
        signals: impl Iterator<Item = Signal>,
    ) {
        let mut steps = steps.rev().peekable();
        let Some(now) = steps.peek().copied() else { return };
        let pose = now.av.pose();
        let discs: Vec<(Path, u8)> = signals
            .filter_map(|Signal { state, stop_point, .. }| {
                let shade = match state {
                    SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => 255,
                    SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => 225,
                    SignalState::Go | SignalState::ArrowGo => 200,
                    SignalState::Unknown => return None,
                };
                Some((self.disc(stop_point.xy(), 1.5)?, shade))
            })
            .collect();
        let own = self.own(now.av.position()).map(f64::from);
        let Some(pixels) = PixmapMut::from_bytes(&mut self.pixels, SIDE as u32, SIDE as u32) else { return };
        let mut brush = Brush { pixels, view: view(pose, self.origin) };
        for (path, shade) in self.ground.iter().chain(&discs) {
            if is_near(path, own) {
                brush.fill(path, [*shade, 0, 0]);
            }
        }
        for step in steps {
            let age = now.log_index.saturating_sub(step.log_index);
            if age > AGES[0] {
                break;
            }
            let shade = 255 - 12 * age as u8;
            if AGES_OF_OTHERS.contains(&age) {
                let near = step
                    .agents
                    .iter()
                    .filter(|agent| agent.state.position().distance(pose.position()) < REACH + agent.state.length);
                near.for_each(|agent| brush.agent(&agent.state, self.origin, [0, shade, 0]));
            }
            if AGES.contains(&age) {
                brush.agent(&step.av, self.origin, [0, 0, shade]);
            }
        }
    }

    /// Adds a line of so many metres across.
    fn line(&mut self, points: impl Iterator<Item = Point>, width: f32, shade: u8) {
        let mut builder = PathBuilder::new();
        let mut before: Option<Point> = None;
        let mut points = points.peekable();
        while let Some(point) = points.next() {
            let [x, y] = self.own(point);
            match before {
                None => builder.move_to(x, y),
                Some(before) if points.peek().is_some() && before.distance(point) < SPACING => continue,
                Some(_) => builder.line_to(x, y),
            }
            before = Some(point);
        }
        let stroke = Stroke { width, line_join: LineJoin::Bevel, ..Stroke::default() };
        let outline = builder.finish().and_then(|path| path.stroke(&stroke, 1.0));
        self.ground.extend(outline.map(|path| (path, shade)));
    }

    fn disc(&self, center: Point, radius: f32) -> Option<Path> {
        let [x, y] = self.own(center);
        PathBuilder::from_circle(x, y, radius)
    }

    fn own(&self, point: Point) -> [f32; 2] {
        own(self.origin, point)
    }
}

/// Fills paths that are relative to the origin.
struct Brush<'p> {
    pixels: PixmapMut<'p>,
    view: Transform,
}

impl Brush<'_> {
    fn fill(&mut self, path: &Path, [red, green, blue]: [u8; CHANNELS]) {
        let mut paint = Paint { blend_mode: BlendMode::Lighten, ..Paint::default() };
        paint.set_color_rgba8(red, green, blue, 255);
        self.pixels.fill_path(path, &paint, FillRule::Winding, self.view, None);
    }

    fn agent(&mut self, state: &AgentState, origin: Point, colour: [u8; CHANNELS]) {
        let shape = OrientedBox::new(state.pose(), state.length.max(LEAST_SIZE), state.width.max(LEAST_SIZE));
        if let Some(path) = polygon(&shape.corners().map(|corner| own(origin, corner))) {
            self.fill(&path, colour);
        }
    }
}

fn own(origin: Point, point: Point) -> [f32; 2] {
    let Point { x, y } = point - origin;
    [x as f32, y as f32]
}

fn polygon(corners: &[[f32; 2]]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, [x, y]) in corners.iter().enumerate() {
        if index == 0 { builder.move_to(*x, *y) } else { builder.line_to(*x, *y) }
    }
    builder.close();
    builder.finish()
}

/// From metres beyond `origin` to places: the AV heads up.
fn view(av: Pose, origin: Point) -> Transform {
    let forward = Point::unit(av.heading) * SCALE;
    let offset = origin - av.position();
    let (across, down) = (AV[0] - forward.cross(offset), AV[1] - forward.dot(offset));
    let [sine, cosine] = [forward.y, forward.x].map(|part| part as f32);
    Transform::from_row(sine, -cosine, -cosine, -sine, across as f32, down as f32)
}

/// Whether a path may be seen from `own`.
fn is_near(path: &Path, [x, y]: [f64; 2]) -> bool {
    let bounds = path.bounds();
    let [left, top, right, bottom] = [bounds.left(), bounds.top(), bounds.right(), bounds.bottom()].map(f64::from);
    let nearest = Point::new(x.clamp(left, right), y.clamp(top, bottom));
    nearest.distance(Point::new(x, y)) < REACH
}

#[cfg(test)]
mod tests {
    use world::geometry::Point3;
    use world::map::{Lane, MapId};
    use world::observation::ObservedAgent;
    use world::scene::{AgentKind, TrackId};

    use super::*;

    const FAR: Point = Point::new(20_000.0, -7_000.0);

    fn point(x: f64, y: f64) -> Point3 {
        Point3 { x: FAR.x + x, y: FAR.y + y, z: 0.0 }
    }

    /// On a road to the north, the AV at its beginning.
    fn map() -> Map {
        let centerline = (0..=200).map(|index| point(0.0, f64::from(index) * 0.5)).collect();
        Map { lanes: vec![Lane { id: MapId(1), centerline, ..Lane::default() }], ..Map::default() }
    }

    fn state(x: f64, y: f64) -> AgentState {
        let Point3 { x, y, .. } = point(x, y);
        AgentState { x, y, heading: std::f64::consts::FRAC_PI_2, length: 4.0, width: 2.0, ..AgentState::default() }
    }

    fn step(log_index: u32, av: AgentState, other: AgentState) -> HistoryStep {
        let agent = ObservedAgent { track: TrackId(2), kind: AgentKind::Vehicle, state: other, unseen: 0 };
        HistoryStep { log_index, av, agents: vec![agent] }
    }

    fn at(picture: &[u8], across: usize, down: usize) -> [u8; 3] {
        picture.as_chunks::<3>().0[down * SIDE + across]
    }

    #[test]
    fn the_av_heads_up_and_the_past_is_dimmer() {
        let mut painter = Painter::new(&map(), &ReferenceLine::default());
        // The AV has come 5 m in half a second; the other stands 20 m ahead, 4 m to the right.
        let steps: Vec<HistoryStep> =
            (0..=5).map(|index| step(index, state(0.0, 25.0 + f64::from(index)), state(4.0, 50.0))).collect();
        let signal = Signal { lane: MapId(1), state: SignalState::Stop, stop_point: point(0.0, 60.0) };
        let picture = painter.paint(steps.iter(), [signal].into_iter());
        assert_eq!(at(picture, 128, 192), [60, 0, 255], "the AV on its lane");
        assert_eq!(at(picture, 128, 192 + 20), [60, 0, 195], "where it was half a second ago");
        assert_eq!(at(picture, 128 + 16, 192 - 80), [0, 255, 0], "the other");
        assert_eq!(at(picture, 128, 192 - 120), [255, 0, 0], "the red light");
        assert_eq!(at(picture, 128 - 6, 40), [60, 0, 0], "the lane is 3.5 m wide");
        assert_eq!(at(picture, 128 - 8, 40), [0, 0, 0]);
    }

    #[test]
    fn the_same_scene_elsewhere_and_turned_looks_the_same() {
        let mut here = Painter::new(&map(), &ReferenceLine::default());
        let steps = [step(7, state(0.0, 30.0), state(3.0, 40.0))];
        let one = here.paint(steps.iter(), std::iter::empty()).to_vec();
        let turn = |x: f64, y: f64| Point::new(-(y - FAR.y), x - FAR.x);
        let mut map = map();
        for point in &mut map.lanes[0].centerline {
            let Point { x, y } = turn(point.x, point.y);
            (point.x, point.y) = (x, y);
        }
        let turned = |state: AgentState| {
            let Point { x, y } = turn(state.x, state.y);
            AgentState { x, y, heading: std::f64::consts::PI, ..state }
        };
        let steps = [step(7, turned(steps[0].av), turned(steps[0].agents[0].state))];
        let other = Painter::new(&map, &ReferenceLine::default()).paint(steps.iter(), std::iter::empty()).to_vec();
        let worst = one.iter().zip(&other).map(|(one, other)| one.abs_diff(*other)).max();
        assert!(worst <= Some(4), "{worst:?}");
    }

    #[test]
    fn nothing_to_see_is_black() {
        let mut painter = Painter::new(&Map::default(), &ReferenceLine::default());
        assert!(painter.paint(std::iter::empty(), std::iter::empty()).iter().all(|value| *value == 0));
    }
}
