//! Signal programmes: which ways of a junction are green when, with yellow and all red between.

use world::geometry::angle_difference;
use world::plan::STEP_SECONDS;
use world::signal::SignalState;

use crate::generated::draw::Draw;
use crate::generated::roads::{Junction, Roads, Turn, Way};

/// One stage of the cycle.
#[derive(Clone, Debug)]
struct Stage {
    /// Arms and the turns that are green; an arrow says that nobody crosses.
    green: Vec<(usize, [bool; 3], bool)>,
    seconds: f64,
}

/// The programme of one junction.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Programme {
    stages: Vec<Stage>,
    yellow: f64,
    all_red: f64,
    /// Time of the cycle at step 0 (s).
    offset: f64,
}

fn slot(turn: Turn) -> usize {
    match turn {
        Turn::Left => 0,
        Turn::Straight => 1,
        Turn::Right => 2,
    }
}

impl Programme {
    /// A programme for `junction`: opposite arms together; where lefts have lanes of their own, and `arrows` of their own, before them.
    pub(in crate::generated) fn new(junction: &Junction, roads: &Roads, arrows: bool, draw: &mut Draw) -> Self {
        let arms = junction.arms.len();
        let mut axes: Vec<Vec<usize>> = Vec::new();
        for arm in 0..arms {
            let opposite = |other: &usize| {
                let turned = angle_difference(junction.arms[arm].heading, junction.arms[*other].heading);
                *other < arm && turned.abs() > 2.4
            };
            match axes.iter_mut().find(|axis| axis.len() == 1 && axis.iter().all(opposite)) {
                Some(axis) => axis.push(arm),
                None => axes.push(vec![arm]),
            }
        }
        // A lane from which one can only turn left.
        let has_left_lane = |arm: usize| {
            junction.arms[arm].inbound.iter().any(|lane| {
                let exits = &roads.lanes[*lane].exits;
                !exits.is_empty()
                    && exits.iter().all(|exit| roads.lanes[*exit].way.is_some_and(|way| way.turn == Turn::Left))
            })
        };
        let mut stages = Vec::new();
        for axis in &axes {
            let protected = arrows && axis.iter().any(|arm| has_left_lane(*arm));
            if protected && axis.len() > 1 {
                let green = axis
                    .iter()
                    .filter(|arm| has_left_lane(**arm))
                    .map(|arm| (*arm, [true, false, false], true))
                    .collect();
                stages.push(Stage { green, seconds: draw.between(6.0, 11.0) });
            }
            let lone = axis.len() == 1;
            let green = axis
                .iter()
                .map(|arm| (*arm, [lone || !(arrows && has_left_lane(*arm)), true, true], lone && axes.len() > 1))
                .collect();
            stages.push(Stage { green, seconds: draw.between(14.0, 30.0) });
        }
        // Long enough for whoever cannot stop any more: a moment, and half the time that stopping takes.
        let limits = junction.arms.iter().flat_map(|arm| &arm.inbound).map(|lane| roads.lanes[*lane].limit);
        let fastest = 1.1 * limits.fold(0.0, f64::max);
        let yellow = (0.7 + fastest / (2.0 * 3.3)).max(2.8) + draw.between(0.0, 0.3);
        let mut programme = Self { stages, yellow, all_red: draw.between(0.5, 1.4), offset: 0.0 };
        programme.offset = draw.between(0.0, programme.cycle());
        programme
    }

    fn cycle(&self) -> f64 {
        self.stages.iter().map(|stage| stage.seconds + self.yellow + self.all_red).sum()
    }

    /// Shifts the programme so that `turn` from `arm` becomes green `seconds` after step 0.
    pub(in crate::generated) fn green_at(&mut self, arm: usize, turn: Turn, seconds: f64) {
        self.offset = self.start_of(arm, turn).unwrap_or(0.0) - seconds;
    }

    fn stage_of(&self, arm: usize, turn: Turn) -> Option<&Stage> {
        self.stages.iter().find(|stage| stage.green.iter().any(|(a, turns, _)| *a == arm && turns[slot(turn)]))
    }

    fn start_of(&self, arm: usize, turn: Turn) -> Option<f64> {
        let mut start = 0.0;
        for stage in &self.stages {
            if stage.green.iter().any(|(a, turns, _)| *a == arm && turns[slot(turn)]) {
                return Some(start);
            }
            start += stage.seconds + self.yellow + self.all_red;
        }
        None
    }

    /// The stage at `step`, and how far into it (s).
    fn stage_at(&self, step: i32) -> (&Stage, f64) {
        let cycle = self.cycle();
        let mut into = (f64::from(step) * STEP_SECONDS + self.offset).rem_euclid(cycle);
        for stage in &self.stages {
            let lasts = stage.seconds + self.yellow + self.all_red;
            if into < lasts {
                return (stage, into);
            }
            into -= lasts;
        }
        (&self.stages[0], 0.0) // rounding at the very end of the cycle
    }

    /// What `way` is shown at `step`.
    pub(in crate::generated) fn shows(&self, way: Way, step: i32) -> SignalState {
        let (stage, into) = self.stage_at(step);
        let ruled = stage.green.iter().find(|(arm, turns, _)| *arm == way.from && turns[slot(way.turn)]);
        let arrow = way.turn == Turn::Left && !self.is_permissive(way);
        match ruled {
            Some(_) if into < stage.seconds => {
                if arrow {
                    SignalState::ArrowGo
                } else {
                    SignalState::Go
                }
            }
            Some(_) if into < stage.seconds + self.yellow => {
                if arrow {
                    SignalState::ArrowCaution
                } else {
                    SignalState::Caution
                }
            }
            _ => {
                if arrow {
                    SignalState::ArrowStop
                } else {
                    SignalState::Stop
                }
            }
        }
    }

    /// Whether somebody on `way` must let oncoming traffic pass though it is green.
    pub(in crate::generated) fn is_permissive(&self, way: Way) -> bool {
        way.turn == Turn::Left
            && self.stage_of(way.from, way.turn).is_some_and(|stage| stage.green.len() > 1 && stage.green[0].1[1])
    }

    /// Whether people may begin to walk over `arm`: traffic goes along them, across the other arms, and will for a while.
    pub(in crate::generated) fn walk(&self, arm: usize, step: i32) -> bool {
        let (stage, into) = self.stage_at(step);
        let along = stage.green.iter().all(|(green, turns, _)| *green != arm && turns[1]);
        along && into < 0.5 * stage.seconds
    }
}
