//! A drive, laid out: who is where, in it and in the log.

use std::collections::{BTreeMap, BTreeSet};

use episode::judges::level::Level;
use episode::judges::road::{RoadEdges, outermost};
use episode::judges::{Body, STOREY};
use episode::protocol::Protocol;
use world::geometry::{OrientedBox, Point3, boxes_overlap};
use world::scene::{AgentKind, AgentState, Scene, TrackId};
use world::traffic::Taken;

use super::yielding;
use crate::drives::{Driven, RetraceError};

/// Edges of the road are looked for so far from the AV's path (m).
const CORRIDOR: f64 = 200.0;

/// Boxes whose centres are farther apart than this (m) do not overlap.
const FAR: f64 = 30.0;

/// Somebody at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Member {
    /// Place of its track in the scene.
    pub place: usize,
    /// What it is.
    pub kind: AgentKind,
    /// Where it is.
    pub state: AgentState,
    /// Its box.
    pub outline: OrientedBox,
}

impl Member {
    fn overlaps(&self, other: &Self) -> bool {
        (self.state.z - other.state.z).abs() <= STOREY
            && self.state.position().distance_squared(other.state.position()) < FAR * FAR
            && boxes_overlap(&self.outline, &other.outline)
    }
}

/// A drive in which somebody reacted.
pub(super) struct Stage<'d> {
    pub driven: &'d Driven,
    /// The AV after each step.
    pub avs: Vec<AgentState>,
    /// Who reacted, and where each was to go.
    pub taken: BTreeMap<TrackId, Taken>,
    /// Places of tracks in the scene.
    pub places: BTreeMap<TrackId, usize>,
    /// Pairs, the lower place first, that overlap somewhere in the log.
    entangled: BTreeSet<(usize, usize)>,
    edges: RoadEdges,
}

impl<'d> Stage<'d> {
    pub(super) fn of(driven: &'d Driven, protocol: &Protocol) -> Result<Self, RetraceError> {
        let mut avs = Vec::with_capacity(driven.states.len());
        let mut taken = BTreeMap::new();
        driven.retrace(protocol, |_, episode| {
            avs.push(*episode.av());
            for agent in episode.taken() {
                taken.entry(agent.track).or_insert_with(|| agent.clone());
            }
        })?;
        let scene = &driven.logged;
        let path = scene.av().states.iter().flatten();
        let ground: Vec<Point3> = path.map(|state| Point3::new(state.x, state.y, ground(state))).collect();
        Ok(Self {
            avs,
            taken,
            places: scene.tracks().iter().zip(0..).map(|(track, place)| (track.id, place)).collect(),
            entangled: entangled(scene),
            edges: RoadEdges::of(scene.map(), &Level::along(&ground, CORRIDOR)),
            driven,
        })
    }

    /// All after a step of the drive, the AV among them.
    pub(super) fn driven_at(&self, step: usize) -> Vec<Member> {
        let log_index = self.driven.start as usize + step + 1;
        members(&self.driven.scene, log_index, Some(self.avs[step]))
    }

    /// All at a moment of the log.
    pub(super) fn logged_at(&self, log_index: usize) -> Vec<Member> {
        let scene = &self.driven.logged;
        members(scene, log_index, scene.av().states.get(log_index).copied().flatten())
    }

    /// Whether somebody overlaps another from whom the log keeps him apart. The AV is none of them: into whom it drives is its own.
    pub(super) fn overlaps(&self, own: &Member, members: &[Member]) -> bool {
        let pair = |other: &Member| (own.place.min(other.place), own.place.max(other.place));
        let mut others = members.iter().filter(|other| other.place != self.driven.scene.av_index());
        others.any(|other| other.place != own.place && own.overlaps(other) && !self.entangled.contains(&pair(other)))
    }

    /// How far (m) the outermost corner of a vehicle is beyond the edge of the road; none where there is no edge, or it is no vehicle.
    pub(super) fn beyond_the_road(&self, member: &Member) -> Option<f64> {
        let is_vehicle = member.kind == AgentKind::Vehicle;
        is_vehicle.then(|| outermost(self.edges.beyond(&Body::of(member.state), ground(&member.state))))?
    }

    /// The crossings at which `taken` had to yield, and whether it did.
    pub(super) fn crossings<'s>(&'s self, taken: &'s Taken) -> impl Iterator<Item = bool> + 's {
        let (scene, start) = (&self.driven.scene, self.driven.start as usize);
        let from = start + taken.since_step as usize;
        let until = start + self.avs.len();
        let of = move |place: usize| -> Vec<Option<AgentState>> {
            if place == scene.av_index() {
                // The AV after the step before is the AV now; at the start it is where it was logged.
                let at = |log_index: usize| match log_index.checked_sub(start + 1) {
                    Some(step) => self.avs.get(step).copied(),
                    None => scene.av().states.get(log_index).copied().flatten(),
                };
                (from..=until).map(at).collect()
            } else {
                (from..=until).map(|log_index| scene.tracks()[place].states.get(log_index).copied().flatten()).collect()
            }
        };
        let own = self.places.get(&taken.track).copied();
        let others = (0..scene.tracks().len()).filter(move |place| Some(*place) != own);
        let mine = own.map(of).unwrap_or_default();
        others.filter_map(move |place| yielding::yielded(taken, &mine, &of(place)))
    }
}

/// The height of the ground under somebody (m).
fn ground(state: &AgentState) -> f64 {
    state.z - 0.5 * state.height
}

fn members(scene: &Scene, log_index: usize, av: Option<AgentState>) -> Vec<Member> {
    let states = scene.tracks().iter().enumerate().filter_map(|(place, track)| {
        let logged = || track.states.get(log_index).copied().flatten();
        let state = if place == scene.av_index() { av } else { logged() }?;
        Some(Member { place, kind: track.kind, state, outline: state.oriented_box() })
    });
    states.collect()
}

fn entangled(scene: &Scene) -> BTreeSet<(usize, usize)> {
    let mut pairs = BTreeSet::new();
    for log_index in 0..scene.steps() {
        let all = members(scene, log_index, scene.av().states[log_index]);
        for (at, one) in all.iter().enumerate() {
            let others = all[at + 1..].iter().filter(|other| one.overlaps(other));
            pairs.extend(others.map(|other| (one.place, other.place)));
        }
    }
    pairs
}
