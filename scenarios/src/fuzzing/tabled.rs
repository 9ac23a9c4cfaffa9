//! Scenes as Argoverse 2's tables and maps, written for tests and as seeds of fuzzing.

use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::{WriterProperties, WriterVersion};
use serde_json::{Value, json};
use world::geometry::Point3;
use world::map::{Lane, LaneKind, Map};
use world::scene::{AgentKind, Scene};

/// Columns of a table by their names.
pub type Columns = Vec<(&'static str, ArrayRef)>;

/// The columns of a scene's table. The first `observed` steps are those that a predictor is shown.
#[must_use]
pub fn columns(scene: &Scene, observed: usize) -> Columns {
    let there = scene.tracks().iter().enumerate().flat_map(|(index, track)| {
        let states = track.states.iter().enumerate();
        states.filter_map(move |(step, state)| Some((index, track, step, (*state)?)))
    });
    let rows: Vec<_> = there.collect();
    let name =
        |index: usize| if index == scene.av_index() { "AV".to_owned() } else { scene.tracks()[index].id.to_string() };
    let kind = |kind| match kind {
        AgentKind::Vehicle => "vehicle",
        AgentKind::Pedestrian => "pedestrian",
        AgentKind::Cyclist => "cyclist",
        AgentKind::Other => "static",
    };
    let texts =
        |of: &dyn Fn(usize) -> String| -> ArrayRef { Arc::new(StringArray::from_iter_values((0..rows.len()).map(of))) };
    let ints =
        |of: &dyn Fn(usize) -> i64| -> ArrayRef { Arc::new(Int64Array::from_iter_values((0..rows.len()).map(of))) };
    let floats =
        |of: &dyn Fn(usize) -> f64| -> ArrayRef { Arc::new(Float64Array::from_iter_values((0..rows.len()).map(of))) };
    let steps = scene.steps() as i64;
    let shown: Vec<bool> = rows.iter().map(|row| row.2 < observed).collect();
    vec![
        ("observed", Arc::new(BooleanArray::from(shown))),
        ("track_id", texts(&|row| name(rows[row].0))),
        ("object_type", texts(&|row| kind(rows[row].1.kind).to_owned())),
        ("object_category", ints(&|row| if rows[row].0 == 0 { 3 } else { 1 })),
        ("timestep", ints(&|row| rows[row].2 as i64)),
        ("position_x", floats(&|row| rows[row].3.x)),
        ("position_y", floats(&|row| rows[row].3.y)),
        ("heading", floats(&|row| rows[row].3.heading)),
        ("velocity_x", floats(&|row| rows[row].3.velocity_x)),
        ("velocity_y", floats(&|row| rows[row].3.velocity_y)),
        ("scenario_id", texts(&|_| scene.id().to_string())),
        ("start_timestamp", ints(&|_| 1_000_000_000)),
        ("end_timestamp", ints(&|_| 1_000_000_000 + 100_000_000 * (steps - 1))),
        ("num_timestamps", ints(&|_| steps)),
    ]
}

/// Ways of writing a table: plain, with dictionaries and packed, and in the second version of pages.
#[must_use]
pub fn packings() -> [WriterProperties; 3] {
    let zstd = Compression::ZSTD(ZstdLevel::default());
    let second = WriterProperties::builder().set_writer_version(WriterVersion::PARQUET_2_0).set_compression(zstd);
    [
        WriterProperties::builder().set_dictionary_enabled(false).build(),
        WriterProperties::builder().set_compression(zstd).build(),
        second.set_dictionary_enabled(true).build(),
    ]
}

/// A table of these columns.
///
/// # Errors
/// If they make none.
pub fn table(columns: Columns, properties: WriterProperties) -> Result<Vec<u8>, ParquetError> {
    let batch = RecordBatch::try_from_iter(columns).map_err(|error| ParquetError::General(error.to_string()))?;
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(bytes)
}

/// A map in the form of Argoverse's archives: lanes 3.5 m wide, crosswalks, and areas by the outlines given.
#[must_use]
pub fn archive(map: &Map, areas: &[Vec<Point3>]) -> Value {
    let lanes = map.lanes.iter().filter(|lane| lane.centerline.len() > 1);
    let crossings = map.crosswalks.iter().filter(|area| area.polygon.len() == 4).map(|area| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| place(&area.polygon[corner]));
        (area.id.to_string(), json!({ "id": area.id.0, "edge1": [a, b], "edge2": [d, c] }))
    });
    let areas = areas.iter().enumerate().map(|(id, area)| {
        (id.to_string(), json!({ "id": id, "area_boundary": area.iter().map(place).collect::<Vec<_>>() }))
    });
    json!({
        "drivable_areas": areas.collect::<serde_json::Map<_, _>>(),
        "lane_segments": lanes.map(|lane| (lane.id.to_string(), segment(lane))).collect::<serde_json::Map<_, _>>(),
        "pedestrian_crossings": crossings.collect::<serde_json::Map<_, _>>(),
    })
}

fn segment(lane: &Lane) -> Value {
    let beside = |lane: &Lane, shift: f64| -> Vec<Value> {
        let direction = |place: usize| {
            let (from, to) = (place.min(lane.centerline.len() - 2), place.min(lane.centerline.len() - 2) + 1);
            let step = lane.centerline[to].xy() - lane.centerline[from].xy();
            let length = step.norm().max(1e-9);
            (step.x / length, step.y / length)
        };
        let shifted = |(place, point): (usize, &Point3)| {
            let (x, y) = direction(place);
            json!({ "x": point.x - shift * y, "y": point.y + shift * x, "z": point.z })
        };
        lane.centerline.iter().enumerate().map(shifted).collect()
    };
    let ids = |ids: &[world::map::MapId]| ids.iter().map(|id| id.0).collect::<Vec<_>>();
    let neighbor = |neighbors: &[world::map::LaneNeighbor]| neighbors.first().map(|neighbor| neighbor.lane.0);
    json!({
        "id": lane.id.0,
        "is_intersection": lane.interpolating,
        "lane_type": if lane.kind == LaneKind::BikeLane { "BIKE" } else { "VEHICLE" },
        "left_lane_boundary": beside(lane, 1.75),
        "left_lane_mark_type": "DOUBLE_SOLID_YELLOW",
        "left_neighbor_id": neighbor(&lane.left_neighbors),
        "right_lane_boundary": beside(lane, -1.75),
        "right_lane_mark_type": "NONE",
        "right_neighbor_id": neighbor(&lane.right_neighbors),
        "predecessors": ids(&lane.entries),
        "successors": ids(&lane.exits),
    })
}

fn place(point: &Point3) -> Value {
    json!({ "x": point.x, "y": point.y, "z": point.z })
}

/// Both files of a scene as one input of a fuzzer: the table's length, the table, the map.
#[must_use]
pub fn joined(table: &[u8], map: &[u8]) -> Vec<u8> {
    [&(table.len() as u32).to_le_bytes(), table, map].concat()
}

/// The two files again.
#[must_use]
pub fn parted(input: &[u8]) -> (&[u8], &[u8]) {
    let (length, rest) = input.split_first_chunk::<4>().unwrap_or((&[0; 4], input));
    rest.split_at((u32::from_le_bytes(*length) as usize).min(rest.len()))
}
