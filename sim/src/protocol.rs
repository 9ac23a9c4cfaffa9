//! The rules of an episode.
