//! Which row of the tape is whom.

use std::ops::Range;

use network::constants::{HISTORY, NEIGHBORS, STATE};

use crate::windows::Sketch;

/// Everybody of a few sketches, a row each: the AV, its neighbours, and one for all who are not there.
#[derive(Clone, Debug, Default)]
pub(super) struct Crew {
    pub rows: Vec<Row>,
    /// Rows of each sketch.
    pub samples: Vec<Range<usize>>,
    /// The AVs' rows.
    pub avs: Vec<usize>,
    /// The neighbours' rows, with sketch and number.
    pub neighbors: Vec<(usize, usize, usize)>,
}

/// A row.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub sample: usize,
    /// 0 is the AV; none is whoever is not there.
    pub agent: Option<usize>,
    /// Which LSTM encodes it.
    pub kind: &'static str,
    /// Whether others look at it.
    pub is_seen: bool,
}

impl Crew {
    pub fn of(sketches: &[&Sketch]) -> Self {
        let mut crew = Self::default();
        for (sample, sketch) in sketches.iter().enumerate() {
            let first = crew.rows.len();
            crew.avs.push(first);
            let is_seen = |agent: usize| sketch.presence.agents[agent];
            crew.rows.push(Row { sample, agent: Some(0), kind: "vehicle", is_seen: is_seen(0) });
            let mut is_full = true;
            for (number, history) in sketch.neighbors.iter().enumerate() {
                if !is_seen(number + 1) && history.as_flattened().iter().all(|value| *value == 0.0) {
                    is_full = false;
                    continue;
                }
                let kind = match history[HISTORY - 1][STATE] as usize {
                    2 => "pedestrian",
                    3 => "cyclist",
                    _ => "vehicle",
                };
                crew.neighbors.push((crew.rows.len(), sample, number));
                crew.rows.push(Row { sample, agent: Some(number + 1), kind, is_seen: is_seen(number + 1) });
            }
            if !is_full {
                crew.rows.push(Row { sample, agent: None, kind: "vehicle", is_seen: false });
            }
            crew.samples.push(first..crew.rows.len());
        }
        debug_assert!(crew.neighbors.iter().all(|(.., number)| *number < NEIGHBORS));
        crew
    }
}

impl Row {
    /// Its state at a step of its history.
    pub fn state(&self, sketches: &[&Sketch], step: usize) -> [f32; STATE] {
        match self.agent {
            Some(0) => sketches[self.sample].ego[step],
            Some(agent) => {
                let row = &sketches[self.sample].neighbors[agent - 1][step];
                std::array::from_fn(|column| row[column])
            }
            None => [0.0; STATE],
        }
    }
}
