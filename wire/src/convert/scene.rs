//! The briefing of an episode (message `Scene`), and the reference line.

use std::sync::Arc;

use world::map::MapId;
use world::observation::{Briefing, HistoryStep};
use world::reference_line::ReferenceLine;
use world::scene::SceneId;

use super::agents::{agent, agent_state};
use super::map::map;
use super::{
    Checked, FieldError, Message, MessageError, Problem, Within, all_finite, all_unsigned, bounded, each, not_negative,
    required, same_length,
};
use crate::{WIRE_VERSION, proto};

/// Agents at one step. Waymo's densest scenes have some hundreds.
pub(super) const MAX_AGENTS: usize = 10_000;
/// Samples of a line: 100 km.
const MAX_SAMPLES: usize = 1_000_000;
/// Lanes of a route, and steps of a history.
const MAX_STEPS: usize = 10_000;
/// Bytes of a text.
const MAX_TEXT: usize = 1_000;

impl From<&Briefing> for proto::Scene {
    fn from(briefing: &Briefing) -> Self {
        let line = &briefing.reference_line;
        Self {
            wire_version: WIRE_VERSION,
            scene: briefing.scene.to_string(),
            protocol: briefing.protocol.clone(),
            start: briefing.start,
            horizon: briefing.horizon,
            wheelbase: briefing.wheelbase,
            map: Some(briefing.map.as_ref().into()),
            route: briefing.route.iter().map(|id| id.0).collect(),
            reference_line: Some(line.as_ref().into()),
            history: briefing.history.iter().map(proto::HistoryStep::from).collect(),
        }
    }
}

impl From<&HistoryStep> for proto::HistoryStep {
    fn from(step: &HistoryStep) -> Self {
        Self {
            log_index: step.log_index,
            av: Some((&step.av).into()),
            agents: step.agents.iter().map(proto::Agent::from).collect(),
        }
    }
}

impl TryFrom<proto::Scene> for Briefing {
    type Error = MessageError;

    fn try_from(scene: proto::Scene) -> Result<Self, MessageError> {
        briefing(scene).map_err(|e| e.of(proto::Scene::NAME))
    }
}

fn briefing(scene: proto::Scene) -> Checked<Briefing> {
    let name = |e: world::scene::SceneError| FieldError::new("scene", Problem::BadName(e.to_string()));
    bounded("protocol", MAX_TEXT, scene.protocol.len())?;
    bounded("route", MAX_STEPS, scene.route.len())?;
    Ok(Briefing {
        scene: SceneId::new(scene.scene).map_err(name)?,
        protocol: scene.protocol,
        start: scene.start,
        horizon: scene.horizon,
        wheelbase: not_negative("wheelbase", scene.wheelbase)?,
        map: Arc::new(map(required("map", scene.map)?).within("map")?),
        route: scene.route.into_iter().map(MapId).collect(),
        reference_line: Arc::new(line(required("reference_line", scene.reference_line)?).within("reference_line")?),
        history: each("history", MAX_STEPS, scene.history, history_step)?,
    })
}

fn history_step(step: proto::HistoryStep) -> Checked<HistoryStep> {
    Ok(HistoryStep {
        log_index: step.log_index,
        av: agent_state(&required("av", step.av)?).within("av")?,
        agents: each("agents", MAX_AGENTS, step.agents, |a| agent(&a))?,
    })
}

impl From<&ReferenceLine> for proto::ReferenceLine {
    fn from(line: &ReferenceLine) -> Self {
        Self {
            x: line.x.clone(),
            y: line.y.clone(),
            z: line.z.clone(),
            heading: line.heading.clone(),
            curvature: line.curvature.clone(),
            speed_limit: line.speed_limit.clone(),
            crosswalk: line.crosswalk.clone(),
        }
    }
}

/// The reference line of a scene, for whoever reads its observations without its map.
///
/// # Errors
/// [`MessageError::Field`].
pub fn reference_line(scene: proto::Scene) -> Result<ReferenceLine, MessageError> {
    let sent = required("reference_line", scene.reference_line).and_then(|sent| line(sent).within("reference_line"));
    sent.map_err(|e| e.of(proto::Scene::NAME))
}

pub(super) fn line(line: proto::ReferenceLine) -> Checked<ReferenceLine> {
    let samples = line.x.len();
    bounded("x", MAX_SAMPLES, samples)?;
    let columns = [
        ("x", &line.x),
        ("y", &line.y),
        ("z", &line.z),
        ("heading", &line.heading),
        ("curvature", &line.curvature),
        ("speed_limit", &line.speed_limit),
    ];
    for (name, column) in columns {
        same_length(name, samples, column.len())?;
        all_finite(name, column)?;
    }
    same_length("crosswalk", samples, line.crosswalk.len())?;
    Ok(ReferenceLine {
        x: all_unsigned(line.x),
        y: all_unsigned(line.y),
        z: all_unsigned(line.z),
        heading: all_unsigned(line.heading),
        curvature: all_unsigned(line.curvature),
        speed_limit: all_unsigned(line.speed_limit),
        crosswalk: line.crosswalk,
    })
}
