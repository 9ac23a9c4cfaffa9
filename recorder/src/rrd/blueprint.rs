//! The layout a viewer opens a recording with: the scene large on the left, plots to its right, the log and texts below.

use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend, ScalarAxis, TextLogColumns,
    TimePanelBlueprint, ViewBlueprint, ViewContents, ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    BackgroundKind, ColumnShare, ContainerKind, Eye3DKind, IncludedContent, PanelState, PlayState, RootContainer,
    RowShare,
};
use re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use re_sdk_types::components::Range1D;
use re_sdk_types::datatypes::Uuid;

use super::columns::color;
use super::store::{RrdError, Store};
use crate::palette;

/// The riding camera's place and what it looks at, in the AV's frame (m).
const RIDE_EYE: [f32; 3] = [-24.0, 0.0, 21.0];
const RIDE_TARGET: [f32; 3] = [13.0, 0.0, 0.0];

/// How high above the middle of the drive the overview's camera hangs: by the drive's extent, and at least (m).
const OVERVIEW_SHARE: f32 = 0.9;
const OVERVIEW_LEAST: f32 = 60.0;

/// Writes the blueprint's views and containers with counted names.
struct Layout<'a> {
    store: Store<'a>,
    count: u128,
}

impl Layout<'_> {
    fn next_id(&mut self) -> Uuid {
        self.count += 1;
        Uuid { bytes: self.count.to_be_bytes() }
    }

    /// A view of `class` on `contents` in the frame of `origin`; returns its path.
    fn view(&mut self, class: &str, name: &str, origin: &str, contents: &str) -> Result<String, RrdError> {
        let path = format!("view/{}", self.next_id());
        self.store.log(format!("{path}/ViewContents"), &ViewContents::new([contents]))?;
        let view = ViewBlueprint::new(class).with_display_name(name).with_space_origin(origin);
        self.store.log(path.as_str(), &view)?;
        Ok(path)
    }

    /// Sets the camera, and the ground's colour, of a spatial view.
    fn look(&mut self, view: &str, from: [f32; 3], to: [f32; 3]) -> Result<(), RrdError> {
        let eye = EyeControls3D::new().with_kind(Eye3DKind::Orbital).with_position(from).with_look_target(to);
        self.store.log(format!("{view}/EyeControls3D"), &eye.with_eye_up([0.0, 0.0, 1.0]))?;
        let background = Background::new(BackgroundKind::SolidColor).with_color(color(palette::BACKGROUND));
        self.store.log(format!("{view}/Background"), &background)?;
        self.store.log(format!("{view}/LineGrid3D"), &LineGrid3D::new().with_visible(false))
    }

    /// A container of views and containers, with the share that each gets; returns its path and id.
    fn container(&mut self, kind: ContainerKind, parts: &[(&str, f32)]) -> Result<(String, Uuid), RrdError> {
        let id = self.next_id();
        let path = format!("container/{id}");
        let contents = parts.iter().map(|(part, _)| IncludedContent((*part).into()));
        let shares = parts.iter().map(|(_, share)| *share);
        let mut container = ContainerBlueprint::new(kind).with_contents(contents);
        match kind {
            ContainerKind::Horizontal => {
                container = container.with_col_shares(shares.map(|share| ColumnShare(share.into())))
            }
            ContainerKind::Vertical => {
                container = container.with_row_shares(shares.map(|share| RowShare(share.into())))
            }
            ContainerKind::Grid | ContainerKind::Tabs => {}
        }
        self.store.log(path.as_str(), &container)?;
        Ok((path, id))
    }
}

/// Writes and activates the layout. `drive` is where the AV was; plots have a name, a path and a range.
///
/// # Errors
/// [`RrdError`].
pub fn write(store: Store<'_>, drive: &[[f32; 3]], plots: &[(&str, &str, [f64; 2])]) -> Result<(), RrdError> {
    let mut layout = Layout { store, count: 0 };

    // A camera that tracks an entity jumps close to it; one that stands still in a frame that moves rides along.
    let ride = layout.view("3D", "Ride along", "/world/ride", "/world/**")?;
    layout.look(&ride, RIDE_EYE, RIDE_TARGET)?;
    let overview = layout.view("3D", "Overview", "/world", "$origin/**")?;
    let (middle, extent) = bounds(drive);
    let height = OVERVIEW_LEAST.max(OVERVIEW_SHARE * extent);
    layout.look(&overview, [middle[0], middle[1] - 0.35 * height, middle[2] + height], middle)?;

    let mut plot_views = Vec::new();
    for (name, path, range) in plots {
        let plot = layout.view("TimeSeries", name, path, "$origin/**")?;
        layout.store.log(format!("{plot}/PlotLegend"), &PlotLegend::new().with_visible(*path == "/plots/speed"))?;
        layout
            .store
            .log(format!("{plot}/ScalarAxis"), &ScalarAxis::new().with_range(Range1D::new(range[0], range[1])))?;
        plot_views.push(plot);
    }
    let events = layout.view("TextLog", "Events", "/events", "$origin/**")?;
    let columns =
        [TextLogColumnKind::LogLevel, TextLogColumnKind::Body].map(|kind| TextLogColumn { kind, visible: true.into() });
    layout.store.log(format!("{events}/TextLogColumns"), &TextLogColumns::new().with_text_log_columns(columns))?;
    let outcome = layout.view("TextDocument", "Outcome", "/outcome", "$origin/**")?;
    let settings = layout.view("TextDocument", "Settings", "/settings", "$origin/**")?;

    let plots: Vec<(&str, f32)> = plot_views.iter().map(|plot| (plot.as_str(), 1.0)).collect();
    let (plots, _) = layout.container(ContainerKind::Vertical, &plots)?;
    let (texts, _) = layout.container(ContainerKind::Tabs, &[(&outcome, 1.0), (&settings, 1.0)])?;
    let (scene, _) = layout.container(ContainerKind::Tabs, &[(&ride, 1.0), (&overview, 1.0)])?;
    let (above, _) = layout.container(ContainerKind::Horizontal, &[(&scene, 2.6), (&plots, 1.0)])?;
    let (below, _) = layout.container(ContainerKind::Horizontal, &[(&events, 2.6), (&texts, 1.0)])?;
    let (_, root) = layout.container(ContainerKind::Vertical, &[(&above, 4.0), (&below, 1.0)])?;

    let viewport = ViewportBlueprint::new()
        .with_root_container(RootContainer(root))
        .with_auto_layout(false)
        .with_auto_views(false);
    layout.store.log("viewport", &viewport)?;
    layout.store.log("blueprint_panel", &PanelBlueprint::new().with_state(PanelState::Collapsed))?;
    layout.store.log("selection_panel", &PanelBlueprint::new().with_state(PanelState::Collapsed))?;
    let time = TimePanelBlueprint::new()
        .with_state(PanelState::Collapsed)
        .with_timeline("sim_time")
        .with_play_state(PlayState::Playing);
    layout.store.log("time_panel", &time)?;
    layout.store.activate()
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
