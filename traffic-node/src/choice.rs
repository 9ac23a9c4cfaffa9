//! Which traffic, as it is typed.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;
use predictor_node::{FeatureStyle, Network, NetworkError};
use thiserror::Error;
use wire::node::TrafficFactory;

use crate::character::CASTS;
use crate::{Cast, Characters, Foreseen};

/// What the traffic of the network goes by.
const NETWORK: &str = "network";

/// Who drives, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrafficName {
    /// A model of how people drive.
    Characters(Cast),
    /// One of the joint futures that the prediction network foresees.
    Network,
}

/// All the names.
pub fn names() -> impl Iterator<Item = &'static str> {
    CASTS.iter().map(|(name, _)| *name).chain([NETWORK])
}

/// Whether the traffic of that name is driven by the network.
#[must_use]
pub fn has_network(name: &str) -> bool {
    name == NETWORK
}

/// Traffic that cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum TrafficError {
    #[error("there is no traffic {0:?}\nhint: {names}", names = names().collect::<Vec<_>>().join(", "))]
    Unknown(String),
    #[error("--weights and --features are for --traffic network, and {0} has no network")]
    NoNetwork(Cast),
    #[error("the weights are of a network that tells nothing of others: nobody could follow it")]
    PredictsNobody,
    #[error(transparent)]
    Network(#[from] NetworkError),
}

impl FromStr for TrafficName {
    type Err = TrafficError;

    fn from_str(text: &str) -> Result<Self, TrafficError> {
        if text == NETWORK {
            return Ok(Self::Network);
        }
        let named = CASTS.iter().find(|(name, _)| *name == text);
        named.map(|(_, cast)| Self::Characters(*cast)).ok_or_else(|| TrafficError::Unknown(text.to_owned()))
    }
}

impl fmt::Display for TrafficName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Characters(cast) => cast.fmt(f),
            Self::Network => f.pad(NETWORK),
        }
    }
}

/// Which traffic drives, and what it draws from.
#[derive(Clone, Debug, Args)]
pub struct Choice {
    /// Who drives: idm, waymax, cautious, assertive, distracted, mixed or network
    #[arg(long, value_name = "NAME")]
    pub traffic: TrafficName,
    /// What is drawn about them is drawn from this
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// The weights of `network`, a .safetensors file [default: those of dipp, built in]
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// How the features of `network` are made [default: as the weights say, or else authors]
    #[arg(long, value_enum)]
    pub features: Option<FeatureStyle>,
}

impl Choice {
    /// What makes it.
    ///
    /// # Errors
    /// [`TrafficError`] where what it needs is not there, or is not for it.
    pub fn factory(&self) -> Result<Arc<dyn TrafficFactory>, TrafficError> {
        Ok(match self.traffic {
            TrafficName::Characters(cast) if self.weights.is_some() || self.features.is_some() => {
                return Err(TrafficError::NoNetwork(cast));
            }
            TrafficName::Characters(cast) => Arc::new(Characters { cast, seed: self.seed }),
            TrafficName::Network => {
                let network = Network::open(self.weights.as_deref(), self.features)?;
                if !network.predicts() {
                    return Err(TrafficError::PredictsNobody);
                }
                Arc::new(Foreseen::new(network, self.seed))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_and_others_are_told_what_there_is() {
        for name in names() {
            assert_eq!(name.parse::<TrafficName>().unwrap().to_string(), name);
        }
        let told = "polite".parse::<TrafficName>().unwrap_err().to_string();
        assert!(names().all(|name| told.contains(name)), "{told}");
    }

    #[test]
    fn weights_are_for_the_network_alone() {
        let choice = Choice {
            traffic: TrafficName::Characters(Cast::Mixed),
            seed: 0,
            weights: Some(PathBuf::from("a.safetensors")),
            features: None,
        };
        assert!(matches!(choice.factory().err(), Some(TrafficError::NoNetwork(Cast::Mixed))));
        let network = Choice { traffic: TrafficName::Network, ..choice };
        assert!(matches!(network.factory().err(), Some(TrafficError::Network(_))), "there is no such file");
    }
}
