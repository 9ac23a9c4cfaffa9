//! Plans and predictions as lines, the same for every kind of file.

use wire::proto;

use crate::origin::Origin;
use crate::outline::outline;

/// Every how many poses of 0.1 s a prediction is drawn at most.
const PREDICTION_STRIDE: usize = 5;

/// Predictions that stay within this distance (m) are not drawn: parked cars would be dots of noise.
const STILL: f64 = 0.5;

/// The plan's states at a height (m, the log's frame).
#[must_use]
pub fn plan(plan: &proto::Plan, height: f64, origin: &Origin) -> Vec<[f32; 3]> {
    let points: Vec<_> = plan.states.iter().map(|state| origin.place(state.x, state.y, height)).collect();
    outline(&points)
}

/// The trajectories of a future that lead anywhere, at a height (m, the log's frame).
#[must_use]
pub fn future(future: &proto::Future, height: f64, origin: &Origin) -> Vec<Vec<[f32; 3]>> {
    let mut points = Vec::new();
    let mut line = |trajectory: &proto::PredictedTrajectory| {
        let poses = trajectory.x.iter().zip(&trajectory.y);
        let last = poses.len().saturating_sub(1);
        let kept = poses.enumerate().filter(|(index, _)| index % PREDICTION_STRIDE == 0 || *index == last);
        points.clear();
        points.extend(kept.map(|(_, (x, y))| origin.place(*x, *y, height)));
        outline(&points)
    };
    future.trajectories.iter().filter(|trajectory| leads_anywhere(trajectory)).map(&mut line).collect()
}

fn leads_anywhere(trajectory: &proto::PredictedTrajectory) -> bool {
    let ways = [&trajectory.x, &trajectory.y].map(|values| match values[..] {
        [first, .., last] => (last - first).abs(),
        _ => 0.0,
    });
    ways[0] + ways[1] > STILL
}

/// What an agent is, in a word.
#[must_use]
pub fn kind_name(kind: proto::AgentKind) -> &'static str {
    match kind {
        proto::AgentKind::Vehicle => "vehicle",
        proto::AgentKind::Pedestrian => "pedestrian",
        proto::AgentKind::Cyclist => "cyclist",
        proto::AgentKind::Other => "other",
    }
}

/// Whether an event is as bad as its kind sounds, or only worth a look.
#[must_use]
pub fn is_grave(event: &proto::Event) -> bool {
    use proto::event::{Contact, Kind};
    let counts = matches!(
        event.kind(),
        Kind::Collision | Kind::OffRoute | Kind::OffRoad | Kind::RedLight | Kind::WrongWay | Kind::DriverFailed
    );
    // Where nobody asks how the two met, as under `paper`, nobody asks whose fault it was.
    let blameless = event.contact() != Contact::Unspecified && !event.at_fault;
    counts && !event.netted && (event.kind() != Kind::Collision || !blameless)
}

/// How an episode ended, in a sentence.
#[must_use]
pub fn end_sentence(end: &proto::EpisodeEnd) -> String {
    use proto::EndReason;
    let reason = match end.reason() {
        EndReason::Unspecified => "ended",
        EndReason::Horizon => "horizon reached",
        EndReason::LogEnd => "end of the log",
        EndReason::Collision => "collision",
        EndReason::OffRoute => "off route",
        EndReason::Undrivable => "undrivable",
        EndReason::DriverFailed => "driver failed",
        EndReason::RouteLost => "route lost",
    };
    let steps = end.steps;
    if end.detail.is_empty() {
        format!("{reason} after {steps} steps")
    } else {
        // It says when and where by itself.
        format!("{reason}: {}", end.detail)
    }
}
