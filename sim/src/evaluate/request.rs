//! A command line and what it means: for each driver what `sim run` would make of it.

use std::path::PathBuf;

use evaluation::open_loop::Definitions;
use evaluation::open_loop::table::Format;
use results::drivers::{self, Predictor};
use thiserror::Error;

use crate::cli::{Entrant, EvaluateArgs, ProtocolName, RunArgs};
use crate::request::{Request, RequestError};

/// Drivers, scenes, definitions.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// A run a driver, in the order of the table.
    pub requests: Vec<Request>,
    /// By what plans are judged.
    pub definitions: Definitions,
    /// Where the scenes come from.
    pub scenarios: Vec<String>,
    /// How the table is printed.
    pub format: Format,
    /// Where the rows of all frames go.
    pub out: Option<PathBuf>,
}

/// A command line that cannot be meant.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum EvaluationError {
    #[error(transparent)]
    Driver(#[from] RequestError),
    #[error(
        "two rows of the table would be called {0}\nhint: LABEL:DRIVER gives one another name, and --label a planner of your own"
    )]
    Twice(String),
    #[error(
        "no driver of --drivers has the predictor network, so --features says nothing\nhint: leave it out, or add --drivers dipp"
    )]
    NoNetwork,
    #[error("scenes are given twice: as PATH and by --scenarios\nhint: leave one of them out")]
    ScenesTwice,
    #[error("nobody is asked\nhint: --drivers dipp,idm or --planner-command COMMAND")]
    Nobody,
}

impl Evaluation {
    /// What `arguments` mean on a machine with so many cores.
    ///
    /// # Errors
    /// [`EvaluationError`].
    pub fn resolve(arguments: EvaluateArgs, cores: u16) -> Result<Self, EvaluationError> {
        if !arguments.paths.is_empty() && !arguments.scenarios.is_empty() {
            return Err(EvaluationError::ScenesTwice);
        }
        let own = arguments.planner_command.clone().map(|command| {
            let driver = drivers::DEFAULT.to_owned(); // not asked: the command is
            let own = Entrant { driver, planner_command: Some(command), ..Entrant::default() };
            RunArgs { label: arguments.label.clone(), ..RunArgs::of(&own) }
        });
        let mut networks = 0;
        let mut requests: Vec<Request> = Vec::new();
        for who in arguments.drivers.iter().map(RunArgs::of).chain(own) {
            let wants = drivers::find(&who.driver).filter(|_| who.planner_command.is_none()).map(|row| row.predictor);
            let has_network = arguments.predictor.or(wants) == Some(Predictor::Network);
            networks += usize::from(has_network);
            let run = RunArgs {
                scenarios: arguments.scenes().to_vec(),
                predictor: arguments.predictor,
                features: arguments.features.clone().filter(|_| has_network),
                protocol: match arguments.definitions {
                    Definitions::Strict => ProtocolName::Strict,
                    Definitions::Authors => ProtocolName::Paper,
                },
                parallel: arguments.parallel,
                in_process: arguments.in_process && who.planner_command.is_none(),
                pin: arguments.pin,
                deadline: arguments.deadline,
                start_timeout: arguments.start_timeout,
                ..who
            };
            let request = Request::resolve(run, cores)?;
            if requests.iter().any(|other| other.settings.driver == request.settings.driver) {
                return Err(EvaluationError::Twice(request.settings.driver));
            }
            requests.push(request);
        }
        if requests.is_empty() {
            return Err(EvaluationError::Nobody);
        }
        if networks == 0 && arguments.features.is_some() {
            return Err(EvaluationError::NoNetwork);
        }
        Ok(Self {
            requests,
            definitions: arguments.definitions,
            scenarios: arguments.scenes().to_vec(),
            format: arguments.format,
            out: arguments.out,
        })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::{Cli, Command};

    fn resolve(line: &str) -> Result<Evaluation, EvaluationError> {
        let words = ["sim", "evaluate", "--open-loop"].into_iter().chain(line.split_whitespace());
        let Command::Evaluate(arguments) = Cli::parse_from(words).command else { panic!("another command") };
        Evaluation::resolve(*arguments, 2)
    }

    #[test]
    fn each_driver_is_asked_as_sim_run_would_ask_it() {
        let evaluation = resolve("--drivers dipp,idm,gn-ctrv a b --definitions authors --parallel 3").unwrap();
        let names: Vec<_> = evaluation.requests.iter().map(|request| &*request.settings.driver).collect();
        assert_eq!(names, ["dipp", "idm", "gn-ctrv"]);
        for request in &evaluation.requests {
            assert_eq!(request.settings.protocol.name(), "paper");
            assert_eq!((request.machine.parallel, &request.machine.scenarios[..]), (3, &["a".into(), "b".into()][..]));
        }
        assert_eq!(evaluation.scenarios, ["a", "b"]);
        let strict = resolve("--drivers human --scenarios a").unwrap();
        assert_eq!(strict.requests[0].settings.protocol.name(), "strict");
    }

    #[test]
    fn a_driver_may_have_weights_and_a_label() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        let other = concat!(env!("CARGO_MANIFEST_DIR"), "/src/lib.rs");
        let line = format!("--drivers dipp={file},sep={other},again:sep={file},idm --features authors");
        let requests = resolve(&line).unwrap().requests;
        let weights: Vec<_> = requests.iter().map(|request| request.machine.weights.as_deref()).collect();
        assert_eq!(weights, [Some(file), Some(other), Some(file), None]);
        assert_eq!(requests[2].settings.driver, "again");
        assert!(matches!(resolve("--drivers idm --features mended"), Err(EvaluationError::NoNetwork)));
        assert!(matches!(resolve("--drivers idm=x"), Err(EvaluationError::Driver(RequestError::NoNetwork(_)))));
        assert!(matches!(resolve("--drivers sep"), Err(EvaluationError::Driver(RequestError::NeedsWeights { .. }))));
    }

    #[test]
    fn a_planner_of_ones_own_stands_beside_the_others() {
        let words = [
            "sim",
            "evaluate",
            "--open-loop",
            "--drivers",
            "idm",
            "--planner-command",
            "python a.py",
            "--label",
            "mine",
        ];
        let Command::Evaluate(arguments) = Cli::parse_from(words).command else { panic!("another command") };
        let requests = Evaluation::resolve(*arguments, 2).unwrap().requests;
        assert_eq!(requests.iter().map(|request| &*request.settings.driver).collect::<Vec<_>>(), ["idm", "mine"]);
        assert!(matches!(resolve("--drivers idm,idm"), Err(EvaluationError::Twice(_))));
        assert!(matches!(resolve("--drivers idm a --scenarios b"), Err(EvaluationError::ScenesTwice)));
        assert!(matches!(resolve(""), Err(EvaluationError::Nobody)));
    }
}
