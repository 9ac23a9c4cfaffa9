//! What is to be solved: the line, the AV, its neighbors and their predicted positions, the weights.

use thiserror::Error;
use world::plan::Control;
use world::vehicle::VehicleState;

use super::constants::{KEY_STEPS, NEIGHBORS, STEPS, STOP_MARGIN, TERMS};
use super::nearest::{Frenet, Line};
use super::shapes::Track;
use super::wide::wide;

/// What a problem is made of, borrowed.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// The reference line's x (m), samples 0.1 m apart.
    pub line_x: &'a [f64],
    /// Its y (m).
    pub line_y: &'a [f64],
    /// Its heading (rad).
    pub line_heading: &'a [f64],
    /// The speed that is wanted (m/s).
    pub speed_target: f64,
    /// A speed for each step in place of that one, if it is not the same all along (m/s).
    pub speed_targets: Option<&'a [f64; STEPS]>,
    /// How far the AV may drive until the red light, if there is one (m).
    pub stop_distance: Option<f64>,
    /// The AV now.
    pub av: Vehicle,
    /// What it is doing now, if that is known: the control that was driven last.
    pub present: Option<Control>,
    /// Its neighbors, at most [`NEIGHBORS`], the nearest first; `None` where nobody is.
    pub neighbors: &'a [Option<Neighbor<'a>>],
    /// The weight of each cost term.
    pub weights: [f64; TERMS],
}

/// The AV.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vehicle {
    /// Place, heading and speed.
    pub state: VehicleState,
    /// Length (m).
    pub length: f64,
    /// Width (m).
    pub width: f64,
}

/// A neighbor and where it is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor<'a> {
    /// Length (m).
    pub length: f64,
    /// Width (m).
    pub width: f64,
    /// Predicted positions (m) at 0.1 s, 0.2 s, ... 5.0 s.
    pub positions: &'a [(f64, f64)],
    /// Predicted headings (rad) at these times, or none: then as it moves. [`Safety::Boxes`](super::Safety::Boxes) alone looks at them.
    pub headings: &'a [f64],
    /// Standard deviations of these positions (m), along and across its heading, or none: then 0. For boxes, too.
    pub deviations: &'a [(f64, f64)],
}

/// Why inputs make no problem.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ProblemError {
    /// There is no line to follow.
    #[error("the reference line is empty")]
    EmptyLine,
    /// Columns or trajectories have the wrong length.
    #[error("{what} has {got} entries, but {expected} are needed")]
    WrongLength {
        /// Which one.
        what: &'static str,
        /// As many as needed.
        expected: usize,
        /// As many as there are.
        got: usize,
    },
    /// A number is infinite or not a number.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
}

/// A checked problem. Filled anew for every solve; a longer line than before is all that makes it allocate.
#[derive(Clone, Debug)]
pub struct Problem {
    pub(super) line: Line,
    pub(super) speed_targets: [f64; STEPS],
    pub(super) stop_distance: Option<f64>,
    pub(super) av: Vehicle,
    pub(super) present: Option<Control>,
    pub(super) neighbors: [Option<PlacedNeighbor>; NEIGHBORS],
    pub(super) weights: [f64; TERMS],
    /// Whether there is any neighbor.
    pub(super) company: bool,
}

/// A neighbor at the key steps, and its box at each look at the lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedNeighbor {
    pub length: f64,
    pub width: f64,
    pub position: [(f64, f64); KEY_STEPS.len()],
    pub frenet: [Frenet; KEY_STEPS.len()],
    pub track: Track,
}

impl Problem {
    /// A first problem.
    ///
    /// # Errors
    /// [`ProblemError`] names the first thing that is wrong.
    pub fn new(inputs: &Inputs<'_>) -> Result<Self, ProblemError> {
        let mut problem = Self {
            line: Line::default(),
            speed_targets: [0.0; STEPS],
            stop_distance: None,
            av: Vehicle::default(),
            present: None,
            neighbors: [None; NEIGHBORS],
            weights: [0.0; TERMS],
            company: false,
        };
        problem.set(inputs)?;
        Ok(problem)
    }

    /// Checks the inputs and takes them in. After an error the problem is what it was before.
    ///
    /// # Errors
    /// [`ProblemError`] names the first thing that is wrong.
    pub fn set(&mut self, inputs: &Inputs<'_>) -> Result<(), ProblemError> {
        check(inputs)?;
        wide(
            #[inline(always)]
            || self.take(inputs),
        );
        Ok(())
    }

    #[inline(always)]
    fn take(&mut self, inputs: &Inputs<'_>) {
        self.line.set(inputs.line_x, inputs.line_y, inputs.line_heading);
        self.speed_targets = inputs.speed_targets.copied().unwrap_or([inputs.speed_target; STEPS]);
        self.stop_distance = inputs.stop_distance;
        self.av = inputs.av;
        self.present = inputs.present;
        self.weights = inputs.weights;
        self.neighbors = [None; NEIGHBORS];
        for (place, neighbor) in self.neighbors.iter_mut().zip(inputs.neighbors) {
            *place = neighbor.as_ref().map(|neighbor| {
                let mut hint = 0;
                let position = KEY_STEPS.map(|t| neighbor.positions[t]);
                let frenet = position.map(|(x, y)| {
                    let frenet = self.line.frenet(x, y, hint);
                    hint = frenet.sample;
                    frenet
                });
                let track = Track::new(neighbor, self.line.direction(frenet[0].sample));
                PlacedNeighbor { length: neighbor.length, width: neighbor.width, position, frenet, track }
            });
        }
        self.company = self.neighbors.iter().any(Option::is_some);
    }

    /// The weights of the cost terms.
    #[must_use]
    pub fn weights(&self) -> &[f64; TERMS] {
        &self.weights
    }

    /// Other weights for the same situation.
    ///
    /// # Errors
    /// [`ProblemError::NotFinite`].
    pub fn set_weights(&mut self, weights: [f64; TERMS]) -> Result<(), ProblemError> {
        finite("a weight", &weights)?;
        self.weights = weights;
        Ok(())
    }

    /// The line.
    #[must_use]
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// Where the neighbor in this place of the list is along and beside the line, at each key step.
    #[must_use]
    pub fn neighbor_frenet(&self, neighbor: usize) -> Option<&[Frenet; KEY_STEPS.len()]> {
        self.neighbors.get(neighbor)?.as_ref().map(|neighbor| &neighbor.frenet)
    }
}

fn check(inputs: &Inputs<'_>) -> Result<(), ProblemError> {
    let samples = inputs.line_x.len();
    if samples == 0 {
        return Err(ProblemError::EmptyLine);
    }
    length("the line's y column", samples, inputs.line_y.len())?;
    length("the line's heading column", samples, inputs.line_heading.len())?;
    finite("the reference line", inputs.line_x)?;
    finite("the reference line", inputs.line_y)?;
    finite("the reference line", inputs.line_heading)?;
    finite("the speed target", &[inputs.speed_target])?;
    finite("a step's speed target", inputs.speed_targets.map_or(&[], |targets| targets.as_slice()))?;
    finite("the stop distance", inputs.stop_distance.as_slice())?;
    let VehicleState { x, y, heading, speed } = inputs.av.state;
    finite("the AV's state", &[x, y, heading, speed, inputs.av.length, inputs.av.width])?;
    if let Some(Control { acceleration, steering }) = inputs.present {
        finite("the present control", &[acceleration, steering])?;
    }
    finite("a weight", &inputs.weights)?;
    if inputs.neighbors.len() > NEIGHBORS {
        return Err(ProblemError::WrongLength {
            what: "the list of neighbors",
            expected: NEIGHBORS,
            got: inputs.neighbors.len(),
        });
    }
    for neighbor in inputs.neighbors.iter().flatten() {
        finite("a neighbor's size", &[neighbor.length, neighbor.width])?;
        length("a predicted trajectory", STEPS, neighbor.positions.len())?;
        if !neighbor.positions.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            return Err(ProblemError::NotFinite("a predicted position"));
        }
        if !neighbor.headings.is_empty() {
            length("a list of predicted headings", STEPS, neighbor.headings.len())?;
            finite("a predicted heading", neighbor.headings)?;
        }
        if !neighbor.deviations.is_empty() {
            length("a list of standard deviations", STEPS, neighbor.deviations.len())?;
            if !neighbor.deviations.iter().all(|(along, across)| along.is_finite() && across.is_finite()) {
                return Err(ProblemError::NotFinite("a standard deviation"));
            }
        }
    }
    Ok(())
}

fn length(what: &'static str, expected: usize, got: usize) -> Result<(), ProblemError> {
    if expected == got { Ok(()) } else { Err(ProblemError::WrongLength { what, expected, got }) }
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), ProblemError> {
    if values.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(ProblemError::NotFinite(what)) }
}

/// What the authors read from the fifth column of their reference line, which means several things: 0 at a red stop point, 1
/// on a crosswalk, else the speed limit of the AV's lane (m/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InfoColumn {
    /// The column's largest entry (m/s).
    pub speed_target: f64,
    /// How far the AV may drive (m), if there is a zero ahead of the AV's own sample. A zero at that very sample is read as
    /// "no red light"; one nearer than [`STOP_MARGIN`] gives a negative distance.
    pub stop_distance: Option<f64>,
}

impl InfoColumn {
    /// Reads the column; the AV is taken to be at sample `own`, whether it is or not.
    #[must_use]
    pub fn read(info: &[f64], own: usize) -> Self {
        let speed_target = info.iter().copied().fold(f64::NEG_INFINITY, |a, b| if b > a { b } else { a });
        let red = info.iter().skip(own).position(|v| *v == 0.0).filter(|r| *r != 0);
        Self { speed_target, stop_distance: red.map(|r| 0.1 * r as f64 - STOP_MARGIN) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs<'a>(x: &'a [f64], neighbors: &'a [Option<Neighbor<'a>>]) -> Inputs<'a> {
        Inputs {
            line_x: x,
            line_y: x,
            line_heading: x,
            speed_target: 10.0,
            speed_targets: None,
            stop_distance: None,
            av: Vehicle::default(),
            present: None,
            neighbors,
            weights: [1.0; TERMS],
        }
    }

    #[test]
    fn inputs_that_make_no_problem_are_refused_by_name() {
        let set = |inputs: &Inputs<'_>| Problem::new(inputs).err().unwrap();
        let line = [0.0, 1.0];
        assert_eq!(set(&inputs(&[], &[])), ProblemError::EmptyLine);
        assert_eq!(set(&inputs(&[f64::NAN], &[])), ProblemError::NotFinite("the reference line"));
        assert_eq!(
            set(&Inputs { line_heading: &[0.0], ..inputs(&line, &[]) }).to_string(),
            "the line's heading column has 1 entries, but 2 are needed"
        );
        assert_eq!(
            set(&Inputs { speed_target: f64::INFINITY, ..inputs(&line, &[]) }),
            ProblemError::NotFinite("the speed target")
        );
        let positions = [(0.0, 0.0); STEPS];
        let plain = Neighbor { length: 4.0, width: 2.0, positions: &positions, headings: &[], deviations: &[] };
        let neighbor = Some(plain);
        assert!(matches!(set(&inputs(&line, &[neighbor; 11])), ProblemError::WrongLength { got: 11, .. }));
        let short = Some(Neighbor { positions: &positions[1..], ..plain });
        assert!(matches!(set(&inputs(&line, &[short])), ProblemError::WrongLength { got: 49, .. }));
        let lost = [(0.0, f64::NAN); STEPS];
        let lost = Some(Neighbor { positions: &lost, ..plain });
        assert_eq!(set(&inputs(&line, &[lost])), ProblemError::NotFinite("a predicted position"));
        let turned = Some(Neighbor { headings: &[0.0], ..plain });
        assert_eq!(
            set(&inputs(&line, &[turned])).to_string(),
            "a list of predicted headings has 1 entries, but 50 are needed"
        );
        let spread = Some(Neighbor { deviations: &[(0.1, f64::NAN); STEPS], ..plain });
        assert_eq!(set(&inputs(&line, &[spread])), ProblemError::NotFinite("a standard deviation"));
        assert_eq!(
            set(&Inputs { speed_targets: Some(&[f64::INFINITY; STEPS]), ..inputs(&line, &[]) }),
            ProblemError::NotFinite("a step's speed target")
        );
    }

    #[test]
    fn the_authors_info_column_is_read_as_they_do() {
        let mut info = vec![13.0; 100];
        assert_eq!(InfoColumn::read(&info, 20), InfoColumn { speed_target: 13.0, stop_distance: None });
        info[19] = 0.0;
        info[60] = 0.0;
        info[61] = 0.0;
        assert_eq!(InfoColumn::read(&info, 20).stop_distance, Some(1.0));
        info[20] = 0.0;
        assert_eq!(InfoColumn::read(&info, 20).stop_distance, None);
        assert_eq!(InfoColumn::read(&[0.0, 1.0], 5).speed_target, 1.0);
    }
}
