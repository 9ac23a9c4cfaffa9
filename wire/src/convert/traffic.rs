//! Who is taken over from the log, and where agents are that react.

use std::collections::BTreeMap;
use std::sync::Arc;

use world::map::MapId;
use world::scene::TrackId;
use world::traffic::way::MOST_SAMPLES;
use world::traffic::{LaneStretch, Taken, TrafficMove, UncheckedMoves, Way};

use super::agents::agent;
use super::answers::refuse;
use super::map::{columns, points};
use super::scene::MAX_AGENTS;
use super::{Checked, FieldError, Message, MessageError, Problem, Within as _, bounded, each, finite, required};
use crate::proto;

/// Who is taken over for the step after the observation of `step`. The way of each is told once, when it is taken over.
#[must_use]
pub fn taken_agents(step: u32, taken: &[Taken]) -> proto::TakenAgents {
    let told = |taken: &Taken| proto::TakenAgent {
        agent: Some(proto::Agent {
            track: taken.track.0,
            kind: proto::AgentKind::from(taken.kind).into(),
            state: Some((&taken.state).into()),
            unseen: 0,
        }),
        since_step: taken.since_step,
        way: (taken.since_step == step).then(|| proto::Way::from(&*taken.way)),
    };
    proto::TakenAgents { step, agents: taken.iter().map(told).collect() }
}

impl From<&Way> for proto::Way {
    fn from(way: &Way) -> Self {
        let lane =
            |stretch: &LaneStretch| proto::LaneStretch { from: stretch.from, lane: stretch.lane.map(|lane| lane.0) };
        Self { samples: Some(columns(&way.samples())), lanes: way.lanes().iter().map(lane).collect() }
    }
}

/// The ways that were told of an episode's agents.
#[derive(Clone, Debug, Default)]
pub struct KnownWays(BTreeMap<TrackId, Arc<Way>>);

impl KnownWays {
    /// Who is taken over, as it was told; ways that came before are remembered.
    ///
    /// # Errors
    /// [`MessageError`] names the field that is wrong, be it the way of an agent of which none was told.
    pub fn taken(&mut self, message: proto::TakenAgents) -> Result<Vec<Taken>, MessageError> {
        self.read(message).map_err(|error| error.of(proto::TakenAgents::NAME))
    }

    fn read(&mut self, message: proto::TakenAgents) -> Checked<Vec<Taken>> {
        bounded("agents", MAX_AGENTS, message.agents.len())?;
        let agents = message.agents.into_iter().enumerate();
        agents.map(|(index, told)| self.one(told).at("agents", index)).collect()
    }

    fn one(&mut self, told: proto::TakenAgent) -> Checked<Taken> {
        let seen = agent(&required("agent", told.agent)?).within("agent")?;
        if let Some(way) = told.way {
            self.0.insert(seen.track, Arc::new(self::way(way).within("way")?));
        }
        let way = required("way", self.0.get(&seen.track))?;
        let (track, kind, state, since_step) = (seen.track, seen.kind, seen.state, told.since_step);
        Ok(Taken { track, kind, since_step, state, way: Arc::clone(way) })
    }
}

fn way(way: proto::Way) -> Checked<Way> {
    let samples = points("samples", way.samples)?;
    let lane = |stretch: proto::LaneStretch| {
        Ok(LaneStretch { from: finite("from", stretch.from)?, lane: stretch.lane.map(MapId) })
    };
    let lanes = each("lanes", MOST_SAMPLES, way.lanes, lane)?;
    let problem = Problem::TooLong { limit: MOST_SAMPLES, got: samples.len() };
    match samples.len() {
        1 => Err(FieldError::new("samples", Problem::Missing)),
        _ => Way::new(&samples, lanes).ok_or(FieldError::new("samples", problem)),
    }
}

/// Kinds are left out: whoever hears it has been told them.
impl From<&UncheckedMoves> for proto::TrafficMoves {
    fn from(moves: &UncheckedMoves) -> Self {
        let told = |told: &TrafficMove| proto::Agent {
            track: told.track.0,
            state: Some((&told.state).into()),
            ..proto::Agent::default()
        };
        Self { step: moves.step, agents: moves.moves.iter().map(told).collect(), error: String::new() }
    }
}

impl TryFrom<proto::TrafficMoves> for UncheckedMoves {
    type Error = MessageError;

    fn try_from(message: proto::TrafficMoves) -> Result<Self, MessageError> {
        refuse(&message.error)?;
        let told = |told| agent(&told).map(|agent| TrafficMove { track: agent.track, state: agent.state });
        let moves = each("agents", MAX_AGENTS, message.agents, told);
        Ok(Self { step: message.step, moves: moves.map_err(|e| e.of(proto::TrafficMoves::NAME))? })
    }
}

#[cfg(test)]
mod tests {
    use world::geometry::Point3;
    use world::scene::{AgentKind, AgentState};

    use super::*;

    fn moves() -> UncheckedMoves {
        let state =
            AgentState { x: 1.5, heading: -0.3, velocity_x: 4.0, length: 4.5, width: 2.0, ..Default::default() };
        UncheckedMoves { step: 7, moves: vec![TrafficMove { track: TrackId(-3), state }] }
    }

    #[test]
    fn moves_come_through_as_they_were() {
        assert_eq!(UncheckedMoves::try_from(proto::TrafficMoves::from(&moves())), Ok(moves()));
    }

    #[test]
    fn a_state_that_is_none_and_a_node_that_cannot_are_refused() {
        let mut nan = moves();
        nan.moves[0].state.y = f64::NAN;
        let error = UncheckedMoves::try_from(proto::TrafficMoves::from(&nan)).unwrap_err().to_string();
        assert!(error.contains("agents[0].state.y"), "{error}");
        let sorry = proto::TrafficMoves { error: "no map".to_owned(), ..Default::default() };
        assert!(matches!(UncheckedMoves::try_from(sorry), Err(MessageError::Refused(told)) if told == "no map"));
    }

    fn taken() -> Taken {
        let samples: Vec<Point3> = (0..20).map(|at| Point3::new(0.5 * f64::from(at), 0.25, 1.0)).collect();
        let lanes = vec![
            LaneStretch { from: 0.0, lane: Some(MapId(-4)) },
            LaneStretch { from: 5.5, lane: None },
            LaneStretch { from: 7.0, lane: Some(MapId(0)) },
        ];
        let state = moves().moves[0].state;
        let way = Arc::new(Way::new(&samples, lanes).unwrap());
        Taken { track: TrackId(-3), kind: AgentKind::Cyclist, since_step: 7, state, way }
    }

    #[test]
    fn a_way_is_told_once_and_remembered() {
        let mut ways = KnownWays::default();
        let told = [7, 8].map(|step| taken_agents(step, &[taken()]));
        assert_eq!(told.each_ref().map(|told| told.agents[0].way.is_some()), [true, false]);
        let late = KnownWays::default().taken(told[1].clone()).unwrap_err().to_string();
        assert!(late.contains("agents[0].way"), "{late}");
        for told in told {
            assert_eq!(ways.taken(told), Ok(vec![taken()]));
        }
    }

    #[test]
    fn a_way_that_is_none_is_refused() {
        let refusal = |change: fn(&mut proto::Way)| {
            let mut told = taken_agents(7, &[taken()]);
            change(told.agents[0].way.as_mut().unwrap());
            KnownWays::default().taken(told).unwrap_err().to_string()
        };
        let column = |way: &mut proto::Way, length: usize| {
            let line = vec![1.0; length];
            way.samples = Some(proto::Polyline { x: line.clone(), y: line.clone(), z: line });
        };
        for (error, field) in [
            (refusal(|way| way.samples = None), "way.samples is missing"),
            (refusal(|way| way.samples.as_mut().unwrap().z[3] = f64::NAN), "way.samples.z[3] is not finite"),
            (refusal(|way| way.lanes[1].from = f64::INFINITY), "way.lanes[1].from is not finite"),
        ] {
            assert!(error.contains(field), "{error}");
        }
        for length in [1, MOST_SAMPLES + 1] {
            let mut told = taken_agents(7, &[taken()]);
            column(told.agents[0].way.as_mut().unwrap(), length);
            let error = KnownWays::default().taken(told).unwrap_err().to_string();
            assert!(error.contains("way.samples"), "{error}");
        }
    }
}
