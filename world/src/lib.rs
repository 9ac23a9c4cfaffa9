//! The world that is driven in: scene, map, lane graph, route, reference line, Frenet frame, vehicle model, boxes.
//!
//! Pure: no IO, no async, no clock, no file format, no message, no metric. Every number is SI, angles are radians, headings
//! counter-clockwise from +x in the log's frame.
//!
//! | module | what |
//! | --- | --- |
//! | [`geometry`] | points, poses, angles, oriented boxes, polylines, grids that find what is near |
//! | [`scene`], [`map`], [`signal`] | one logged stretch of traffic, checked and immutable |
//! | [`scene::bridged`] | the same with its gaps filled in and marked |
//! | [`lane_graph`], [`map_matching`] | how lanes hang together; which one a pose is on |
//! | [`route`], [`reference_line`] | the lanes to follow, the smooth line along them, its window at a step |
//! | [`frenet`] | along the line and beside it |
//! | [`vehicle`] | how the AV moves: the kinematic bicycle model and its limits |
//! | [`observation`], [`plan`] | what a driver is told and what it answers |
//! | [`traffic`] | agents that react: what whoever drives them is told and answers |
//! | [`trigonometry`] | sines, cosines and tangents of many angles at once |
//! | [`pcg`] | random numbers that are the same everywhere |
//! | [`authors_frame`] | states in the AV's frame by the paper's code, to its last bit |

pub mod authors_frame;
pub mod frenet;
pub mod geometry;
pub mod lane_graph;
pub mod map;
pub mod map_matching;
pub mod observation;
pub mod pcg;
pub mod plan;
pub mod reference_line;
pub mod route;
pub mod scene;
pub mod signal;
mod spline;
pub mod traffic;
pub mod trigonometry;
pub mod vehicle;
