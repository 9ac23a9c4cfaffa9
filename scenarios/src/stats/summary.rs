//! A row of figures for each scene.

use world::scene::{Scene, SceneId};

use super::quantity::{Quantity, Share};
use super::samples::Samples;

/// What a column holds.
#[derive(Clone, Copy, Debug)]
enum Figure {
    Steps,
    Number(Quantity),
    Median(Quantity),
    MedianOfAbsolute(Quantity),
    Mean(Quantity),
    Count(Quantity),
    Part(Share),
}

/// The columns of a row, by name.
pub const COLUMNS: &[Column] = &[
    column("steps", Figure::Steps),
    column("vehicles", Figure::Number(Quantity::Vehicles)),
    column("pedestrians", Figure::Number(Quantity::Pedestrians)),
    column("cyclists", Figure::Number(Quantity::Cyclists)),
    column("share_valid_mean", Figure::Mean(Quantity::ShareValid)),
    column("tracks_valid_median", Figure::Median(Quantity::TracksValid)),
    column("vehicles_within_50_m_median", Figure::Median(Quantity::VehiclesWithin50)),
    column("moving_vehicles_within_50_m_median", Figure::Median(Quantity::MovingWithin50)),
    column("pedestrians_within_50_m_mean", Figure::Mean(Quantity::PedestriansWithin50)),
    column("vehicle_length_median_m", Figure::Median(Quantity::VehicleLength)),
    column("vehicle_width_median_m", Figure::Median(Quantity::VehicleWidth)),
    column("share_parked", Figure::Part(Share::Parked)),
    column("share_on_lane", Figure::Part(Share::OnLane)),
    column("parked_to_lane_median_m", Figure::Median(Quantity::ParkedToLane)),
    column("moving_to_lane_median_m", Figure::Median(Quantity::MovingToLane)),
    column("vehicle_speed_median_mps", Figure::Median(Quantity::VehicleSpeed)),
    column("vehicle_abs_acceleration_median_mps2", Figure::MedianOfAbsolute(Quantity::VehicleAcceleration)),
    column("pedestrian_speed_median_mps", Figure::Median(Quantity::PedestrianSpeed)),
    column("cyclist_speed_median_mps", Figure::Median(Quantity::CyclistSpeed)),
    column("gap_median_m", Figure::Median(Quantity::GapBothMoving)),
    column("headway_median_s", Figure::Median(Quantity::HeadwayBothMoving)),
    column("gaps", Figure::Count(Quantity::GapBothMoving)),
    column("queue_gap_median_m", Figure::Median(Quantity::QueueGap)),
    column("av_gap_median_m", Figure::Median(Quantity::AvGap)),
    column("av_path_m", Figure::Number(Quantity::AvPath)),
    column("av_max_speed_mps", Figure::Number(Quantity::AvMaxSpeed)),
    column("av_share_standing", Figure::Number(Quantity::AvStanding)),
    column("av_abs_acceleration_mean_mps2", Figure::Number(Quantity::AvMeanAcceleration)),
    column("av_abs_jerk_mean_mps3", Figure::Number(Quantity::AvMeanJerk)),
    column("av_abs_lateral_mean_mps2", Figure::Number(Quantity::AvMeanLateral)),
    column("lanes", Figure::Number(Quantity::LanesPerScene)),
    column("lane_length_median_m", Figure::Median(Quantity::LaneLength)),
    column("lane_width_median_m", Figure::Median(Quantity::LaneWidth)),
    column("largest_curvature_median_per_m", Figure::Median(Quantity::LargestCurvature)),
    column("exits_mean", Figure::Mean(Quantity::Exits)),
    column("speed_limit_median_mph", Figure::Median(Quantity::SpeedLimit)),
    column("share_interpolating", Figure::Part(Share::Interpolating)),
    column("share_bike_lanes", Figure::Part(Share::BikeLane)),
    column("signal_lanes", Figure::Number(Quantity::SignalLanes)),
    column("share_signal_steps", Figure::Number(Quantity::SignalSteps)),
    column("share_red_of_known", Figure::Part(Share::RedOfKnown)),
    column("crosswalks", Figure::Number(Quantity::Crosswalks)),
    column("stop_signs", Figure::Number(Quantity::StopSigns)),
    column("speed_bumps", Figure::Number(Quantity::SpeedBumps)),
    column("driveways", Figure::Number(Quantity::Driveways)),
    column("road_lines", Figure::Number(Quantity::RoadLines)),
    column("road_edges", Figure::Number(Quantity::RoadEdges)),
];

/// A column of the rows: its name, with the unit.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Name, with the unit.
    pub name: &'static str,
    figure: Figure,
}

const fn column(name: &'static str, figure: Figure) -> Column {
    Column { name, figure }
}

/// The figures of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The scene.
    pub scene: SceneId,
    /// A value for each of [`COLUMNS`]; none where there is nothing to measure.
    pub values: Vec<Option<f64>>,
}

impl Summary {
    /// The row of `scene`, whose samples these are.
    #[must_use]
    pub fn new(scene: &Scene, samples: &Samples) -> Self {
        let value = |column: &Column| match column.figure {
            Figure::Steps => Some(scene.steps() as f64),
            // One sample a scene, so the mean is that one.
            Figure::Number(quantity) | Figure::Mean(quantity) => samples.mean(quantity),
            Figure::Median(quantity) => samples.percentile(quantity, 50.0),
            Figure::MedianOfAbsolute(quantity) => {
                let absolute: Vec<f32> = samples.of(quantity).iter().map(|value| value.abs()).collect();
                super::samples::percentile(&super::samples::sorted(&absolute), 50.0)
            }
            Figure::Count(quantity) => Some(samples.of(quantity).len() as f64),
            Figure::Part(share) => samples.count(share).share(),
        };
        Self { scene: scene.id().clone(), values: COLUMNS.iter().map(value).collect() }
    }
}
