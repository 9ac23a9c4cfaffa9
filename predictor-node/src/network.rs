//! The prediction network of the DIPP paper: three joint futures of the ten nearest, the AV's own controls in the likeliest, and the
//! weights of the planner's cost.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use network::features::{Features, Moment, Other, Style};
use network::frame::{Frame, HISTORY};
use network::inference::{Forecast, Memory, Network as Model};
use network::weights::Weights;
use network::weights::file::WeightsError;
use thiserror::Error;
use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::{Point, Pose, wrap_angle};
use world::observation::Briefing;
use world::plan::{Control, Future, PredictedTrajectory, UncheckedPrediction};
use world::scene::TrackId;
use world::signal::Signal;

/// How features are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum FeatureStyle {
    /// As the authors' code makes them, for weights of theirs
    #[default]
    Authors,
    /// Without what is plainly a bug, for weights trained so
    Mended,
}

impl From<FeatureStyle> for Style {
    fn from(style: FeatureStyle) -> Self {
        match style {
            FeatureStyle::Authors => Self::Authors,
            FeatureStyle::Mended => Self::Mended,
        }
    }
}

/// Weights that cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum NetworkError {
    #[error("the predictor network needs weights\nhint: --weights FILE.safetensors; docs/network.md says where from")]
    NoWeights,
    #[error("cannot read {}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Weights { path: PathBuf, source: WeightsError },
}

/// The predictor `network`.
pub struct Network {
    model: Arc<Model>,
    style: Style,
}

impl Network {
    /// The predictor with the weights in the file `path`.
    ///
    /// # Errors
    /// [`NetworkError`] where they cannot be read.
    pub fn open(path: Option<&Path>, style: FeatureStyle) -> Result<Self, NetworkError> {
        let path = path.ok_or(NetworkError::NoWeights)?.to_owned();
        let bytes = std::fs::read(&path).map_err(|source| NetworkError::File { path: path.clone(), source })?;
        let weights = Weights::from_safetensors(&bytes).map_err(|source| NetworkError::Weights { path, source })?;
        Ok(Self { model: Arc::new(Model::of(&weights)), style: style.into() })
    }
}

impl PredictorFactory for Network {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        Ok(Box::new(Drive {
            model: Arc::clone(&self.model),
            features: Features::new(&briefing.map, self.style),
            frame: Frame::default(),
            memory: Memory::default(),
            forecast: Forecast::default(),
            others: Vec::new(),
            signals: Vec::new(),
        }))
    }
}

/// The predictor in one episode.
struct Drive {
    model: Arc<Model>,
    features: Features,
    frame: Frame,
    memory: Memory,
    forecast: Forecast,
    others: Vec<Other>,
    signals: Vec<Signal>,
}

impl Predictor for Drive {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let observation = step.observation;
        let now = observation.log_index;
        let mut av = [observation.av; HISTORY];
        let mut known = step.history.steps().rev().filter(|past| past.log_index <= now).map(|past| past.av);
        // Whose history is shorter stood where it was first seen.
        let mut last = observation.av;
        for state in av.iter_mut().rev() {
            last = known.next().unwrap_or(last);
            *state = last;
        }
        self.others.clear();
        self.others.extend(observation.agents.iter().map(|agent| {
            let at = |row: usize| {
                let index = (now + row as u32 + 1).checked_sub(HISTORY as u32)?;
                step.history.state(agent.track, index).copied()
            };
            let mut history: [_; HISTORY] = std::array::from_fn(at);
            history[HISTORY - 1] = Some(agent.state);
            Other { kind: agent.kind, history }
        }));
        self.signals.clear();
        self.signals.extend(observation.signals.iter().map(|seen| seen.signal));
        let av_is_logged = observation.step == 0;
        let moment = Moment { av, av_is_logged, others: &self.others, signals: &self.signals };
        let sources = self.features.frame(&moment, &mut self.frame);
        self.model.forecast(&self.frame, &mut self.memory, &mut self.forecast);
        let tracks: Vec<TrackId> = sources.neighbors.iter().map(|other| observation.agents[*other].track).collect();
        Ok(self.answer(observation.step, observation.av.pose(), &tracks))
    }
}

impl Drive {
    fn answer(&self, step: u32, av: Pose, tracks: &[TrackId]) -> UncheckedPrediction {
        let in_the_log = |[x, y, heading]: &[f32; 3]| {
            let place = av.to_world(Point::new(f64::from(*x), f64::from(*y)));
            Pose::new(place.x, place.y, wrap_angle(f64::from(*heading) + av.heading))
        };
        let probabilities = self.forecast.probabilities();
        let futures = self.forecast.predictions.iter().zip(probabilities).map(|(predictions, probability)| Future {
            probability: f64::from(probability),
            trajectories: tracks
                .iter()
                .zip(predictions)
                .map(|(track, poses)| PredictedTrajectory {
                    track: *track,
                    poses: poses.iter().map(in_the_log).collect(),
                })
                .collect(),
        });
        // Of equally likely ones the first, as of the planner's.
        let likeliest =
            (1..probabilities.len()).fold(0, |a, b| if probabilities[b] > probabilities[a] { b } else { a });
        let control = |[acceleration, steering]: &[f32; 2]| Control {
            acceleration: (*acceleration).into(),
            steering: (*steering).into(),
        };
        UncheckedPrediction {
            step,
            futures: futures.collect(),
            initial_controls: self.forecast.plans[likeliest].iter().map(control).collect(),
            cost_weights: self.forecast.cost_weights.map(f64::from).to_vec(),
        }
    }
}
