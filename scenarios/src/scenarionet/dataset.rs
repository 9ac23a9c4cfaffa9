//! What the converters of the data sets do with what they are given, as far as it has to be undone.

use super::layout::Layout;
use super::pickle::Value;

/// The data set that a scene was converted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dataset {
    Waymo,
    NuScenes,
    NuPlan,
    Argoverse,
    Other,
}

impl Dataset {
    /// By the scene's metadata. Scenes without any are WOMD's: those of the first converters.
    pub fn of<'p>(layout: &Layout<'p>, metadata: Option<Value<'p>>) -> Self {
        let Some(metadata) = metadata else { return Self::Waymo };
        match layout.text(metadata, &["dataset"]).unwrap_or_default() {
            "waymo" => Self::Waymo,
            // Lyft's logs are in nuScenes' form, and go through its converter.
            "nuscenes" | "lyft" => Self::NuScenes,
            "nuplan" => Self::NuPlan,
            "av2" | "argoverse" | "argoverse2" => Self::Argoverse,
            _ if layout.text(metadata, &["coordinate"]) == Some("waymo") => Self::Waymo,
            _ => Self::Other,
        }
    }

    /// Whether heights mean nothing: nuScenes' lanes have the direction in the place of z, its AV stands at 0 among agents that do not;
    /// nuPlan has none; Argoverse's agents are at 0 in a map with hills.
    pub fn is_flat(self) -> bool {
        matches!(self, Self::NuScenes | Self::NuPlan | Self::Argoverse)
    }

    /// Whether speed limits are the map's: nuScenes' converter writes 100 km/h, Argoverse's 85 mph, whatever the lane.
    pub fn has_speed_limits(self) -> bool {
        !matches!(self, Self::NuScenes | Self::Argoverse)
    }

    /// Whether outlines of the drivable area are called solid white lines `boundary_0`, `boundary_1` ...
    pub fn has_outlines(self) -> bool {
        matches!(self, Self::NuScenes | Self::NuPlan)
    }

    /// Whether a signal's place is 8 m into its lane, and not where one stops.
    pub fn has_signals_in_the_junction(self) -> bool {
        self == Self::NuPlan
    }

    /// Whether the AV has its length for its width, and stands where its rear axle is: nuScenes' converter takes Renault's measures in the
    /// wrong order, and poses as they are logged.
    pub fn has_av_by_its_rear_axle(self) -> bool {
        self == Self::NuScenes
    }

    /// Whether velocities are differences to the next step, and nothing where there is no next.
    pub fn has_forward_velocities(self) -> bool {
        self == Self::NuScenes
    }
}
