//! From a record's payload to a checked scene.

use world::geometry::Point3;
use world::map::MapId;
use world::scene::{AgentState, Finding, Scene, SceneId, SceneParts, Track, TrackId, TrackToPredict};
use world::signal::Signal;

use super::features::Features;
use super::{ExampleError, ID, roadgraph};
use crate::womd::kinds::Numbered;

/// Steps come in three parts.
const PARTS: [&str; 3] = ["past", "current", "future"];

/// A step (s), where a record does not say when it was.
const STEP_SECONDS: f64 = 0.1;

/// The scene in `payload`, and what was found odd in it and mended.
///
/// # Errors
/// [`ExampleError`]: which feature, and what is wrong with it.
pub fn read(payload: &[u8]) -> Result<(Scene, Vec<Finding>), ExampleError> {
    let features = Features::of(payload)?;
    let id = features.text(ID)?;
    let agents = Agents::read(&features)?;
    let (map, mut findings) = roadgraph::map(&features)?;
    let signals = signals(&features, &agents, &mut findings)?;
    let parts = SceneParts {
        id,
        timestamps: agents.timestamps(),
        av_index: agents.av_index()?,
        objects_of_interest: agents
            .marked(&features, "objects_of_interest")?
            .into_iter()
            .map(|slot| agents.id(slot))
            .collect(),
        tracks_to_predict: agents.tracks_to_predict(&features)?,
        current_time_index: agents.current()?,
        tracks: agents.tracks(),
        signals,
        map,
    };
    if agents.kept.len() == agents.ids.len() {
        findings.push(Finding::Full { what: "road users", most: agents.ids.len() });
    }
    let (scene, found) = parts.check()?;
    findings.extend(found);
    Ok((scene, findings))
}

/// The id of the scene in `payload`.
///
/// # Errors
/// [`ExampleError`] as of [`read`].
pub fn scene_id(payload: &[u8]) -> Result<SceneId, ExampleError> {
    Ok(SceneId::new(Features::of(payload)?.text(ID)?)?)
}

/// Columns of states, in the order in which they are read.
const COLUMNS: [&str; 9] = ["x", "y", "z", "bbox_yaw", "velocity_x", "velocity_y", "length", "width", "height"];

/// What is known of all road users at the steps of a part: a row for each of them.
struct Part {
    steps: usize,
    columns: [Vec<f64>; COLUMNS.len()],
    valid: Vec<i64>,
    micros: Vec<i64>,
}

/// All road users: a record has room for so many, and most leave some of it.
struct Agents {
    ids: Vec<i64>,
    kinds: Vec<i64>,
    is_av: Vec<i64>,
    parts: [Part; PARTS.len()],
    /// The slots that are taken.
    kept: Vec<usize>,
}

/// `values`, if there are so many.
fn of_length<T>(name: &str, values: Vec<T>, expected: usize) -> Result<Vec<T>, ExampleError> {
    let name = || name.to_owned();
    if values.len() == expected {
        Ok(values)
    } else {
        Err(ExampleError::Values { name: name(), values: values.len(), expected })
    }
}

impl Agents {
    fn read(features: &Features<'_>) -> Result<Self, ExampleError> {
        let ids = features.ints("state/id")?;
        let slots = ids.len();
        let ints = |name: &str| of_length(name, features.ints(name)?, slots);
        let part = |part: &str| -> Result<Part, ExampleError> {
            let name = |column: &str| format!("state/{part}/{column}");
            let valid = features.ints(&name("valid"))?;
            let steps = valid.len().checked_div(slots).unwrap_or(0);
            let valid = of_length(&name("valid"), valid, steps * slots)?;
            let column = |column: &str| of_length(&name(column), features.floats(&name(column))?, valid.len());
            let mut columns: [Vec<f64>; COLUMNS.len()] = Default::default();
            for (place, name) in columns.iter_mut().zip(COLUMNS) {
                *place = column(name)?;
            }
            let micros = match features.has(&name("timestamp_micros")) {
                true => of_length(&name("timestamp_micros"), features.ints(&name("timestamp_micros"))?, valid.len())?,
                false => vec![-1; valid.len()],
            };
            Ok(Part { steps, columns, valid, micros })
        };
        let parts = [part(PARTS[0])?, part(PARTS[1])?, part(PARTS[2])?];
        let steps: usize = parts.iter().map(|part| part.steps).sum();
        features.budget().spend(steps.saturating_mul(slots))?;
        let is_there = |slot: &usize| {
            ids[*slot] >= 0 || parts.iter().any(|part| part.valid[slot * part.steps..][..part.steps].contains(&1))
        };
        let kept = (0..slots).filter(is_there).collect();
        Ok(Self { kinds: ints("state/type")?, is_av: ints("state/is_sdc")?, ids, parts, kept })
    }

    fn id(&self, slot: usize) -> TrackId {
        TrackId(i32::try_from(self.ids[slot]).unwrap_or(i32::MAX))
    }

    fn tracks(&self) -> Vec<Track> {
        let track = |slot: &usize| Track {
            id: self.id(*slot),
            kind: Numbered::from_number(i32::try_from(self.kinds[*slot]).unwrap_or(0)),
            states: self.parts.iter().flat_map(|part| (0..part.steps).map(|step| part.state(*slot, step))).collect(),
        };
        self.kept.iter().map(track).collect()
    }

    /// Time of each step (s): as any of the road users has it that are there.
    fn timestamps(&self) -> Vec<f64> {
        let steps = self.parts.iter().flat_map(|part| (0..part.steps).map(move |step| (part, step)));
        let seconds = |(index, (part, step)): (usize, (&Part, usize))| {
            let there = self.kept.iter().map(|slot| slot * part.steps + step).find(|at| part.valid[*at] == 1);
            let micros = there.map(|at| part.micros[at]).filter(|micros| *micros >= 0);
            micros.map_or(STEP_SECONDS * index as f64, |micros| micros as f64 * 1e-6)
        };
        steps.enumerate().map(seconds).collect()
    }

    /// The step up to which predictors are shown the log. What follows must be there.
    fn current(&self) -> Result<usize, ExampleError> {
        let [past, current, future] = &self.parts;
        let current = (past.steps + current.steps).saturating_sub(1);
        if future.valid.contains(&1) { Ok(current) } else { Err(ExampleError::FutureWithheld { current }) }
    }

    /// The AV's place among the tracks.
    fn av_index(&self) -> Result<usize, ExampleError> {
        let avs: Vec<usize> = (0..self.kept.len()).filter(|place| self.is_av[self.kept[*place]] == 1).collect();
        if let [av] = avs[..] { Ok(av) } else { Err(ExampleError::Avs(avs.len())) }
    }

    /// The taken slots that a feature marks; none where there is no such feature.
    fn marked(&self, features: &Features<'_>, name: &str) -> Result<Vec<usize>, ExampleError> {
        let name = format!("state/{name}");
        if !features.has(&name) {
            return Ok(Vec::new());
        }
        let marks = of_length(&name, features.ints(&name)?, self.ids.len())?;
        Ok(self.kept.iter().copied().filter(|slot| marks[*slot] == 1).collect())
    }

    fn tracks_to_predict(&self, features: &Features<'_>) -> Result<Vec<TrackToPredict>, ExampleError> {
        let name = "state/difficulty_level";
        let difficulties = match features.has(name) {
            true => of_length(name, features.ints(name)?, self.ids.len())?,
            false => vec![0; self.ids.len()],
        };
        let task = |slot: usize| TrackToPredict {
            track_index: self.kept.partition_point(|kept| *kept < slot),
            difficulty: i32::try_from(difficulties[slot]).unwrap_or(0).max(0),
        };
        Ok(self.marked(features, "tracks_to_predict")?.into_iter().map(task).collect())
    }
}

impl Part {
    fn state(&self, slot: usize, step: usize) -> Option<AgentState> {
        let at = slot * self.steps + step;
        let [x, y, z, heading, velocity_x, velocity_y, length, width, height] =
            self.columns.each_ref().map(|column| column[at]);
        (self.valid[at] == 1).then_some(AgentState { x, y, z, heading, velocity_x, velocity_y, length, width, height })
    }
}

/// What signals show at each step, all of a step behind those of the step before.
fn signals(
    features: &Features<'_>,
    agents: &Agents,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Vec<Signal>>, ExampleError> {
    let mut steps = Vec::new();
    let mut full = None;
    for (part, of_agents) in PARTS.iter().zip(&agents.parts) {
        let name = |column: &str| format!("traffic_light_state/{part}/{column}");
        if !features.has(&name("id")) {
            steps.resize(steps.len() + of_agents.steps, Vec::new());
            continue;
        }
        let lanes = features.ints(&name("id"))?;
        let lights = lanes.len().checked_div(of_agents.steps).unwrap_or(0);
        let lanes = of_length(&name("id"), lanes, lights * of_agents.steps)?;
        let ints = |column: &str| of_length(&name(column), features.ints(&name(column))?, lanes.len());
        let floats = |column: &str| of_length(&name(column), features.floats(&name(column))?, lanes.len());
        let (states, valid) = (ints("state")?, ints("valid")?);
        let (x, y, z) = (floats("x")?, floats("y")?, floats("z")?);
        let signal = |at: usize| Signal {
            lane: MapId(lanes[at]),
            state: Numbered::from_number(i32::try_from(states[at]).unwrap_or(0)),
            stop_point: Point3::new(x[at], y[at], z[at]),
        };
        for step in 0..of_agents.steps {
            let there = (step * lights..(step + 1) * lights).filter(|at| valid[*at] == 1);
            let signals: Vec<Signal> = there.map(signal).collect();
            if lights > 0 && signals.len() == lights {
                full = Some(lights);
            }
            steps.push(signals);
        }
    }
    findings.extend(full.map(|most| Finding::Full { what: "signals", most }));
    Ok(steps)
}
