//! The layout a viewer opens a recording with: the scene large on the left, plots to its right, the log and texts below.

use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, PlotLegend, TimePanelBlueprint,
    ViewBlueprint, ViewContents, ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    BackgroundKind, ColumnShare, ContainerKind, Eye3DKind, IncludedContent, PanelState, PlayState, RootContainer, RowShare,
};
use re_sdk_types::datatypes::Uuid;

use super::columns::color;
use super::store::{RrdError, Store};
use crate::origin::Origin;
use crate::palette;

/// Behind and above the AV's start, and what it looks at from there (m, in the AV's direction and up).
const EYE_BACK: f64 = 32.0;
const EYE_UP: f64 = 34.0;
const LOOK_AHEAD: f64 = 14.0;

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

    /// A view of `class` on everything below `origin`; returns its path.
    fn view(&mut self, class: &str, name: &str, origin: &str) -> Result<String, RrdError> {
        let path = format!("view/{}", self.next_id());
        self.store.log(format!("{path}/ViewContents"), &ViewContents::new(["$origin/**"]))?;
        let view = ViewBlueprint::new(class).with_display_name(name).with_space_origin(origin);
        self.store.log(path.as_str(), &view)?;
        Ok(path)
    }

    /// A container of views and containers, with the share that each gets; returns its path and id.
    fn container(&mut self, kind: ContainerKind, parts: &[(&str, f32)]) -> Result<(String, Uuid), RrdError> {
        let id = self.next_id();
        let path = format!("container/{id}");
        let contents = parts.iter().map(|(part, _)| IncludedContent((*part).into()));
        let shares = parts.iter().map(|(_, share)| *share);
        let mut container = ContainerBlueprint::new(kind).with_contents(contents);
        match kind {
            ContainerKind::Horizontal => container = container.with_col_shares(shares.map(|share| ColumnShare(share.into()))),
            ContainerKind::Vertical => container = container.with_row_shares(shares.map(|share| RowShare(share.into()))),
            ContainerKind::Grid | ContainerKind::Tabs => {}
        }
        self.store.log(path.as_str(), &container)?;
        Ok((path, id))
    }
}

/// Writes and activates the layout; the camera begins behind the AV's start.
///
/// # Errors
/// [`RrdError`].
pub fn write(store: Store<'_>, origin: &Origin) -> Result<(), RrdError> {
    let mut layout = Layout { store, count: 0 };

    let scene = layout.view("3D", "Scene", "/world")?;
    let (sine, cosine) = libm::sincos(origin.heading);
    let ahead = |distance: f64, up: f64| [(distance * cosine) as f32, (distance * sine) as f32, up as f32];
    let eye = EyeControls3D::new()
        .with_kind(Eye3DKind::Orbital)
        .with_position(ahead(-EYE_BACK, EYE_UP))
        .with_look_target(ahead(LOOK_AHEAD, 0.0))
        .with_eye_up([0.0, 0.0, 1.0])
        .with_tracking_entity("/world/av");
    layout.store.log(format!("{scene}/EyeControls3D"), &eye)?;
    let background = Background::new(BackgroundKind::SolidColor).with_color(color(palette::BACKGROUND));
    layout.store.log(format!("{scene}/Background"), &background)?;
    layout.store.log(format!("{scene}/LineGrid3D"), &LineGrid3D::new().with_visible(false))?;

    let mut plots = Vec::new();
    for (name, path) in [
        ("Speed (m/s)", "/plots/speed"),
        ("Acceleration (m/s²)", "/plots/acceleration"),
        ("Steering (rad)", "/plots/steering"),
        ("Time to collision (s)", "/plots/time_to_collision"),
    ] {
        let plot = layout.view("TimeSeries", name, path)?;
        layout.store.log(format!("{plot}/PlotLegend"), &PlotLegend::new().with_visible(path == "/plots/speed"))?;
        plots.push(plot);
    }
    let events = layout.view("TextLog", "Events", "/events")?;
    let outcome = layout.view("TextDocument", "Outcome", "/outcome")?;
    let settings = layout.view("TextDocument", "Settings", "/settings")?;

    let plots: Vec<(&str, f32)> = plots.iter().map(|plot| (plot.as_str(), 1.0)).collect();
    let (plots, _) = layout.container(ContainerKind::Vertical, &plots)?;
    let (texts, _) = layout.container(ContainerKind::Tabs, &[(&outcome, 1.0), (&settings, 1.0)])?;
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
