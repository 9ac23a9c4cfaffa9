//! `sim check-node`: is a node what the bus expects of one?
//!
//! ```text
//! courses (scenes that idm drives) ──▶ stand (a bus, the node at its seat) ──▶ answers ──▶ trials ──▶ a finding a rule ──▶ report
//! ```
//!
//! | file | what |
//! | --- | --- |
//! | [`rule`] | what is asked, and what to do where it is not so |
//! | [`course`] | the observations, the same for everybody |
//! | [`stand`] | the bus, and the node on it |
//! | [`answers`], [`golden`] | what it answered: when, where, and whether that is what it said before |
//! | [`traffic`] | what of that is asked of traffic alone |
//! | [`trials`] | rule by rule |
//! | [`report`] | what was found |

use std::sync::Arc;
use std::time::Duration;

use scenarios::{SceneSet, SetError};
use thiserror::Error;
use wire::keys::Role;

use self::course::{Course, CourseError};
use self::golden::GoldenError;
use self::report::Report;
use self::stand::{Stand, Subject};
use self::trials::Wishes;
use crate::cli::CheckNodeArgs;
use crate::run::console::Console;
use crate::run::process::Groups;

pub mod answers;
pub mod course;
pub mod golden;
pub mod report;
pub mod rule;
pub mod stand;
pub mod traffic;
pub mod trials;

/// Nothing could be checked.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum CheckError {
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Course(#[from] CourseError),
    #[error(transparent)]
    Golden(#[from] GoldenError),
    #[error("{0}")]
    Bus(String),
}

/// How long nodes may take to start, where nobody says.
const START_TIMEOUT: Duration = Duration::from_secs(20);

/// Checks a node, rule by rule.
///
/// # Errors
/// [`CheckError`] where nothing could be checked. What is wrong with the node is in the report.
pub fn check(arguments: &CheckNodeArgs, console: &Console, groups: &Groups) -> Result<Report, CheckError> {
    let commands = [
        (Role::Planner, &arguments.planner_command),
        (Role::Predictor, &arguments.predictor_command),
        (Role::Traffic, &arguments.traffic_command),
    ];
    let given = commands.into_iter().find_map(|(role, command)| Some((role, command.as_ref()?)));
    let (role, command) = given.ok_or_else(|| CheckError::Bus("no command".to_owned()))?;
    let predictor = arguments.predictor.map(|predictor| predictor.name().to_owned());
    let subject = Subject { role, command: command.clone(), predictor };
    let mut courses = Course::built_in(role)?;
    if !arguments.paths.is_empty() {
        let scenes = SceneSet::open(&arguments.paths)?;
        for at in 0..scenes.entries().len() {
            courses.push(Course::of(Arc::clone(&scenes.load(at)?.0), role)?);
        }
    }
    let patience = arguments.start_timeout.unwrap_or(START_TIMEOUT);
    let stand = Stand::open(subject, [arguments.deadline, patience], console, groups).map_err(CheckError::Bus)?;
    let (command, what) = (command.clone(), stand.subject().what());
    console.line("note: what the node says follows; some of its errors are provoked");
    let wishes = Wishes { skip: &arguments.skip, golden: arguments.golden.as_deref(), bless: arguments.bless };
    let findings = trials::all(stand, &courses, &wishes)?;
    Ok(Report { command, role: what, findings })
}
