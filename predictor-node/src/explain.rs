//! `explain x.mcap --step N`: what the network was shown at a recorded step, and what each agent attended to.
//!
//! The question is made again from the recording, by the code that serves, and put to the network.

use std::fmt;
use std::path::{Path, PathBuf};

use network::Prediction as Answer;
use network::features::{History, SceneFeatures, View};
use network::inference::Workspace;
use recording::{Event, LoadError, NotMcap, Reader};
use thiserror::Error;
use wire::convert::{decode, observation};
use wire::proto;
use world::observation::Briefing;

use crate::network::{FeatureStyle, NetworkError, model};

/// Lane sequences of an agent; what follows them among its slots are crosswalks.
const LANES: usize = 6;

/// Agents that are named among those attended to.
const NAMED: usize = 3;

/// Why there is no explanation.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ExplainError {
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error("cannot use {}: {why}", path.display())]
    NotMcap { path: PathBuf, why: NotMcap },
    #[error("{} does not tell step {step}\nhint: `recorder info {}` says what it holds", path.display(), path.display())]
    Missing { path: PathBuf, step: u32 },
    #[error("{}: {topic}: {what}", path.display())]
    Message { path: PathBuf, topic: &'static str, what: String },
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// What the network was shown, and what it made of it.
#[derive(Clone, Debug)]
pub struct Explanation {
    scene: String,
    step: u32,
    /// The AV, then its neighbors: name and distance (m).
    agents: Vec<(String, f64)>,
    views: Vec<View>,
    answer: Answer,
}

const SCENE: &str = "/reloop/scene";
const OBSERVATION: &str = "/reloop/observation";

/// Explains a step of a recording, with the weights in a file, or those that are built in.
///
/// # Errors
/// [`ExplainError`].
pub fn explain(
    path: &Path,
    step: u32,
    weights: Option<&Path>,
    style: Option<FeatureStyle>,
) -> Result<Explanation, ExplainError> {
    let (model, settings) = model(weights, style)?;
    let bytes = recording::load(path)?;
    let mut reader = Reader::new(&bytes).map_err(|why| ExplainError::NotMcap { path: path.to_owned(), why })?;
    let wrong = |topic, what| ExplainError::Message { path: path.to_owned(), topic, what };
    let mut told: Option<(Briefing, History)> = None;
    while let Some(event) = reader.next() {
        let Event::Message(message) = event else { continue };
        match message.channel.topic.as_str() {
            SCENE if told.is_none() => {
                let scene: proto::Scene = decode(message.data).map_err(|error| wrong(SCENE, error.to_string()))?;
                let briefing = Briefing::try_from(scene).map_err(|error| wrong(SCENE, error.to_string()))?;
                let history = History::new(&briefing);
                told = Some((briefing, history));
            }
            OBSERVATION => {
                let Some((briefing, history)) = &mut told else { continue };
                let seen: proto::Observation =
                    decode(message.data).map_err(|error| wrong(OBSERVATION, error.to_string()))?;
                let seen = observation(seen, &briefing.reference_line);
                let seen = seen.map_err(|error| wrong(OBSERVATION, error.to_string()))?;
                let window = history.observe(&seen);
                if seen.step != step {
                    continue;
                }
                let features = SceneFeatures::new(&briefing.map, settings).at(&window);
                let mut answer = [Answer::empty()];
                model.forward(&[&features.frame], &mut Workspace::new(1), &mut answer);
                let [answer] = answer;
                let neighbors = window.neighbors.iter().map(|neighbor| {
                    let away = neighbor.now.position().distance(seen.av.position());
                    (format!("{} {}", neighbor.kind, neighbor.track), away)
                });
                let agents = std::iter::once(("AV".to_owned(), 0.0)).chain(neighbors).collect();
                let scene = briefing.scene.to_string();
                return Ok(Explanation { scene, step, agents, views: features.views, answer });
            }
            _ => {}
        }
    }
    Err(ExplainError::Missing { path: path.to_owned(), step })
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, step, agents, views, answer } = self;
        writeln!(f, "scene {scene}, step {step}: what the network was shown, and what each agent attended to")?;
        let probabilities = answer.probabilities[..answer.futures.min(answer.probabilities.len())].iter();
        let probabilities: Vec<String> = probabilities.map(|probability| format!("{probability:.2}")).collect();
        let likeliest = answer.most_probable();
        writeln!(f, "futures {}; attention to the map is that of number {}", probabilities.join(", "), likeliest + 1)?;
        for (agent, ((name, away), view)) in agents.iter().zip(views).enumerate() {
            match agent {
                0 => writeln!(f, "\n{name}")?,
                _ => writeln!(f, "\n{name}, {away:.1} m away")?,
            }
            // The second layer's: what the rest of the network goes by.
            let mut others: Vec<(f32, &str)> = answer.attention.agents[1][agent]
                .iter()
                .zip(agents)
                .map(|(share, (other, _))| (*share, other.as_str()))
                .collect();
            others.sort_by(|a, b| b.0.total_cmp(&a.0));
            let others = others.iter().take(NAMED).map(|(share, other)| format!("{other} {share:.2}"));
            writeln!(f, "  agents         {}", others.collect::<Vec<_>>().join(", "))?;
            let shares = answer.attention.map[likeliest][agent];
            for (slot, sequence) in view.sequences.iter().enumerate() {
                let lanes: Vec<String> = sequence.lanes.iter().map(|(lane, _)| lane.to_string()).collect();
                writeln!(f, "  lanes     {:.2} {}", shares[slot], lanes.join(" > "))?;
            }
            for (slot, crosswalk) in view.crosswalks.iter().enumerate() {
                writeln!(f, "  crosswalk {:.2} {crosswalk}", shares[LANES + slot])?;
            }
            if let Some(candidates) = view.candidates.filter(|candidates| *candidates > view.sequences.len()) {
                writeln!(f, "  (of {candidates} sequences)")?;
            }
        }
        Ok(())
    }
}
