//! A drive that is given state by state, on a map of a few lanes.

use std::sync::Arc;

use episode::Episode;
use episode::protocol::{Motion, Protocol, StrictSettings};
use serde::Deserialize;
use serde_json::{Map as Object, Value, json};
use world::geometry::{Point, Point3};
use world::map::{Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind};
use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan};
use world::scene::{AgentKind, AgentState, Scene, SceneParts, Track, TrackId};

/// x, y, heading, speed, length, width.
pub type Row = [f64; 6];

type Error = Box<dyn std::error::Error>;

/// The state that a row tells of.
pub fn state([x, y, heading, speed, length, width]: Row) -> AgentState {
    let velocity = Point::unit(heading) * speed;
    let (velocity_x, velocity_y) = (velocity.x, velocity.y);
    AgentState { x, y, z: 0.75, heading, velocity_x, velocity_y, length, width, height: 1.5 }
}

/// The rules of such a drive.
pub fn settings() -> StrictSettings {
    StrictSettings { motion: Motion::Playback, off_route_distance: 1e6, ..StrictSettings::default() }
}

/// The whole of it. Rows are at log indices from 0 on, `null` where nobody is; the AV's own states follow the start, which is log index 19
/// of the human.
#[derive(Deserialize)]
pub struct Case {
    lanes: Vec<CaseLane>,
    /// Road edges: the road is to the left of them.
    #[serde(default)]
    edges: Vec<Vec<[f64; 2]>>,
    human: Vec<Option<Row>>,
    #[serde(default)]
    agents: Vec<Vec<Option<Row>>>,
    av: Vec<Row>,
}

#[derive(Deserialize)]
struct CaseLane {
    id: i64,
    line: Vec<[f64; 2]>,
    mph: f64,
    #[serde(default)]
    interpolating: bool,
    #[serde(default)]
    entries: Vec<i64>,
    #[serde(default)]
    exits: Vec<i64>,
}

impl Case {
    /// Drives the AV along its states, in as wide a corridor as they need.
    pub fn drive(&self) -> Result<Value, Error> {
        let mut episode = Episode::new(self.scene()?, &Protocol::Strict(settings()))?;
        for (step, [x, y, heading, speed, ..]) in self.av.iter().copied().enumerate() {
            let states = vec![PlanState { x, y, heading, speed }; PLAN_STEPS];
            let step = u32::try_from(step)?;
            let plan = UncheckedPlan { step, states, ..UncheckedPlan::default() }.check(step)?;
            episode.advance(&plan);
        }
        let outcome = episode.finish();
        let metrics: Object<String, Value> =
            outcome.end.metrics.iter().map(|metric| (metric.name.clone(), json!(metric.value))).collect();
        let steps = outcome.records.iter().map(|record| {
            json!({
                "in_one_lane": record.in_one_lane,
                "backward_travel": record.backward_travel,
                "speed_limit": record.speed_limit,
                "time_to_collision": record.time_to_collision,
                "road_edge_distance": record.road_edge_distance,
            })
        });
        Ok(json!({ "metrics": metrics, "steps": steps.collect::<Vec<_>>() }))
    }

    /// The scene without the AV's own states.
    pub fn scene(&self) -> Result<Arc<Scene>, Error> {
        let line = |points: &[[f64; 2]]| points.iter().map(|[x, y]| Point3::new(*x, *y, 0.0)).collect();
        let lane = |lane: &CaseLane| Lane {
            id: MapId(lane.id),
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph: lane.mph,
            interpolating: lane.interpolating,
            centerline: line(&lane.line),
            entries: lane.entries.iter().copied().map(MapId).collect(),
            exits: lane.exits.iter().copied().map(MapId).collect(),
            ..Lane::default()
        };
        let edge = |(index, points): (usize, &Vec<[f64; 2]>)| RoadEdge {
            id: MapId(1_000_000 + index as i64),
            kind: RoadEdgeKind::Boundary,
            polyline: line(points),
        };
        let steps = self.human.len();
        let track = |(index, rows): (usize, &Vec<Option<Row>>)| Track {
            id: TrackId(index as i32 + 1),
            kind: AgentKind::Vehicle,
            states: (0..steps).map(|step| rows.get(step).copied().flatten().map(state)).collect(),
        };
        let parts = SceneParts {
            id: "case".to_owned(),
            timestamps: (0..steps).map(|step| step as f64 * 0.1).collect(),
            tracks: std::iter::once(&self.human).chain(&self.agents).enumerate().map(track).collect(),
            signals: vec![Vec::new(); steps],
            map: Map {
                lanes: self.lanes.iter().map(lane).collect(),
                road_edges: self.edges.iter().enumerate().map(edge).collect(),
                ..Map::default()
            },
            ..SceneParts::default()
        };
        Ok(Arc::new(parts.check()?.0))
    }
}
