//! nuPlan's closed-loop score, by its code (not by its documentation, which differs): motional/nuplan-devkit,
//! `planning/metrics/evaluation_metrics/common/*.py` and `simulation_metric/*.yaml`.

use world::scene::AgentKind;

/// Progress below this (m) counts as this, of the AV and of the human.
pub const LEAST_PROGRESS: f64 = 2.0;
/// The share of the human's progress below which the AV makes none.
pub const MAKING_PROGRESS: f64 = 0.2;
/// Backward travel (m, within a second) that halves the score of direction, and that which takes it.
pub const BACKWARD_TRAVEL: (f64, f64) = (2.0, 6.0);
/// Driving this much (m/s) above the limit all the time takes the whole score of speed.
pub const OVERSPEED: f64 = 2.23;

/// The terms of the score; none where a term cannot be judged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// No at-fault collision: 0, 1/2 or 1.
    pub no_collision: Option<f64>,
    /// Drivable area kept: 0 or 1.
    pub drivable_area: Option<f64>,
    /// Driving direction kept: 0, 1/2 or 1.
    pub direction: Option<f64>,
    /// Making progress: 0 or 1.
    pub making_progress: Option<f64>,
    /// Progress along the human's route, relative to the human's: 0 to 1.
    pub progress: Option<f64>,
    /// Time to collision within bound: 0 or 1.
    pub time_to_collision: Option<f64>,
    /// Speed limit kept: 0 to 1.
    pub speed_limit: Option<f64>,
    /// Comfort: 0 or 1.
    pub comfort: Option<f64>,
}

/// A score of factors and weighted terms, as nuPlan's and NAVSIM's are. Terms that cannot be judged are left out.
#[derive(Clone, Copy, Debug)]
pub struct Composite<'a> {
    /// What is multiplied.
    pub factors: &'a [Option<f64>],
    /// What is averaged, each with its weight.
    pub weighted: &'a [(f64, Option<f64>)],
}

impl Composite<'_> {
    /// The factors' product times the weighted mean, 0 to 1; none where no weighted term can be judged, unless the product is 0.
    #[must_use]
    pub fn score(&self) -> Option<f64> {
        let product: f64 = self.factors.iter().flatten().product();
        let judged = || self.weighted.iter().filter_map(|(weight, term)| Some((weight, (*term)?)));
        let weights: f64 = judged().map(|(weight, _)| weight).sum();
        let sum: f64 = judged().map(|(weight, term)| weight * term).sum();
        if weights > 0.0 { Some(product * sum / weights) } else { (product == 0.0).then_some(0.0) }
    }

    /// How many of its terms can be judged.
    #[must_use]
    pub fn judged(&self) -> usize {
        let weighted = self.weighted.iter().filter(|(_, term)| term.is_some()).count();
        self.factors.iter().flatten().count() + weighted
    }
}

impl Terms {
    fn factors(&self) -> [Option<f64>; 4] {
        [self.no_collision, self.drivable_area, self.direction, self.making_progress]
    }

    fn weighted(&self) -> [(f64, Option<f64>); 4] {
        [(5.0, self.progress), (5.0, self.time_to_collision), (4.0, self.speed_limit), (2.0, self.comfort)]
    }

    /// The score, 0 to 1, of the terms that can be judged: their product times their weighted mean; none where no weighted term
    /// can be, unless the product is 0.
    #[must_use]
    pub fn score(&self) -> Option<f64> {
        Composite { factors: &self.factors(), weighted: &self.weighted() }.score()
    }

    /// How many of the eight terms can be judged.
    #[must_use]
    pub fn judged(&self) -> usize {
        Composite { factors: &self.factors(), weighted: &self.weighted() }.judged()
    }
}

/// NC from what the AV hit at fault: any road user takes it all, one object half.
#[must_use]
pub fn no_collision(at_fault: impl Iterator<Item = AgentKind>) -> f64 {
    let (mut road_users, mut objects) = (0_u32, 0_u32);
    for kind in at_fault {
        match kind {
            AgentKind::Vehicle | AgentKind::Pedestrian | AgentKind::Cyclist => road_users += 1,
            AgentKind::Other => objects += 1,
        }
    }
    if road_users > 0 { 0.0 } else { (1.0 - f64::from(objects) / 2.0).max(0.0) }
}

/// DDC from the greatest backward travel within a second (m).
#[must_use]
pub fn direction(backward_travel: f64) -> f64 {
    if backward_travel < BACKWARD_TRAVEL.0 {
        1.0
    } else if backward_travel < BACKWARD_TRAVEL.1 {
        0.5
    } else {
        0.0
    }
}

/// EP from the AV's and the human's progress (m).
#[must_use]
pub fn progress(av: f64, human: f64) -> f64 {
    if av < -LEAST_PROGRESS { 0.0 } else { (av.max(LEAST_PROGRESS) / human.max(LEAST_PROGRESS)).min(1.0) }
}

/// SL from the speed above the limit at each step (m/s; 0 where it is kept or not known).
#[must_use]
pub fn speed_limit(overspeed: &[f64]) -> f64 {
    if overspeed.is_empty() {
        return 1.0;
    }
    (1.0 - overspeed.iter().sum::<f64>() / (OVERSPEED * overspeed.len() as f64)).max(0.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const PERFECT: Terms = Terms {
        no_collision: Some(1.0),
        drivable_area: Some(1.0),
        direction: Some(1.0),
        making_progress: Some(1.0),
        progress: Some(1.0),
        time_to_collision: Some(1.0),
        speed_limit: Some(1.0),
        comfort: Some(1.0),
    };

    #[test]
    fn the_weights_are_those_of_the_code() {
        let score = |terms: Terms| terms.score().unwrap();
        assert_eq!((score(PERFECT), PERFECT.judged()), (1.0, 8));
        assert_eq!(score(Terms { progress: Some(0.0), ..PERFECT }), 11.0 / 16.0);
        assert_eq!(score(Terms { time_to_collision: Some(0.0), ..PERFECT }), 11.0 / 16.0);
        assert_eq!(score(Terms { speed_limit: Some(0.5), ..PERFECT }), 14.0 / 16.0);
        assert_eq!(score(Terms { comfort: Some(0.0), ..PERFECT }), 14.0 / 16.0);
        assert_eq!(score(Terms { direction: Some(0.5), comfort: Some(0.0), ..PERFECT }), 7.0 / 16.0);
        assert_eq!(score(Terms { drivable_area: Some(0.0), ..PERFECT }), 0.0);
    }

    #[test]
    fn what_cannot_be_judged_is_left_out_of_the_score_and_of_its_weights() {
        let partial = Terms { speed_limit: None, drivable_area: None, comfort: Some(0.0), ..PERFECT };
        assert_eq!((partial.score(), partial.judged()), (Some(10.0 / 12.0), 6));
        let nothing = Terms { no_collision: Some(1.0), ..Terms::default() };
        assert_eq!((nothing.score(), nothing.judged()), (None, 1));
        assert_eq!(Terms { no_collision: Some(0.0), ..nothing }.score(), Some(0.0), "lost is lost");
    }

    #[test]
    fn one_object_costs_half_and_any_road_user_all() {
        use AgentKind::{Other, Pedestrian, Vehicle};
        assert_eq!(no_collision([].into_iter()), 1.0);
        assert_eq!(no_collision([Other].into_iter()), 0.5);
        assert_eq!(no_collision([Other, Other].into_iter()), 0.0);
        assert_eq!(no_collision([Vehicle].into_iter()), 0.0);
        assert_eq!(no_collision([Other, Pedestrian].into_iter()), 0.0);
    }

    #[test]
    fn progress_has_a_floor_of_two_metres_and_a_cap() {
        assert_eq!(progress(30.0, 60.0), 0.5);
        assert_eq!(progress(0.0, 0.5), 1.0, "both stand");
        assert_eq!(progress(0.0, 20.0), 0.1);
        assert_eq!(progress(90.0, 60.0), 1.0);
        assert_eq!(progress(-2.1, 1.0), 0.0);
    }

    #[test]
    fn two_metres_a_second_above_the_limit_all_the_time() {
        assert!((speed_limit(&[2.0; 150]) - (1.0 - 2.0 / 2.23)).abs() < 1e-12);
        assert_eq!(speed_limit(&[3.0; 150]), 0.0);
        assert_eq!(speed_limit(&[0.0; 150]), 1.0);
    }

    #[test]
    fn backward_travel_halves_and_takes_the_direction() {
        assert_eq!([1.99, 2.0, 5.99, 6.0].map(direction), [1.0, 0.5, 0.5, 0.0]);
    }
}
