//! The frame that pictures are drawn in: the log's, moved to where the AV starts.
//!
//! Logs lie up to tens of kilometres from their origin, and viewers draw in single precision, whose steps are there a
//! millimetre and more: boxes would tremble. Single precision is left for coordinates that are small.

use wire::proto;

/// Added to a number and taken away again, these leave a multiple of 1/512 (m) and of 1/16384 (of a quaternion's part): doubles have 52
/// binary places. What is below 1 mm and a hundredth of a degree shows nowhere, and is what can least be packed in a file.
const PLACES: f64 = 1.5 * (1_u64 << (52 - 9)) as f64;
const TURNS: f64 = 1.5 * (1_u64 << (52 - 14)) as f64;

/// Where the drawn frame lies in the log's frame (m): whole metres, so that moving there and back is exact. Directions are not
/// turned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Origin {
    /// East.
    pub x: f64,
    /// North.
    pub y: f64,
    /// Up: about the ground.
    pub z: f64,
}

impl Origin {
    /// The place where the AV of `scene` starts: its last state of the history, else the start of the reference line.
    #[must_use]
    pub fn of_scene(scene: &proto::Scene) -> Self {
        let last = scene.history.iter().rev().find_map(|step| step.av.as_ref());
        let first_sample = || {
            let line = scene.reference_line.as_ref()?;
            Some((*line.x.first()?, *line.y.first()?, *line.z.first()?))
        };
        let (x, y, z) = match last {
            Some(av) => (av.x, av.y, av.z - 0.5 * av.height),
            None => first_sample().unwrap_or_default(),
        };
        let whole = |value: f64| if value.is_finite() { value.round() } else { 0.0 };
        Self { x: whole(x), y: whole(y), z: whole(z) }
    }

    /// A point of the log's frame in the drawn one.
    #[must_use]
    pub fn place(&self, x: f64, y: f64, z: f64) -> [f32; 3] {
        let place = |exact: f64| (exact + PLACES - PLACES) as f32;
        [place(x - self.x), place(y - self.y), place(z - self.z)]
    }
}

/// The quaternion (x, y, z, w) of a turn by `heading` (rad) about the vertical.
#[must_use]
pub fn quaternion(heading: f64) -> [f64; 4] {
    let (sine, cosine) = libm::sincos(0.5 * heading);
    let part = |exact: f64| exact + TURNS - TURNS;
    [0.0, 0.0, part(sine), part(cosine)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_is_a_coarse_number_next_to_the_true_one() {
        let origin = Origin { x: 8_412.0, y: -9_377.0, z: 31.0 };
        assert_eq!(origin.place(8_412.25, -9_377.5, 30.0), [0.25, -0.5, -1.0]);
        for value in [0.0, 0.1, -17.377_123, 812.4, -2_999.999] {
            let [drawn, ..] = origin.place(origin.x + value, 0.0, 0.0).map(f64::from);
            assert_eq!((512.0 * drawn).fract(), 0.0);
            assert!((drawn - value).abs() < 0.001, "{value} at {drawn}");
        }
        assert!(origin.place(f64::NAN, f64::INFINITY, 0.0)[..2].iter().all(|part| !part.is_finite()));
        let [.., sine, cosine] = quaternion(2.0);
        assert!((2.0 * libm::atan2(sine, cosine) - 2.0).abs() < 2e-4 && (16_384.0 * sine).fract() == 0.0);
    }
}
