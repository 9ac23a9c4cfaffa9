//! Drivers of ours in this process: the planner and the predictor that nodes would serve, made by the same arguments.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use clap::Parser;
use planner_node::PlannerError;
use predictor_node::PredictorError;
use results::settings::{Machine, Node, Planner, Settings};
use scenarios::Logs;
use thiserror::Error;
use traffic_node::TrafficError;
use wire::hub::Minds;
use world::scene::{Scene, SceneId};

/// A driver that cannot be in this process.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum InProcessError {
    #[error(
        "--in-process drives with planners, predictors and traffic of reloop, and one of these is a process of yours\nhint: leave --in-process out"
    )]
    NotOurs,
    #[error("{node} does not take these arguments: {error}")]
    Arguments { node: &'static str, error: clap::Error },
    #[error(transparent)]
    Planner(#[from] PlannerError),
    #[error(transparent)]
    Predictor(#[from] PredictorError),
    #[error(transparent)]
    Traffic(#[from] TrafficError),
}

#[derive(Parser)]
struct PlannerLine {
    #[command(flatten)]
    choice: planner_node::Choice,
    #[command(flatten)]
    gauss_newton: planner_node::GaussNewtonOptions,
    #[command(flatten)]
    proposals: planner_node::ProposalsOptions,
    #[command(flatten)]
    cql: planner_node::CqlOptions,
}

#[derive(Parser)]
struct PredictorLine {
    #[command(flatten)]
    choice: predictor_node::Choice,
}

#[derive(Parser)]
struct TrafficLine {
    #[command(flatten)]
    choice: traffic_node::Choice,
}

/// Who drives by these settings. Who reads the log finds it in `logs`.
///
/// # Errors
/// [`InProcessError`].
pub fn minds(settings: &Settings, machine: &Machine, logs: &Arc<DrivenLogs>) -> Result<Minds, InProcessError> {
    let Planner::Node(planner) = &settings.planner else { return Err(InProcessError::NotOurs) };
    let logs = || Some(Arc::clone(logs) as Arc<dyn Logs>);
    let line = parsed::<PlannerLine>("planner-node", "--planner", planner, machine)?;
    let planner = line.choice.factory(&line.gauss_newton, line.proposals, &line.cql, logs())?;
    if settings.predictor.as_ref().is_some_and(|node| node.command.is_some()) {
        return Err(InProcessError::NotOurs);
    }
    let predictor = settings.predictor.as_ref().map(|node| -> Result<_, InProcessError> {
        let line = parsed::<PredictorLine>("predictor-node", "--predictor", node, machine)?;
        Ok(line.choice.factory(logs())?)
    });
    let traffic = settings.traffic.as_ref().map(|traffic| -> Result<_, InProcessError> {
        if traffic.node.command.is_some() {
            return Err(InProcessError::NotOurs);
        }
        let line = parsed::<TrafficLine>("traffic-node", "--traffic", &traffic.node, machine)?;
        Ok(line.choice.factory()?)
    });
    Ok(Minds { planner, predictor: predictor.transpose()?, traffic: traffic.transpose()? })
}

fn parsed<L: Parser>(program: &'static str, which: &str, node: &Node, machine: &Machine) -> Result<L, InProcessError> {
    let weights = weights_arguments(which, node, machine);
    let line = [program, which, &node.name].into_iter().chain(node.options.iter().map(String::as_str)).chain(weights);
    L::try_parse_from(line).map_err(|error| InProcessError::Arguments { node: program, error })
}

/// How a node, called by `which`, is told where its weights are, if they are not built in: a planner's `--weights` are those of a cost. Those of the
/// run are the driver's; the network of traffic is always the one that is built in.
pub fn weights_arguments<'a>(which: &str, node: &Node, machine: &'a Machine) -> impl Iterator<Item = &'a str> {
    let option = if which == "--planner" { "--policy" } else { "--weights" };
    let is_told = node.weights_sha256.is_some() && which != "--traffic";
    machine.weights.iter().filter(move |_| is_told).flat_map(move |path| [option, path.as_str()])
}

/// The logs of the scenes that are driven now, for who reads them: no scene is read twice.
#[derive(Debug, Default)]
pub struct DrivenLogs(Mutex<BTreeMap<SceneId, Arc<Scene>>>);

/// While it lives, a scene's log can be read.
pub struct Open<'a> {
    logs: &'a DrivenLogs,
    scene: SceneId,
}

impl DrivenLogs {
    /// Lets the log of `scene` be read.
    #[must_use]
    pub fn open(&self, scene: &Arc<Scene>) -> Open<'_> {
        self.scenes().insert(scene.id().clone(), Arc::clone(scene));
        Open { logs: self, scene: scene.id().clone() }
    }

    /// A poisoned lock is taken all the same: the map is whole between any two statements.
    fn scenes(&self) -> MutexGuard<'_, BTreeMap<SceneId, Arc<Scene>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Open<'_> {
    fn drop(&mut self) {
        self.logs.scenes().remove(&self.scene);
    }
}

impl Logs for DrivenLogs {
    fn scene(&self, id: &SceneId) -> Result<Arc<Scene>, String> {
        self.scenes().get(id).cloned().ok_or_else(|| format!("scene {id} is not driven now"))
    }
}
