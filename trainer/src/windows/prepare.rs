//! From a set of scenes to a file of windows: threads cut scenes into parts, then the parts are joined in the set's order.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use scenarios::{SceneSet, SetError};
use thiserror::Error;

use super::error::WindowsError;
use super::head::{Head, Place, SceneRecord};
use super::parts::Parts;
use super::recipe::Cutting;
use super::split::{Role, Split};

/// What is to be made.
pub struct Order<'a> {
    /// The scenes.
    pub set: &'a SceneSet,
    /// How they are cut.
    pub recipe: &'a dyn Cutting,
    /// What they are for.
    pub split: &'a Split,
    /// The file.
    pub out: &'a Path,
    /// Threads.
    pub jobs: usize,
}

/// What was made.
#[derive(Debug)]
pub struct Prepared {
    /// The scenes in the file.
    pub scenes: Vec<SceneRecord>,
    /// Windows of scenes to learn from, and of scenes that validate.
    pub windows: [usize; 2],
    /// Bytes of the file.
    pub bytes: u64,
    /// Scenes that cannot be read.
    pub broken: Vec<Broken>,
    /// Scenes that the split does not name.
    pub left_out: Vec<String>,
    /// Scenes that were ready from before.
    pub resumed: usize,
}

/// A scene that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// Its id.
    pub scene: String,
    /// Why, and what to do.
    pub reason: String,
}

/// Why there is no file.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PrepareError {
    #[error("{}: {source}\nhint: see that the folder is there, can be written and has room", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Part(#[from] WindowsError),
    #[error("somebody else prepares {}\nhint: wait for it, or give another file with --out", .0.display())]
    Busy(PathBuf),
    #[error("no scene gives a window{}\nhint: {}", Among(broken), no_window_hint(broken))]
    NoWindows { broken: Vec<Broken> },
    #[error("threads cannot be started: {0}\nhint: give fewer --jobs")]
    Threads(String),
    #[error("interrupted\nhint: the same command goes on from there")]
    Interrupted,
}

struct Among<'a>(&'a [Broken]);

impl std::fmt::Display for Among<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            [] => Ok(()),
            [first, ..] => write!(f, ", and {} cannot be read, first {}: {}", self.0.len(), first.scene, first.reason),
        }
    }
}

fn no_window_hint(broken: &[Broken]) -> &'static str {
    if broken.is_empty() {
        "a window takes 7.1 s of a scene, a lane under its AV, and with --split a line in that list"
    } else {
        "`scenarios list PATH...` shows what is in the files"
    }
}

/// Makes the file. `progress` is told of every scene that is done, with how many windows it gave and whether it was ready before.
///
/// # Errors
/// [`PrepareError`]; a scene that cannot be read is none.
pub fn prepare(
    order: &Order<'_>,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, bool) + Sync),
) -> Result<Prepared, PrepareError> {
    let recipe = order.recipe.text();
    // Another build may make other windows: parts of one are not mixed with those of another.
    let parts = Parts::open(order.out, format!("{recipe}revision = {:?}\n", terminal::REVISION))?;
    let (mut chosen, mut left_out) = (Vec::new(), Vec::new());
    for (index, entry) in order.set.entries().iter().enumerate() {
        match order.split.role(entry.id.as_str()) {
            Some(role) => chosen.push((index, role)),
            None => left_out.push(entry.id.to_string()),
        }
    }
    let threads = rayon::ThreadPoolBuilder::new().num_threads(order.jobs).build();
    let threads = threads.map_err(|error| PrepareError::Threads(error.to_string()))?;
    let one = |scene: &(usize, Role)| {
        if stop.load(Ordering::Relaxed) {
            Err(PrepareError::Interrupted)
        } else {
            ready(order, &parts, *scene, progress)
        }
    };
    let done: Vec<Done> = threads.install(|| chosen.par_iter().map(one).collect::<Result<_, _>>())?;
    let (mut heads, mut broken, mut resumed) = (Vec::new(), Vec::new(), 0);
    for done in done {
        match done {
            Done::Ready { head, before } => {
                resumed += usize::from(before);
                heads.push(head);
            }
            Done::Broken(scene) => broken.push(scene),
        }
    }
    if heads.iter().all(|head| head.places.is_empty()) {
        return Err(PrepareError::NoWindows { broken });
    }
    let by = match order.split {
        Split::Share(share) => format!("{share} of the scenes validate, by a hash of their ids"),
        Split::List(list) => format!("a list of {} scenes", list.len()),
    };
    let head = parts.join(order.out, format!("{recipe}split = {by:?}\n"), heads)?;
    parts.remove()?;
    let validates = |place: &&Place| head.scenes[place.scene as usize].role == Role::Validation;
    let validation = head.places.iter().filter(validates).count();
    let bytes = head.places.last().map_or(0, |last| last.offset + u64::from(last.length));
    let windows = [head.places.len() - validation, validation];
    Ok(Prepared { scenes: head.scenes, windows, bytes, broken, left_out, resumed })
}

/// What became of a scene.
enum Done {
    Ready { head: Head, before: bool },
    Broken(Broken),
}

/// Sees to it that the part of a scene is there.
fn ready(
    order: &Order<'_>,
    parts: &Parts,
    (index, role): (usize, Role),
    progress: &(dyn Fn(usize, bool) + Sync),
) -> Result<Done, PrepareError> {
    let id = order.set.entries()[index].id.as_str();
    let broken = |error: SetError| {
        progress(0, false);
        let reason = format!("{error}\nhint: {}", error.hint());
        Ok(Done::Broken(Broken { scene: id.to_owned(), reason }))
    };
    let sha256 = match order.set.sha256(index) {
        Ok(sha256) => sha256,
        Err(error) => return broken(error),
    };
    let (mut head, before) = match parts.find(id, &sha256) {
        Some(head) => (head, true),
        None => match order.set.load(index) {
            Ok((scene, _)) => (parts.put(id, &sha256, order.recipe.pieces(&scene))?, false),
            Err(error) => return broken(error),
        },
    };
    // A part does not know what its scene is for.
    head.scenes.iter_mut().for_each(|scene| scene.role = role);
    progress(head.places.len(), before);
    Ok(Done::Ready { head, before })
}
