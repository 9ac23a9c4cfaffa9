//! What is ahead on somebody's way: who is followed, who crosses, and whom one gives room.

use world::geometry::{Bounds, Point};
use world::scene::AgentKind;
use world::traffic::way::SPACING;
use world::traffic::{Way, WayPlace};

use crate::collision;
use crate::gap_acceptance::{Claim, claim, comes_near};
use crate::idm::{HARDEST_BRAKING, Idm};
use crate::scenery::{Body, Forecast, STANDING, Scenery, Who};

/// Heights further apart than this (m) are on different levels.
const STOREY: f64 = 3.0;

/// Less room than this (m) between two is none.
const CLEARANCE: f64 = 0.15;

/// Who drives along and comes nearer sideways, faster than this (m/s), is seen where he will be after this time (s).
const COMES_LEAST: f64 = 0.3;
const COMES_SECONDS: f64 = 1.0;

/// Room (m) that is left to an AV, and to people on foot or on bicycles, where that can be.
const COURTESY: f64 = 0.8;

/// How far ahead room is given (m).
const COURTESY_AHEAD: f64 = 30.0;

/// Who is behind, and faster by no more than this (m/s), does not come ahead while one looks.
const FASTER: f64 = 1.0;

/// Whoever heads so much as one does (cosine of 25 degrees) goes the same way.
const SAME_WAY: f64 = 0.9;

/// Who goes one's own way, this much farther (m) than somebody who is followed already, is that one's to mind.
const BEYOND: f64 = 5.0;

/// How far one looks (m), and how much farther for each m/s.
const SIGHT: f64 = 15.0;
const SIGHT_SECONDS: f64 = 3.5;

/// Samples between those that bound what is looked at (4 m), and how far a way bends aside between them (m).
const STRIDE: usize = 8;
const SAG: f64 = 0.5;

/// What of the others counts for somebody.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heed {
    /// Nobody: for measures of what somebody else has decided.
    Nobody,
    /// Whoever would be driven into within a second and a half: `collision`.
    LastResort,
    /// Whoever is followed, crosses or wants room.
    Everybody,
}

/// Somebody's own place, as it looks ahead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    pub way: &'a Way,
    pub place: WayPlace,
    /// Offset from the way that it steers to (m).
    pub target: f64,
    pub own: &'a Body,
    pub idm: &'a Idm,
    /// Time that is left to who crosses (s), and how far one moves aside (m).
    pub margin: f64,
    pub room: f64,
    pub heed: Heed,
}

/// What comes of what is ahead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead {
    /// The acceleration that it allows (m/s^2).
    pub acceleration: f64,
    /// The nearest who is followed: gap (m), and speed (m/s).
    pub leader: Option<(f64, f64)>,
    /// How far to move aside (m): to the right, and to the left.
    pub aside: (f64, f64),
}

impl View<'_> {
    /// The station of the front bumper (m).
    pub(crate) fn front(&self) -> f64 {
        self.place.station + self.own.half_length
    }

    /// What is swept across the way (m): from where one is to where one steers.
    pub(crate) fn swept(&self) -> (f64, f64) {
        let (now, then) = (self.place.lateral, self.target);
        (now.min(then) - self.own.half_width, now.max(then) + self.own.half_width)
    }

    /// Room (m) between what is swept and somebody at `there` who reaches `across` to either side. In a bend one's ends swing out.
    pub(crate) fn clearance(&self, there: &WayPlace, across: f64) -> f64 {
        let (right, left) = self.swept();
        let swing = 0.5 * self.own.half_length * self.own.half_length * self.way.curvature(there.sample);
        let (right, left) = (right - swing.max(0.0), left - swing.min(0.0));
        (there.lateral - across - left).max(right - there.lateral - across)
    }

    /// The bounds of the stretch that is looked at.
    fn sight(&self) -> Bounds {
        let samples = ((SIGHT + SIGHT_SECONDS * self.own.speed) * (1.0 / SPACING)) as u32 as usize;
        let points = self.way.points();
        let until = (self.place.sample + samples).min(points.len() - 1);
        let Point { x, y } = points[until];
        let (mut least, mut greatest) = (self.own.position, self.own.position);
        let mut hold = |x: f64, y: f64| {
            least = Point::new(least.x.min(x), least.y.min(y));
            greatest = Point::new(greatest.x.max(x), greatest.y.max(y));
        };
        hold(x, y);
        for stride in points[self.place.sample..until].chunks(STRIDE) {
            hold(stride[0].x, stride[0].y);
        }
        Bounds { least, greatest }.grown(SAG + self.own.half_width + COURTESY)
    }

    /// Looks at everybody who may come into what is looked at, from near to far: who is beyond a leader need not be. `near` is room to list them.
    pub(crate) fn ahead(&self, scenery: &Scenery, near: &mut Vec<(f64, usize)>) -> Ahead {
        let sight = self.sight();
        near.clear();
        near.reserve(scenery.bodies.len());
        for (index, (body, reach)) in scenery.bodies.iter().zip(&scenery.reaches).enumerate() {
            if meet(&sight, reach) && body.track != self.own.track && (body.z - self.own.z).abs() <= STOREY {
                let along = (body.position - self.own.position).dot(self.own.forward);
                let stays_behind =
                    self.is_behind(body, along) && body.velocity.dot(self.own.forward) <= self.own.speed + FASTER;
                if !stays_behind {
                    near.push((along, index));
                }
            }
        }
        near.sort_unstable_by(|(a, first), (b, second)| a.total_cmp(b).then(first.cmp(second)));
        let mut ahead = Ahead { acceleration: f64::INFINITY, leader: None, aside: (0.0, 0.0) };
        for &(along, index) in near.iter() {
            self.mind(&scenery.bodies[index], &scenery.forecasts[index], along, &sight, &mut ahead);
        }
        ahead
    }

    fn is_behind(&self, body: &Body, along: f64) -> bool {
        along < -self.own.half_length - body.half_length
    }

    /// What comes of somebody so far ahead (m).
    fn mind(&self, body: &Body, forecast: &Forecast, along: f64, sight: &Bounds, ahead: &mut Ahead) {
        let beyond = ahead.leader.map_or(f64::INFINITY, |(gap, _)| gap + self.own.half_length + BEYOND);
        if along - body.half_length > beyond && body.forward.dot(self.own.forward) > SAME_WAY {
            return;
        }
        let is_seen = !self.is_behind(body, along) && sight.grown(body.half_length).hold(body.position);
        if !is_seen && (body.speed < STANDING || !meet(sight, &forecast.bounds)) {
            return;
        }
        let hint = self.place.sample + (along.max(0.0) * (1.0 / SPACING)) as u32 as usize;
        let place = self.way.follow(body.position, hint);
        if self.heed == Heed::LastResort {
            if collision::is_imminent(self, body, forecast) {
                ahead.acceleration = -HARDEST_BRAKING;
            }
            return;
        }
        if is_seen && self.look_at(body, &place, ahead) || !comes_near(self, body, &place, forecast) {
            return;
        }
        if collision::is_imminent(self, body, forecast) {
            ahead.acceleration = -HARDEST_BRAKING;
            return;
        }
        match claim(self, body, &place, forecast) {
            None => {}
            Some(Claim::Follow { gap, speed }) => ahead.follow(self, gap, speed),
            Some(Claim::FallBack { acceleration }) => ahead.acceleration = ahead.acceleration.min(acceleration),
            Some(Claim::Yield { distance }) => {
                ahead.acceleration = ahead.acceleration.min(self.idm.before_a_line(self.own.speed, distance));
            }
        }
    }

    /// How far somebody who drives along the way comes nearer to it (m) while one looks: in [`COMES_SECONDS`].
    fn comes_aside(&self, body: &Body, place: &WayPlace, direction: Point) -> f64 {
        let sideways = direction.cross(body.velocity) * if place.lateral > 0.0 { -1.0 } else { 1.0 };
        let is_along = direction.dot(body.velocity) > sideways.abs();
        if is_along && sideways > COMES_LEAST { sideways * COMES_SECONDS } else { 0.0 }
    }

    /// Follows somebody who is in the way, and gives room to who nearly is; whether he is done with.
    fn look_at(&self, body: &Body, place: &WayPlace, ahead: &mut Ahead) -> bool {
        // What of it is nearest to the way, and what is first along it: in a bend, not its middle.
        let (mut clearance, mut gap, mut at) = (f64::INFINITY, f64::INFINITY, None);
        let direction = self.way.direction(place.sample);
        let comes = self.comes_aside(body, place, direction);
        let (across, _) = body.reach(direction, body.forward);
        let sag = 0.5 * body.half_length * body.half_length * self.way.curvature(place.sample).abs();
        if self.clearance(place, across + sag) > COURTESY + comes {
            return false; // nobody has to look closer
        }
        for (center, radius) in body.discs(direction) {
            let there = if center == body.position { *place } else { self.way.follow(center, place.sample) };
            if there.station <= self.place.station {
                continue;
            }
            let room = self.clearance(&there, radius);
            if room < clearance {
                (clearance, at) = (room, Some(there));
            }
            if room - comes < CLEARANCE {
                gap = gap.min(there.station - radius - self.front());
            }
        }
        let Some(at) = at else { return false };
        let direction = self.way.direction(at.sample);
        let (across, along) = body.reach(direction, body.forward);
        let gap = if gap.is_finite() { gap } else { at.station - along - self.front() };
        let (forwards, sideways) = (direction.dot(body.velocity), direction.cross(body.velocity));
        if body.who == Who::Av || matches!(body.kind, AgentKind::Pedestrian | AgentKind::Cyclist) {
            let wanted = COURTESY - clearance;
            if wanted > 0.0 && wanted <= self.room + COURTESY && gap < COURTESY_AHEAD {
                let aside = wanted.min(self.room);
                let is_left = place.lateral > 0.5 * (self.swept().0 + self.swept().1);
                let side = if is_left { &mut ahead.aside.0 } else { &mut ahead.aside.1 };
                *side = side.max(aside);
            }
        }
        if clearance - comes >= CLEARANCE {
            return false;
        }
        if sideways.abs() > forwards.abs() && sideways.abs() > 1.0 {
            // It crosses: it is past, or it is in the way, when one comes there.
            let (right, left) = self.swept();
            let rest = if sideways > 0.0 { left - place.lateral + across } else { place.lateral + across - right };
            if rest / sideways.abs() + self.margin < gap / self.own.speed.max(1.0) {
                return true;
            }
        }
        ahead.follow(self, gap, forwards.max(0.0));
        true
    }
}

impl Ahead {
    fn follow(&mut self, view: &View<'_>, gap: f64, speed: f64) {
        self.acceleration = self.acceleration.min(view.idm.behind(view.own.speed, gap, speed));
        if self.leader.is_none_or(|(nearest, _)| gap < nearest) {
            self.leader = Some((gap, speed));
        }
    }
}

fn meet(a: &Bounds, b: &Bounds) -> bool {
    // All four are cheaper than a guess at which of them is the first to fail.
    (a.least.x <= b.greatest.x)
        & (b.least.x <= a.greatest.x)
        & (a.least.y <= b.greatest.y)
        & (b.least.y <= a.greatest.y)
}
