//! How episodes begin that are not their driver's from the first step on: another drive's plans lead up to a step, the AV begins later, or
//! some of the traffic is left out. A fork, a second drive of a fork, and the drives that look for blame are ordinary runs of episodes
//! that begin so.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use episode::protocol::{Protocol, SettingError};
use episode::traffic::TrafficSettings;
use episode::{Episode, Undrivable};
use evaluation::recorded::RecordedError;
use evaluation::replay::{PlanError, Recorded};
use recording::LoadError;
use thiserror::Error;
use world::plan::Plan;
use world::scene::{Scene, SceneError, TrackId};

/// Plans that cannot lead.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum LeadError {
    #[error(transparent)]
    File(#[from] LoadError),
    #[error("{}: {source}", path.display())]
    Recording { path: PathBuf, source: RecordedError },
    #[error("{}: {source}", path.display())]
    Plan { path: PathBuf, source: PlanError },
}

/// An episode that cannot begin.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum NotBegun {
    #[error(transparent)]
    Undrivable(#[from] Undrivable),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Lead(#[from] LeadError),
    #[error(transparent)]
    Setting(#[from] SettingError),
}

/// Plans that are driven before the driver's own. Its nodes see all that happens meanwhile.
#[derive(Clone, Debug)]
pub enum Lead {
    /// Those of a recording, before a step.
    Recording {
        /// The MCAP file.
        path: PathBuf,
        /// The first step that is the driver's.
        until: u32,
    },
    /// These, from step 0 on.
    Plans(Arc<[Plan]>),
}

impl Lead {
    /// The plans.
    ///
    /// # Errors
    /// [`LeadError`].
    pub fn plans(&self) -> Result<Vec<Plan>, LeadError> {
        let (path, until) = match self {
            Self::Plans(plans) => return Ok(plans.to_vec()),
            Self::Recording { path, until } => (path, *until),
        };
        let bytes = recording::load(path)?;
        let recorded = Recorded::read(&bytes);
        let recorded = recorded.map_err(|source| LeadError::Recording { path: path.clone(), source })?;
        recorded.plans(until).map_err(|source| LeadError::Plan { path: path.clone(), source })
    }
}

/// An episode before its first step.
#[derive(Debug)]
pub struct Begun {
    /// The scene as it is driven through.
    pub scene: Arc<Scene>,
    /// The episode.
    pub episode: Episode,
    /// Plans that are driven before the driver's own.
    pub lead: Vec<Plan>,
}

/// How an episode begins. By default as any other.
#[derive(Clone, Debug, Default)]
pub struct Beginning {
    /// Who leads.
    pub lead: Option<Lead>,
    /// It begins so many steps later, where the logged AV is then.
    pub later: u32,
    /// Tracks that are not there.
    pub without: Vec<TrackId>,
}

impl Beginning {
    /// The episode of `scene` that begins so, under these rules, and with agents that react if `traffic` says whom it takes over.
    ///
    /// # Errors
    /// [`NotBegun`].
    pub fn begin(
        &self,
        scene: &Arc<Scene>,
        protocol: &Protocol,
        traffic: Option<&TrafficSettings>,
    ) -> Result<Begun, NotBegun> {
        let scene = self.scene(scene)?;
        let episode = match self.later {
            0 => Episode::new(Arc::clone(&scene), protocol)?,
            steps => Episode::begun_later(Arc::clone(&scene), protocol, steps)?,
        };
        let episode = match traffic {
            None => episode,
            Some(settings) => episode.with_traffic(settings)?,
        };
        let lead = self.lead.as_ref().map_or(Ok(Vec::new()), Lead::plans)?;
        Ok(Begun { scene, episode, lead })
    }

    fn scene(&self, scene: &Arc<Scene>) -> Result<Arc<Scene>, SceneError> {
        if self.without.is_empty() {
            return Ok(Arc::clone(scene));
        }
        let av = scene.av().id;
        let mut parts = Scene::clone(scene).into_parts();
        let stays = |id: TrackId| id == av || !self.without.contains(&id);
        parts.tracks.retain(|track| stays(track.id));
        parts.av_index = parts.tracks.iter().position(|track| track.id == av).unwrap_or(0);
        // What prediction tasks ask for counts by places that are others now, and no drive knows it.
        parts.tracks_to_predict.clear();
        parts.objects_of_interest.retain(|id| stays(*id));
        parts.check().map(|(scene, _)| Arc::new(scene))
    }
}

/// How the episodes of a run begin, by scene; those of all others begin as ever.
#[derive(Clone, Debug, Default)]
pub struct Beginnings(BTreeMap<String, Beginning>);

impl Beginnings {
    /// How the episode of `scene` begins.
    #[must_use]
    pub fn of(&self, scene: &str) -> Beginning {
        self.0.get(scene).cloned().unwrap_or_default()
    }
}

impl FromIterator<(String, Beginning)> for Beginnings {
    fn from_iter<T: IntoIterator<Item = (String, Beginning)>>(beginnings: T) -> Self {
        Self(beginnings.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use scenarios::generated::{Family, Parameters};

    use super::*;

    fn scene() -> Arc<Scene> {
        let payload = Family::named("following").unwrap().payload("following", 1, 0, &Parameters::default()).unwrap();
        Arc::new(scenarios::womd::read(&payload).unwrap().0)
    }

    #[test]
    fn who_is_left_out_is_not_there_and_the_av_stays() {
        let scene = scene();
        let away: Vec<TrackId> = scene.tracks().iter().map(|track| track.id).collect();
        let alone = Beginning { without: away, ..Beginning::default() };
        let alone = alone.begin(&scene, &Protocol::default(), None).unwrap();
        assert_eq!((alone.scene.tracks().len(), alone.scene.av()), (1, scene.av()));
        assert!(alone.episode.observe().agents.is_empty());
        assert!(Arc::ptr_eq(&scene, &Beginning::default().begin(&scene, &Protocol::default(), None).unwrap().scene));
    }

    #[test]
    fn who_begins_later_begins_where_the_log_is_then_and_ends_when_it_would() {
        for protocol in [Protocol::default(), Protocol::Paper] {
            let scene = scene();
            let usual = Beginning::default().begin(&scene, &protocol, None).unwrap().episode.briefing();
            let later = Beginning { later: 40, ..Beginning::default() }.begin(&scene, &protocol, None).unwrap().episode;
            let briefing = later.briefing();
            assert_eq!((briefing.start, briefing.horizon), (usual.start + 40, usual.horizon - 40));
            let there = scene.av().states[briefing.start as usize].unwrap();
            assert_eq!(later.observe().av.position(), there.position());
        }
    }
}
