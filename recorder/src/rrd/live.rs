//! An episode that is drawn while it is driven: pieces of a stream that is one recording to a viewer.

use re_sdk_types::blueprint::components::PlayState;
use rrd::{RrdError, Standing, Store};

use super::blueprint;
use super::drawing::{Drawing, recording_name, write_frame};
use crate::message::{Body, Message};

/// The layout's plots: nobody knows yet how far their values will reach.
const PLOTS: [(&str, &str, [f64; 2]); 4] = [
    ("Speed (m/s)", "/plots/speed", [0.0, 20.0]),
    ("Acceleration (m/s²)", "/plots/acceleration", [-5.5, 5.5]),
    ("Steering (rad)", "/plots/steering", [-0.55, 0.55]),
    ("Time to collision (s)", "/plots/time_to_collision", [0.0, 3.0]),
];

/// An episode on its way into a viewer.
pub struct Live {
    drawing: Drawing,
    name: String,
    standing: Standing,
    /// How many messages of it no piece has yet.
    waiting: usize,
}

impl Live {
    /// Begins with the scene, and gives the first piece: the map. `with_layout` brings the layout of views along, which a viewer needs once, for
    /// it would undo what its user has changed meanwhile. None where the message is no scene.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn begin(
        scene: &Message,
        run: &str,
        settings: &str,
        with_layout: bool,
    ) -> Result<Option<(Self, Vec<u8>)>, RrdError> {
        let Body::Scene(told) = &scene.body else { return Ok(None) };
        let mut drawing = Drawing::default();
        drawing.push(scene);
        let name = recording_name(run, &told.scene, settings);
        let mut encoder = rrd::encoder()?;
        if with_layout {
            blueprint::write(Store::blueprint(&mut encoder, "recorder", &name)?, &[], &PLOTS, PlayState::Following)?;
        }
        let mut store = Store::recording(&mut encoder, "recorder", &name)?;
        write_frame(&mut store, &format!("{run}, {}", told.scene), settings)?;
        // The map is drawn once, and not kept.
        if let Some(scene) = drawing.take_scene() {
            drawing.write_map(&mut store, &scene)?;
        }
        let standing = store.standing();
        encoder.finish()?;
        Ok(Some((Self { drawing, name, standing, waiting: 0 }, encoder.into_inner()?)))
    }

    /// Draws the next message; how many wait now.
    pub fn push(&mut self, message: &Message) -> usize {
        self.drawing.push(message);
        if matches!(message.body, Body::End(_)) {
            self.drawing.show_the_end();
        }
        self.waiting += 1;
        self.waiting
    }

    /// The piece of what was drawn since the last one; none where that is nothing.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn piece(&mut self) -> Result<Option<Vec<u8>>, RrdError> {
        if std::mem::take(&mut self.waiting) == 0 {
            return Ok(None);
        }
        let mut encoder = rrd::encoder()?;
        let mut store = Store::resumed(&mut encoder, &self.name, self.standing);
        self.drawing.take_steps().write_steps(&mut store)?;
        self.standing = store.standing();
        encoder.finish()?;
        Ok(Some(encoder.into_inner()?))
    }
}
