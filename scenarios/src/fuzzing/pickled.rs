//! Pickles as ScenarioNet writes them, of scenes that were generated: for tests and seeds. What is written is protocol 4 and, as
//! [`Raw`](Python::Raw) operations, whatever a test wants.

use world::geometry::Point3;
use world::map::{BoundarySegment, LaneKind, LaneNeighbor, RoadEdgeKind};
use world::scene::{AgentKind, AgentState, Scene};
use world::signal::SignalState;

/// A value of Python's.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "Python's and NumPy's words")]
pub enum Python {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Python>),
    Dict(Vec<(Python, Python)>),
    /// An array of 64-bit floats of this shape.
    Array(Vec<usize>, Vec<f64>),
    /// Operations as they are.
    Raw(Vec<u8>),
}

use Python::{Array, Bool, Dict, Float, Int, List, None as Nothing, Raw, Text};

/// A text.
#[must_use]
pub fn text(text: impl ToString) -> Python {
    Text(text.to_string())
}

/// A dict whose keys are texts.
#[must_use]
pub fn dict<const N: usize>(pairs: [(&str, Python); N]) -> Python {
    Dict(pairs.into_iter().map(|(key, value)| (text(key), value)).collect())
}

/// The call of a class by name.
#[must_use]
pub fn call(module: &str, name: &str, argument: &Python) -> Python {
    let mut out = format!("c{module}\n{name}\n").into_bytes();
    put(argument, &mut out);
    out.extend(b"\x85R");
    Raw(out)
}

impl Python {
    /// What a dict has under a text.
    ///
    /// # Panics
    /// If it is no dict, or has nothing there.
    pub fn at(&mut self, key: &str) -> &mut Self {
        let Dict(pairs) = self else { panic!("no dict") };
        let found = pairs.iter_mut().find(|(name, _)| matches!(name, Text(name) if name == key));
        found.map(|(_, value)| value).unwrap_or_else(|| panic!("no {key}"))
    }

    /// The dict's keys and values.
    ///
    /// # Panics
    /// If it is no dict.
    pub fn pairs(&mut self) -> &mut Vec<(Self, Self)> {
        match self {
            Dict(pairs) => pairs,
            _ => panic!("no dict"),
        }
    }

    /// As a pickle.
    #[must_use]
    pub fn pickle(&self) -> Vec<u8> {
        let mut out = b"\x80\x04".to_vec();
        put(self, &mut out);
        out.push(b'.');
        out
    }
}

fn put_bytes(operation: u8, bytes: &[u8], out: &mut Vec<u8>) {
    out.push(operation);
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(bytes);
}

fn put(value: &Python, out: &mut Vec<u8>) {
    match value {
        Nothing => out.push(b'N'),
        Bool(truth) => out.push(if *truth { 0x88 } else { 0x89 }),
        Int(number) => {
            out.extend([0x8a, 8]);
            out.extend(number.to_le_bytes());
        }
        Float(number) => {
            out.push(b'G');
            out.extend(number.to_be_bytes());
        }
        Text(text) => put_bytes(b'X', text.as_bytes(), out),
        List(items) => {
            out.extend(b"](");
            items.iter().for_each(|item| put(item, out));
            out.push(b'e');
        }
        Dict(pairs) => {
            out.extend(b"}(");
            for (key, value) in pairs {
                put(key, out);
                put(value, out);
            }
            out.push(b'u');
        }
        Array(shape, numbers) => {
            out.extend(b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R(K\x01(");
            shape.iter().for_each(|length| put(&Int(*length as i64), out));
            out.extend(
                b"tcnumpy\ndtype\n\x8c\x02f8\x89\x88\x87R(K\x03\x8c\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89",
            );
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            put_bytes(b'B', &bytes, out);
            out.extend(b"tb");
        }
        Raw(operations) => out.extend(operations),
    }
}

/// A scene in the layout of WOMD's scenes of today.
#[must_use]
pub fn current(scene: &Scene) -> Python {
    let tracks = scene.tracks().iter().map(|track| {
        let type_name = match track.kind {
            AgentKind::Vehicle => "VEHICLE",
            AgentKind::Pedestrian => "PEDESTRIAN",
            AgentKind::Cyclist => "CYCLIST",
            AgentKind::Other => "OTHER",
        };
        (text(track.id), dict([("type", text(type_name)), ("state", states(&track.states))]))
    });
    let ids = |ids: &[world::scene::TrackId]| List(ids.iter().map(text).collect());
    let tasks = scene.tracks_to_predict().iter().map(|task| {
        let (index, difficulty) = (task.track_index, task.difficulty);
        let task = dict([("track_index", Int(index as i64)), ("difficulty", Int(difficulty.into()))]);
        (text(scene.tracks()[index].id), task)
    });
    let metadata = dict([
        ("ts", Array(vec![scene.steps()], scene.timestamps().to_vec())),
        ("sdc_id", text(scene.av().id)),
        ("dataset", text("waymo")),
        ("current_time_index", Int(scene.current_time_index() as i64)),
        ("objects_of_interest", ids(scene.objects_of_interest())),
        ("tracks_to_predict", Dict(tasks.collect())),
    ]);
    dict([
        ("id", text(scene.id())),
        ("version", text("v1.2")),
        ("length", Int(scene.steps() as i64)),
        ("tracks", Dict(tracks.collect())),
        ("dynamic_map_states", signals(scene)),
        ("map_features", features(scene)),
        ("metadata", metadata),
    ])
}

fn states(states: &[Option<AgentState>]) -> Python {
    let column = |of: fn(&AgentState) -> f64| {
        Array(vec![states.len()], states.iter().map(|state| state.as_ref().map_or(0.0, of)).collect())
    };
    let rows = |of: fn(&AgentState) -> Vec<f64>, width: usize| {
        let row = |state: &Option<AgentState>| state.as_ref().map_or(vec![0.0; width], of);
        Array(vec![states.len(), width], states.iter().flat_map(row).collect())
    };
    dict([
        ("position", rows(|s| vec![s.x, s.y, s.z], 3)),
        ("length", column(|s| s.length)),
        ("width", column(|s| s.width)),
        ("height", column(|s| s.height)),
        ("heading", column(|s| s.heading)),
        ("velocity", rows(|s| vec![s.velocity_x, s.velocity_y], 2)),
        ("valid", column(|_| 1.0)),
    ])
}

fn signals(scene: &Scene) -> Python {
    let mut lanes = Vec::new();
    for signal in (0..scene.steps()).flat_map(|step| scene.signals(step)) {
        if !lanes.contains(&(signal.lane, signal.stop_point)) {
            lanes.push((signal.lane, signal.stop_point));
        }
    }
    let signal = |(lane, stop): (world::map::MapId, Point3)| {
        let shown = |step: usize| match scene.signals(step).iter().find(|signal| signal.lane == lane) {
            Some(signal) => text(format!("LANE_STATE_{}", signal_name(signal.state))),
            None => Nothing,
        };
        let state = dict([("object_state", List((0..scene.steps()).map(shown).collect()))]);
        let stop = Array(vec![3], vec![stop.x, stop.y, stop.z]);
        (text(lane), dict([("state", state), ("lane", Int(lane.0)), ("stop_point", stop)]))
    };
    Dict(lanes.into_iter().map(signal).collect())
}

fn signal_name(state: SignalState) -> &'static str {
    match state {
        SignalState::Unknown => "UNKNOWN",
        SignalState::ArrowStop => "ARROW_STOP",
        SignalState::ArrowCaution => "ARROW_CAUTION",
        SignalState::ArrowGo => "ARROW_GO",
        SignalState::Stop => "STOP",
        SignalState::Caution => "CAUTION",
        SignalState::Go => "GO",
        SignalState::FlashingStop => "FLASHING_STOP",
        SignalState::FlashingCaution => "FLASHING_CAUTION",
    }
}

/// Points as an array.
#[must_use]
pub fn points(points: &[Point3]) -> Python {
    Array(vec![points.len(), 3], points.iter().flat_map(|point| [point.x, point.y, point.z]).collect())
}

fn features(scene: &Scene) -> Python {
    let map = scene.map();
    let ids = |ids: &[world::map::MapId]| List(ids.iter().map(|id| Int(id.0)).collect());
    let lane_name = |kind| match kind {
        LaneKind::Undefined => "UNKNOWN",
        LaneKind::Freeway => "LANE_FREEWAY",
        LaneKind::SurfaceStreet => "LANE_SURFACE_STREET",
        LaneKind::BikeLane => "LANE_BIKE_LANE",
    };
    let edge_name = |kind| match kind {
        RoadEdgeKind::Unknown => "ROAD_EDGE_UNKNOWN",
        RoadEdgeKind::Boundary => "ROAD_EDGE_BOUNDARY",
        RoadEdgeKind::Median => "ROAD_EDGE_MEDIAN",
    };
    let lanes = map.lanes.iter().map(|lane| {
        let feature = dict([
            ("speed_limit_mph", Float(lane.speed_limit_mph)),
            ("type", text(lane_name(lane.kind))),
            ("polyline", points(&lane.centerline)),
            ("interpolating", Bool(lane.interpolating)),
            ("entry_lanes", ids(&lane.entries)),
            ("exit_lanes", ids(&lane.exits)),
            ("left_boundaries", boundaries(&lane.left_boundaries)),
            ("right_boundaries", boundaries(&lane.right_boundaries)),
            ("left_neighbor", neighbors(&lane.left_neighbors)),
            ("right_neighbor", neighbors(&lane.right_neighbors)),
        ]);
        (text(lane.id), feature)
    });
    let line = |id, name: String, line: &[Point3]| (text(id), dict([("type", Text(name)), ("polyline", points(line))]));
    let area = |name: &'static str| {
        move |area: &world::map::Area| (text(area.id), dict([("type", text(name)), ("polygon", points(&area.polygon))]))
    };
    let lines = map.road_lines.iter().map(|l| line(l.id, line_name(l.kind), &l.polyline));
    let edges = map.road_edges.iter().map(|e| line(e.id, edge_name(e.kind).to_owned(), &e.polyline));
    let signs = map.stop_signs.iter().map(|sign| {
        let position = Array(vec![3], vec![sign.position.x, sign.position.y, sign.position.z]);
        (text(sign.id), dict([("type", text("STOP_SIGN")), ("lane", ids(&sign.lanes)), ("position", position)]))
    });
    let areas = map.crosswalks.iter().map(area("CROSSWALK"));
    let areas = areas.chain(map.speed_bumps.iter().map(area("SPEED_BUMP")));
    let areas = areas.chain(map.driveways.iter().map(area("DRIVEWAY")));
    Dict(lanes.chain(lines).chain(edges).chain(signs).chain(areas).collect())
}

/// `ROAD_LINE_BROKEN_SINGLE_WHITE` of `BrokenSingleWhite`.
fn line_name(kind: world::map::RoadLineKind) -> String {
    let mut name = "ROAD_LINE".to_owned();
    for letter in format!("{kind:?}").chars() {
        if letter.is_ascii_uppercase() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}

fn boundaries(segments: &[BoundarySegment]) -> Python {
    let segment = |segment: &BoundarySegment| {
        dict([
            ("lane_start_index", text(segment.lane_start_index)),
            ("lane_end_index", text(segment.lane_end_index)),
            ("boundary_type", Text(line_name(segment.kind))),
            ("boundary_feature_id", text(segment.feature)),
        ])
    };
    List(segments.iter().map(segment).collect())
}

fn neighbors(neighbors: &[LaneNeighbor]) -> Python {
    let neighbor = |neighbor: &LaneNeighbor| {
        dict([
            ("feature_id", text(neighbor.lane)),
            ("self_start_index", text(neighbor.self_start_index)),
            ("self_end_index", text(neighbor.self_end_index)),
            ("neighbor_start_index", text(neighbor.neighbor_start_index)),
            ("neighbor_end_index", text(neighbor.neighbor_end_index)),
            ("boundaries", boundaries(&neighbor.boundaries)),
        ])
    };
    List(neighbors.iter().map(neighbor).collect())
}
