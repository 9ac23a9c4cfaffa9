//! A map as its file has it: `log_map_archive_ID.json`.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use world::geometry::Point3;

/// All that is read of the file. Its own centre lines are left out: they are coarser than what is made of the boundaries, and flat.
#[derive(Debug, Deserialize)]
pub(super) struct Archive {
    #[serde(default)]
    pub drivable_areas: Values<DrivableArea>,
    pub lane_segments: Values<LaneSegment>,
    #[serde(default)]
    pub pedestrian_crossings: Values<PedestrianCrossing>,
}

#[derive(Debug, Deserialize)]
pub(super) struct DrivableArea {
    pub area_boundary: Vec<Place>,
}

#[derive(Debug, Deserialize)]
pub(super) struct LaneSegment {
    pub id: i64,
    #[serde(default)]
    pub is_intersection: bool,
    #[serde(default)]
    pub lane_type: String,
    pub left_lane_boundary: Vec<Place>,
    pub right_lane_boundary: Vec<Place>,
    #[serde(default)]
    pub left_lane_mark_type: String,
    #[serde(default)]
    pub right_lane_mark_type: String,
    #[serde(default)]
    pub predecessors: Vec<i64>,
    #[serde(default)]
    pub successors: Vec<i64>,
    #[serde(default)]
    pub left_neighbor_id: Option<i64>,
    #[serde(default)]
    pub right_neighbor_id: Option<i64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct PedestrianCrossing {
    pub id: i64,
    pub edge1: Vec<Place>,
    pub edge2: Vec<Place>,
}

/// A point (m).
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Place {
    x: f64,
    y: f64,
    #[serde(default)]
    z: f64,
}

impl Place {
    pub fn point(self) -> Point3 {
        Point3::new(self.x, self.y, self.z)
    }
}

/// What an object has under its names, in the file's order. The names are ids, which the values have too.
#[derive(Debug)]
pub(super) struct Values<T>(pub Vec<T>);

impl<T> Default for Values<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Values<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Each<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Each<T> {
            type Value = Values<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of map features by their ids")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Values<T>, A::Error> {
                let mut values = Vec::new();
                while let Some((_, value)) = map.next_entry::<IgnoredAny, T>()? {
                    values.push(value);
                }
                Ok(Values(values))
            }
        }
        deserializer.deserialize_map(Each(PhantomData))
    }
}
