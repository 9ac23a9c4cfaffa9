//! A scene as the judges see it.

use std::sync::Arc;

use episode::Episode;
use episode::judges::road;
use episode::protocol::{Protocol, StrictSettings};
use episode::strict::course::Course;
use scenarios::SceneSet;
use serde_json::{Value, json};
use world::geometry::{Point, Point3};
use world::route::{Route, RouteStyle};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Scene};

use crate::Error;

/// The scene of the input `path`.
pub fn read(path: &str) -> Result<Arc<Scene>, Error> {
    Ok(SceneSet::open(&[path.to_owned()])?.load(0)?.0)
}

/// The scene as the judges see it under `settings`.
pub fn seen(logged: &Arc<Scene>, settings: &StrictSettings) -> Result<Value, Error> {
    let bridged = Bridged::of(logged);
    let scene = bridged.judged();
    let start = settings.start as usize;
    let av = scene.av().states[start].ok_or("the AV is not there at the start")?;
    let wheelbase = settings.vehicle(av.length)?.wheelbase;
    let episode = Episode::new(Arc::clone(logged), &Protocol::Strict(settings.clone()))?;
    let course = Course::of(&bridged, Route::of_log(scene, RouteStyle::Strict)?, settings, wheelbase);
    let row = |s: &AgentState| json!([s.x, s.y, s.heading, s.speed(), s.length, s.width, s.z]);
    let tracks = scene.tracks().iter().map(|track| {
        let states: Vec<_> = track.states.iter().map(|state| state.as_ref().map(row)).collect();
        json!({ "id": track.id.0, "kind": track.kind.to_string(), "states": states })
    });
    let line = |points: &[Point]| points.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>();
    let flat = |points: &[Point3]| points.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>();
    let lanes = course.lanes().strips().iter().enumerate().map(|(lane, strip)| {
        json!({
            "line": line(&strip.points),
            "widths": (0..strip.points.len()).map(|point| course.lanes().widths(lane, point)).collect::<Vec<_>>(),
            "entries": strip.entries,
            "exits": strip.exits,
            "speed_limit": strip.speed_limit,
            "connector": course.lanes().is_connector(lane),
        })
    });
    let edges: Vec<_> = road::chains(scene.map(), course.level()).iter().map(|chain| flat(chain)).collect();
    let on_level = scene.map().driveways.iter().filter(|area| area.polygon.iter().any(|at| course.level().holds(*at)));
    let driveways: Vec<_> = on_level.map(|area| flat(&area.polygon)).collect();
    Ok(json!({
        "id": scene.id().to_string(),
        "start": start,
        "horizon": episode.briefing().horizon,
        "steering": episode.observe().control.steering,
        "wheelbase": wheelbase,
        "av_index": scene.av_index(),
        "tracks": tracks.collect::<Vec<_>>(),
        "lanes": lanes.collect::<Vec<_>>(),
        "edges": edges,
        "driveways": driveways,
    }))
}
