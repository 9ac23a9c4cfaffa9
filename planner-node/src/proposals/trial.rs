//! What a proposal would be worth: driven in a small simulation among the expected futures, and judged by the sim's own judges, with the
//! weights of nuPlan's score.

use episode::judges::Body;
use episode::judges::collision::{classify, is_at_fault, is_behind};
use episode::judges::lanes::{Against, Lanes};
use episode::judges::rear_axle_to_center;
use episode::judges::road::{RoadEdges, TOLERANCE, outermost};
use episode::judges::time_to_collision::{STANDING_SPEED, TrafficAgent, time_to_collision};
use episode::metrics::comfort::{
    JERK, LONGITUDINAL_ACCELERATION, LONGITUDINAL_JERK, Ride, SMOOTH, YAW_ACCELERATION_BOUND,
};
use world::geometry::{OrientedBox, Point, boxes_overlap};
use world::plan::{PLAN_STEPS, STEP_SECONDS};
use world::scene::{AgentState, TrackId};

use super::company::{Company, Expected, FUTURES, LOOK_STEPS, LOOKS, Other};
use super::ride::Filter;
use super::rollout::Rollout;

/// Looks that are judged: 4 s. What is expected later is not worth much.
const JUDGED: usize = 20;
const _: () = assert!(JUDGED < LOOKS);

/// Steps after which the AV brakes if those ahead do at once.
pub const REACTION: usize = 6;
/// How hard they do (m/s^2).
const SUDDEN_BRAKING: f64 = 5.0;

/// What the gap to them should be beyond none then (m), and for each m/s of the AV (s).
const GAP: (f64, f64) = (1.5, 0.3);

/// A time to collision (s) that is too short: the bound is 0.95, and nobody is sure of 0.15.
const TIME_TO_COLLISION: f64 = 1.1;

/// Room (m) around others, growing with time (m/s) around those who move: ahead and behind, and to the sides.
const ROOM: f64 = 0.1;
const ROOM_GROWS: (f64, f64) = (0.1, 0.03);
/// Who is nearer than this now (m) is given none.
const NEAR: (f64, f64) = (0.6, 0.3);

/// What is late is known less well, and can still be changed: what is worth of a contact, and of a time to collision that is too short, in 5 s
/// instead of within the first one.
const LATE_CONTACT: f64 = 0.5;
const LATE_CLOSE: f64 = 0.6;
/// What is worth of a time to collision that is too short for but a moment.
const BRIEFLY_CLOSE: f64 = 0.4;

/// Factors of a corner beyond the road's edge by nuPlan's tolerance, and by less; of what could not be saved if those ahead braked, and
/// could without the gap that is wanted.
pub const OFF_ROAD: f64 = 0.2;
const OVER_THE_EDGE: f64 = 0.95;
const UNSAVED: f64 = 0.5;
const TIGHT: f64 = 0.75;
/// ... of a lane of oncoming traffic, and of what is almost off the route (m), which ends the drive.
const ONCOMING: f64 = 0.8;
const OFF_ROUTE: f64 = 0.1;
pub const FARTHEST: f64 = 4.0;
/// What a metre farther beside the line costs, and a metre beside it beyond so much (m).
const ASIDE: f64 = 0.005;
const BESIDE: f64 = 0.01;
pub const ON_THE_LINE: f64 = 0.3;

/// nuPlan's weights of progress, time to collision and comfort.
const WEIGHTS: (f64, f64, f64) = (5.0, 5.0, 2.0);

/// Who is hit, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub look: usize,
    pub track: TrackId,
    /// Relative speed (m/s).
    pub speed: f64,
}

/// What becomes of a proposal in one future.
#[derive(Clone, Copy, Debug, Default)]
pub struct Meeting {
    /// The first contact at fault.
    pub contact: Option<Hit>,
    /// Where the time to collision first is too short.
    pub close: Option<Hit>,
    /// At how many looks it is.
    close_looks: usize,
    /// The last of them.
    last_close: usize,
}

/// What is found of a proposal.
#[derive(Clone, Copy, Debug, Default)]
pub struct Verdict {
    pub meetings: [Meeting; FUTURES],
    /// Whom it would hit if those ahead braked at once.
    pub unsaved: Option<TrackId>,
    /// To whom it would come too near then.
    pub tight: Option<TrackId>,
    /// 1 on the road, less beyond its edge.
    pub drivable: f64,
    /// Whether it comes into a lane that is for others.
    pub oncoming: bool,
    /// How far beside the line it ends (m), how much farther than now, and how far it is at most.
    pub beside: f64,
    pub aside: f64,
    pub farthest: f64,
    /// Whether it passes a red light, or the line's end.
    pub red: bool,
    /// Along the line (m).
    pub progress: f64,
    /// 1 within nuPlan's bounds, less beyond.
    pub comfort: f64,
}

impl Verdict {
    /// Whether nothing is wrong with it in these futures.
    fn is_clean(&self, futures: usize) -> bool {
        let nobody = self.meetings[..futures].iter().all(|meeting| meeting.contact.is_none());
        nobody && self.drivable > OFF_ROAD && self.farthest <= FARTHEST && !self.red && self.unsaved.is_none()
    }

    /// Its score in a future, where the best progress is `most` (m).
    pub fn score(&self, future: usize, most: f64) -> f64 {
        /// Progress below this (m) is none to compare with.
        const NO_PROGRESS: f64 = 0.5;
        let meeting = &self.meetings[future];
        let progress = if most > NO_PROGRESS { (self.progress / most).clamp(0.0, 1.0) } else { 1.0 };
        let close = match meeting.close {
            None => 1.0,
            Some(hit) => {
                LATE_CLOSE * lateness(hit) + BRIEFLY_CLOSE * (1.0 - meeting.close_looks as f64 / JUDGED as f64)
            }
        };
        let contact = meeting.contact.map_or(1.0, |hit| LATE_CONTACT * lateness(hit));
        let factor = contact
            * self.drivable
            * if self.red { 0.0 } else { 1.0 }
            * if self.oncoming { ONCOMING } else { 1.0 }
            * if self.farthest > FARTHEST { OFF_ROUTE } else { 1.0 }
            * (1.0 - ASIDE * self.aside)
            * (1.0 - BESIDE * (self.beside - ON_THE_LINE).max(0.0))
            * if self.tight.is_some() { TIGHT } else { 1.0 }
            * if self.unsaved.is_some() { UNSAVED } else { 1.0 };
        let (for_progress, for_time, for_comfort) = WEIGHTS;
        let weighted = for_progress * progress + for_time * close + for_comfort * self.comfort;
        // Where all is lost: late and slow is better.
        let last = meeting.contact.map_or(1.0, |hit| lateness(hit) - hit.speed);
        factor * weighted / (for_progress + for_time + for_comfort) + 1e-3 * last
    }
}

/// 0 within the first second, 1 in 5 s.
fn lateness(hit: Hit) -> f64 {
    (((hit.look * LOOK_STEPS) as f64 * STEP_SECONDS - 1.0) / 4.0).clamp(0.0, 1.0)
}

/// The greatest progress (m) of those with which nothing is wrong.
pub fn most_progress<'a>(verdicts: impl Iterator<Item = &'a Verdict>, futures: usize) -> f64 {
    verdicts.filter(|verdict| verdict.is_clean(futures)).map(|verdict| verdict.progress).fold(0.0, f64::max)
}

/// All that a trial needs to know.
pub struct Court<'a> {
    pub company: &'a Company,
    pub edges: &'a RoadEdges,
    pub lanes: &'a Lanes,
    pub av: &'a AgentState,
    /// Height of the ground (m).
    pub ground: f64,
    pub wheelbase: f64,
    /// Stations of red lights (m).
    pub red: &'a [f64],
    /// Station of the line's end (m), where it is seen.
    pub end: Option<f64>,
    /// What was driven, the latest last, whether that is all, and the yaw rate (rad/s) before it.
    pub past: &'a [Ride],
    pub begins: bool,
    pub turning: f64,
    pub filters: &'a Filters,
}

impl Court<'_> {
    /// Judges a proposal.
    pub fn judge(&self, rollout: &Rollout, against: &mut Against) -> Verdict {
        let beside = |k: usize| rollout.places[k].lateral.abs();
        Verdict {
            meetings: self.meet(rollout),
            unsaved: None,
            tight: None,
            drivable: self.drivable(rollout),
            oncoming: self.oncoming(rollout, against),
            beside: beside(JUDGED * LOOK_STEPS),
            aside: (beside(JUDGED * LOOK_STEPS) - beside(0)).max(0.0),
            farthest: (1..=JUDGED * LOOK_STEPS).map(beside).fold(0.0, f64::max),
            red: self.passes_red(rollout),
            progress: rollout.places[JUDGED * LOOK_STEPS].station - rollout.places[0].station,
            comfort: self.comfort(rollout),
        }
    }

    /// To whom a proposal that brakes after [`REACTION`] would come too near if those ahead braked now, and whom it would hit.
    pub fn brakes_late(&self, fallback: &Rollout) -> (Option<TrackId>, Option<TrackId>) {
        let tight = self.brakes_within(fallback, GAP.0 + GAP.1 * fallback.states[0].speed);
        (tight, tight.and_then(|_| self.brakes_within(fallback, 0.0)))
    }

    /// Who is nearer than such a gap (m) then.
    fn brakes_within(&self, fallback: &Rollout, gap: f64) -> Option<TrackId> {
        let begun = fallback.places[0].station;
        let ahead = |other: &&Other| {
            let now = &self.company.places(other, 0)[0];
            now.along > 1.0 && now.footprint.stations.1 >= begun
        };
        let others = || self.company.others().iter().filter(ahead);
        (1..=JUDGED).find_map(|look| {
            let body = self.body(fallback, look);
            others().find_map(|other| {
                let now = &self.company.places(other, 0)[0];
                let reach = body.outline.radius() + other.radius + 2.0 * now.speed;
                if body.outline.center.distance_squared(now.outline.center) > reach * reach {
                    return None;
                }
                let there = self.company.braking(other, look, SUDDEN_BRAKING);
                let hits = boxes_overlap(&body.outline, &grown(&there.outline, gap, 0.0));
                let at_fault = || is_at_fault(classify(&body, self.wheelbase, &agent(other, &there)), true);
                (hits && at_fault()).then_some(other.track)
            })
        })
    }

    /// The AV at a look.
    fn body(&self, rollout: &Rollout, look: usize) -> Body {
        let state = rollout.states[look * LOOK_STEPS];
        let outline = rollout.outline(look * LOOK_STEPS, self.av);
        Body {
            state: AgentState { x: state.x, y: state.y, heading: state.heading, ..*self.av },
            outline,
            speed: state.speed,
        }
    }

    fn meet(&self, rollout: &Rollout) -> [Meeting; FUTURES] {
        let mut meetings = [Meeting::default(); FUTURES];
        let futures = self.company.probabilities().len();
        for look in 1..=JUDGED {
            let body = self.body(rollout, look);
            for other in self.company.others() {
                for (future, meeting) in meetings[..futures].iter_mut().enumerate() {
                    let there = &self.company.places(other, future)[look];
                    // As far as both come within the time to collision that counts.
                    let reach = body.outline.radius() + other.radius + TIME_TO_COLLISION * (body.speed + there.speed);
                    let near = body.outline.center.distance_squared(there.outline.center) <= reach * reach;
                    if near && meeting.contact.is_none() {
                        self.meet_one(&body, other, there, look, meeting);
                    }
                }
            }
        }
        meetings
    }

    fn meet_one(&self, body: &Body, other: &Other, there: &Expected, look: usize, meeting: &mut Meeting) {
        let seconds = (look * LOOK_STEPS) as f64 * STEP_SECONDS;
        let vague = if there.speed > 0.3 { seconds } else { 0.0 };
        let (along, across) =
            if self.is_near(other) { (0.0, 0.0) } else { (ROOM + ROOM_GROWS.0 * vague, ROOM + ROOM_GROWS.1 * vague) };
        let agent = agent(other, there);
        let speed = (agent.velocity - body.velocity()).norm();
        let hit = Hit { look, track: other.track, speed };
        // Who is hit from the side is not known to be in one lane.
        if boxes_overlap(&body.outline, &grown(&there.outline, along, across))
            && is_at_fault(classify(body, self.wheelbase, &agent), false)
        {
            meeting.contact = Some(hit);
        } else if body.speed > STANDING_SPEED
            && !is_behind(body, self.wheelbase, there.outline.center)
            && time_to_collision(body, &agent).is_some_and(|time| time < TIME_TO_COLLISION)
        {
            meeting.close.get_or_insert(hit);
            meeting.close_looks += usize::from(meeting.last_close != look);
            meeting.last_close = look;
        }
    }

    /// Whether somebody is so near now that no more room can be asked for.
    fn is_near(&self, other: &Other) -> bool {
        let there = &self.company.places(other, 0)[0].outline;
        boxes_overlap(&self.av.oriented_box(), &grown(there, NEAR.0, NEAR.1))
    }

    fn drivable(&self, rollout: &Rollout) -> f64 {
        /// Steps between those that are looked at.
        const EVERY: usize = 8;
        /// Over the edge by so much (m) is not worth a word.
        const HAIR: f64 = 0.1;
        let beyond = |k: usize| {
            let body = Body { outline: rollout.outline(k, self.av), ..Body::of(*self.av) };
            outermost(self.edges.beyond(&body, self.ground)).unwrap_or(f64::NEG_INFINITY)
        };
        // What is wrong now is no argument against any.
        let now = beyond(0).max(0.0);
        let worst = (1..=JUDGED * LOOK_STEPS / EVERY).map(|k| beyond(k * EVERY)).fold(f64::NEG_INFINITY, f64::max);
        if worst > (now + 0.02).max(TOLERANCE - 0.05) {
            OFF_ROAD
        } else if worst > now + HAIR {
            OVER_THE_EDGE
        } else {
            1.0
        }
    }

    /// Whether it comes into oncoming traffic's lane, where it is not now.
    fn oncoming(&self, rollout: &Rollout, against: &mut Against) -> bool {
        /// Steps between those that are looked at.
        const EVERY: usize = 8;
        /// Nearer to the line than this (m) nobody is in another lane.
        const OWN: f64 = 0.7;
        let mut is_at = |k: usize| {
            let (state, place) = (rollout.states[k], rollout.places[k]);
            place.lateral.abs() > OWN
                && against.is_oncoming(self.lanes, state.pose().position(), self.ground, Point::unit(state.heading))
        };
        (1..=JUDGED * LOOK_STEPS / EVERY).any(|k| is_at(k * EVERY)) && !is_at(0)
    }

    /// Whether it passes a red light, or the line's end.
    fn passes_red(&self, rollout: &Rollout) -> bool {
        let half = 0.5 * self.av.length;
        let (from, to) = (rollout.places[0].station + half, rollout.places[PLAN_STEPS].station + half);
        self.red.iter().chain(&self.end).any(|stop| from < *stop && *stop <= to)
    }

    /// As nuPlan's bounds have it.
    fn comfort(&self, rollout: &Rollout) -> f64 {
        /// A bound that is not kept costs this factor, and what is beyond the more.
        const UNCOMFORTABLE: f64 = 0.4;
        let mut read = [0.0; PAST + AHEAD];
        let center = rear_axle_to_center(self.wheelbase);
        let mut count = 0;
        let mut before = self.turning;
        let mut sharpest: f64 = 0.0;
        let mut feel = |ride: Ride| {
            let last = std::mem::replace(&mut before, ride.yaw_rate);
            read[count] = ride.nuplan(last, center).acceleration;
            count += 1;
            (ride.yaw_rate - last).abs() / STEP_SECONDS
        };
        for ride in self.past {
            feel(*ride);
        }
        for k in 0..AHEAD {
            let (now, next) = (rollout.states[k], rollout.states[k + 1]);
            let yaw_rate = next.speed * libm::tan(rollout.controls[k].steering) / self.wheelbase;
            let acceleration = (next.speed - now.speed) / STEP_SECONDS;
            sharpest = sharpest.max(feel(Ride { acceleration, yaw_rate, ..Ride::default() }));
        }
        let (past, begins) = (self.past.len(), self.begins);
        let jerk = self.filters.jerk.extremes(&read[..count], past, begins);
        let (least, most) = self.filters.smooth.extremes(&read[..count], past, begins);
        let jerk = jerk.1.max(-jerk.0);
        // Somewhat within the metric's bounds: what is driven in the end is another plan's.
        let over = |value: f64, bound: f64, scale: f64| ((value - bound) / scale).max(0.0);
        let excess = over(jerk, LONGITUDINAL_JERK - 0.4, 4.0)
            + over(-least, -LONGITUDINAL_ACCELERATION.0 - 0.15, 2.0)
            + over(most, LONGITUDINAL_ACCELERATION.1 - 0.3, 1.0)
            + over(sharpest, YAW_ACCELERATION_BOUND - 0.13, 1.0);
        (1.0 - excess).max(0.0) * if excess > 0.0 { UNCOMFORTABLE } else { 1.0 }
    }
}

/// Somebody as the judges see them.
fn agent(other: &Other, there: &Expected) -> TrafficAgent {
    TrafficAgent {
        track: 0,
        kind: other.kind,
        outline: there.outline,
        z: other.z,
        velocity: there.outline.forward * there.speed,
        speed: there.speed,
        sudden: false,
    }
}

/// A box with so much more room (m) before and behind, and to either side.
fn grown(outline: &OrientedBox, along: f64, across: f64) -> OrientedBox {
    OrientedBox { half_length: outline.half_length + along, half_width: outline.half_width + across, ..*outline }
}

/// Steps driven that are felt still, and steps of a plan that count.
pub const PAST: usize = 24;
const AHEAD: usize = 34;

/// The filters of nuPlan's comfort bounds.
#[derive(Clone, Debug)]
pub struct Filters {
    smooth: Filter,
    jerk: Filter,
}

impl Default for Filters {
    fn default() -> Self {
        Self { smooth: Filter::of(&[SMOOTH]), jerk: Filter::of(&[SMOOTH, JERK]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEAN: Verdict = Verdict {
        meetings: [Meeting { contact: None, close: None, close_looks: 0, last_close: 0 }; FUTURES],
        unsaved: None,
        tight: None,
        oncoming: false,
        beside: 0.0,
        aside: 0.0,
        farthest: 0.0,
        drivable: 1.0,
        red: false,
        progress: 20.0,
        comfort: 1.0,
    };

    fn hit(look: usize, speed: f64) -> Option<Hit> {
        Some(Hit { look, track: TrackId(1), speed })
    }

    fn contact(contact: Option<Hit>) -> f64 {
        let mut verdict = CLEAN;
        verdict.meetings[0].contact = contact;
        verdict.score(0, 20.0)
    }

    #[test]
    fn with_nothing_wrong_and_the_most_progress_all_is_won() {
        assert!((CLEAN.score(0, 20.0) - 1.001).abs() < 1e-12);
        assert!((CLEAN.score(0, 0.0) - 1.001).abs() < 1e-12);
        // Half of the progress is half of 5 of 12.
        assert!((CLEAN.score(0, 40.0) - (1.001 - 2.5 / 12.0)).abs() < 1e-12);
    }

    #[test]
    fn a_contact_is_worse_the_sooner_and_the_faster_it_is() {
        let worth = [None, hit(20, 1.0), hit(10, 1.0), hit(2, 1.0), hit(2, 8.0)].map(contact);
        assert!(worth.windows(2).all(|pair| pair[0] > pair[1]), "{worth:?}");
        assert!(worth[3].abs() < 0.01);
    }

    #[test]
    fn who_comes_too_near_loses_less_late_and_briefly() {
        let worth = [(20, 1), (5, 1), (5, 10), (5, 20)].map(|(look, close_looks)| {
            let mut verdict = CLEAN;
            verdict.meetings[0] = Meeting { close: hit(look, 3.0), close_looks, ..Meeting::default() };
            verdict.score(0, 20.0)
        });
        assert!(worth.windows(2).all(|pair| pair[0] > pair[1]), "{worth:?}");
        assert!(worth[3] > 0.5);
    }

    #[test]
    fn a_red_light_passed_is_worth_nothing() {
        assert!(Verdict { red: true, ..CLEAN }.score(0, 20.0) < 0.01);
    }

    #[test]
    fn what_is_wrong_is_worth_less_the_worse_it_is() {
        let tight = Verdict { tight: Some(TrackId(2)), ..CLEAN };
        let all = [
            CLEAN,
            Verdict { beside: 1.0, farthest: 1.0, ..CLEAN },
            Verdict { beside: 3.0, farthest: 3.0, ..CLEAN },
            Verdict { oncoming: true, ..CLEAN },
            tight,
            Verdict { unsaved: tight.tight, ..tight },
            Verdict { beside: 4.5, farthest: 4.5, ..CLEAN },
        ];
        let worth = all.map(|verdict| verdict.score(0, 20.0));
        assert!(worth.windows(2).all(|pair| pair[0] > pair[1]), "{worth:?}");
    }

    #[test]
    fn progress_with_which_something_is_wrong_is_no_measure() {
        let mut touches = Verdict { progress: 60.0, ..CLEAN };
        touches.meetings[1].contact = hit(8, 2.0);
        let all = [
            CLEAN,
            touches,
            Verdict { progress: 50.0, red: true, ..CLEAN },
            Verdict { progress: 50.0, unsaved: Some(TrackId(2)), ..CLEAN },
            Verdict { progress: 50.0, drivable: OFF_ROAD, ..CLEAN },
            Verdict { progress: 50.0, farthest: 4.5, ..CLEAN },
        ];
        assert_eq!(most_progress(all.iter(), 2), 20.0);
        assert_eq!(most_progress(all.iter(), 1), 60.0, "the second future is not looked at");
        assert_eq!(most_progress(all[1..].iter(), 2), 0.0);
    }
}
