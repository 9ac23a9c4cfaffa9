//! The layout a viewer opens a training with: windows on the left, curves on the right.

use re_sdk_types::blueprint::archetypes::{PlotLegend, TimePanelBlueprint};
use re_sdk_types::blueprint::components::{ContainerKind, PanelState};
use rrd::{Layout, RrdError, Store};

use super::{STEP, pictures};
use crate::windows::Window;

/// Behind windows, as in the recorder's pictures.
const BACKGROUND: [u8; 4] = [13, 16, 22, 255];
/// How high above the AV the camera hangs, and how far ahead of it it looks (m): five seconds of a drive in town.
const HEIGHT: f32 = 75.0;
const AHEAD: f32 = 20.0;

/// Curves: a view's name, and the entity above all that it shows.
const PLOTS: [(&str, &str); 8] = [
    ("Loss", "/loss/total"),
    ("Terms of the loss", "/loss/terms"),
    ("Planner's errors (m)", "/errors/planner"),
    ("Predictor's errors (m)", "/errors/predictor"),
    ("Cost weights", "/cost_weights"),
    ("Learning rate", "/learning_rate"),
    ("Loss by step", "/steps/loss"),
    ("Gradient norm by step", "/steps/gradient_norm"),
];

/// Writes and activates it.
pub fn write(store: Store<'_>, windows: &[Window]) -> Result<(), RrdError> {
    let mut layout = Layout::new(store);
    let mut views = Vec::new();
    for (number, window) in windows.iter().enumerate() {
        let origin = format!("/{}", pictures::path(number));
        let view = layout.view("3D", &pictures::name(window), &origin, "$origin/**")?;
        // From behind, so that it drives up the picture: straight from above a camera has no heading.
        layout.look(&view, [AHEAD - 0.35 * HEIGHT, 0.0, HEIGHT], [AHEAD, 0.0, 0.0], BACKGROUND)?;
        views.push(view);
    }
    let mut plots = Vec::new();
    for (name, origin) in PLOTS {
        let plot = layout.view("TimeSeries", name, origin, "$origin/**")?;
        layout.set(&plot, "PlotLegend", &PlotLegend::new().with_visible(origin == "/cost_weights"))?;
        plots.push(plot);
    }
    plots.push(layout.view("TextDocument", "Settings", "/settings", "$origin/**")?);
    let grid = |layout: &mut Layout<'_>, views: &[String]| {
        let views: Vec<(&str, f32)> = views.iter().map(|view| (view.as_str(), 1.0)).collect();
        layout.container(ContainerKind::Grid, &views)
    };
    let (plots, only) = grid(&mut layout, &plots)?;
    let root = if views.is_empty() {
        only
    } else {
        let (views, _) = grid(&mut layout, &views)?;
        layout.container(ContainerKind::Horizontal, &[(&views, 1.0), (&plots, 1.2)])?.1
    };
    layout.activate(root, &TimePanelBlueprint::new().with_state(PanelState::Collapsed).with_timeline(STEP))
}
