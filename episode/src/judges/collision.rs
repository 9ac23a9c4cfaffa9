//! Which contact it is when the AV's box overlaps an agent's, and whose fault. The classes and their order are nuPlan's
//! (`no_ego_at_fault_collisions.py`): what stands decides first, then where the other is.

use wire::proto::event::Contact;
use world::geometry::{OrientedBox, Point, boxes_overlap};

use super::time_to_collision::TrafficAgent;
use super::{Body, STOREY};

/// At most this speed (m/s) is standing.
pub const STANDING_SPEED: f64 = 0.05;

/// cos^2 of 30 degrees: what lies within that angle of straight ahead is ahead, within that of straight back behind.
const COS_SQUARED_30: f64 = 0.75;

/// Whether the AV's box and the agent's overlap, on one level.
#[must_use]
pub fn overlaps(av: &Body, agent: &TrafficAgent) -> bool {
    (av.state.z - agent.z).abs() <= STOREY && boxes_overlap(&av.outline, &agent.outline)
}

/// What kind of contact the AV's with `agent` is, given that their boxes overlap.
#[must_use]
pub fn classify(av: &Body, wheelbase: f64, agent: &TrafficAgent) -> Contact {
    if av.speed <= STANDING_SPEED {
        Contact::Standing
    } else if agent.speed <= STANDING_SPEED {
        Contact::StoppedTrack
    } else if is_behind(av, wheelbase, agent.outline.center) {
        Contact::Rear
    } else if boxes_overlap(&front_bumper(&av.outline), &agent.outline) {
        Contact::Front
    } else {
        Contact::Lateral
    }
}

/// Whether the AV is at fault for such a contact: never where it stood or was hit from behind; from the side only where
/// its box is not wholly in one lane.
#[must_use]
pub fn is_at_fault(contact: Contact, in_one_lane: bool) -> bool {
    match contact {
        Contact::StoppedTrack | Contact::Front => true,
        Contact::Lateral => !in_one_lane,
        Contact::Standing | Contact::Rear | Contact::Unspecified => false,
    }
}

/// Whether `point` lies within 30 degrees of straight ahead, seen from the rear axle.
#[must_use]
pub fn is_ahead(av: &Body, wheelbase: f64, point: Point) -> bool {
    let offset = point - av.rear_axle(wheelbase);
    let along = offset.dot(av.outline.forward);
    along > 0.0 && along * along > COS_SQUARED_30 * offset.norm_squared()
}

/// Whether `point` lies within 30 degrees of straight back, seen from the rear axle.
#[must_use]
pub fn is_behind(av: &Body, wheelbase: f64, point: Point) -> bool {
    let offset = point - av.rear_axle(wheelbase);
    let along = offset.dot(av.outline.forward);
    along < 0.0 && along * along > COS_SQUARED_30 * offset.norm_squared()
}

/// The front edge of a box, as a box without length.
pub(super) fn front_bumper(outline: &OrientedBox) -> OrientedBox {
    OrientedBox { center: outline.front(), half_length: 0.0, ..*outline }
}

#[cfg(test)]
mod tests {
    use world::scene::{AgentKind, AgentState};
    use world::vehicle::WHEELBASE;

    use super::*;

    fn state(x: f64, y: f64, heading: f64, speed: f64) -> AgentState {
        let velocity = Point::unit(heading) * speed;
        AgentState {
            x,
            y,
            heading,
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            length: 5.0,
            width: 2.0,
            height: 1.5,
            ..AgentState::default()
        }
    }

    fn av(speed: f64) -> Body {
        Body::of(state(0.0, 0.0, 0.0, speed))
    }

    fn car(x: f64, y: f64, heading: f64, speed: f64) -> TrafficAgent {
        let state = state(x, y, heading, speed);
        TrafficAgent {
            track: 1,
            kind: AgentKind::Vehicle,
            outline: state.oriented_box(),
            z: 0.0,
            velocity: state.velocity(),
            speed,
            sudden: false,
        }
    }

    #[test]
    fn a_box_that_just_touches_is_no_contact() {
        assert!(!overlaps(&av(5.0), &car(5.0, 0.0, 0.0, 0.0)));
        assert!(overlaps(&av(5.0), &car(4.999, 0.0, 0.0, 0.0)));
    }

    #[test]
    fn a_car_on_the_bridge_above_is_no_contact() {
        let mut above = car(1.0, 0.0, 0.0, 3.0);
        above.z = 5.0;
        assert!(!overlaps(&av(5.0), &above));
    }

    #[test]
    fn running_into_the_car_ahead_is_at_fault_whether_it_drives_or_stands() {
        let moving = classify(&av(9.0), WHEELBASE, &car(4.9, 0.0, 0.0, 3.0));
        let standing = classify(&av(9.0), WHEELBASE, &car(4.9, 0.0, 0.0, 0.0));
        assert_eq!((moving, standing), (Contact::Front, Contact::StoppedTrack));
        assert!(is_at_fault(moving, true) && is_at_fault(standing, true));
    }

    #[test]
    fn being_hit_from_behind_is_not_at_fault() {
        let contact = classify(&av(3.0), WHEELBASE, &car(-4.9, 0.0, 0.0, 9.0));
        assert_eq!(contact, Contact::Rear);
        assert!(!is_at_fault(contact, false));
    }

    #[test]
    fn a_standing_av_is_never_at_fault() {
        let contact = classify(&av(0.04), WHEELBASE, &car(4.9, 0.0, 3.1, 9.0));
        assert_eq!(contact, Contact::Standing);
        assert!(!is_at_fault(contact, false));
    }

    #[test]
    fn side_to_side_is_at_fault_only_outside_of_one_lane() {
        let contact = classify(&av(8.0), WHEELBASE, &car(-0.5, 1.9, 0.0, 8.0));
        assert_eq!(contact, Contact::Lateral);
        assert!(is_at_fault(contact, false) && !is_at_fault(contact, true));
    }
}
