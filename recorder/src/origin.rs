//! The frame that pictures are drawn in: the log's, moved to where the AV starts.
//!
//! Logs lie up to tens of kilometres from their origin, and viewers draw in single precision, whose steps are there a
//! millimetre and more: boxes would tremble. Single precision is left for coordinates that are small.

use wire::proto;

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
        [(x - self.x) as f32, (y - self.y) as f32, (z - self.z) as f32]
    }
}

/// The quaternion (x, y, z, w) of a turn by `heading` (rad) about the vertical.
#[must_use]
pub fn quaternion(heading: f64) -> [f64; 4] {
    let (sine, cosine) = libm::sincos(0.5 * heading);
    [0.0, 0.0, sine, cosine]
}
