#!/usr/bin/env python3
"""Holds generated scenes to Waymo's own reader.

TensorFlow reads the shards, Waymo's message classes the scenes; then each scene is held to what WOMD says of its own: counts, ids, lengths,
links that lead somewhere. A row for each thing that is wrong, a table of what was read, and exit code 1 if anything was. Not part of CI:
the package is 3 GB with its dependencies, and runs under Python 3.8 to 3.11.

    python3.11 -m venv venv && venv/bin/pip install waymo-open-dataset-tf-2-12-0
    scenarios generate --family all --count 20 --out plain && scenarios generate --family all --count 20 --out packed --gzip
    venv/bin/python scenarios/checks/womd_reader.py plain packed
"""

import argparse
import collections
import math
import os
import pathlib
import sys

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import tensorflow as tf
from waymo_open_dataset.protos import scenario_pb2

STEPS = 200
STEP_SECONDS = 0.1
KINDS = {1: "vehicles", 2: "pedestrians", 3: "cyclists", 4: "others"}
SOLID_ENOUGH = {"entries and exits": 1e-3, "velocities": 1e-2}  # m, m/s: 32-bit numbers


class Tally:
    """What is wrong, and how much was looked at."""

    def __init__(self, most):
        self.most = most
        self.wrong = collections.Counter()
        self.checked = 0

    def hold(self, scene, claim, holds, detail=""):
        self.checked += 1
        if not holds:
            self.wrong[claim] += 1
            if self.wrong[claim] <= self.most:
                print(f"{scene}: not so: {claim} {detail}".rstrip())


def records(path):
    """The records of a shard; TensorFlow verifies both checksums of each."""
    with open(path, "rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    return tf.data.TFRecordDataset(str(path), compression_type="GZIP" if packed else "").as_numpy_iterator()


def check_time(scene, tally):
    times = list(scene.timestamps_seconds)
    tally.hold(scene.scenario_id, f"there are {STEPS} steps", len(times) == STEPS, f"({len(times)})")
    steps = [after - before for before, after in zip(times, times[1:])]
    tally.hold(scene.scenario_id, "steps are 0.1 s", all(abs(step - STEP_SECONDS) < 1e-6 for step in steps))
    tally.hold(scene.scenario_id, "signals have a state for each step", len(scene.dynamic_map_states) == len(times))


def check_tracks(scene, tally):
    name = scene.scenario_id
    ids = [track.id for track in scene.tracks]
    tally.hold(name, "track ids are unique", len(set(ids)) == len(ids))
    tally.hold(name, "the AV is a track", 0 <= scene.sdc_track_index < len(scene.tracks))
    av = scene.tracks[scene.sdc_track_index]
    tally.hold(name, "the AV is a vehicle, valid at every step", av.object_type == 1 and all(s.valid for s in av.states))
    for track in scene.tracks:
        tally.hold(name, f"every track has {STEPS} states", len(track.states) == STEPS, f"(track {track.id}: {len(track.states)})")
        tally.hold(name, "every track has a kind", track.object_type in KINDS, f"(track {track.id})")
        valid = [state.valid for state in track.states]
        tally.hold(name, "every track is somewhere", any(valid), f"(track {track.id})")
        for before, state in zip(track.states, track.states[1:]):
            if not state.valid:
                continue
            numbers = (state.center_x, state.center_y, state.center_z, state.heading)
            tally.hold(name, "valid states are finite", all(map(math.isfinite, numbers)), f"(track {track.id})")
            tally.hold(name, "boxes have a size", min(state.length, state.width, state.height) > 0, f"(track {track.id})")
            if before.valid:
                off_x = (state.center_x - before.center_x) / STEP_SECONDS - state.velocity_x
                off_y = (state.center_y - before.center_y) / STEP_SECONDS - state.velocity_y
                fits = math.hypot(off_x, off_y) < SOLID_ENOUGH["velocities"]
                tally.hold(name, "velocities are backward differences", fits, f"(track {track.id})")


def check_map(scene, tally):
    name = scene.scenario_id
    features = {feature.id: feature for feature in scene.map_features}
    tally.hold(name, "map ids are unique", len(features) == len(scene.map_features))
    kinds = {id: feature.WhichOneof("feature_data") for id, feature in features.items()}
    tally.hold(name, "every feature is something", all(kinds.values()))
    lanes = {id: feature.lane for id, feature in features.items() if kinds[id] == "lane"}
    tally.hold(name, "there are lanes", bool(lanes))
    for id, lane in lanes.items():
        check_lane(name, id, lane, lanes, kinds, tally)
    for id, feature in features.items():
        data = getattr(feature, kinds[id])
        if kinds[id] in ("road_line", "road_edge"):
            tally.hold(name, "lines and edges have two points", len(data.polyline) >= 2, f"({id})")
        elif kinds[id] == "stop_sign":
            tally.hold(name, "stop signs are for lanes", data.lane and all(lane in lanes for lane in data.lane), f"({id})")
        elif kinds[id] in ("crosswalk", "speed_bump", "driveway"):
            tally.hold(name, "areas have three corners", len(data.polygon) >= 3, f"({id})")
    for step, state in enumerate(scene.dynamic_map_states):
        shown = [signal.lane for signal in state.lane_states]
        tally.hold(name, "no lane has two signals", len(set(shown)) == len(shown), f"(step {step})")
        for signal in state.lane_states:
            tally.hold(name, "signals are for lanes", signal.lane in lanes, f"({signal.lane} at step {step})")
            if signal.lane in lanes:
                start = lanes[signal.lane].polyline[0]
                there = math.hypot(start.x - signal.stop_point.x, start.y - signal.stop_point.y) < 1e-3
                tally.hold(name, "signals stop where their lane begins", there, f"({signal.lane} at step {step})")


def check_lane(name, id, lane, lanes, kinds, tally):
    points = lane.polyline
    tally.hold(name, "lanes have two points", len(points) >= 2, f"({id})")
    for before, after in zip(points, points[1:]):
        tally.hold(name, "points lie half a metre apart", math.dist((before.x, before.y), (after.x, after.y)) < 0.56, f"({id})")
    for other in lane.exit_lanes:
        tally.hold(name, "exits resolve", other in lanes, f"({id} to {other})")
        if other in lanes:
            tally.hold(name, "links are mutual", id in lanes[other].entry_lanes, f"({id} to {other})")
            end, start = points[-1], lanes[other].polyline[0]
            apart = math.dist((end.x, end.y, end.z), (start.x, start.y, start.z))
            tally.hold(name, "a lane begins where its entry ends", apart < SOLID_ENOUGH["entries and exits"], f"({id} to {other}: {apart:.3f} m)")
    for other in lane.entry_lanes:
        tally.hold(name, "entries resolve", other in lanes, f"({id} from {other})")
        if other in lanes:
            tally.hold(name, "links are mutual", id in lanes[other].exit_lanes, f"({id} from {other})")
    for neighbor in [*lane.left_neighbors, *lane.right_neighbors]:
        other = lanes.get(neighbor.feature_id)
        tally.hold(name, "neighbours resolve", other is not None, f"({id} beside {neighbor.feature_id})")
        if other is not None:
            own = 0 <= neighbor.self_start_index <= neighbor.self_end_index < len(points)
            theirs = 0 <= neighbor.neighbor_start_index <= neighbor.neighbor_end_index < len(other.polyline)
            tally.hold(name, "neighbours' indices lie on their lanes", own and theirs, f"({id} beside {neighbor.feature_id})")
    for boundary in [*lane.left_boundaries, *lane.right_boundaries]:
        known = kinds.get(boundary.boundary_feature_id) in ("road_line", "road_edge")
        tally.hold(name, "boundaries resolve", known, f"({id} at {boundary.boundary_feature_id})")
        inside = 0 <= boundary.lane_start_index <= boundary.lane_end_index < len(points)
        tally.hold(name, "boundaries' indices lie on their lane", inside, f"({id})")


def check_scene(payload, tally):
    scene = scenario_pb2.Scenario()
    scene.ParseFromString(payload)
    known = scenario_pb2.Scenario()
    known.CopyFrom(scene)
    known.DiscardUnknownFields()
    tally.hold(scene.scenario_id, "Waymo's definition knows every field", known.ByteSize() == scene.ByteSize())
    tally.hold(scene.scenario_id, "every message is whole", scene.IsInitialized())
    check_time(scene, tally)
    check_tracks(scene, tally)
    check_map(scene, tally)
    return scene


def wanted(folder):
    """The ids that the folder's settings promise; none where there are no settings."""
    try:
        import tomllib

        settings = tomllib.loads((folder / "generated.toml").read_text())
    except (ImportError, FileNotFoundError):
        return None
    return [f"{family}-{settings['seed']}-{index}" for family in settings["families"] for index in range(settings["count"])]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=pathlib.Path, help="what scenarios generate wrote")
    parser.add_argument("--most", type=int, default=3, help="examples shown of each thing that is wrong")
    arguments = parser.parse_args()
    tally = Tally(arguments.most)
    sums = collections.defaultdict(collections.Counter)
    for folder in arguments.folders:
        ids = []
        for shard in sorted(path for path in folder.iterdir() if ".tfrecord" in path.name and not path.name.endswith(".partial")):
            for payload in records(shard):
                scene = check_scene(payload, tally)
                ids.append(scene.scenario_id)
                row = sums[shard.name.split(".tfrecord")[0].rsplit("-", 1)[0]]
                row["scenes"] += 1
                row["bytes"] += len(payload)
                row["lanes"] += sum(feature.WhichOneof("feature_data") == "lane" for feature in scene.map_features)
                row["signals"] += len({signal.lane for state in scene.dynamic_map_states for signal in state.lane_states})
                row.update(KINDS.get(track.object_type, "others") for track in scene.tracks)
        promised = wanted(folder)
        tally.hold(folder, "the scenes are those that were asked for", promised is None or sorted(promised) == sorted(ids))
    columns = ["vehicles", "pedestrians", "cyclists", "lanes", "signals"]
    print("in the mean".ljust(24), "scenes", *(column.rjust(11) for column in columns), "MB".rjust(6))
    for family, row in sums.items():
        means = (f"{row[column] / row['scenes']:11.1f}" for column in columns)
        print(family.ljust(24), f"{row['scenes']:6}", *means, f"{row['bytes'] / row['scenes'] / 1e6:6.2f}")
    scenes, wrong = sum(row["scenes"] for row in sums.values()), sum(tally.wrong.values())
    print(f"{scenes} scenes read by TensorFlow {tf.__version__} and Waymo's Scenario: {tally.checked} claims, {wrong} do not hold")
    for claim, count in tally.wrong.most_common():
        print(f"{count:8} {claim}")
    sys.exit(1 if wrong or not scenes else 0)


if __name__ == "__main__":
    main()
