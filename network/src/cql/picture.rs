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
//! Edges are smooth: a place that is covered in part goes that part of the way to the brightness. Drawn by [`Brush`] in pure arithmetic, the same bytes
//! everywhere, and without an allocation: outlines of what does not move are made once an episode ([`Ground`]), and filled anew at each step.

use world::geometry::{OrientedBox, Point};
use world::map::Map;
use world::observation::HistoryStep;
use world::reference_line::ReferenceLine;
use world::scene::AgentState;
use world::signal::{Signal, SignalState};

use super::brush::Brush;
use super::ground::{Ground, View, own};

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
/// Nothing farther from the AV is seen (m).
const REACH: f64 = 58.0;
/// Somebody whose size the log does not say has this (m).
const LEAST_SIZE: f64 = 0.6;

/// Draws the pictures of one episode.
#[derive(Clone, Debug)]
pub struct Painter {
    ground: Ground,
    brush: Brush,
    picture: Vec<u8>,
}

impl Painter {
    /// For a map and the line along the route.
    #[must_use]
    pub fn new(map: &Map, line: &ReferenceLine) -> Self {
        Self { ground: Ground::new(map, line), brush: Brush::new(), picture: vec![0; PICTURE] }
    }

    /// The picture at the last of `steps`, in which earlier ones are found by their log index. Rows from the front to the back, in each from left to
    /// right, all channels of a place together. Black where there is no step.
    pub fn paint<'h>(
        &mut self,
        steps: impl DoubleEndedIterator<Item = &'h HistoryStep>,
        signals: impl Iterator<Item = Signal>,
    ) -> &[u8] {
        self.picture.fill(0);
        self.draw(steps, signals);
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
        let view = View::new(pose, self.ground.origin);
        self.ground.draw(&view, &mut self.brush, &mut self.picture);
        for Signal { state, stop_point, .. } in signals {
            let shade = match state {
                SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => 255,
                SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => 225,
                SignalState::Go | SignalState::ArrowGo => 200,
                SignalState::Unknown => continue,
            };
            let corners = self.ground.disc(stop_point.xy(), 1.5);
            self.brush.outline(corners.map(|corner| view.place(corner)));
            self.brush.fill(&mut self.picture, 0, shade);
        }
        for step in steps {
            let age = now.log_index.saturating_sub(step.log_index);
            if age > AGES[0] {
                break;
            }
            let shade = 255 - 12 * age as u8;
            if AGES_OF_OTHERS.contains(&age) {
                let others = step.agents.iter().map(|agent| &agent.state);
                let near = others.filter(|other| other.position().distance(pose.position()) < REACH + other.length);
                near.for_each(|other| self.agent(other, &view, 1, shade));
            }
            if AGES.contains(&age) {
                self.agent(&step.av, &view, 2, shade);
            }
        }
    }

    fn agent(&mut self, state: &AgentState, view: &View, channel: usize, shade: u8) {
        let shape = OrientedBox::new(state.pose(), state.length.max(LEAST_SIZE), state.width.max(LEAST_SIZE));
        let corners = shape.corners().map(|corner: Point| view.place(own(self.ground.origin, corner)));
        self.brush.outline(corners.into_iter());
        self.brush.fill(&mut self.picture, channel, shade);
    }
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
