//! A drive as the scores of other tools read it: where the AV was at each step from the start on, beside the log.

use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::sync::Arc;

use episode::paper;
use episode::protocol::Protocol;
use world::plan::PlanState;
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Judgement, Scene, Unjudged};

use super::ground::Ground;
use crate::drives::Driven;

/// All that a scene may not allow to judge.
const JUDGEMENTS: [Judgement; 4] = [Judgement::Collision, Judgement::OffRoad, Judgement::WrongWay, Judgement::Speeding];

/// A drive of a run.
pub struct Drive<'a> {
    /// The scene as it lies in its file.
    pub scene: &'a Arc<Scene>,
    /// The rules it was driven under.
    pub protocol: &'a Protocol,
    /// Log index at which it starts.
    pub start: usize,
    /// The log index after the last that there was to drive.
    pub end: usize,
    /// The AV at the start, and after each step.
    pub states: Vec<AgentState>,
    /// The same after each step, as a plan says it.
    pub driven: &'a [PlanState],
    bridged: OnceCell<Bridged>,
    unjudged: OnceCell<BTreeSet<Judgement>>,
    ground: OnceCell<Result<Ground, String>>,
}

impl<'a> Drive<'a> {
    /// The drive of a run under `protocol`; or why there is none to judge. `unjudged` names what its scene does not allow to judge, as
    /// `results.parquet` has it of runs under `strict`.
    ///
    /// # Errors
    /// A sentence.
    pub fn of(driven: &'a Driven, protocol: &'a Protocol, unjudged: &str) -> Result<Self, String> {
        let (scene, start) = (&driven.scene, driven.start as usize);
        let begin = scene.av().states.get(start).copied().flatten();
        let begin = begin.ok_or_else(|| format!("the log has no state of the AV at log index {start}"))?;
        let steps = driven.table.as_ref().ok_or("nothing was driven")?;
        let numbers = steps.numbers().map_err(|error| error.to_string())?;
        let number = |column: &str, step: usize| numbers.get(column).and_then(|values| values[step]);
        let state = |(step, state): (usize, &PlanState)| AgentState {
            x: state.x,
            y: state.y,
            z: number("av_z_m", step).unwrap_or(begin.z),
            heading: state.heading,
            velocity_x: number("av_velocity_x_mps", step).unwrap_or_default(),
            velocity_y: number("av_velocity_y_mps", step).unwrap_or_default(),
            // The protocols mend the AV's size where the log's makes no sense.
            length: number("av_length_m", step).unwrap_or(begin.length),
            width: number("av_width_m", step).unwrap_or(begin.width),
            height: begin.height,
        };
        let mut states: Vec<AgentState> = driven.states.iter().enumerate().map(state).collect();
        let size = states.first().map_or((begin.length, begin.width), |first| (first.length, first.width));
        states.insert(0, AgentState { length: size.0, width: size.1, ..begin });
        let drive = Self::new(scene, protocol, start, states, &driven.states);
        if matches!(protocol, Protocol::Strict(_)) {
            let named = |judgement: &Judgement| unjudged.split(", ").any(|name| name == judgement.to_string());
            let _ = drive.unjudged.set(JUDGEMENTS.into_iter().filter(named).collect());
        }
        Ok(drive)
    }

    /// The drive through `scene` under `protocol` in which the AV was in `states`, the first at log index `start`.
    pub(super) fn new(
        scene: &'a Arc<Scene>,
        protocol: &'a Protocol,
        start: usize,
        states: Vec<AgentState>,
        driven: &'a [PlanState],
    ) -> Self {
        let horizon = match protocol {
            Protocol::Strict(settings) => settings.horizon,
            Protocol::Paper => paper::MOST_STEPS,
        };
        let end = start.saturating_add(horizon as usize).saturating_add(1).min(scene.steps());
        let (bridged, unjudged, ground) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Self { scene, protocol, start, end, states, driven, bridged, unjudged, ground }
    }

    /// The columns of `steps.parquet` that it reads beside the AV's place.
    pub const COLUMNS: [&'static str; 3] = ["av_z_m", "av_length_m", "av_width_m"];

    /// The scene with its gaps filled in, as `strict` judges it.
    pub fn bridged(&self) -> &Bridged {
        self.bridged.get_or_init(|| Bridged::of(self.scene))
    }

    /// Whether the scene allows to judge that.
    pub fn is_judged(&self, judgement: Judgement) -> bool {
        let unjudged = || self.bridged().unjudged().iter().map(Unjudged::judgement).collect();
        !self.unjudged.get_or_init(unjudged).contains(&judgement)
    }

    /// What the map says around the route.
    ///
    /// # Errors
    /// Why there is no route, in a sentence.
    pub fn ground(&self) -> Result<&Ground, String> {
        self.ground.get_or_init(|| Ground::of(self.bridged().judged())).as_ref().map_err(Clone::clone)
    }

    /// The logged AV at the same log indices as [`Drive::states`]; none where the log lacks one of them.
    pub fn human(&self) -> Option<Vec<AgentState>> {
        self.scene.av().states.get(self.start..self.start + self.states.len())?.iter().copied().collect()
    }

    /// The tracks of others that are there at a step from the start: place among the tracks, and state.
    pub fn others(&self, step: usize) -> impl Iterator<Item = (usize, AgentState)> {
        let log_index = self.start + step;
        let others = self.scene.tracks().iter().enumerate().filter(|(track, _)| *track != self.scene.av_index());
        others.filter_map(move |(track, logged)| Some((track, logged.states.get(log_index).copied().flatten()?)))
    }
}
