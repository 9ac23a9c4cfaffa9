//! Where agents are that react.

use world::traffic::{TrafficMove, UncheckedMoves};

use super::agents::agent;
use super::answers::refuse;
use super::scene::MAX_AGENTS;
use super::{Message, MessageError, each};
use crate::proto;

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
    use world::scene::{AgentState, TrackId};

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
}
