//! A finished run to be driven again: by the nodes that drove it, over scenes that are still the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use episode::latency::Latency;
use results::files::{self, FileError};
use results::settings::{Planner, Record, RunFile, SceneLine};
use results::trace::TRACE;
use results::weights;
use scenarios::{SceneSet, SetError};
use thiserror::Error;

use crate::request::Request;

/// A run that cannot be driven again.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum CastError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error("the scene {0} is not there any more\nhint: --scenarios says where the scenes are now")]
    NoScene(String),
    #[error(
        "the scene {0} is another one than was driven: its SHA-256 differs\nhint: --scenarios says where the scenes are now"
    )]
    OtherScene(String),
    #[error("the run was driven with other weights than {}: theirs have the SHA-256 {sha256}\nhint: --weights says where they are now", path.display())]
    OtherWeights { path: PathBuf, sha256: String },
    #[error(
        "the run was driven with the weights that were built in then, SHA-256 {0}; others are now\nhint: --weights FILE, a copy of those"
    )]
    OtherBuiltIn(String),
    #[error("--weights is for the prediction network or the policy of cql, and the run has none\nhint: leave it out")]
    NoNetwork,
}

/// Where and how a run is driven again, as far as it may be another way than before.
#[derive(Clone, Debug, Default)]
pub struct Means {
    /// Where its scenes are, if not where they were.
    pub scenarios: Vec<String>,
    /// Where its weights are, if not where they were.
    pub weights: Option<PathBuf>,
    /// Episodes at a time.
    pub parallel: u16,
    /// Whether it is driven in this process.
    pub in_process: bool,
}

/// The request that drives as the run `file` in `folder` was driven, with nothing recorded, and no folder yet.
///
/// # Errors
/// [`CastError`] where the weights are others.
pub fn again(folder: &Path, file: &RunFile, means: &Means) -> Result<Request, CastError> {
    let mut machine = file.machine.clone();
    (machine.parallel, machine.in_process) = (means.parallel, means.in_process);
    machine.weights = own_weights(file, means.weights.as_deref())?;
    if file.settings.planner != Planner::External {
        (machine.endpoint, machine.zenoh_config) = (None, None);
        machine.planner_certificates.clear();
    }
    if !means.scenarios.is_empty() {
        machine.scenarios.clone_from(&means.scenarios);
    }
    let mut settings = file.settings.clone();
    settings.record = Record::None;
    let mut request = Request {
        settings,
        machine,
        out: None,
        shard: None,
        retry: Vec::new(),
        verify: false,
        timing: false,
        view: false,
    };
    be_as_late(&mut request, folder, file);
    Ok(request)
}

/// Has plans take effect as in the run `file` in `folder`. What was measured then is known of drives that lead others; from there on it is
/// measured again.
pub fn be_as_late(request: &mut Request, folder: &Path, file: &RunFile) {
    request.settings.latency.clone_from(&file.settings.latency);
    request.settings.traffic.clone_from(&file.settings.traffic);
    request.machine.latency_trace = match &file.settings.latency {
        Some(Latency::Measured) => Some(folder.join(TRACE).display().to_string()),
        _ => file.machine.latency_trace.clone(),
    };
}

/// Has every plan take as long as it took in the run in `folder`, which was measured or had a trace.
///
/// # Errors
/// [`CastError`] where that is not known any more.
pub fn take_as_long(request: &mut Request, folder: &Path) -> Result<(), CastError> {
    if let Some(Latency::Measured | Latency::Trace { .. }) = &request.settings.latency {
        let path = folder.join(TRACE);
        request.settings.latency = Some(Latency::Trace { sha256: files::sha256([&*path])? });
        request.machine.latency_trace = Some(path.display().to_string());
    }
    Ok(())
}

/// Where the weights of the run are; none where it has none, or those that are built in.
fn own_weights(file: &RunFile, asked: Option<&Path>) -> Result<Option<String>, CastError> {
    let planner = match &file.settings.planner {
        Planner::Node(node) => Some(node),
        Planner::Command { .. } | Planner::External => None,
    };
    let mut nodes = file.settings.predictor.iter().chain(planner);
    let Some(sha256) = nodes.find_map(|node| node.weights_sha256.clone()) else {
        return if asked.is_some() { Err(CastError::NoNetwork) } else { Ok(None) };
    };
    let path = asked.map(Path::to_owned).or_else(|| file.machine.weights.as_ref().map(PathBuf::from));
    match path {
        Some(path) if files::sha256([&*path])? != sha256 => Err(CastError::OtherWeights { path, sha256 }),
        None if sha256 != weights::built_in_sha256() => Err(CastError::OtherBuiltIn(sha256)),
        path => Ok(path.map(|path| path.display().to_string())),
    }
}

/// Those of the files that commands of the user's name that are others now than when the run was driven.
#[must_use]
pub fn changed_files(file: &RunFile) -> Vec<&str> {
    let of_planner = match &file.settings.planner {
        Planner::Command { files, .. } => Some(files),
        Planner::Node(_) | Planner::External => None,
    };
    let files = of_planner.into_iter().chain(file.settings.predictor.iter().map(|node| &node.files)).flatten();
    let is_other = |(path, sha256): &(&String, &String)| {
        files::sha256([Path::new(path.as_str())]).map_or(true, |now| now != **sha256)
    };
    files.filter(is_other).map(|(path, _)| path.as_str()).collect()
}

/// The scenes of these episodes, in their order, held to the hashes of those that were driven.
///
/// # Errors
/// [`CastError`] of the first that is not there.
pub fn scenes<'l>(scenarios: &[String], lines: impl IntoIterator<Item = &'l SceneLine>) -> Result<SceneSet, CastError> {
    let set = SceneSet::open(scenarios)?;
    let entries = set.entries().iter().enumerate();
    let by_id: BTreeMap<&str, usize> = entries.map(|(place, entry)| (entry.id.as_str(), place)).collect();
    let lines: Vec<&SceneLine> = lines.into_iter().collect();
    let place = |line: &&SceneLine| by_id.get(&*line.id).copied().ok_or_else(|| CastError::NoScene(line.id.clone()));
    let places = lines.iter().map(place).collect::<Result<Vec<usize>, _>>()?;
    let set = set.only(&places);
    // All at once, on all cores; what was found is known then.
    set.verify()?;
    let is_other = |at: &usize| set.known_sha256(*at).as_deref() != Some(&*lines[*at].sha256);
    match (0..lines.len()).find(is_other) {
        Some(at) => Err(CastError::OtherScene(lines[at].id.clone())),
        None => Ok(set),
    }
}
