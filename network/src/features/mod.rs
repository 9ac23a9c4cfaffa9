//! From what a node knows at a step to what the network is asked (paper III-B): the same for a logged window and for a live drive.
//!
//! | module | what |
//! | --- | --- |
//! | `map` | what does not change within a scene |
//! | `agents` | histories, with what is missing filled in |
//! | `lanes` | which lanes an agent may be on, and where they lead |
//! | `crosswalks` | which crosswalks lie before an agent |
//! | `transform`, `sampling` | the AV's frame; a hundred points |

mod agents;
mod crosswalks;
mod lanes;
mod map;
mod sampling;
mod transform;

use world::geometry::{Point, Pose};
use world::map::{Map, MapId};
use world::scene::{AgentKind, AgentState};
use world::signal::Signal;

use self::lanes::LaneSearch;
use self::map::PreparedMap;
use self::transform::Transform;
use crate::frame::{AGENTS, CROSSWALKS, Frame, HISTORY, LANES, LanePoint, Motion, NEIGHBORS, POINTS, Sequence};

pub use self::agents::History;

/// How features are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// As the authors' code makes them, quirk for quirk: for their weights.
    Authors,
    /// Without what is plainly a bug: for weights that were trained so.
    Mended,
}

/// Points that are walked along a sequence of lanes: about 150 m.
const WALKED: usize = 300;

/// A lane's point is at the stop point if it is nearer than this (m).
const AT_STOP: f64 = 1.0;

/// Somebody else at a step.
#[derive(Clone, Copy, Debug)]
pub struct Other {
    /// What it is.
    pub kind: AgentKind,
    /// Where it was.
    pub history: History,
}

/// What is known at a step, in the log's frame.
#[derive(Clone, Debug)]
pub struct Moment<'a> {
    /// The AV's last 20 states, oldest first; the last one now.
    pub av: [AgentState; HISTORY],
    /// Whether they are the log's own, which the authors hold in f32.
    pub av_is_logged: bool,
    /// Everybody else, in the log's order.
    pub others: &'a [Other],
    /// What is shown now, in the log's order.
    pub signals: &'a [Signal],
}

/// Which lanes and neighbors went into a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// For each neighbor its place among the moment's others.
    pub neighbors: Vec<usize>,
    /// For each agent its sequences: each lane, and the number of the point that it is entered at.
    pub lanes: [Vec<Vec<(MapId, usize)>>; AGENTS],
    /// For each agent how many sequences there were.
    pub candidates: [Option<usize>; AGENTS],
}

/// Makes frames of one scene.
#[derive(Clone, Debug)]
pub struct Features {
    style: Style,
    map: PreparedMap,
    search: LaneSearch,
    /// For each lane its signal: state, and where cars stop.
    lights: Vec<Option<(u8, Point)>>,
    /// For each point of the map its number in the frame.
    numbers: Vec<Option<u16>>,
    used: Vec<usize>,
}

impl Features {
    /// For the scenes of `map`.
    #[must_use]
    pub fn new(map: &Map, style: Style) -> Self {
        let map = PreparedMap::of(map, style);
        let (lights, numbers) = (vec![None; map.lanes.len()], vec![None; map.points.len()]);
        Self { style, map, search: LaneSearch::default(), lights, numbers, used: Vec::new() }
    }

    /// The frame at a moment, in `frame`; and where it comes from.
    pub fn frame(&mut self, moment: &Moment<'_>, frame: &mut Frame) -> Sources {
        let style = self.style;
        let mut sources = Sources::default();
        frame.lane_points.clear();
        frame.crosswalk_points.clear();
        self.light(moment.signals);
        let now = moment.av[HISTORY - 1];
        let transform = Transform::to(now.pose(), style);
        sources.neighbors = neighbors(moment.others, now.position());
        frame.agents = Default::default();
        let mut crosswalks = vec![None; self.map.crosswalks.len()];
        for index in 0..=sources.neighbors.len() {
            let other = index.checked_sub(1).map(|neighbor| &moment.others[sources.neighbors[neighbor]]);
            let agent = &mut frame.agents[index];
            let pose: Pose;
            (agent.history, pose) = match other {
                None => agents::rows(
                    &moment.av.map(Some),
                    &transform,
                    style,
                    style == Style::Authors && moment.av_is_logged,
                ),
                Some(other) => agents::rows(&other.history, &transform, style, style == Style::Authors),
            };
            let kind = other.map_or(AgentKind::Vehicle, |other| other.kind);
            agent.motion = Motion::of_code(agents::code(kind));
            agent.masked = style == Style::Authors && agent.history[HISTORY - 1][7] == 0.0;
            // To the authors, who stands at x = 0 is nobody.
            if style == Style::Authors && pose.x == 0.0 {
                continue;
            }
            let on_foot = kind == AgentKind::Pedestrian;
            self.search.run(&self.map, pose, on_foot, style, LANES);
            sources.candidates[index] = Some(self.search.candidates);
            for slot in 0..self.search.sequences.len() {
                sources.lanes[index].push(self.told(slot));
                let sequence = self.sequence(slot, &transform, &mut frame.lane_points);
                frame.agents[index].lanes[slot] = sequence;
            }
            let before = crosswalks::before(&self.map.crosswalks, pose);
            for (slot, number) in frame.agents[index].crosswalks.iter_mut().zip(before.take(CROSSWALKS)) {
                let first = *crosswalks[number].get_or_insert_with(|| {
                    let first = frame.crosswalk_points.len();
                    let outline = self.map.crosswalks[number].outline.iter();
                    frame.crosswalk_points.extend(outline.map(|vertex| transform.vertex(vertex, false)));
                    first
                });
                let masked = style == Style::Authors && frame.crosswalk_points[first][0] == 0.0;
                *slot = Some(Sequence { points: std::array::from_fn(|k| (first + k) as u16), masked });
            }
        }
        for agent in frame.agents[1 + sources.neighbors.len()..].iter_mut() {
            agent.masked = true;
        }
        self.used.drain(..).for_each(|point| self.numbers[point] = None);
        sources
    }

    /// What each lane is shown: the authors let it leak to the lanes that lead there.
    fn light(&mut self, signals: &[Signal]) {
        self.lights.fill(None);
        for signal in signals {
            let Some(lane) = self.map.lane_of.get(&signal.lane) else { continue };
            let shown = Some((signal.state as u8, signal.stop_point.xy()));
            self.lights[*lane] = shown;
            if self.style == Style::Authors {
                self.map.lanes[*lane].entries.iter().for_each(|entry| self.lights[*entry] = shown);
            }
        }
    }

    fn start(&self, lane: usize) -> usize {
        // A lane that was reached twice keeps the later start.
        self.search.entries.iter().rev().find(|(entry, _)| *entry == lane).map_or(0, |(_, start)| *start)
    }

    fn told(&self, slot: usize) -> Vec<(MapId, usize)> {
        let lanes = self.search.sequences[slot].iter();
        lanes.map(|lane| (self.map.lanes[*lane].id, self.start(*lane))).collect()
    }

    /// The points along a sequence; those that the frame does not hold yet are added to it.
    fn sequence(&mut self, slot: usize, transform: &Transform, points: &mut Vec<LanePoint>) -> Option<Sequence> {
        let mut walked = [(0_usize, 0_usize); WALKED];
        let mut count = 0;
        'lanes: for lane in &self.search.sequences[slot] {
            for index in self.start(*lane)..self.map.lanes[*lane].count {
                walked[count] = (*lane, index);
                count += 1;
                if count == WALKED {
                    break 'lanes;
                }
            }
        }
        if count == 0 {
            return None;
        }
        let chosen: [(usize, usize); POINTS] = sampling::sampled(count, |at| walked[at]);
        let mut numbers = [0; POINTS];
        for (number, (lane, index)) in numbers.iter_mut().zip(chosen) {
            let place = self.map.lanes[lane].first + index;
            *number = match self.numbers[place] {
                Some(number) => number,
                None => {
                    let number = points.len() as u16;
                    points.push(self.point(lane, place, transform));
                    self.numbers[place] = Some(number);
                    self.used.push(place);
                    number
                }
            };
        }
        let masked = self.style == Style::Authors && points[usize::from(numbers[0])][0] == 0.0;
        Some(Sequence { points: numbers, masked })
    }

    fn point(&self, lane: usize, place: usize, transform: &Transform) -> LanePoint {
        let vertex = &self.map.points[place];
        let prepared = &self.map.lanes[lane];
        let mut row = [0.0; 17];
        row[..3].copy_from_slice(&transform.vertex(&vertex.center, false));
        for (side, to) in vertex.sides.iter().zip(row[3..9].as_chunks_mut::<3>().0) {
            if side.known {
                *to = transform.vertex(&side.nearest, true);
            }
        }
        let light = self.lights[lane];
        let at_stop = light.is_some_and(|(_, stop)| stop.distance(vertex.center.point()) < AT_STOP);
        let flag = |is: bool| f32::from(u8::from(is));
        row[9] = prepared.speed_limit;
        row[10] = f32::from(prepared.kind);
        row[11] = f32::from(vertex.sides[0].code);
        row[12] = f32::from(vertex.sides[1].code);
        row[13] = f32::from(light.map_or(0, |(state, _)| state));
        row[14] = flag(at_stop);
        row[15] = flag(prepared.interpolating);
        row[16] = flag(prepared.stop_sign);
        row
    }
}

/// The nearest ten of those that are there now, the nearest first; of two as near the first.
fn neighbors(others: &[Other], av: Point) -> Vec<usize> {
    let there = others.iter().enumerate().filter_map(|(index, other)| Some((index, other.history[HISTORY - 1]?)));
    let mut near: Vec<(f64, usize)> = there.map(|(index, now)| (now.position().distance(av), index)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.into_iter().map(|(_, index)| index).take(NEIGHBORS).collect()
}
