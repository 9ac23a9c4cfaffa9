//! A scene as the judges see it.

use std::sync::Arc;

use episode::Episode;
use episode::judges::road;
use episode::protocol::{Protocol, StrictSettings};
use episode::strict::course::Course;
use scenarios::SceneSet;
use serde_json::{Value, json};
use world::geometry::Point;
use world::route::{Route, RouteStyle};
use world::scene::AgentState;
use world::scene::bridged::Bridged;

use crate::Error;

/// x, y, heading, speed, length, width.
pub type Row = [f64; 6];

/// The state that a row tells of.
pub fn state([x, y, heading, speed, length, width]: Row) -> AgentState {
    let velocity = Point::unit(heading) * speed;
    let (velocity_x, velocity_y) = (velocity.x, velocity.y);
    AgentState { x, y, z: 0.75, heading, velocity_x, velocity_y, length, width, height: 1.5 }
}

/// The scene of the input `path`.
pub fn seen(path: &str) -> Result<Value, Error> {
    let bridged = Bridged::of(&SceneSet::open(&[path.to_owned()])?.load(0)?.0);
    let scene = bridged.judged();
    let settings = StrictSettings::default();
    let start = settings.start as usize;
    let av = scene.av().states[start].ok_or("the AV is not there at the start")?;
    let wheelbase = settings.vehicle(av.length)?.wheelbase;
    let horizon = Episode::new(Arc::clone(bridged.logged()), &Protocol::Strict(settings.clone()))?.briefing().horizon;
    let course = Course::of(&bridged, Route::of_log(scene, RouteStyle::Strict)?, &settings, wheelbase);
    let row = |s: &AgentState| json!([s.x, s.y, s.heading, s.speed(), s.length, s.width, s.z]);
    let tracks = scene.tracks().iter().map(|track| {
        let states: Vec<_> = track.states.iter().map(|state| state.as_ref().map(row)).collect();
        json!({ "id": track.id.0, "kind": track.kind.to_string(), "states": states })
    });
    let line = |points: &[Point]| points.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>();
    let lanes = course.lanes().strips().iter().map(|strip| {
        json!({
            "line": line(&strip.points),
            "widths": strip.widths,
            "entries": strip.entries,
            "exits": strip.exits,
            "speed_limit": strip.speed_limit,
            "connector": strip.connector,
        })
    });
    let edges: Vec<_> = road::chains(scene.map(), course.level()).iter().map(|chain| line(chain)).collect();
    Ok(json!({
        "id": scene.id().to_string(),
        "start": start,
        "horizon": horizon,
        "wheelbase": wheelbase,
        "av_index": scene.av_index(),
        "tracks": tracks.collect::<Vec<_>>(),
        "lanes": lanes.collect::<Vec<_>>(),
        "edges": edges,
    }))
}
