//! From the log's frame into the AV's, rounded where each setting rounds (`network.md` 4.2, 4.3).

use std::f32::consts::{PI, TAU};

use world::geometry::{Point, Pose, wrap_angle, wrap_angle_single};

use super::settings::Settings;

/// The AV's frame at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct AvFrame {
    pub settings: Settings,
    pose: Pose,
    forward: Point,
}

impl AvFrame {
    pub fn new(pose: Pose, settings: Settings) -> Self {
        Self { settings, pose, forward: Point::unit(pose.heading) }
    }

    fn turn(&self, vector: Point) -> Point {
        Point::new(self.forward.dot(vector), self.forward.cross(vector))
    }

    /// A place on the map. The authors round it first, and take a coordinate of 0 for one that is missing.
    pub fn place(&self, place: Point) -> [f32; 2] {
        match self.settings {
            Settings::Mended => {
                let own = self.turn(place - self.pose.position());
                [own.x as f32, own.y as f32]
            }
            Settings::Authors => {
                let (x, y) = (place.x as f32, place.y as f32);
                let own = self.turn(Point::new(f64::from(x), f64::from(y)) - self.pose.position());
                [unless_missing(x, own.x as f32), unless_missing(y, own.y as f32)]
            }
        }
    }

    /// A direction on the map.
    pub fn heading(&self, heading: f64) -> f32 {
        match self.settings {
            Settings::Mended => wrap_angle(heading - self.pose.heading) as f32,
            Settings::Authors => wrap(heading as f32 - self.pose.heading as f32),
        }
    }

    /// A velocity.
    pub fn velocity(&self, velocity: Point) -> [f32; 2] {
        match self.settings {
            Settings::Mended => {
                let own = self.turn(velocity);
                [own.x as f32, own.y as f32]
            }
            Settings::Authors => {
                let (x, y) = (velocity.x as f32, velocity.y as f32);
                let (cos, sin) = (self.forward.x as f32, self.forward.y as f32);
                [unless_missing(x, x * cos + y * sin), unless_missing(y, y * cos - x * sin)]
            }
        }
    }

    /// The AV's own state where it drives by itself: in double precision to the end.
    pub fn driven(&self, pose: Pose, velocity: Point) -> [f32; 5] {
        let (place, own) = (self.turn(pose.position() - self.pose.position()), self.turn(velocity));
        let row = [place.x, place.y, wrap_angle(pose.heading - self.pose.heading), own.x, own.y];
        let logged = [pose.x, pose.y, pose.heading, velocity.x, velocity.y];
        let missing = |index: usize| self.settings == Settings::Authors && logged[index] == 0.0;
        std::array::from_fn(|index| if missing(index) { 0.0 } else { row[index] as f32 })
    }
}

/// What is exactly 0 in the log's frame stays so in the AV's.
pub(super) fn unless_missing(logged: f32, own: f32) -> f32 {
    if logged == 0.0 { 0.0 } else { own }
}

/// [`wrap_angle_single`], and fast where there is nothing to wrap: the sum is its own remainder then.
fn wrap(angle: f32) -> f32 {
    let shifted = angle + PI;
    if (0.0..TAU).contains(&shifted) { shifted - PI } else { wrap_angle_single(angle) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_fast_way_to_wrap_has_the_bits_of_the_slow_one(angle in -20.0_f32..20.0) {
            prop_assert_eq!(wrap(angle).to_bits(), wrap_angle_single(angle).to_bits());
        }

        #[test]
        fn both_settings_say_the_same_but_for_rounding(
            (x, y, heading) in (-2e4..2e4, -2e4..2e4, -3.0..3.0), (dx, dy, turn) in (-99.0..99.0, -99.0..99.0, -3.0..3.0_f64),
        ) {
            let av = Pose::new(x, y, heading);
            let (authors, mended) = (AvFrame::new(av, Settings::Authors), AvFrame::new(av, Settings::Mended));
            let point = Point::new(x + dx, y + dy);
            for (a, b) in authors.place(point).into_iter().zip(mended.place(point)) {
                prop_assert!((a - b).abs() < 4e-3);
            }
            let apart = authors.heading(turn) - mended.heading(turn);
            prop_assert!(apart.abs() < 1e-5 || (apart.abs() - TAU).abs() < 1e-5);
            for (a, b) in authors.velocity(Point::new(dx, dy)).into_iter().zip(mended.velocity(Point::new(dx, dy))) {
                prop_assert!((a - b).abs() < 1e-4);
            }
        }
    }
}
