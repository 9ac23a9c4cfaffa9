//! Whether two oriented boxes overlap.

use super::OrientedBox;

/// Whether the boxes share more than their edges: boxes that only touch do not overlap.
///
/// Separating axes by hand: two rectangles are apart iff they are apart along one of their four edge directions. The
/// boxes keep their direction as a unit vector, so there is no trigonometry. Swapping the boxes gives the same bits.
#[must_use]
pub fn boxes_overlap(a: &OrientedBox, b: &OrientedBox) -> bool {
    let offset = b.center - a.center;
    let cosine = a.forward.dot(b.forward).abs();
    let sine = a.forward.cross(b.forward).abs();
    let reach = |own: f64, along: f64, across: f64| own + (along * cosine + across * sine);
    offset.dot(a.forward).abs() < reach(a.half_length, b.half_length, b.half_width)
        && offset.cross(a.forward).abs() < reach(a.half_width, b.half_width, b.half_length)
        && offset.dot(b.forward).abs() < reach(b.half_length, a.half_length, a.half_width)
        && offset.cross(b.forward).abs() < reach(b.half_width, a.half_width, a.half_length)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    use parry2d_f64::math::{Pose as ParryPose, Vector};
    use parry2d_f64::query::intersection_test;
    use parry2d_f64::shape::Cuboid;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Pose;

    fn car(x: f64, y: f64, heading: f64) -> OrientedBox {
        OrientedBox::new(Pose::new(x, y, heading), 4.0, 2.0)
    }

    #[test]
    fn boxes_that_share_an_edge_do_not_overlap() {
        assert!(!boxes_overlap(&car(0.0, 0.0, 0.0), &car(4.0, 0.0, 0.0)));
        assert!(!boxes_overlap(&car(0.0, 0.0, 0.0), &car(0.0, 2.0, 0.0)));
        assert!(boxes_overlap(&car(0.0, 0.0, 0.0), &car(3.999_999, 0.0, 0.0)));
        assert!(boxes_overlap(&car(0.0, 0.0, 0.0), &car(0.0, -1.999_999, 0.0)));
    }

    #[test]
    fn a_box_touching_at_a_corner_is_no_overlap() {
        assert!(!boxes_overlap(&car(0.0, 0.0, 0.0), &car(4.0, 2.0, 0.0)));
        assert!(boxes_overlap(&car(0.0, 0.0, 0.0), &car(3.999, 1.999, 0.0)));
    }

    #[test]
    fn crossed_boxes_overlap_though_no_corner_lies_in_the_other() {
        assert!(boxes_overlap(&car(0.0, 0.0, 0.0), &car(0.3, 0.2, FRAC_PI_2)));
    }

    #[test]
    fn boxes_whose_upright_bounds_overlap_may_be_apart() {
        // Two cars side by side on a diagonal road.
        let beside = Pose::new(0.0, 0.0, FRAC_PI_4).to_world(crate::geometry::Point::new(0.0, 2.001));
        assert!(!boxes_overlap(&car(0.0, 0.0, FRAC_PI_4), &car(beside.x, beside.y, FRAC_PI_4)));
    }

    #[test]
    fn a_box_within_a_box_overlaps_it() {
        let dot = OrientedBox::new(Pose::new(0.5, 0.5, 1.0), 0.0, 0.0);
        assert!(boxes_overlap(&car(0.0, 0.0, 0.0), &dot));
    }

    fn any_box() -> impl Strategy<Value = (Pose, f64, f64)> {
        (-8.0..8.0, -8.0..8.0, -PI..PI, 0.1..8.0, 0.1..4.0)
            .prop_map(|(x, y, heading, length, width)| (Pose::new(x, y, heading), length, width))
    }

    fn parry(pose: Pose, length: f64, width: f64) -> (ParryPose, Cuboid) {
        let place = ParryPose::new(Vector::new(pose.x, pose.y), pose.heading);
        (place, Cuboid::new(Vector::new(0.5 * length, 0.5 * width)))
    }

    fn grown((pose, length, width): (Pose, f64, f64), by: f64) -> OrientedBox {
        OrientedBox::new(pose, (length + by).max(0.0), (width + by).max(0.0))
    }

    proptest! {
        #[test]
        fn parry_says_the_same_away_from_touching(a in any_box(), b in any_box()) {
            let near_touching = boxes_overlap(&grown(a, 1e-6), &grown(b, 1e-6))
                != boxes_overlap(&grown(a, -1e-6), &grown(b, -1e-6));
            prop_assume!(!near_touching);
            let (place_a, shape_a) = parry(a.0, a.1, a.2);
            let (place_b, shape_b) = parry(b.0, b.1, b.2);
            let overlap = intersection_test(&place_a, &shape_a, &place_b, &shape_b).unwrap();
            prop_assert_eq!(boxes_overlap(&grown(a, 0.0), &grown(b, 0.0)), overlap.intersecting);
        }

        #[test]
        fn neither_box_comes_first(a in any_box(), b in any_box()) {
            let (a, b) = (grown(a, 0.0), grown(b, 0.0));
            prop_assert_eq!(boxes_overlap(&a, &b), boxes_overlap(&b, &a));
        }

        #[test]
        fn turning_the_world_changes_nothing(a in any_box(), b in any_box(), turn in -PI..PI) {
            let turned = |(pose, length, width): (Pose, f64, f64)| {
                let at = Pose::new(0.0, 0.0, turn).to_world(pose.position());
                (Pose::new(at.x, at.y, pose.heading + turn), length, width)
            };
            let near_touching = boxes_overlap(&grown(a, 1e-9), &grown(b, 1e-9))
                != boxes_overlap(&grown(a, -1e-9), &grown(b, -1e-9));
            prop_assume!(!near_touching);
            let before = boxes_overlap(&grown(a, 0.0), &grown(b, 0.0));
            prop_assert_eq!(before, boxes_overlap(&grown(turned(a), 0.0), &grown(turned(b), 0.0)));
        }
    }
}
