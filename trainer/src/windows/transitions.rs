//! Transitions of the driver `cql`: what was seen, what the logged AV did then, how far that took it, and what was seen next (paper section IV-C).
//!
//! A file of windows holds them, with a piece for each step of a scene: where the AV is a step later (three f32: forward, left, around), whether that is
//! the last of the log (one byte), and the picture, packed (DEFLATE, 2 to 6 kB). Two pieces of steps that follow one another are a transition.

use std::path::PathBuf;

use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec_with_limit;
use network::cql::{AGES, PICTURE, Painter, action_of};
use serde::{Deserialize, Serialize};
use world::geometry::Pose;
use world::observation::{HistoryStep, ObservedAgent};
use world::route::{Route, RouteStyle};
use world::scene::Scene;

use super::error::{FileProblem, WindowsError};
use super::file::{WindowsFile, digest, number};
use super::recipe::{Cutting, Piece, Pieces};
use super::split::Role;

/// Episodes begin at this step of the log.
const FIRST: usize = 19;
/// How hard pictures are packed: more takes twice the time for a tenth of the size.
const LEVEL: u8 = 4;
/// Bytes before the picture.
const HEAD: usize = 13;

/// How pictures are drawn; another number, other pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drawn {
    /// The form of `docs/cql.md`.
    pub picture: u32,
}

impl Default for Drawn {
    fn default() -> Self {
        Self { picture: 2 } // 1: filled by tiny-skia, with other edges
    }
}

/// A step of the logged AV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transition {
    /// What was seen.
    pub state: Vec<u8>,
    /// What was done, each number in [-1, 1].
    pub action: Vec<f32>,
    /// How far it took the AV (m).
    pub distance: f32,
    /// Whether the AV is at its goal then: where the log ends.
    pub goal: bool,
    /// What was seen then.
    pub next: Vec<u8>,
}

/// Transitions by number, as the loop sees them.
pub trait Experience: Sync {
    /// One of them.
    ///
    /// # Errors
    /// Where it cannot be read.
    fn get(&self, index: usize) -> anyhow::Result<Transition>;
    /// Numbers of those to learn from.
    fn training(&self) -> &[usize];
    /// Numbers of those that tell how well was learned.
    fn validation(&self) -> &[usize];
    /// A hash that tells these from any others.
    fn digest(&self) -> String;
}

/// Those in files that `trainer prepare --transitions` wrote, read where they lie as windows are.
#[derive(Debug)]
pub struct Transitions {
    files: Vec<WindowsFile>,
    training: Vec<usize>,
    validation: Vec<usize>,
}

impl Cutting for Drawn {
    fn text(&self) -> String {
        toml::to_string(self).unwrap_or_default() // a number
    }

    fn pieces(&self, scene: &Scene) -> Pieces {
        let mut all = Pieces::default();
        let Ok(route) = Route::of_log(scene, RouteStyle::Strict) else {
            all.skipped.insert("no route", scene.steps().saturating_sub(FIRST) as u32);
            return all;
        };
        let mut painter = Painter::new(scene.map(), &route.line);
        for step in FIRST..scene.steps() {
            let Some(now) = scene.av().states[step] else {
                *all.skipped.entry("the AV is not seen at the step").or_default() += 1;
                continue;
            };
            let next = scene.av().states.get(step + 1).copied().flatten();
            let done = next.map_or(Pose::default(), |next| now.pose().pose_to_body(next.pose()));
            let mut bytes = Vec::new();
            [done.x, done.y, done.heading].iter().for_each(|value| bytes.extend((*value as f32).to_le_bytes()));
            bytes.push(u8::from(step + 2 == scene.steps()));
            let before = AGES.iter().filter_map(|age| history(scene, step.checked_sub(*age as usize)?));
            let before: Vec<HistoryStep> = before.collect();
            let picture = painter.paint(before.iter(), scene.signals(step).iter().copied());
            bytes.extend(compress_to_vec(picture, LEVEL));
            all.pieces.push(Piece { step: step as u32, av: scene.av().id.0, bytes });
        }
        all
    }
}

/// Who was where at a step; none where the AV was not seen.
fn history(scene: &Scene, step: usize) -> Option<HistoryStep> {
    let av = scene.av().states[step]?;
    let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
    let agents = others.filter_map(|(_, track)| {
        Some(ObservedAgent { track: track.id, kind: track.kind, state: track.states[step]?, unseen: 0 })
    });
    Some(HistoryStep { log_index: step as u32, av, agents: agents.collect() })
}

impl Transitions {
    /// Opens files as one; reads their heads alone.
    ///
    /// # Errors
    /// [`WindowsError`] where one cannot be read, is not whole or holds something else, or where a scene trains in one and validates in another.
    pub fn open(paths: &[PathBuf]) -> Result<Self, WindowsError> {
        let mut files = paths.iter().map(|path| WindowsFile::open(path)).collect::<Result<Vec<_>, _>>()?;
        for file in &files {
            let Drawn { picture } = file.recipe()?;
            if picture != Drawn::default().picture {
                let problem = FileProblem::Version { found: picture, known: Drawn::default().picture };
                return Err(file.told(problem));
            }
        }
        let (mut training, mut validation) = (Vec::new(), Vec::new());
        let all = number(&mut files)?;
        for file in &files {
            for (at, pair) in file.head.places.windows(2).enumerate() {
                if (pair[1].scene, pair[1].step) == (pair[0].scene, pair[0].step + 1) {
                    let (index, role) = all[file.first + at];
                    if role == Role::Training { training.push(index) } else { validation.push(index) }
                }
            }
        }
        Ok(Self { files, training, validation })
    }
}

impl Experience for Transitions {
    fn get(&self, index: usize) -> anyhow::Result<Transition> {
        let file = self.files.partition_point(|file| file.first <= index).checked_sub(1).map(|at| &self.files[at]);
        let count = self.training.len() + self.validation.len();
        let file = file.filter(|file| index + 1 < file.first + file.head.places.len());
        let file = file.ok_or(WindowsError::Index { index, windows: count })?;
        let read = |at: usize| -> Result<(Vec<u8>, Vec<u8>), WindowsError> {
            let bytes = file.payload(at)?;
            let cut_short = || file.problem(at, FileProblem::CutShort);
            let (head, packed) = bytes.split_at_checked(HEAD).ok_or_else(cut_short)?;
            let picture = decompress_to_vec_with_limit(packed, PICTURE).map_err(|_| cut_short())?;
            if picture.len() == PICTURE { Ok((head.to_vec(), picture)) } else { Err(cut_short()) }
        };
        let (head, state) = read(index - file.first)?;
        let (_, next) = read(index - file.first + 1)?;
        let mut done = head.as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes)));
        let [x, y, heading] = std::array::from_fn(|_| done.next().unwrap_or_default());
        let action = action_of(Pose::default(), Pose::new(x, y, heading)).to_vec();
        let distance = (x * x + y * y).sqrt() as f32;
        Ok(Transition { state, action, distance, goal: head[HEAD - 1] == 1, next })
    }

    fn training(&self) -> &[usize] {
        &self.training
    }

    fn validation(&self) -> &[usize] {
        &self.validation
    }

    fn digest(&self) -> String {
        digest(&self.files)
    }
}
