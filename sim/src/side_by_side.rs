//! `sim compare --open`: the drives of two runs through one scene, drawn into one file by the recorder, and shown by a viewer.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use evaluation::compare::{Comparison, parting};
use results::folder::recording_of;
use results::parquet::ParquetError;
use thiserror::Error;

use crate::run::process::{StartError, program};

/// Drives that cannot be shown.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum OpenError {
    #[error("no scene flipped between the two runs\nhint: --open SCENE shows any")]
    NothingFlipped,
    #[error("{0} is not among the scenes that both drove")]
    NoScene(String),
    #[error("{} is not there: the drive is not recorded\nhint: `sim run --record all` keeps recordings", .0.display())]
    NotRecorded(PathBuf),
    #[error(transparent)]
    Steps(#[from] ParquetError),
    #[error(transparent)]
    Recorder(#[from] StartError),
    #[error("the recorder cannot be started: {0}")]
    Start(io::Error),
    #[error("the recorder could not draw them:\n{0}")]
    Drawing(String),
}

/// What is shown.
#[derive(Debug)]
pub struct Shown {
    /// The scene.
    pub scene: String,
    /// Where it is drawn.
    pub rrd: PathBuf,
    /// The first step after which the AVs are apart; none where they never are.
    pub part_at_step: Option<u32>,
    /// Whether a viewer was started.
    pub viewer: bool,
}

/// Draws `scene`, or if it is empty the first that flipped, into `rrd`, and starts a viewer if there is one.
///
/// # Errors
/// [`OpenError`].
pub fn open(comparison: &Comparison, scene: &str, rrd: Option<&Path>) -> Result<Shown, OpenError> {
    let scene = match scene {
        "" => {
            let flips = || comparison.new_failures.iter().chain(&comparison.mended);
            let flip = flips().find(|flip| recordings(comparison, &flip.scene).iter().all(|path| path.exists()));
            flip.or(flips().next()).map(|flip| flip.scene.clone()).ok_or(OpenError::NothingFlipped)?
        }
        scene if comparison.scenes.iter().any(|both| both.scene == scene) => scene.to_owned(),
        scene => return Err(OpenError::NoScene(scene.to_owned())),
    };
    let [a, b] = recordings(comparison, &scene);
    if let Some(missing) = [&a, &b].into_iter().find(|path| !path.exists()) {
        return Err(OpenError::NotRecorded(missing.clone()));
    }
    let (one, other) = (Path::new(&comparison.a.folder), Path::new(&comparison.b.folder));
    let part_at_step = parting(one, other, comparison.protocol, &scene)?;
    let rrd = rrd.map_or_else(|| std::env::temp_dir().join(format!("reloop-{scene}.rrd")), Path::to_owned);
    let from = part_at_step.unwrap_or_default().to_string();
    let mut recorder = Command::new(program("recorder")?);
    recorder.arg("export").arg(&a).arg("--beside").arg(&b).args(["--from", &from, "--force", "--rrd"]).arg(&rrd);
    let drawn = recorder.output().map_err(OpenError::Start)?;
    if !drawn.status.success() {
        return Err(OpenError::Drawing(String::from_utf8_lossy(&drawn.stderr).trim_end().to_owned()));
    }
    // It stays open when we are gone.
    let viewer =
        Command::new("rerun").arg(&rrd).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    Ok(Shown { scene, rrd, part_at_step, viewer: viewer.is_ok() })
}

/// Where the drives of `scene` are recorded.
fn recordings(comparison: &Comparison, scene: &str) -> [PathBuf; 2] {
    [&comparison.a, &comparison.b].map(|side| recording_of(Path::new(&side.folder), scene))
}
