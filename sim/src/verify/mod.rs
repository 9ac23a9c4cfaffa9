//! `sim verify`: holds the protocol `paper` to vectors that the authors' simulator wrote down.
//!
//! For every scene of the set the folder may hold `<scene>__route.npz`, and for each policy `<scene>__<policy>.npz` with
//! `<scene>__<policy>.json`. `human` and `constant-velocity` are driven whole; `planner` is driven along the states that were
//! recorded, so that everything but its plans is compared. The folder's README defines the arrays.
//!
//! | module | what |
//! | --- | --- |
//! | `policy` | who drives |
//! | `vector` | an episode as it was written down |
//! | `route` | the route |
//! | `episode` | an episode, step by step |

mod episode;
mod error;
mod policy;
mod route;
mod vector;

use std::path::Path;
use std::sync::Arc;

use scenarios::SceneSet;
use vectors::{Npz, Report, npz_files};
use world::scene::Scene;

pub use self::error::VerifyError;
use self::policy::Policy;
use self::vector::Vector;

/// Compares all vectors of `folder` whose scene is among `scenarios`, see [`SceneSet::open`].
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify(scenarios: &[String], folder: &Path) -> Result<Report, VerifyError> {
    let set = SceneSet::open(scenarios).map_err(VerifyError::Set)?;
    let files = npz_files(folder)?;
    let mut report = Report::new(&["deviation"], &[]);
    let mut compared = false;
    for (index, entry) in set.entries().iter().enumerate() {
        let named = |part: &str| {
            let path = folder.join(format!("{}__{part}.npz", entry.id));
            files.contains(&path).then_some(path)
        };
        let route = named("route");
        let episodes: Vec<_> = Policy::NAMES.iter().filter_map(|name| Some((*name, named(name)?))).collect();
        if route.is_none() && episodes.is_empty() {
            continue;
        }
        compared = true;
        let (scene, _) = set.load(index).map_err(VerifyError::Set)?;
        if let Some(route) = route {
            route::compare(&scene, &Npz::read(&route)?, &mut report)?;
        }
        for (name, path) in episodes {
            compare_episode(&scene, name, &path, &mut report)?;
        }
    }
    if compared { Ok(report) } else { Err(VerifyError::NoScene(folder.to_owned())) }
}

fn compare_episode(scene: &Arc<Scene>, name: &str, path: &Path, report: &mut Report) -> Result<(), VerifyError> {
    let npz = Npz::read(path)?;
    let vector = Vector::read(&npz, &path.with_extension("json"))?;
    let place = format!("{} {name}", scene.id());
    episode::compare(scene, &vector, &Policy::named(name, scene, &vector), &place, report);
    report.count_case();
    Ok(())
}
