//! Two drives through one scene, side by side in one recording, at the same time.

use re_chunk::EntityPath;
use re_sdk_types::archetypes::{RecordingInfo, ViewCoordinates};
use re_sdk_types::blueprint::archetypes::{PlotLegend, ScalarAxis, TimePanelBlueprint};
use re_sdk_types::blueprint::components::{AbsoluteTimeRange, ContainerKind, LoopMode, PanelState, PlayState};
use re_sdk_types::components::Range1D;
use re_sdk_types::datatypes;
use rrd::{Layout, RrdError, Store};

use super::Drawing;
use super::blueprint::{RIDE_EYE, RIDE_TARGET, events};
use crate::message::STEP_NANOSECONDS;
use crate::palette;

/// Where each side's entities lie.
const ROOTS: [&str; 2] = ["a", "b"];

/// Steps before the one that matters at which the viewer begins: a second.
const LEAD: u32 = 10;

/// One of the drives.
pub struct Side {
    /// All of its messages.
    pub drawing: Drawing,
    /// What it is called.
    pub name: String,
}

/// The file of both. The viewer plays from a second before step `from` to the end, again and again.
///
/// # Errors
/// [`RrdError`].
pub fn beside(mut sides: [Side; 2], from: u32) -> Result<Vec<u8>, RrdError> {
    sides.iter_mut().for_each(|side| side.drawing.show_the_end());
    let [a, b] = &sides;
    let title = format!("{} beside {}, {}", a.name, b.name, a.drawing.scene_name());
    let mut encoder = rrd::encoder()?;
    lay_out(Store::blueprint(&mut encoder, "recorder", &title)?, &sides, from)?;
    let mut store = Store::recording(&mut encoder, "recorder", &title)?;
    store.log(EntityPath::properties(), &RecordingInfo::new().with_name(title.clone()))?;
    for (side, root) in sides.into_iter().zip(ROOTS) {
        store.below(root);
        store.log("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
        side.drawing.write(&mut store)?;
    }
    encoder.finish()?;
    Ok(encoder.into_inner()?)
}

fn lay_out(store: Store<'_>, sides: &[Side; 2], from: u32) -> Result<(), RrdError> {
    let mut layout = Layout::new(store);
    let speeds = sides.each_ref().map(|side| side.drawing.speeds());
    let speeds = Range1D::new(speeds[0][0].min(speeds[1][0]), speeds[0][1].max(speeds[1][1]));
    let mut columns = Vec::new();
    for (Side { name, .. }, root) in sides.iter().zip(ROOTS) {
        let ride = layout.view("3D", name, &format!("/{root}/world/ride"), &format!("/{root}/world/**"))?;
        layout.look(&ride, RIDE_EYE, RIDE_TARGET, palette::BACKGROUND)?;
        let speed = layout.view("TimeSeries", "Speed (m/s)", &format!("/{root}/plots/speed"), "$origin/**")?;
        layout.set(&speed, "PlotLegend", &PlotLegend::new().with_visible(true))?;
        layout.set(&speed, "ScalarAxis", &ScalarAxis::new().with_range(speeds))?;
        let events = events(&mut layout, &format!("/{root}/events"))?;
        let parts = [(ride.as_str(), 4.0), (speed.as_str(), 1.0), (events.as_str(), 1.0)];
        columns.push(layout.container(ContainerKind::Vertical, &parts)?.0);
    }
    let columns: Vec<(&str, f32)> = columns.iter().map(|column| (column.as_str(), 1.0)).collect();
    let (_, root) = layout.container(ContainerKind::Horizontal, &columns)?;
    let nanoseconds = |step: u32| i64::from(step) * STEP_NANOSECONDS as i64;
    let range = datatypes::AbsoluteTimeRange {
        min: datatypes::TimeInt(nanoseconds(from.saturating_sub(LEAD))),
        max: datatypes::TimeInt(nanoseconds(sides.iter().map(|side| side.drawing.steps()).max().unwrap_or(from))),
    };
    let time = TimePanelBlueprint::new()
        .with_state(PanelState::Collapsed)
        .with_timeline("sim_time")
        .with_loop_mode(LoopMode::Selection)
        .with_time_selection(AbsoluteTimeRange(range))
        .with_play_state(PlayState::Playing);
    layout.activate(root, &time)
}
