//! The product's messages as Foxglove's: scene entities, frames and log lines.
//!
//! Each channel's message holds the whole state of what it shows (it deletes what was there before), so that a viewer may jump
//! to any time and needs the last message of each channel alone.

use std::fmt::{self, Write as _};

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::log::Level;
use foxglove::messages::scene_entity_deletion::Type as DeletionType;
use foxglove::messages::{
    Color, CubePrimitive, Duration, FrameTransform, FrameTransforms, KeyValuePair, LinePrimitive, Log, Point3, Pose,
    Quaternion, SceneEntity, SceneEntityDeletion, SceneUpdate, SpherePrimitive, TextPrimitive, Timestamp, Vector3,
};
use wire::proto;

use crate::contacts::Contacts;
use crate::layers::{layers, stop_signs};
use crate::message::STEP_NANOSECONDS;
use crate::origin::{Origin, quaternion};
use crate::palette::{self, Rgba};
use crate::strokes;

/// The log's frame.
pub const MAP_FRAME: &str = "map";
/// The frame that everything is drawn in: the log's, moved to where the AV starts.
pub const SCENE_FRAME: &str = "scene";
/// The AV's own: x forward, y left.
pub const AV_FRAME: &str = "av";

/// Simulated time of a step.
#[must_use]
pub fn timestamp(step: u32) -> Timestamp {
    Timestamp::new(step / 10, step % 10 * STEP_NANOSECONDS as u32)
}

/// The map and the route.
#[must_use]
pub fn map(scene: &proto::Scene, origin: &Origin) -> SceneUpdate {
    let mut entities: Vec<SceneEntity> = layers(scene, origin)
        .into_iter()
        .map(|layer| {
            let width = f64::from(layer.width);
            let lines = layer.lines.iter().map(|(points, color)| line(points, width, *color)).collect();
            SceneEntity { lines, ..entity(0, layer.name.to_owned()) }
        })
        .collect();
    let signs = stop_signs(scene, origin);
    if !signs.is_empty() {
        let spheres = signs.iter().map(|point| sphere(*point, 0.9, palette::STOP_SIGN)).collect();
        entities.push(SceneEntity { spheres, ..entity(0, "map/stop_signs".to_owned()) });
    }
    whole_state(0, entities)
}

/// All agents that are seen, a box each, in an entity that names the track; a text too over those that the AV touched. Those that
/// are supposed are paler. Drawn over the agents of the step before: most are there again, and to make an entity costs more than to write it.
pub fn agents(update: &mut SceneUpdate, step: u32, agents: &[proto::Agent], contacts: &Contacts, origin: &Origin) {
    update.deletions.clear();
    update.deletions.push(everything(step));
    let seen = agents.iter().filter_map(|agent| Some((agent, agent.state.as_ref()?)));
    let mut drawn = 0;
    for (agent, state) in seen {
        if drawn == update.entities.len() {
            update.entities.push(entity(step, String::new()));
        }
        let (kind, mark, entity) = (agent.kind(), contacts.mark(agent.track), &mut update.entities[drawn]);
        drawn += 1;
        let rgba = mark.map_or(palette::agent(kind), |(rgba, _)| *rgba);
        entity.timestamp = Some(timestamp(step));
        write(&mut entity.id, format_args!("agent/{}", agent.track));
        entity.cubes.clear();
        entity.cubes.push(cube(state, if agent.unseen > 0 { palette::supposed(rgba) } else { rgba }, origin));
        entity.texts.clear();
        entity.texts.extend(mark.map(|(rgba, label)| text_above(state, label, *rgba, origin)));
        entity.metadata.resize_with(if agent.unseen > 0 { 2 } else { 1 }, KeyValuePair::default);
        let kind = ("kind", format_args!("{}", strokes::kind_name(kind)));
        let unseen = ("unseen_steps", format_args!("{}", agent.unseen));
        for (pair, (key, value)) in entity.metadata.iter_mut().zip([kind, unseen]) {
            write(&mut pair.key, format_args!("{key}"));
            write(&mut pair.value, value);
        }
    }
    update.entities.truncate(drawn);
}

/// Puts a text in the place of what was there.
fn write(text: &mut String, what: fmt::Arguments<'_>) {
    text.clear();
    // Nothing that is written here fails.
    let _ = text.write_fmt(what);
}

/// Where the log has the AV, if it has.
#[must_use]
pub fn logged_av(step: u32, state: Option<&proto::AgentState>, origin: &Origin) -> SceneUpdate {
    let entity = |state| SceneEntity {
        cubes: vec![cube(state, palette::GHOST, origin)],
        ..entity(step, "logged_av".to_owned())
    };
    whole_state(step, state.map(entity).into_iter().collect())
}

/// The AV.
#[must_use]
pub fn av(step: u32, state: &proto::AgentState, origin: &Origin) -> SceneUpdate {
    let cubes = vec![cube(state, palette::AV, origin)];
    whole_state(step, vec![SceneEntity { cubes, ..entity(step, "av".to_owned()) }])
}

/// What signals show, as lights at their stop points.
#[must_use]
pub fn signals(observation: &proto::Observation, origin: &Origin) -> SceneUpdate {
    let light = |signal: &proto::Signal| {
        let point = origin.place(signal.stop_x, signal.stop_y, signal.stop_z);
        let spheres = vec![sphere(point, 1.2, palette::signal(signal.state()))];
        SceneEntity { spheres, ..entity(observation.step, format!("signal/{}", signal.lane)) }
    };
    whole_state(observation.step, observation.signals.iter().map(light).collect())
}

/// The plan's line, at the AV's height.
#[must_use]
pub fn plan(plan: &proto::Plan, height: f64, origin: &Origin) -> SceneUpdate {
    let points = strokes::plan(plan, height, origin);
    let lines = vec![line(&points, 4.0, palette::PLAN)];
    whole_state(plan.step, vec![SceneEntity { lines, ..entity(plan.step, "plan".to_owned()) }])
}

/// Every future, an entity each.
#[must_use]
pub fn predictions(prediction: &proto::Prediction, height: f64, origin: &Origin) -> SceneUpdate {
    let entities = prediction.futures.iter().enumerate().map(|(number, future)| {
        let color = palette::prediction(future.probability);
        let lines = strokes::future(future, height, origin).iter().map(|points| line(points, 2.0, color)).collect();
        SceneEntity { lines, ..entity(prediction.step, format!("future/{number}")) }
    });
    whole_state(prediction.step, entities.collect())
}

/// Where the frames lie at a step.
#[must_use]
pub fn frames(step: u32, av: &proto::AgentState, origin: &Origin) -> FrameTransforms {
    let frame = |parent: &str, child: &str, (x, y, z), heading| FrameTransform {
        timestamp: Some(timestamp(step)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 { x, y, z }),
        rotation: Some(turn(heading)),
    };
    let [x, y, z] = origin.place(av.x, av.y, av.z).map(f64::from);
    FrameTransforms {
        transforms: vec![
            frame(MAP_FRAME, SCENE_FRAME, (origin.x, origin.y, origin.z), 0.0),
            frame(SCENE_FRAME, AV_FRAME, (x, y, z), av.heading),
        ],
    }
}

/// A line of the log.
#[must_use]
pub fn log(step: u32, level: Level, name: &str, message: String) -> Log {
    let timestamp = Some(timestamp(step));
    Log { timestamp, level: level as i32, message, name: name.to_owned(), file: String::new(), line: 0 }
}

fn whole_state(step: u32, entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate { deletions: vec![everything(step)], entities }
}

fn everything(step: u32) -> SceneEntityDeletion {
    SceneEntityDeletion { timestamp: Some(timestamp(step)), r#type: DeletionType::All as i32, id: String::new() }
}

fn entity(step: u32, id: String) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(step)),
        frame_id: SCENE_FRAME.to_owned(),
        id,
        lifetime: Some(Duration::new(0, 0)),
        ..SceneEntity::default()
    }
}

fn cube(state: &proto::AgentState, color: Rgba, origin: &Origin) -> CubePrimitive {
    CubePrimitive {
        pose: Some(pose(origin.place(state.x, state.y, state.z), state.heading)),
        size: Some(Vector3 { x: state.length, y: state.width, z: state.height }),
        color: Some(self::color(color)),
    }
}

/// A text that faces the viewer, above a box.
fn text_above(state: &proto::AgentState, text: &str, color: Rgba, origin: &Origin) -> TextPrimitive {
    let position = origin.place(state.x, state.y, state.z + 0.5 * state.height + 1.0);
    TextPrimitive {
        pose: Some(pose(position, 0.0)),
        billboard: true,
        font_size: 14.0,
        scale_invariant: true,
        color: Some(self::color(color)),
        text: text.to_owned(),
    }
}

fn sphere(center: [f32; 3], diameter: f64, color: Rgba) -> SpherePrimitive {
    let size = Some(Vector3 { x: diameter, y: diameter, z: diameter });
    SpherePrimitive { pose: Some(pose(center, 0.0)), size, color: Some(self::color(color)) }
}

fn line(points: &[[f32; 3]], width: f64, color: Rgba) -> LinePrimitive {
    let points = points.iter().map(|point| {
        let [x, y, z] = point.map(f64::from);
        Point3 { x, y, z }
    });
    LinePrimitive {
        r#type: LineType::LineStrip as i32,
        pose: Some(pose([0.0; 3], 0.0)),
        thickness: width,
        scale_invariant: true,
        points: points.collect(),
        color: Some(self::color(color)),
        ..LinePrimitive::default()
    }
}

fn pose(position: [f32; 3], heading: f64) -> Pose {
    let [x, y, z] = position.map(f64::from);
    Pose { position: Some(Vector3 { x, y, z }), orientation: Some(turn(heading)) }
}

fn turn(heading: f64) -> Quaternion {
    let [x, y, z, w] = quaternion(heading);
    Quaternion { x, y, z, w }
}

fn color([red, green, blue, opacity]: Rgba) -> Color {
    let [r, g, b, a] = [red, green, blue, opacity].map(|channel| f64::from(channel) / 255.0);
    Color { r, g, b, a }
}
