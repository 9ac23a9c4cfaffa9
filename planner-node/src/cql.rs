//! The planner `cql`: a policy that sees the scene from above and says where the AV is a step later (`docs/cql.md`). What comes after that pose is the same
//! step again and again: a tracker looks ahead, the policy does not.

use std::path::PathBuf;
use std::sync::Arc;

use network::cql::{Painter, Policy, Workspace, next_pose};
use network::weights::WeightsError;
use thiserror::Error;
use wire::node::{Planner, PlannerFactory, StepInput};
use world::observation::Briefing;
use world::plan::{PLAN_STEPS, PlanState, STEP_SECONDS, UncheckedPlan};

/// What it is told on the command line.
#[derive(Clone, Debug, Default, clap::Args)]
#[group(id = "cql_options")]
#[command(next_help_heading = "Options of cql")]
pub struct Options {
    /// The policy's weights, a .safetensors file
    #[arg(long, value_name = "FILE")]
    pub policy: Option<PathBuf>,
}

/// A policy that cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PolicyError {
    #[error(
        "the planner cql needs a policy\nhint: --policy FILE, as weights/cql.f16.safetensors of reloop's repository"
    )]
    None,
    #[error("{}: {source}\nhint: see that the path is right and can be read", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: {source}", path.display())]
    Weights { path: PathBuf, source: WeightsError },
}

/// The planner `cql`.
pub struct Cql(Arc<Policy>);

impl Cql {
    /// With the policy in a file.
    ///
    /// # Errors
    /// [`PolicyError`] where there is none, or it is none.
    pub fn open(options: &Options) -> Result<Self, PolicyError> {
        let path = options.policy.clone().ok_or(PolicyError::None)?;
        let bytes = std::fs::read(&path).map_err(|source| PolicyError::Read { path: path.clone(), source })?;
        let policy = Policy::read(&bytes).map_err(|source| PolicyError::Weights { path, source })?;
        Ok(Self(Arc::new(policy)))
    }
}

impl PlannerFactory for Cql {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Drive {
            policy: Arc::clone(&self.0),
            painter: Painter::new(&briefing.map, &briefing.reference_line),
            room: Workspace::default(),
        }))
    }
}

struct Drive {
    policy: Arc<Policy>,
    painter: Painter,
    room: Workspace,
}

impl Planner for Drive {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let observation = step.observation;
        let signals = observation.signals.iter().map(|seen| seen.signal);
        let picture = self.painter.paint(step.history.steps(), signals);
        let action = self.policy.act(picture, &mut self.room);
        let mut pose = observation.av.pose();
        let speed = next_pose(pose, action).position().distance(pose.position()) / STEP_SECONDS;
        let states = (0..PLAN_STEPS).map(|_| {
            pose = next_pose(pose, action);
            PlanState { x: pose.x, y: pose.y, heading: pose.heading, speed }
        });
        Ok(UncheckedPlan { step: observation.step, states: states.collect(), ..UncheckedPlan::default() })
    }
}
