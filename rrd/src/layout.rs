//! The layout a viewer opens a recording with: views and containers with counted names.

use re_sdk_types::AsComponents;
use re_sdk_types::blueprint::archetypes::{
    Background, ContainerBlueprint, EyeControls3D, LineGrid3D, PanelBlueprint, TimePanelBlueprint, ViewBlueprint,
    ViewContents, ViewportBlueprint,
};
use re_sdk_types::blueprint::components::{
    BackgroundKind, ColumnShare, ContainerKind, Eye3DKind, IncludedContent, PanelState, RootContainer, RowShare,
};
use re_sdk_types::datatypes::Uuid;

use crate::color;
use crate::store::{RrdError, Store};

/// Writes a blueprint.
pub struct Layout<'a> {
    store: Store<'a>,
    count: u128,
}

impl<'a> Layout<'a> {
    /// Begins in the store of a blueprint.
    #[must_use]
    pub fn new(store: Store<'a>) -> Self {
        Self { store, count: 0 }
    }

    fn next_id(&mut self) -> Uuid {
        self.count += 1;
        Uuid { bytes: self.count.to_be_bytes() }
    }

    /// A view of `class` on `contents` in the frame of `origin`; returns its path.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn view(&mut self, class: &str, name: &str, origin: &str, contents: &str) -> Result<String, RrdError> {
        let path = format!("view/{}", self.next_id());
        self.store.log(format!("{path}/ViewContents"), &ViewContents::new([contents]))?;
        let view = ViewBlueprint::new(class).with_display_name(name).with_space_origin(origin);
        self.store.log(path.as_str(), &view)?;
        Ok(path)
    }

    /// Sets a property of a view.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn set(&mut self, view: &str, property: &str, what: &dyn AsComponents) -> Result<(), RrdError> {
        self.store.log(format!("{view}/{property}"), what)
    }

    /// Sets the camera, and the ground's colour, of a spatial view.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn look(&mut self, view: &str, from: [f32; 3], to: [f32; 3], background: [u8; 4]) -> Result<(), RrdError> {
        let eye = EyeControls3D::new().with_kind(Eye3DKind::Orbital).with_position(from).with_look_target(to);
        self.set(view, "EyeControls3D", &eye.with_eye_up([0.0, 0.0, 1.0]))?;
        let background = Background::new(BackgroundKind::SolidColor).with_color(color(background));
        self.set(view, "Background", &background)?;
        self.set(view, "LineGrid3D", &LineGrid3D::new().with_visible(false))
    }

    /// A container of views and containers, with the share that each gets; returns its path and id.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn container(&mut self, kind: ContainerKind, parts: &[(&str, f32)]) -> Result<(String, Uuid), RrdError> {
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

    /// Ends it: `root` is the container of all, and panels are folded.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn activate(mut self, root: Uuid, time: &TimePanelBlueprint) -> Result<(), RrdError> {
        let viewport = ViewportBlueprint::new()
            .with_root_container(RootContainer(root))
            .with_auto_layout(false)
            .with_auto_views(false);
        self.store.log("viewport", &viewport)?;
        self.store.log("blueprint_panel", &PanelBlueprint::new().with_state(PanelState::Collapsed))?;
        self.store.log("selection_panel", &PanelBlueprint::new().with_state(PanelState::Collapsed))?;
        self.store.log("time_panel", time)?;
        self.store.activate()
    }
}
