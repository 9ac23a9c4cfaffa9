//! The route of a scene beside the authors'.

use vectors::{Npz, NpzError, Quantity, Report, absolute, worst_deviation};
use world::geometry::{Point, angle_difference};
use world::route::{Route, RouteStyle};
use world::scene::Scene;

const LOG: Quantity = Quantity::within("logged poses", 1e-6, "abs");
const WAYPOINTS: Quantity = Quantity::within("route, waypoints", 1e-6, "m");
const POSITION: Quantity = Quantity::within("route, position", 1e-6, "m");
const HEADING: Quantity = Quantity::within("route, heading", 1e-6, "rad");
const CURVATURE: Quantity = Quantity::within("route, curvature", 1e-5, "1/m");

/// Compares the route of `scene`.
///
/// # Errors
/// [`NpzError`] where the vectors are not what they should be.
pub fn compare(scene: &Scene, npz: &Npz, report: &mut Report) -> Result<(), NpzError> {
    let log = npz.array("track_poses", &[None, Some(3)])?;
    let waypoints = npz.array("waypoints", &[None, Some(2)])?;
    let rows = npz.rows::<4>("route", &[None, Some(4)])?;
    let mut add = |quantity, deviation| report.add(0, quantity, deviation, scene.id());
    let poses = scene.av().states.iter().map(|state| state.map(|state| state.pose()));
    let poses = poses.flat_map(|pose| pose.map_or([f64::NAN; 3], |pose| [pose.x, pose.y, pose.heading]));
    add(LOG, worst_deviation(poses, log, absolute));
    let route = match Route::of_log(scene, RouteStyle::Paper) {
        Ok(route) => route,
        Err(error) => {
            report.add(0, WAYPOINTS, f64::INFINITY, format_args!("{}: {error}", scene.id()));
            return Ok(());
        }
    };
    let mut add = |quantity, deviation| report.add(0, quantity, deviation, scene.id());
    add(WAYPOINTS, worst_deviation(route.waypoints().iter().flat_map(|point| [point.x, point.y]), waypoints, absolute));
    let line = &route.line;
    if line.len() != rows.len() {
        add(POSITION, f64::INFINITY);
        return Ok(());
    }
    for (sample, [x, y, heading, curvature]) in rows.iter().enumerate() {
        add(POSITION, line.point(sample).distance(Point::new(*x, *y)));
        add(HEADING, angle_difference(*heading, line.heading[sample]).abs());
        add(CURVATURE, (line.curvature[sample] - curvature).abs());
    }
    Ok(())
}
