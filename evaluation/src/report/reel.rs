//! A drive as the page's player plays it, as compact as it can be: JSON of whole numbers (`packed`), deflated.

use std::collections::BTreeMap;

use serde::Serialize;
use world::geometry::{Point, wrap_angle};
use world::map::{Area, LaneKind, Map, RoadLineKind};
use world::plan::PlanState;
use world::scene::{AgentKind, TrackId};
use world::signal::SignalState;

use super::packed::{HEADING, MAP, PLACE, RATE, coded, letters, quantised};
use super::thinned::thinned;
use crate::footage::{Footage, Future, Recording};

/// An episode takes at most so many letters of the page.
pub const MOST_BYTES: usize = 150_000;

/// How far off the line through the points that are left the others may be (m).
const MAP_TOLERANCE: f64 = 0.04;
/// Predictions that stay within this distance are not drawn (m): parked cars would be dots of noise.
const STILL: f64 = 0.5;
/// The AV's places around which the map is kept, every so many frames.
const PLACES_EVERY: usize = 10;

/// How much of a drive is told.
#[derive(Clone, Copy, Debug)]
struct Detail {
    /// Map and agents within this distance of the AV (m).
    radius: f64,
    /// Every how many poses of 0.1 s a prediction is told.
    stride: usize,
    /// Every how many frames.
    every: usize,
    /// The likeliest futures, so many.
    futures: usize,
}

/// From the most on: the first that fits is taken.
const DETAILS: [Detail; 6] = [
    Detail { radius: 100.0, stride: 5, every: 1, futures: 6 },
    Detail { radius: 100.0, stride: 10, every: 1, futures: 6 },
    Detail { radius: 80.0, stride: 10, every: 2, futures: 3 },
    Detail { radius: 70.0, stride: 10, every: 5, futures: 1 },
    Detail { radius: 50.0, stride: 10, every: 10, futures: 1 },
    Detail { radius: 40.0, stride: 10, every: 1, futures: 0 },
];

/// Every how many poses of 0.1 s a plan is told.
const PLAN_STRIDE: usize = 5;

/// A drive, packed.
#[derive(Debug)]
pub struct Reel {
    /// zlib, base64: at most [`MOST_BYTES`] letters.
    pub letters: String,
    /// What the page must say of it; empty where nothing.
    pub note: String,
}

/// Another drive through the same scene, to be shown beside.
#[derive(Debug)]
pub struct Beside<'a> {
    /// What it is called.
    pub label: &'a str,
    /// Its AV after each step.
    pub states: &'a [PlanState],
}

impl Reel {
    /// `footage`, with `title` above it; none where it is too large in the least detail.
    #[must_use]
    pub fn of(footage: &Footage, beside: Option<&Beside<'_>>) -> Option<Self> {
        for (level, detail) in DETAILS.iter().enumerate() {
            let bytes = serde_json::to_vec(&Film::of(footage, beside, detail)).ok()?;
            let letters = letters(&bytes);
            if letters.len() <= MOST_BYTES {
                return Some(Self { letters, note: note(footage, level) });
            }
        }
        None
    }
}

fn note(footage: &Footage, level: usize) -> String {
    match &footage.recording {
        Recording::Missing => {
            "No plans or predictions are recorded of this drive: `sim run --record all` keeps them.".to_owned()
        }
        Recording::Unusable(why) => {
            format!("The recording cannot be used, so that there are no plans and predictions: {why}")
        }
        Recording::Read if level > 1 => {
            "The drive is too large to be shown whole: the map is cut closer, and predictions are fewer.".to_owned()
        }
        Recording::Read => String::new(),
    }
}

/// What the player is told. Names are short: there are many.
#[derive(Debug, Serialize)]
struct Film {
    /// The quanta: places of what moves, of the map, headings, rates.
    q: [f64; 4],
    /// Where (0, 0) is in the log's frame (m).
    o: [f64; 2],
    map: Layers,
    av: Mover,
    /// Speed, acceleration, and the limit (-1 where none is known).
    speed: Vec<i64>,
    acc: Vec<i64>,
    limit: Vec<i64>,
    /// The log's own AV.
    log: Vec<Run>,
    agents: Vec<Agent>,
    signals: Vec<Light>,
    /// Of each frame: x and y of each point, less the AV's place; empty where there is none.
    plans: Vec<Vec<i64>>,
    /// Of each frame, of each future; null where those of the frame before still hold.
    futures: Vec<Option<Vec<Told>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    beside: Option<Other>,
    /// Frame, sentence, whether a fault begins.
    events: Vec<(usize, String, bool)>,
}

/// The map: x and y of each line, one after the other.
#[derive(Debug, Default, Serialize)]
struct Layers {
    lanes: Vec<[Vec<i64>; 2]>,
    bikes: Vec<[Vec<i64>; 2]>,
    edges: Vec<[Vec<i64>; 2]>,
    white: Vec<[Vec<i64>; 2]>,
    yellow: Vec<[Vec<i64>; 2]>,
    dashed: Vec<[Vec<i64>; 2]>,
    crossings: Vec<[Vec<i64>; 2]>,
    areas: Vec<[Vec<i64>; 2]>,
    stops: Vec<[i64; 2]>,
}

/// Who moves: length, width and a run.
#[derive(Debug, Serialize)]
struct Mover {
    size: [i64; 2],
    run: Run,
}

/// Frames in a row: the first, then x, y and heading.
type Run = (usize, Vec<i64>, Vec<i64>, Vec<i64>);

#[derive(Debug, Serialize)]
struct Agent {
    id: i32,
    kind: u8,
    size: [i64; 2],
    runs: Vec<Run>,
    /// From which frame on it reacts.
    #[serde(skip_serializing_if = "Option::is_none")]
    reacts: Option<usize>,
}

/// A signal: where, and how long it shows what.
#[derive(Debug, Serialize)]
struct Light {
    at: [i64; 2],
    shows: Vec<(i8, usize)>,
}

/// A future: its probability in percent, and of each agent its number among those told, and x and y of each point less its place.
type Told = (u8, Vec<(usize, Vec<i64>)>);

#[derive(Debug, Serialize)]
struct Other {
    label: String,
    run: Run,
}

/// Where numbers are counted from.
#[derive(Clone, Copy)]
struct Origin(Point);

impl Origin {
    fn place(self, point: Point) -> [i64; 2] {
        self.at(point, PLACE)
    }

    fn at(self, point: Point, quantum: f64) -> [i64; 2] {
        let offset = point - self.0;
        [quantised(offset.x, quantum), quantised(offset.y, quantum)]
    }

    /// A run of places and headings.
    fn run(self, from: usize, poses: &[(Point, f64)]) -> Run {
        let places: Vec<[i64; 2]> = poses.iter().map(|(point, _)| self.place(*point)).collect();
        let column = |axis: usize| coded(&places.iter().map(|place| place[axis]).collect::<Vec<_>>());
        let headings: Vec<i64> = poses.iter().map(|(_, heading)| quantised(wrap_angle(*heading), HEADING)).collect();
        (from, column(0), column(1), coded(&headings))
    }

    /// Points one after the other, each less the one before; the first less `base`.
    fn way(self, base: Point, points: impl Iterator<Item = Point>) -> Vec<i64> {
        let mut last = self.place(base);
        let mut way = Vec::new();
        for point in points {
            let place = self.place(point);
            way.extend([place[0] - last[0], place[1] - last[1]]);
            last = place;
        }
        way
    }
}

impl Film {
    fn of(footage: &Footage, beside: Option<&Beside<'_>>, detail: &Detail) -> Self {
        let first = footage.frames.first().map_or(Point::default(), |frame| at(&frame.av));
        let origin = Origin(Point::new(first.x.round(), first.y.round()));
        let places: Vec<Point> = footage
            .frames
            .iter()
            .step_by(PLACES_EVERY)
            .chain(footage.frames.last())
            .map(|frame| at(&frame.av))
            .collect();
        let near = |point: Point, radius: f64| places.iter().any(|place| place.distance(point) < radius);
        let agents = agents(footage, origin, |point| near(point, detail.radius));
        let index: BTreeMap<TrackId, usize> =
            agents.iter().enumerate().map(|(index, agent)| (TrackId(agent.id), index)).collect();
        let av: Vec<(Point, f64)> = footage.frames.iter().map(|frame| (at(&frame.av), frame.av.heading)).collect();
        let rates = |value: fn(&crate::footage::Frame) -> f64| {
            coded(&footage.frames.iter().map(|frame| quantised(value(frame), RATE)).collect::<Vec<_>>())
        };
        let logged: Vec<Option<(Point, f64)>> = (0..footage.frames.len())
            .map(|frame| footage.logged_av(frame).map(|state| (state.position(), state.heading)))
            .collect();
        let mut plans = Vec::with_capacity(footage.frames.len());
        let mut futures = Vec::with_capacity(footage.frames.len());
        for (number, frame) in footage.frames.iter().enumerate() {
            plans.push(origin.way(at(&frame.av), strided(&frame.plan, PLAN_STRIDE)));
            let told = number % detail.every == 0 || frame.futures.is_empty();
            futures.push(told.then(|| {
                let likeliest = frame.futures.iter().take(detail.futures);
                likeliest.map(|future| told_future(footage, number, future, &index, origin, detail.stride)).collect()
            }));
        }
        let beside = beside.map(|other| {
            let poses = std::iter::once(av[0]).chain(other.states.iter().map(|state| (at(state), state.heading)));
            Other { label: other.label.to_owned(), run: origin.run(0, &poses.collect::<Vec<_>>()) }
        });
        Self {
            q: [PLACE, MAP, HEADING, RATE],
            o: [origin.0.x, origin.0.y],
            map: layers(footage.scene.map(), origin, |point| near(point, detail.radius)),
            av: Mover { size: footage.size.map(|side| quantised(side, PLACE)), run: origin.run(0, &av) },
            speed: rates(|frame| frame.av.speed),
            acc: rates(|frame| frame.acceleration),
            limit: rates(|frame| frame.limit.unwrap_or(-RATE)),
            log: runs(origin, &logged),
            agents,
            signals: signals(footage, origin, |point| near(point, detail.radius)),
            plans,
            futures,
            beside,
            events: footage.events.iter().map(|event| (event.frame, event.text.clone(), event.is_fault)).collect(),
        }
    }
}

fn at(state: &PlanState) -> Point {
    Point::new(state.x, state.y)
}

/// Every so many points, so that the last is among them.
fn strided(points: &[Point], stride: usize) -> impl Iterator<Item = Point> {
    points.iter().skip(stride - 1).step_by(stride).copied()
}

fn told_future(
    footage: &Footage,
    frame: usize,
    future: &Future,
    index: &BTreeMap<TrackId, usize>,
    origin: Origin,
    stride: usize,
) -> Told {
    let log_index = footage.start + frame;
    let tracks = footage.scene.tracks();
    let lines = future.tracks.iter().filter_map(|(track, points)| {
        let number = *index.get(track)?;
        let (first, last) = (points.first()?, points.last()?);
        let moves = first.distance(*last) > STILL;
        let place = tracks.iter().position(|one| one.id == *track)?;
        // Who is predicted and not there is counted from the origin.
        let base = footage.scene.logged(place, log_index).map_or(origin.0, |state| state.position());
        moves.then(|| (number, origin.way(base, strided(points, stride))))
    });
    let percent = (100.0 * future.probability).round().clamp(0.0, 100.0) as u8;
    (percent, lines.collect())
}

/// Stretches of frames at which somebody is there.
fn runs(origin: Origin, poses: &[Option<(Point, f64)>]) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut from = 0;
    for stretch in poses.chunk_by(|a, b| a.is_some() == b.is_some()) {
        let there: Vec<(Point, f64)> = stretch.iter().flatten().copied().collect();
        if !there.is_empty() {
            runs.push(origin.run(from, &there));
        }
        from += stretch.len();
    }
    runs
}

fn agents(footage: &Footage, origin: Origin, near: impl Fn(Point) -> bool) -> Vec<Agent> {
    let scene = &footage.scene;
    let mut agents = Vec::new();
    for (index, track) in scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index()) {
        let states: Vec<_> =
            (0..footage.frames.len()).map(|frame| scene.logged(index, footage.start + frame)).collect();
        let Some(first) = states.iter().flatten().next() else { continue };
        if !states.iter().flatten().step_by(PLACES_EVERY).any(|state| near(state.position())) {
            continue;
        }
        let poses: Vec<_> = states.iter().map(|state| state.map(|one| (one.position(), one.heading))).collect();
        let kind = match track.kind {
            AgentKind::Vehicle => 0,
            AgentKind::Pedestrian => 1,
            AgentKind::Cyclist => 2,
            AgentKind::Other => 3,
        };
        let size = [first.length, first.width].map(|side| quantised(side.max(0.0), PLACE));
        let reacts = footage.reacts.get(&track.id).copied();
        agents.push(Agent { id: track.id.0, kind, size, runs: runs(origin, &poses), reacts });
    }
    agents
}

fn signals(footage: &Footage, origin: Origin, near: impl Fn(Point) -> bool) -> Vec<Light> {
    let code = |state: SignalState| match state {
        SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => 1,
        SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => 2,
        SignalState::Go | SignalState::ArrowGo => 3,
        SignalState::Unknown => 0,
    };
    // By lane: where it stands, and what it shows in each frame; -1 where nothing is said.
    let mut lights: BTreeMap<i64, ([i64; 2], Vec<i8>)> = BTreeMap::new();
    let frames = footage.frames.len();
    for frame in 0..frames {
        for signal in footage.scene.signals(footage.log_index(frame)) {
            let point = signal.stop_point.xy();
            if near(point) {
                let light = lights.entry(signal.lane.0).or_insert_with(|| (origin.place(point), vec![-1; frames]));
                light.1[frame] = code(signal.state);
            }
        }
    }
    let stretches = |states: &[i8]| states.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect();
    lights.into_values().map(|(at, states)| Light { at, shows: stretches(&states) }).collect()
}

fn layers(map: &Map, origin: Origin, near: impl Fn(Point) -> bool) -> Layers {
    let mut layers = Layers::default();
    let line = |points: &mut dyn Iterator<Item = Point>, into: &mut Vec<[Vec<i64>; 2]>| {
        let points: Vec<Point> = points.collect();
        // Long lines are cut to their parts that are near.
        for part in points.chunk_by(|a, b| near(*a) == near(*b)) {
            let kept = thinned(part, MAP_TOLERANCE);
            if kept.len() > 1 && near(part[0]) {
                let places: Vec<[i64; 2]> = kept.iter().map(|point| origin.at(*point, MAP)).collect();
                into.push([0, 1].map(|axis| coded(&places.iter().map(|place| place[axis]).collect::<Vec<_>>())));
            }
        }
    };
    for lane in &map.lanes {
        let into = if lane.kind == LaneKind::BikeLane { &mut layers.bikes } else { &mut layers.lanes };
        line(&mut lane.centerline.iter().map(|point| point.xy()), into);
    }
    for edge in &map.road_edges {
        line(&mut edge.polyline.iter().map(|point| point.xy()), &mut layers.edges);
    }
    for painted in &map.road_lines {
        use RoadLineKind as Kind;
        let into = match painted.kind {
            Kind::BrokenSingleWhite => &mut layers.dashed,
            Kind::Unknown | Kind::SolidSingleWhite | Kind::SolidDoubleWhite => &mut layers.white,
            _ => &mut layers.yellow,
        };
        line(&mut painted.polyline.iter().map(|point| point.xy()), into);
    }
    let outlines = |areas: &mut dyn Iterator<Item = &Area>| -> Vec<[Vec<i64>; 2]> {
        let seen = areas.filter(|area| area.polygon.iter().any(|corner| near(corner.xy())));
        let outline = |area: &Area| {
            let places: Vec<[i64; 2]> = area.polygon.iter().map(|corner| origin.at(corner.xy(), MAP)).collect();
            [0, 1].map(|axis| coded(&places.iter().map(|place| place[axis]).collect::<Vec<_>>()))
        };
        seen.map(outline).collect()
    };
    layers.crossings = outlines(&mut map.crosswalks.iter());
    layers.areas = outlines(&mut map.driveways.iter().chain(&map.speed_bumps));
    let stops = map.stop_signs.iter().map(|sign| sign.position.xy()).filter(|point| near(*point));
    layers.stops = stops.map(|point| origin.at(point, MAP)).collect();
    layers
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use base64::Engine as _;
    use scenarios::SceneSet;
    use serde_json::Value;

    use super::super::packed::decoded;
    use super::*;
    use crate::footage::{Event, Frame};

    /// The log's own drive through a scene of the demo set, planned and predicted as it came to pass.
    fn footage(number: usize, futures: usize) -> Footage {
        let (scene, _) = SceneSet::open(&[]).unwrap().load(number).unwrap();
        let (start, frames) = (19, 100);
        let at = |track: usize, step: usize| scene.logged(track, step).copied();
        let ahead = |track: usize, step: usize| -> Vec<Point> {
            (1..=50).filter_map(|k| Some(at(track, step + k)?.position())).collect()
        };
        let frame = |index: usize| {
            let state = at(scene.av_index(), start + index).unwrap();
            let others = (0..scene.tracks().len()).filter(|track| *track != scene.av_index());
            let tracks: Vec<_> = others.map(|track| (scene.tracks()[track].id, ahead(track, start + index))).collect();
            let future = |which: usize| Future { probability: 1.0 / (1 + which) as f64, tracks: tracks.clone() };
            Frame {
                av: PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() },
                acceleration: 0.3,
                limit: (index > 50).then_some(13.4),
                plan: ahead(scene.av_index(), start + index),
                futures: (0..futures).map(future).collect(),
            }
        };
        let frames = (0..frames).map(frame).collect();
        let event = Event { frame: 7, text: "</script><b>".to_owned(), is_fault: true };
        let other = scene.tracks().iter().enumerate().find(|(index, _)| *index != scene.av_index()).unwrap().1;
        let reacts = BTreeMap::from([(other.id, 3)]);
        Footage { start, size: [4.8, 2.0], frames, reacts, events: vec![event], recording: Recording::Read, scene }
    }

    fn film(letters: &str) -> Value {
        let packed = base64::engine::general_purpose::STANDARD.decode(letters).unwrap();
        serde_json::from_slice(&miniz_oxide::inflate::decompress_to_vec_zlib(&packed).unwrap()).unwrap()
    }

    fn row(value: &Value) -> Vec<i64> {
        value.as_array().unwrap().iter().map(|number| number.as_i64().unwrap()).collect()
    }

    fn numbers(value: &Value, quantum: f64) -> Vec<f64> {
        decoded(&row(value)).iter().map(|number| *number as f64 * quantum).collect()
    }

    fn near(told: f64, is: f64, quantum: f64) {
        assert!((told - is).abs() <= 0.5 * quantum + 1e-9, "{told} for {is}");
    }

    #[test]
    fn what_is_played_is_the_drive_within_half_a_quantum() {
        let footage = footage(3, 2);
        let beside: Vec<PlanState> = footage.frames[1..].iter().map(|frame| frame.av).collect();
        let reel = Reel::of(&footage, Some(&Beside { label: "B", states: &beside })).unwrap();
        assert!(reel.note.is_empty() && !reel.letters.contains('<'));
        let film = film(&reel.letters);
        let origin = [0, 1].map(|axis| film["o"][axis].as_f64().unwrap());
        let run = &film["av"]["run"];
        let [x, y] = [1, 2].map(|column| numbers(&run[column], PLACE));
        let (heading, speed) = (numbers(&run[3], HEADING), numbers(&film["speed"], RATE));
        let limit = numbers(&film["limit"], RATE);
        assert_eq!((x.len(), film["events"][0][0].as_u64()), (footage.frames.len(), Some(7)));
        for (index, frame) in footage.frames.iter().enumerate() {
            near(x[index] + origin[0], frame.av.x, PLACE);
            near(y[index] + origin[1], frame.av.y, PLACE);
            near(heading[index], wrap_angle(frame.av.heading), HEADING);
            near(speed[index], frame.av.speed, RATE);
            near(limit[index], frame.limit.unwrap_or(-RATE), RATE);
            // The plan: each point less the one before, the first less the AV.
            let (mut at_x, mut at_y) = (x[index], y[index]);
            let told = row(&film["plans"][index]);
            let points: Vec<Point> = strided(&frame.plan, PLAN_STRIDE).collect();
            assert_eq!(told.len(), 2 * points.len());
            for (step, point) in told.chunks(2).zip(points) {
                (at_x, at_y) = (at_x + step[0] as f64 * PLACE, at_y + step[1] as f64 * PLACE);
                near(at_x + origin[0], point.x, PLACE);
                near(at_y + origin[1], point.y, PLACE);
            }
        }
        // Everybody is where the log has them, when it has them.
        for agent in film["agents"].as_array().unwrap() {
            let id = TrackId(agent["id"].as_i64().unwrap() as i32);
            let track = footage.scene.tracks().iter().position(|track| track.id == id).unwrap();
            let reacts = agent.get("reacts").and_then(Value::as_u64);
            assert_eq!(reacts, footage.reacts.get(&id).map(|frame| *frame as u64));
            let mut told = 0;
            for run in agent["runs"].as_array().unwrap() {
                let from = run[0].as_u64().unwrap() as usize;
                for (offset, (x, y)) in numbers(&run[1], PLACE).iter().zip(numbers(&run[2], PLACE)).enumerate() {
                    let state = footage.scene.logged(track, footage.start + from + offset).unwrap();
                    near(x + origin[0], state.x, PLACE);
                    near(y + origin[1], state.y, PLACE);
                    told += 1;
                }
            }
            let frames = 0..footage.frames.len();
            assert_eq!(told, frames.filter(|at| footage.scene.logged(track, footage.start + at).is_some()).count());
        }
        assert!(film["agents"].as_array().unwrap().iter().any(|agent| agent.get("reacts").is_some()));
        assert_eq!(film["beside"]["run"][1], film["av"]["run"][1]);
    }

    #[test]
    fn no_drive_of_the_demo_set_is_too_large_and_what_is_left_out_is_said() {
        for number in (0..SceneSet::open(&[]).unwrap().entries().len()).step_by(4) {
            let reel = Reel::of(&footage(number, 6), None).unwrap();
            assert!(reel.letters.len() <= MOST_BYTES, "{}", reel.letters.len());
        }
        // Futures that nobody could pack.
        let mut large = footage(3, 6);
        let mut generator = world::pcg::Pcg32::new(1, 1);
        for future in large.frames.iter_mut().flat_map(|frame| &mut frame.futures) {
            for (_, points) in &mut future.tracks {
                let mut place = || generator.between(-900.0, 900.0);
                *points = (0..50).map(|_| Point::new(place(), place())).collect();
            }
        }
        let reel = Reel::of(&large, None).unwrap();
        assert!(reel.letters.len() <= MOST_BYTES && !reel.note.is_empty(), "{}: {}", reel.letters.len(), reel.note);
    }
}
