//! The prediction network of the DIPP paper: three joint futures of the ten nearest, the AV's own controls in each, and the weights of
//! the planner's cost.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use network::Prediction as Answer;
use network::features::{Features, History, SceneFeatures, Settings};
use network::inference::{Network as Model, Workspace};
use network::weights::{Weights, WeightsError};
use thiserror::Error;
use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::{Point, Pose, wrap_angle};
use world::observation::{Briefing, Observation};
use world::plan::{Control, Future, PLAN_STEPS, PredictedTrajectory, UncheckedPrediction};
use world::scene::TrackId;

use crate::oracle::Oracle;

/// The weights of the driver `dipp`; `weights/README.md` says what they were trained on, and how.
static BUILT_IN: &[u8] = include_bytes!("../../weights/dipp.f16.safetensors");

/// What errors call them.
const BUILT_IN_NAME: &str = "the weights that are built in";

/// How features are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FeatureStyle {
    /// As the authors' code makes them, for weights of theirs
    Authors,
    /// Without what is plainly a bug, for weights trained so
    Mended,
}

impl From<FeatureStyle> for Settings {
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
    #[error("cannot read {}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Weights { path: PathBuf, source: WeightsError },
}

/// The predictor `network`.
pub struct Network {
    model: Arc<Model>,
    settings: Settings,
    /// Tells the futures in its place.
    log: Option<Oracle>,
}

impl Network {
    /// The predictor with the weights in the file `path`, or those that are built in.
    ///
    /// # Errors
    /// [`NetworkError`] where they cannot be read.
    pub fn open(path: Option<&Path>, style: Option<FeatureStyle>) -> Result<Self, NetworkError> {
        let (model, settings) = model(path, style)?;
        Ok(Self { model: Arc::new(model), settings, log: None })
    }

    /// The same network with the log's futures in place of its own: what its planner would do if it knew. They say no controls of the AV:
    /// those of the network are for futures of its own.
    #[must_use]
    pub fn with_futures(self, log: Oracle) -> Self {
        Self { log: Some(log), ..self }
    }

    /// Whether it tells where others will be: some networks tell what the AV does alone.
    #[must_use]
    pub fn predicts(&self) -> bool {
        self.model.variant().predicts()
    }

    /// The network in the episode of `briefing`, for who does not ask it at every step.
    #[must_use]
    pub fn foresight(&self, briefing: &Briefing) -> Foresight {
        Foresight {
            model: Arc::clone(&self.model),
            features: SceneFeatures::new(&briefing.map, self.settings),
            history: History::new(briefing),
            workspace: Workspace::new(1),
            answer: [Answer::empty()],
        }
    }
}

/// The network with the weights in the file `path`, or those that are built in, and how its features are made: as asked for, else as the
/// file says, else as the authors make them.
///
/// # Errors
/// [`NetworkError`].
pub(crate) fn model(path: Option<&Path>, style: Option<FeatureStyle>) -> Result<(Model, Settings), NetworkError> {
    let bytes = match path {
        None => Cow::Borrowed(BUILT_IN),
        Some(path) => {
            let read = std::fs::read(path);
            Cow::Owned(read.map_err(|source| NetworkError::File { path: path.to_owned(), source })?)
        }
    };
    let name = path.unwrap_or(Path::new(BUILT_IN_NAME));
    let read = Weights::read(&bytes).and_then(|weights| Ok((Model::new(&weights)?, weights.features())));
    let (model, trained_on) = read.map_err(|source| NetworkError::Weights { path: name.to_owned(), source })?;
    let trained_on = if path.is_none() { Some(Settings::Mended) } else { trained_on };
    let asked = style.map(Settings::from);
    let settings = asked.or(trained_on).unwrap_or(Settings::Authors);
    let (name, made) = (name.display(), settings.name());
    match trained_on {
        None if asked.is_none() => {
            tracing::warn!(
                "{name} does not say on which features it was trained: {made} are made, --features has others"
            );
        }
        Some(trained_on) if trained_on != settings => {
            tracing::warn!("{name} was trained on {} features, but {made} are made", trained_on.name());
        }
        _ => {}
    }
    Ok((model, settings))
}

impl PredictorFactory for Network {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        let log = self.log.as_ref().map(|log| log.start(briefing)).transpose()?;
        Ok(Box::new(Drive { foresight: self.foresight(briefing), log }))
    }
}

/// The network in one episode. It must see every observation, for it looks at the last two seconds; it need not be asked at each.
pub struct Foresight {
    model: Arc<Model>,
    features: SceneFeatures,
    history: History,
    workspace: Workspace,
    answer: [Answer; 1],
}

impl Foresight {
    /// Takes in an observation of which nothing is asked: the network does not run.
    pub fn see(&mut self, observation: &Observation) {
        self.history.observe(observation);
    }

    /// Takes in an observation, if it was not seen yet, and tells the futures at its step.
    pub fn foresee(&mut self, observation: &Observation) -> UncheckedPrediction {
        let features = self.features.at(&self.history.observe(observation));
        self.model.forward(&[&features.frame], &mut self.workspace, &mut self.answer);
        let predicted = if self.model.variant().predicts() { self.answer[0].futures } else { 0 };
        answered(&self.answer[0], predicted, &features, observation.step, observation.av.pose())
    }
}

/// The predictor in one episode.
struct Drive {
    foresight: Foresight,
    log: Option<Box<dyn Predictor>>,
}

impl Predictor for Drive {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let mut told = self.foresight.foresee(step.observation);
        if let Some(log) = &mut self.log {
            told.futures = log.predict(step)?.futures;
        }
        Ok(told)
    }
}

/// The message of an answer, in the log's frame; the first futures of it are of others too.
fn answered(answer: &Answer, predicted: usize, features: &Features, step: u32, av: Pose) -> UncheckedPrediction {
    let in_the_log = |[x, y, heading]: &[f32; 3]| {
        let place = av.to_world(Point::new(f64::from(*x), f64::from(*y)));
        Pose::new(place.x, place.y, wrap_angle(f64::from(*heading) + av.heading))
    };
    let trajectory = |(track, poses): (&TrackId, &[[f32; 3]; PLAN_STEPS])| PredictedTrajectory {
        track: *track,
        poses: poses.iter().map(in_the_log).collect(),
    };
    let control = |[acceleration, steering]: &[f32; 2]| Control {
        acceleration: f64::from(*acceleration),
        steering: f64::from(*steering),
    };
    let futures = answer.poses.iter().zip(answer.probabilities).zip(&answer.controls).take(predicted);
    let futures = futures.map(|((poses, probability), controls)| Future {
        probability: f64::from(probability),
        trajectories: features.tracks.iter().zip(poses).map(trajectory).collect(),
        controls: controls.iter().map(control).collect(),
    });
    UncheckedPrediction {
        step,
        futures: futures.collect(),
        initial_controls: answer.controls[answer.most_probable()].iter().map(control).collect(),
        cost_weights: answer.cost_weights.map_or_else(Vec::new, |weights| weights.map(f64::from).to_vec()),
    }
}
