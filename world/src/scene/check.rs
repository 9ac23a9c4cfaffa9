//! The one check that every scene passes: parts in, a scene that holds what its type promises out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{
    AgentState, Finding, NO_SIZE, Scene, SceneError, SceneId, SceneParts, Steps, TrackId, is_in_range, is_size,
};
use crate::geometry::Point3;
use crate::map::{Lane, MapId};

impl SceneParts {
    /// The scene, and what was found odd and mended.
    ///
    /// # Errors
    /// [`SceneError`] where nothing sensible can be made of it.
    pub fn check(mut self) -> Result<(Scene, Vec<Finding>), SceneError> {
        let id = SceneId::new(std::mem::take(&mut self.id))?;
        let mut findings = Vec::new();
        self.check_time(&mut findings)?;
        let without_size = self.check_tracks(&mut findings)?;
        self.check_map(&mut findings);
        self.check_signals(&mut findings)?;
        self.check_tasks(&mut findings);
        let map = Arc::new(std::mem::take(&mut self.map));
        Ok((Scene { id, parts: self, map, without_size }, findings))
    }

    fn check_time(&mut self, findings: &mut Vec<Finding>) -> Result<(), SceneError> {
        if self.timestamps.is_empty() {
            return Err(SceneError::NoSteps);
        }
        if let Some(step) = self.timestamps.iter().position(|t| !t.is_finite()) {
            return Err(SceneError::Timestamp { step });
        }
        if let Some(step) = self.timestamps.windows(2).position(|pair| pair[1] < pair[0]) {
            findings.push(Finding::TimeGoesBack { step: step + 1 });
        }
        if self.current_time_index >= self.timestamps.len() {
            findings.push(Finding::CurrentTimeIndex { index: self.current_time_index as i64 });
            self.current_time_index = self.timestamps.len() - 1;
        }
        Ok(())
    }

    /// Answers the states that have a place but no size.
    fn check_tracks(
        &mut self,
        findings: &mut Vec<Finding>,
    ) -> Result<BTreeMap<(usize, usize), AgentState>, SceneError> {
        let steps = self.timestamps.len();
        if self.tracks.is_empty() {
            return Err(SceneError::NoTracks);
        }
        if self.av_index >= self.tracks.len() {
            return Err(SceneError::AvIndex { index: self.av_index as i64, tracks: self.tracks.len() });
        }
        let (mut seen, mut without_size) = (BTreeSet::new(), BTreeMap::new());
        for (index, track) in self.tracks.iter_mut().enumerate() {
            if !seen.insert(track.id) {
                return Err(SceneError::DuplicateTrack(track.id));
            }
            if track.states.len() != steps {
                return Err(SceneError::TrackLength { track: track.id, states: track.states.len(), steps });
            }
            let mut bad = Steps::default();
            for (step, slot) in track.states.iter_mut().enumerate() {
                let Some(mut state) = slot.take_if(|state| !state.has_place() || !state.has_size()) else { continue };
                if state.has_place() {
                    let sizes = [&mut state.length, &mut state.width, &mut state.height];
                    sizes.into_iter().filter(|size| !is_size(**size)).for_each(|size| *size = NO_SIZE);
                    without_size.insert((index, step), state);
                } else {
                    bad.push(step);
                }
            }
            if !bad.is_empty() {
                findings.push(Finding::BadState { track: track.id, steps: bad });
            }
            let nowhere = track.states.iter().all(Option::is_none);
            if nowhere && without_size.range((index, 0)..(index + 1, 0)).next().is_none() {
                findings.push(Finding::EmptyTrack { track: track.id });
            }
        }
        let av = &self.tracks[self.av_index];
        let missing = av.states.iter().filter(|state| state.is_none()).count();
        if missing == steps {
            return Err(SceneError::AvNeverValid(av.id));
        }
        if let Some(first) = av.states.iter().position(Option::is_none) {
            findings.push(Finding::AvGaps { missing, steps, first });
        }
        Ok(without_size)
    }

    fn check_map(&mut self, findings: &mut Vec<Finding>) {
        let map = &mut self.map;
        let mut seen = BTreeSet::new();
        let mut keep = |id: MapId, points: &[Point3]| {
            if points.is_empty() || !points.iter().all(|p| [p.x, p.y, p.z].into_iter().all(is_in_range)) {
                findings.push(Finding::BadFeature(id));
                return false;
            }
            if !seen.insert(id) {
                findings.push(Finding::DuplicateFeature(id));
                return false;
            }
            true
        };
        map.lanes.retain(|lane| keep(lane.id, &lane.centerline));
        map.road_lines.retain(|line| keep(line.id, &line.polyline));
        map.road_edges.retain(|edge| keep(edge.id, &edge.polyline));
        map.stop_signs.retain(|sign| keep(sign.id, &[sign.position]));
        map.crosswalks.retain(|area| keep(area.id, &area.polygon));
        map.speed_bumps.retain(|area| keep(area.id, &area.polygon));
        map.driveways.retain(|area| keep(area.id, &area.polygon));

        let lanes: BTreeMap<MapId, usize> = map.lanes.iter().map(|lane| (lane.id, lane.centerline.len())).collect();
        let edges = map.road_edges.iter().map(|edge| edge.id);
        let bounds: BTreeSet<MapId> = map.road_lines.iter().map(|line| line.id).chain(edges).collect();
        for lane in &mut map.lanes {
            check_lane(lane, &lanes, &bounds, findings);
        }
        let entries: BTreeSet<(MapId, MapId)> =
            map.lanes.iter().flat_map(|lane| lane.entries.iter().map(|entry| (*entry, lane.id))).collect();
        for lane in &map.lanes {
            let one_way = lane.exits.iter().filter(|exit| !entries.contains(&(lane.id, **exit)));
            findings.extend(one_way.map(|exit| Finding::OneWayLink { from: lane.id, to: *exit }));
        }
        for sign in &mut map.stop_signs {
            let id = sign.id;
            retain_known(&mut sign.lanes, &lanes, |missing| {
                findings.push(Finding::DanglingStopSign { sign: id, missing });
            });
        }
    }

    fn check_signals(&mut self, findings: &mut Vec<Finding>) -> Result<(), SceneError> {
        let steps = self.timestamps.len();
        if self.signals.is_empty() {
            self.signals = vec![Vec::new(); steps];
        }
        if self.signals.len() != steps {
            return Err(SceneError::SignalLength { signals: self.signals.len(), steps });
        }
        let lanes: BTreeSet<MapId> = self.map.lanes.iter().map(|lane| lane.id).collect();
        let mut unknown_lanes = BTreeSet::new();
        let (mut bad, mut repeated) = (BTreeMap::<MapId, Steps>::new(), BTreeMap::<MapId, Steps>::new());
        for (step, signals) in self.signals.iter_mut().enumerate() {
            let mut seen = BTreeSet::new();
            signals.retain(|signal| {
                let point = signal.stop_point;
                let usable = [point.x, point.y, point.z].into_iter().all(is_in_range);
                let first = usable && seen.insert(signal.lane);
                if !usable {
                    bad.entry(signal.lane).or_default().push(step);
                } else if !first {
                    repeated.entry(signal.lane).or_default().push(step);
                }
                first
            });
            for signal in signals.iter().filter(|signal| !lanes.contains(&signal.lane)) {
                if unknown_lanes.insert(signal.lane) {
                    findings.push(Finding::SignalWithoutLane { lane: signal.lane, step });
                }
            }
        }
        findings.extend(bad.into_iter().map(|(lane, steps)| Finding::BadSignal { lane, steps }));
        findings.extend(repeated.into_iter().map(|(lane, steps)| Finding::DuplicateSignal { lane, steps }));
        Ok(())
    }

    fn check_tasks(&mut self, findings: &mut Vec<Finding>) {
        let ids: BTreeSet<TrackId> = self.tracks.iter().map(|track| track.id).collect();
        self.objects_of_interest.retain(|id| {
            let known = ids.contains(id);
            if !known {
                findings.push(Finding::UnknownObjectOfInterest(*id));
            }
            known
        });
        self.tracks_to_predict.retain(|task| {
            let known = task.track_index < self.tracks.len();
            if !known {
                findings.push(Finding::UnknownTrackToPredict { index: task.track_index as i64 });
            }
            known
        });
    }
}

/// `lanes`: for each lane its number of points; `bounds`: all lines and edges.
fn check_lane(lane: &mut Lane, lanes: &BTreeMap<MapId, usize>, bounds: &BTreeSet<MapId>, findings: &mut Vec<Finding>) {
    let id = lane.id;
    if lane.centerline.len() == 1 {
        findings.push(Finding::OnePointLane(id));
    }
    if !(0.0..=200.0).contains(&lane.speed_limit_mph) {
        findings.push(Finding::BadSpeedLimit { lane: id, text: lane.speed_limit_mph.to_string() });
        lane.speed_limit_mph = 0.0;
    }
    for links in [&mut lane.entries, &mut lane.exits] {
        retain_known(links, lanes, |missing| findings.push(Finding::DanglingLane { lane: id, missing }));
    }
    let points = lane.centerline.len();
    let mut check_boundaries = |segments: &mut Vec<crate::map::BoundarySegment>| {
        segments.retain(|segment| {
            let none = segment.feature == MapId(0) && !bounds.contains(&MapId(0));
            let in_range = |index: i32| usize::try_from(index).is_ok_and(|index| index < points);
            let known = none || bounds.contains(&segment.feature);
            let whole = known && in_range(segment.lane_start_index) && in_range(segment.lane_end_index);
            if !whole {
                findings.push(Finding::DanglingBoundary { lane: id, missing: segment.feature });
            }
            whole
        });
    };
    check_boundaries(&mut lane.left_boundaries);
    check_boundaries(&mut lane.right_boundaries);
    for neighbor in lane.left_neighbors.iter_mut().chain(&mut lane.right_neighbors) {
        check_boundaries(&mut neighbor.boundaries);
    }
    for neighbors in [&mut lane.left_neighbors, &mut lane.right_neighbors] {
        neighbors.retain(|neighbor| {
            let Some(neighbor_points) = lanes.get(&neighbor.lane) else {
                findings.push(Finding::DanglingLane { lane: id, missing: neighbor.lane });
                return false;
            };
            let in_range = |index: i32, points: usize| usize::try_from(index).is_ok_and(|index| index < points);
            let whole = in_range(neighbor.self_start_index, points)
                && in_range(neighbor.self_end_index, points)
                && in_range(neighbor.neighbor_start_index, *neighbor_points)
                && in_range(neighbor.neighbor_end_index, *neighbor_points);
            if !whole {
                findings.push(Finding::BadNeighbor { lane: id, neighbor: neighbor.lane });
            }
            whole
        });
    }
}

fn retain_known(links: &mut Vec<MapId>, known: &BTreeMap<MapId, usize>, mut missing: impl FnMut(MapId)) {
    links.retain(|link| {
        let is_known = known.contains_key(link);
        if !is_known {
            missing(*link);
        }
        is_known
    });
}

#[cfg(test)]
mod tests;
