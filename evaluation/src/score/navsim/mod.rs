//! NAVSIM's scores, PDMS of v1.1 and EPDMS of v2.1.2 (autonomousvision/navsim, `pdm_scorer.py`, `pdm_comfort_metrics.py`), as far as a
//! drive in closed loop has them: NAVSIM scores one plan of 4 s, here the whole drive stands for it, and the human for the rival
//! planner that progress is measured by. `docs/scores/navsim.md` defines each figure and names every difference.
//!
//! | module | what |
//! | --- | --- |
//! | here | the terms made into scores, beside the human's |
//! | `terms` | the terms of a series of states: the AV's, and the human's |
//! | `comfort` | both versions of comfort |

mod comfort;
mod terms;

use episode::metrics::nuplan::Composite;

use self::terms::Terms;
use super::Judged;
use super::drive::Drive;
use super::figure::Figure;

/// Up to this product of metres and penalties (m) everybody has made all the progress (`progress_distance_threshold`).
const LEAST_PROGRESS: f64 = 5.0;

/// The figures of an episode.
#[must_use]
pub fn figures() -> Vec<Figure> {
    vec![
        Figure::new("navsim_pdms_by_human", "", "NC DAC (5 EP + 5 TTC + 2 C) / 12 of v1, progress by the human's")
            .mean(&["PDMS", "by", "human"], 3),
        Figure::new("navsim_pdms_terms", "", "of how many of the five terms it is made: those that can be judged"),
        Figure::new(
            "navsim_epdms_by_human",
            "",
            "NC DAC DDC TLC (5 EP + 5 TTC + 2 LK + 2 HC) / 14 of v2, each 1 where the human's is 0, without EC",
        )
        .mean(&["EPDMS", "by", "human"], 3),
        Figure::new("navsim_epdms_terms", "", "of how many of the nine terms it is made; EC is never among them"),
        Figure::new(
            "navsim_no_at_fault_collisions",
            "",
            "NC: 0 after a hit of a road user at fault, 1/2 after one of an object",
        )
        .mean(&["NC", "", ""], 3),
        Figure::new("navsim_drivable_area_compliance", "", "DAC: 0 if a corner was off the road")
            .mean(&["DAC", "", ""], 3),
        Figure::new(
            "navsim_driving_direction_compliance",
            "",
            "DDC: 1, 1/2, 0 by the metres off the route's lanes in a second",
        )
        .mean(&["DDC", "", ""], 3),
        Figure::new("navsim_traffic_light_compliance", "", "TLC: 0 if the box was on a lane of the route that is red")
            .mean(&["TLC", "", ""], 3),
        Figure::new("navsim_time_to_collision_v1", "", "TTC of v1: 0 if the box met somebody's within 0.9 s"),
        Figure::new("navsim_time_to_collision", "", "TTC of v2: the same, but for the last 0.9 s")
            .mean(&["TTC", "", ""], 3),
        Figure::new("navsim_lane_keeping", "", "LK: 0 after 2 s more than 0.5 m off the line, intersections left out")
            .mean(&["LK", "", ""], 3),
        Figure::new("navsim_comfort_v1", "", "C of v1: within nuPlan's bounds").mean(&["C", "", ""], 3),
        Figure::new("navsim_history_comfort", "", "HC of v2: the same, with the log of the 1.5 s before")
            .mean(&["HC", "", ""], 3),
        Figure::new("navsim_extended_comfort", "", "EC: needs two plans; never known"),
        Figure::new("navsim_progress_by_human_v1", "", "EP of v1: metres times NC DAC, over its denominator"),
        Figure::new("navsim_progress_by_human", "", "EP of v2: metres over its denominator, at most 1")
            .mean(&["EP", "", ""], 3),
        Figure::new("navsim_progress_m", "m", "metres along the line from start to end, at least 0"),
        Figure::new("navsim_human_progress_m", "m", "the same of the human"),
        Figure::new(
            "navsim_progress_denominator_v1_m",
            "m",
            "the larger of metres times NC DAC, the AV's and the human's",
        ),
        Figure::new("navsim_progress_denominator_m", "m", "the larger of metres times NC DAC DDC TLC"),
        Figure::new("navsim_human_filtered", "", "how many terms of v2 are 1 because the human's is 0"),
    ]
}

/// The figures of a drive.
pub fn judge(drive: &Drive<'_>) -> Judged {
    let ground = match drive.ground() {
        Ok(ground) => ground,
        Err(reason) => return Judged::none(figures().len(), reason),
    };
    let own = Terms::of(drive, ground, &drive.states);
    let human = drive.human().map(|states| Terms::of(drive, ground, &states));
    let reason =
        human.is_none().then(|| "the log lacks states of the human: nothing is filtered, no progress".to_owned());
    Judged { values: told(&own, human.as_ref()), reason }
}

fn told(own: &Terms, human: Option<&Terms>) -> Vec<Option<f64>> {
    let first = |terms: &Terms| terms.progress * product(&[terms.no_collision, terms.drivable_area]);
    let second = |terms: &Terms| {
        terms.progress * product(&[terms.no_collision, terms.drivable_area, terms.direction, terms.traffic_light])
    };
    let denominator = |of: &dyn Fn(&Terms) -> f64| {
        human.map(|human| {
            let (own, human) = (of(own), of(human));
            if human > own { human } else { own }
        })
    };
    let (denominator_1, denominator_2) = (denominator(&first), denominator(&second));
    let progress_1 = denominator_1.map(|most| match most > LEAST_PROGRESS {
        true => first(own) / most,
        false if product(&[own.no_collision, own.drivable_area]) == 0.0 => 0.0,
        false => 1.0,
    });
    let progress_2 =
        denominator_2.map(|most| if most > LEAST_PROGRESS { (own.progress / most).clamp(0.0, 1.0) } else { 1.0 });
    let pdms = Composite {
        factors: &[own.no_collision, own.drivable_area],
        weighted: &[(5.0, progress_1), (5.0, own.time_to_collision_1), (2.0, own.comfort)],
    };
    let mut filtered = 0.0;
    let mut filter = |own: Option<f64>, of_human: fn(&Terms) -> Option<f64>| {
        let excused = own.is_some() && human.and_then(of_human) == Some(0.0);
        filtered += f64::from(u8::from(excused));
        if excused { Some(1.0) } else { own }
    };
    let factors = [
        filter(own.no_collision, |human| human.no_collision),
        filter(own.drivable_area, |human| human.drivable_area),
        filter(own.direction, |human| human.direction),
        filter(own.traffic_light, |human| human.traffic_light),
    ];
    // Progress and comfort of the human are never 0 in NAVSIM: alone it is the best there is, and it gets no history.
    let weighted = [
        (5.0, progress_2),
        (5.0, filter(own.time_to_collision_2, |human| human.time_to_collision_2)),
        (2.0, filter(own.lane_keeping, |human| human.lane_keeping)),
        (2.0, own.history_comfort),
    ];
    let epdms = Composite { factors: &factors, weighted: &weighted };
    vec![
        pdms.score(),
        Some(pdms.judged() as f64),
        epdms.score(),
        Some(epdms.judged() as f64),
        own.no_collision,
        own.drivable_area,
        own.direction,
        own.traffic_light,
        own.time_to_collision_1,
        own.time_to_collision_2,
        own.lane_keeping,
        own.comfort,
        own.history_comfort,
        None,
        progress_1,
        progress_2,
        Some(own.progress),
        human.map(|human| human.progress),
        denominator_1,
        denominator_2,
        Some(filtered),
    ]
}

/// The product of the factors that can be judged.
fn product(factors: &[Option<f64>]) -> f64 {
    factors.iter().flatten().product()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const PERFECT: Terms = Terms {
        no_collision: Some(1.0),
        drivable_area: Some(1.0),
        direction: Some(1.0),
        traffic_light: Some(1.0),
        time_to_collision_1: Some(1.0),
        time_to_collision_2: Some(1.0),
        lane_keeping: Some(1.0),
        comfort: Some(1.0),
        history_comfort: Some(1.0),
        progress: 40.0,
    };

    fn value(own: &Terms, human: Option<&Terms>, name: &str) -> Option<f64> {
        let place = figures().iter().position(|figure| figure.name == name).unwrap();
        told(own, human)[place]
    }

    #[test]
    fn the_weights_are_those_of_both_versions() {
        let score = |own: Terms, name: &str| value(&own, Some(&PERFECT), name).unwrap();
        let both = |own: Terms| [score(own, "navsim_pdms_by_human"), score(own, "navsim_epdms_by_human")];
        assert_eq!(both(PERFECT), [1.0, 1.0]);
        assert_eq!(both(Terms { progress: 20.0, ..PERFECT }), [9.5 / 12.0, 11.5 / 14.0]);
        let late = Terms { time_to_collision_1: Some(0.0), time_to_collision_2: Some(0.0), ..PERFECT };
        assert_eq!(both(late), [7.0 / 12.0, 9.0 / 14.0]);
        assert_eq!(both(Terms { comfort: Some(0.0), ..PERFECT }), [10.0 / 12.0, 1.0]);
        assert_eq!(both(Terms { lane_keeping: Some(0.0), ..PERFECT }), [1.0, 12.0 / 14.0]);
        assert_eq!(both(Terms { traffic_light: Some(0.0), ..PERFECT }), [1.0, 0.0]);
        assert_eq!(both(Terms { drivable_area: Some(0.0), ..PERFECT }), [0.0, 0.0]);
        // One object: half of all, and of v1's progress once more.
        assert_eq!(both(Terms { no_collision: Some(0.5), ..PERFECT }), [0.5 * (2.5 + 7.0) / 12.0, 0.5]);
    }

    #[test]
    fn what_the_human_breaks_too_is_forgiven_by_v2_alone() {
        let broken = Terms { drivable_area: Some(0.0), lane_keeping: Some(0.0), ..PERFECT };
        assert_eq!(value(&broken, Some(&broken), "navsim_epdms_by_human"), Some(1.0));
        assert_eq!(value(&broken, Some(&broken), "navsim_human_filtered"), Some(2.0));
        assert_eq!(value(&broken, Some(&broken), "navsim_pdms_by_human"), Some(0.0));
        // Halves are no zeros.
        let half = Terms { direction: Some(0.5), ..PERFECT };
        assert_eq!(value(&half, Some(&half), "navsim_epdms_by_human"), Some(0.5));
    }

    #[test]
    fn progress_is_by_the_larger_of_both_and_the_denominator_is_told() {
        let own = Terms { progress: 30.0, ..PERFECT };
        assert_eq!(value(&own, Some(&PERFECT), "navsim_progress_by_human"), Some(0.75));
        assert_eq!(value(&own, Some(&PERFECT), "navsim_progress_denominator_m"), Some(40.0));
        // A human that is off the road makes none.
        let off = Terms { drivable_area: Some(0.0), ..PERFECT };
        assert_eq!(value(&own, Some(&off), "navsim_progress_denominator_m"), Some(30.0));
        assert_eq!(value(&own, Some(&off), "navsim_progress_by_human"), Some(1.0));
        // Up to 5 m there is nothing to make.
        let still = Terms { progress: 5.0, ..PERFECT };
        assert_eq!(value(&Terms { progress: 0.0, ..PERFECT }, Some(&still), "navsim_progress_by_human"), Some(1.0));
        assert_eq!(value(&own, None, "navsim_progress_by_human"), None);
    }

    #[test]
    fn what_cannot_be_judged_is_left_out_and_counted() {
        let partial = Terms { drivable_area: None, direction: None, comfort: None, ..PERFECT };
        assert_eq!(value(&partial, Some(&PERFECT), "navsim_epdms_terms"), Some(6.0));
        assert_eq!(value(&partial, Some(&PERFECT), "navsim_pdms_terms"), Some(3.0));
        assert_eq!(value(&partial, Some(&PERFECT), "navsim_pdms_by_human"), Some(1.0));
        assert_eq!(value(&PERFECT, Some(&PERFECT), "navsim_epdms_terms"), Some(8.0));
    }
}
