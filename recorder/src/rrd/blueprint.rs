//! The layout a viewer opens a recording with: the scene large on the left, plots to its right, the log and texts below.

use re_sdk_types::blueprint::archetypes::{PlotLegend, ScalarAxis, TextLogColumns, TimePanelBlueprint};
use re_sdk_types::blueprint::components::{ContainerKind, PanelState, PlayState};
use re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use re_sdk_types::components::Range1D;
use rrd::{Layout, RrdError, Store};

use crate::palette;

/// The riding camera's place and what it looks at, in the AV's frame (m).
pub(super) const RIDE_EYE: [f32; 3] = [-24.0, 0.0, 21.0];
pub(super) const RIDE_TARGET: [f32; 3] = [13.0, 0.0, 0.0];

/// How high above the middle of the drive the overview's camera hangs: by the drive's extent, and at least (m).
const OVERVIEW_SHARE: f32 = 0.9;
const OVERVIEW_LEAST: f32 = 60.0;

/// Writes and activates the layout. `drive` is where the AV was; plots have a name, a path and a range. `play` is what the viewer does first.
///
/// # Errors
/// [`RrdError`].
pub fn write(
    store: Store<'_>,
    drive: &[[f32; 3]],
    plots: &[(&str, &str, [f64; 2])],
    play: PlayState,
) -> Result<(), RrdError> {
    let mut layout = Layout::new(store);

    // A camera that tracks an entity jumps close to it; one that stands still in a frame that moves rides along.
    let ride = layout.view("3D", "Ride along", "/world/ride", "/world/**")?;
    layout.look(&ride, RIDE_EYE, RIDE_TARGET, palette::BACKGROUND)?;
    let overview = layout.view("3D", "Overview", "/world", "$origin/**")?;
    let (middle, extent) = bounds(drive);
    let height = OVERVIEW_LEAST.max(OVERVIEW_SHARE * extent);
    let from = [middle[0], middle[1] - 0.35 * height, middle[2] + height];
    layout.look(&overview, from, middle, palette::BACKGROUND)?;

    let mut plot_views = Vec::new();
    for (name, path, range) in plots {
        let plot = layout.view("TimeSeries", name, path, "$origin/**")?;
        layout.set(&plot, "PlotLegend", &PlotLegend::new().with_visible(*path == "/plots/speed"))?;
        layout.set(&plot, "ScalarAxis", &ScalarAxis::new().with_range(Range1D::new(range[0], range[1])))?;
        plot_views.push(plot);
    }
    let events = events(&mut layout, "/events")?;
    let outcome = layout.view("TextDocument", "Outcome", "/outcome", "$origin/**")?;
    let settings = layout.view("TextDocument", "Settings", "/settings", "$origin/**")?;

    let plots: Vec<(&str, f32)> = plot_views.iter().map(|plot| (plot.as_str(), 1.0)).collect();
    let (plots, _) = layout.container(ContainerKind::Vertical, &plots)?;
    let (texts, _) = layout.container(ContainerKind::Tabs, &[(&outcome, 1.0), (&settings, 1.0)])?;
    let (scene, _) = layout.container(ContainerKind::Tabs, &[(&ride, 1.0), (&overview, 1.0)])?;
    let (above, _) = layout.container(ContainerKind::Horizontal, &[(&scene, 2.6), (&plots, 1.0)])?;
    let (below, _) = layout.container(ContainerKind::Horizontal, &[(&events, 2.6), (&texts, 1.0)])?;
    let (_, root) = layout.container(ContainerKind::Vertical, &[(&above, 4.0), (&below, 1.0)])?;

    let time =
        TimePanelBlueprint::new().with_state(PanelState::Collapsed).with_timeline("sim_time").with_play_state(play);
    layout.activate(root, &time)
}

/// The view of the events at `origin`; its path.
pub(super) fn events(layout: &mut Layout<'_>, origin: &str) -> Result<String, RrdError> {
    let events = layout.view("TextLog", "Events", origin, "$origin/**")?;
    let columns =
        [TextLogColumnKind::LogLevel, TextLogColumnKind::Body].map(|kind| TextLogColumn { kind, visible: true.into() });
    layout.set(&events, "TextLogColumns", &TextLogColumns::new().with_text_log_columns(columns))?;
    Ok(events)
}

/// The middle of the points, and how far they reach at most along x or y.
fn bounds(points: &[[f32; 3]]) -> ([f32; 3], f32) {
    let axis = |axis: usize| {
        let values = points.iter().map(|point| point[axis]).filter(|value| value.is_finite());
        let (low, high) =
            values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low <= high { (low, high) } else { (0.0, 0.0) }
    };
    let ranges = [axis(0), axis(1), axis(2)];
    let extent = ranges[..2].iter().fold(0.0, |extent: f32, (low, high)| extent.max(high - low));
    (ranges.map(|(low, high)| 0.5 * (low + high)), extent)
}
