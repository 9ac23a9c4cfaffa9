//! `scenarios inspect`: all about each scene.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use scenarios::SceneEntry;
use scenarios::lint::{self, Lint};
use world::geometry::Point3;
use world::reference_line::SAMPLE_SPACING;
use world::route::{Route, RouteStyle};
use world::scene::bridged::Bridged;
use world::scene::{AgentKind, Scene, Track};
use world::signal::SignalState;

use super::Failure;
use super::scenes::Scenes;
use super::table::count;
use crate::cli::InspectArguments;

pub fn run(arguments: &InspectArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let scenes = Scenes::open(&arguments.inputs)?;
    let mut grave = false;
    for (nth, (index, entry)) in scenes.iter().enumerate() {
        let (scene, findings) = scenes.set.load_hashed(index)?;
        let lints = lint::lint(&scene, &findings);
        grave |= lints.iter().any(|lint| lint.severity() == lint::Severity::Error);
        if nth > 0 {
            writeln!(out).map_err(Failure::Output)?;
        }
        show(entry, scenes.set.sha256(index)?, &scene, &lints, out).map_err(Failure::Output)?;
    }
    Ok(grave)
}

fn show(
    entry: &SceneEntry,
    sha256: String,
    scene: &Arc<Scene>,
    lints: &[Lint],
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "{}", entry.id)?;
    let mut line = |name: &str, text: String| writeln!(out, "  {name:<9} {text}");
    line("from", entry.source.to_string())?;
    line("sha256", sha256)?;
    line("time", time(scene))?;
    line("AV", av(scene))?;
    line("agents", agents(scene))?;
    line("map", map(scene))?;
    line("signals", signals(scene))?;
    line("route", route(scene))?;
    let findings = if lints.is_empty() { "none".to_owned() } else { lints.len().to_string() };
    line("findings", findings)?;
    for lint in lints {
        writeln!(out, "    {:<8} {lint}", lint.severity())?;
    }
    Ok(())
}

fn time(scene: &Scene) -> String {
    let times = scene.timestamps();
    let current = match scene.current_time_index() {
        0 => String::new(),
        index => format!(", prediction tasks begin after step {index}"),
    };
    format!("{} steps, {:.1} to {:.1} s{current}", times.len(), times[0], times[times.len() - 1])
}

fn av(scene: &Scene) -> String {
    let (av, steps) = (scene.av(), scene.steps());
    let valid = av.states.iter().flatten().count();
    let seen = if valid == steps { String::new() } else { format!(", valid at {valid} steps") };
    let size = av
        .states
        .iter()
        .flatten()
        .next()
        .map_or(String::new(), |s| format!("{:.2} x {:.2} x {:.2} m, ", s.length, s.width, s.height));
    format!("track {}, {size}drives {:.1} m, at most {:.1} m/s{seen}", av.id, av_path(scene), fastest(scene))
}

fn agents(scene: &Scene) -> String {
    let kinds = [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Other];
    let of = |kind: &AgentKind| others(scene).filter(|track| track.kind == *kind).count();
    let parts: Vec<String> = kinds
        .iter()
        .filter(|kind| of(kind) > 0)
        .map(|kind| {
            if *kind == AgentKind::Other {
                format!("{} of other kinds", of(kind))
            } else {
                count(of(kind), &kind.to_string())
            }
        })
        .collect();
    if parts.is_empty() {
        return "nobody but the AV".to_owned();
    }
    let at = |step: usize| others(scene).filter(|track| track.states[step].is_some()).count();
    let most = (0..scene.steps()).map(at).max().unwrap_or(0);
    format!("{}; at most {most} at a time", parts.join(", "))
}

fn map(scene: &Scene) -> String {
    let map = scene.map();
    let meters: f64 = map.lanes.iter().map(|lane| length(&lane.centerline)).sum();
    let parts = [
        (map.road_lines.len(), "road line"),
        (map.road_edges.len(), "road edge"),
        (map.crosswalks.len(), "crosswalk"),
        (map.stop_signs.len(), "stop sign"),
        (map.speed_bumps.len(), "speed bump"),
        (map.driveways.len(), "driveway"),
    ];
    let parts = parts.iter().filter(|(number, _)| *number > 0).map(|(number, thing)| count(*number, thing));
    let lanes = format!("{} ({:.1} km)", count(map.lanes.len(), "lane"), meters / 1000.0);
    std::iter::once(lanes).chain(parts).collect::<Vec<_>>().join(", ")
}

fn signals(scene: &Scene) -> String {
    let (mut lanes, mut shown, mut with) = (std::collections::BTreeSet::new(), BTreeMap::new(), 0);
    for step in 0..scene.steps() {
        let signals = scene.signals(step);
        with += usize::from(!signals.is_empty());
        for signal in signals {
            lanes.insert(signal.lane);
            *shown.entry(colour(signal.state)).or_insert(0_usize) += 1;
        }
    }
    if lanes.is_empty() {
        return "none".to_owned();
    }
    let all: usize = shown.values().sum();
    let share = |(colour, number): (&&str, &usize)| format!("{colour} {:.0}%", 100.0 * *number as f64 / all as f64);
    let shares: Vec<String> = shown.iter().map(share).collect();
    format!("for {} at {with} of {} steps: {}", count(lanes.len(), "lane"), scene.steps(), shares.join(", "))
}

fn route(scene: &Arc<Scene>) -> String {
    match Route::of_log(Bridged::of(scene).judged(), RouteStyle::Strict) {
        Ok(route) => {
            let lanes: Vec<String> = route.lanes.iter().map(ToString::to_string).collect();
            let meters = route.line.x.len() as f64 * SAMPLE_SPACING;
            format!("{meters:.0} m along {}: {}", count(lanes.len(), "lane"), lanes.join(" > "))
        }
        Err(_) => "none".to_owned(), // a finding says why
    }
}

fn colour(state: SignalState) -> &'static str {
    match state {
        SignalState::Stop | SignalState::ArrowStop => "red",
        SignalState::Caution | SignalState::ArrowCaution => "yellow",
        SignalState::Go | SignalState::ArrowGo => "green",
        SignalState::FlashingStop | SignalState::FlashingCaution => "flashing",
        SignalState::Unknown => "unknown",
    }
}

fn length(points: &[Point3]) -> f64 {
    points.windows(2).map(|pair| pair[0].xy().distance(pair[1].xy())).sum()
}

/// All tracks but the AV's.
pub fn others(scene: &Scene) -> impl Iterator<Item = &Track> {
    let av = scene.av_index();
    scene.tracks().iter().enumerate().filter(move |(index, _)| *index != av).map(|(_, track)| track)
}

/// The way that the logged AV makes (m).
pub fn av_path(scene: &Scene) -> f64 {
    let states: Vec<_> = scene.av().states.iter().flatten().collect();
    states.windows(2).map(|pair| pair[0].position().distance(pair[1].position())).sum()
}

/// The logged AV's highest speed (m/s).
pub fn fastest(scene: &Scene) -> f64 {
    scene.av().states.iter().flatten().map(|state| state.speed()).fold(0.0, f64::max)
}
