//! Who asks a service: `sim submit`, `status`, `watch`, `cancel` and `session`.
//!
//! | module | what |
//! | --- | --- |
//! | here | a connection that comes back, and what goes over it |
//! | [`status`] | how runs are, and what is offered |
//! | [`watch`] | how a run goes |
//! | [`session`] | one scene, step by step |

pub mod session;
pub mod status;
pub mod watch;

use std::thread;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use thiserror::Error;
use wire::keys::Secret;
use wire::proto::service::{self as message, Settings, ask, reply};
use wire::service::{Client, ServiceError};
use wire::session::{ZenohFile, ZenohFileError, settle_for};

use crate::cli::{CancelArgs, NO_TRAFFIC, ServiceArgs, SettingsArgs, SubmitArgs};
use crate::serve::offer::is_name;
use crate::serve::secret::{self, SecretError};

/// How long a client waits for a service that is gone to be there again.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long between two attempts.
const PAUSE: Duration = Duration::from_millis(250);

/// A question without an answer.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ClientError {
    #[error(transparent)]
    Service(#[from] ServiceError),
    #[error(transparent)]
    Secret(#[from] SecretError),
    #[error("cannot use the Zenoh configuration: {0}")]
    ZenohFile(#[from] ZenohFileError),
    #[error("the system gives no randomness: {0}")]
    Random(std::io::Error),
    #[error("the service answers what was not asked\nhint: take service and client from the same revision")]
    OtherAnswer,
}

/// A service, seen by a client. It may be killed and started again meanwhile.
pub struct Service {
    endpoint: String,
    secret: Secret,
    zenoh_file: Option<ZenohFile>,
    /// Who asks.
    pub client: String,
    connection: Option<Client>,
}

impl Service {
    /// The service that these arguments mean; nothing is asked yet.
    ///
    /// # Errors
    /// [`ClientError::Secret`], [`ClientError::ZenohFile`].
    pub fn new(arguments: &ServiceArgs) -> Result<Self, ClientError> {
        let said = arguments.client.clone().or_else(|| std::env::var("USER").ok());
        let client =
            said.filter(|name| is_name(name) || arguments.client.is_some()).unwrap_or_else(|| "somebody".to_owned());
        let secret = secret::of_client(&arguments.endpoint)?;
        settle_for(&arguments.endpoint);
        let zenoh_file = arguments.zenoh_config.as_deref().map(ZenohFile::read).transpose()?;
        Ok(Self { endpoint: arguments.endpoint.clone(), secret, zenoh_file, client, connection: None })
    }

    /// Asks what may be asked twice: again while the service is gone, for a while.
    ///
    /// # Errors
    /// [`ClientError`], also where the service refuses.
    pub fn ask(&mut self, what: &ask::What) -> Result<reply::What, ClientError> {
        self.ask_for(what, PATIENCE)
    }

    /// Asks, again while the service is gone for no longer than `patience`.
    ///
    /// # Errors
    /// As [`Service::ask`].
    pub fn ask_for(&mut self, what: &ask::What, patience: Duration) -> Result<reply::What, ClientError> {
        let until = Instant::now() + patience;
        loop {
            match self.ask_once(what.clone()) {
                Err(ClientError::Service(error)) if error.may_pass() && Instant::now() < until => thread::sleep(PAUSE),
                answer => return answer,
            }
        }
    }

    /// Asks once.
    ///
    /// # Errors
    /// As [`Service::ask`].
    pub fn ask_once(&mut self, what: ask::What) -> Result<reply::What, ClientError> {
        let connection = match self.connection.take() {
            Some(connection) => connection,
            None => Client::connect(&self.endpoint, self.secret.clone(), self.zenoh_file.as_ref())?,
        };
        let answer = connection.ask(what);
        // What has no answer may have no service any more behind it.
        if !answer.as_ref().is_err_and(ServiceError::may_pass) {
            self.connection = Some(connection);
        }
        Ok(answer?)
    }
}

/// These settings, as a service is told them.
#[must_use]
pub fn settings(arguments: &SettingsArgs) -> Settings {
    let text = |text: &Option<String>| text.clone().unwrap_or_default();
    let seconds = |time: Duration| format!("{}s", time.as_secs_f64());
    Settings {
        // The command's own name is the service's to give.
        driver: if arguments.planner_command.is_some() { String::new() } else { arguments.driver.clone() },
        predictor: arguments.predictor.map(word).unwrap_or_default(),
        weights: text(&arguments.weights),
        features: text(&arguments.features),
        label: text(&arguments.label),
        protocol: arguments.protocol.name().to_owned(),
        set: arguments.set.clone(),
        motion: arguments.motion.map(word).unwrap_or_default(),
        deadline: seconds(arguments.deadline),
        start_timeout: arguments.start_timeout.map(seconds).unwrap_or_default(),
        in_process: arguments.in_process,
        scenes: arguments.sets.clone(),
        planner_command: text(&arguments.planner_command),
        predictor_command: text(&arguments.predictor_command),
        ..Settings::default()
    }
}

/// As it is typed.
fn word(value: impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// Submits a run.
///
/// # Errors
/// [`ClientError`].
pub fn submit(arguments: &SubmitArgs, service: &mut Service) -> Result<message::Run, ClientError> {
    let settings = Settings {
        record: word(arguments.record),
        verify: arguments.verify,
        latency: arguments.latency.as_ref().map(ToString::to_string).unwrap_or_default(),
        parallel: arguments.parallel.unwrap_or_default().into(),
        traffic: if arguments.traffic == NO_TRAFFIC { String::new() } else { arguments.traffic.clone() },
        traffic_command: arguments.traffic_command.clone().unwrap_or_default(),
        traffic_seed: arguments.traffic_seed,
        traffic_set: arguments.traffic_set.clone(),
        ..settings(&arguments.settings)
    };
    let submission = Secret::random().map_err(ClientError::Random)?;
    let asked = ask::What::Submit(message::Submit {
        client: service.client.clone(),
        name: arguments.name.clone().unwrap_or_default(),
        settings: Some(settings),
        submission: submission.reveal().to_owned(),
    });
    match service.ask(&asked)? {
        reply::What::Run(run) => Ok(run),
        _ => Err(ClientError::OtherAnswer),
    }
}

/// Cancels runs, one after the other; how each is then.
///
/// # Errors
/// [`ClientError`] of the first that cannot be.
pub fn cancel(arguments: &CancelArgs, service: &mut Service) -> Result<Vec<message::Run>, ClientError> {
    let cancel = |name: &String| match service.ask(&ask::What::Cancel(message::Cancel { run: name.clone() }))? {
        reply::What::Run(run) => Ok(run),
        _ => Err(ClientError::OtherAnswer),
    };
    arguments.runs.iter().map(cancel).collect()
}
