"""Scenes of Argoverse 2's form with content of our own, written by its own library, and what that library reads in them.

Usage: python argoverse.py FOLDER

Writes FOLDER/{train,test}/ID/scenario_ID.parquet with log_map_archive_ID.json beside it, and FOLDER/read.json: tracks, lanes, crossings and drivable
areas as `av2` reads them back. The test `argoverse` of this crate holds our reader to these numbers.

Needs av2 (pip install --no-deps av2) and what it imports: numpy pandas pyarrow scipy pyproj polars numba pillow matplotlib universal-pathlib
opencv-python-headless.
"""

import argparse
import json
import math
import pathlib
import uuid

import numpy as np
from av2.datasets.motion_forecasting.data_schema import ArgoverseScenario, ObjectState, ObjectType, Track, TrackCategory
from av2.datasets.motion_forecasting.scenario_serialization import load_argoverse_scenario_parquet, serialize_argoverse_scenario_parquet
from av2.geometry.interpolate import compute_midpoint_line
from av2.map.map_api import ArgoverseStaticMap

STEPS, OBSERVED = 110, 50
TILE, RIM, BOX, ARM = 60.0, 150.0, 12.0, 60.0
SPACING = 0.5


def place(x, y):
    """A point on a hillside, rounded as the data set's are."""
    return {"x": round(x, 2), "y": round(y, 2), "z": round(22.0 + 0.02 * x - 0.01 * y, 2)}


class Town:
    """A street from west to east with two lanes each way and one for bicycles, and a lesser one across."""

    def __init__(self):
        self.lanes, self.next = {}, 205119100

    def lane(self, left, right, marks=("NONE", "NONE"), kind="VEHICLE", inside=False):
        self.next += 1
        self.lanes[self.next] = {
            "id": self.next, "is_intersection": inside, "lane_type": kind,
            "left_lane_boundary": [place(*p) for p in left], "left_lane_mark_type": marks[0], "left_neighbor_id": None,
            "right_lane_boundary": [place(*p) for p in right], "right_lane_mark_type": marks[1], "right_neighbor_id": None,
            "predecessors": [], "successors": [], "centerline": [],
        }
        return self.next

    def chain(self, *lanes):
        for one, other in zip(lanes, lanes[1:]):
            self.lanes[one]["successors"].append(other)
            self.lanes[other]["predecessors"].append(one)

    def beside(self, left, right):
        self.lanes[left]["right_neighbor_id"] = right
        self.lanes[right]["left_neighbor_id"] = left


def street(town, begin, middle, end, to_world):
    """A straight lane from `begin` over the tiles and the junction to `end`: left, right, marks and kind in `middle`."""
    left, right, marks, kind = middle
    cuts = [cut for cut in (-RIM, -TILE, -BOX, BOX, TILE, RIM) if begin <= cut <= end]
    parts = []
    for one, other in zip(cuts, cuts[1:]):
        inside = (one, other) == (-BOX, BOX)
        line = lambda y: [to_world(one, y), to_world(0.4 * one + 0.6 * other, y), to_world(other, y)]
        parts.append(town.lane(line(left), line(right), ("NONE", "NONE") if inside else marks, kind, inside))
    town.chain(*parts)
    return parts


def arc(centre, radius, first, last, count):
    angles = np.radians(np.linspace(first, last, count))
    return [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in angles]


def build():
    town = Town()
    east, west = (lambda x, y: (x, y)), (lambda x, y: (-x, -y))
    north, south = (lambda x, y: (-y, x)), (lambda x, y: (y, -x))
    inner, outer = (0.0, -3.5, ("DOUBLE_SOLID_YELLOW", "DASHED_WHITE"), "VEHICLE"), (-3.5, -7.0, ("DASHED_WHITE", "SOLID_WHITE"), "VEHICLE")
    bike = (-7.0, -8.5, ("SOLID_WHITE", "NONE"), "BIKE")
    bus = (-3.5, -7.0, ("DASHED_WHITE", "UNKNOWN"), "BUS")
    lesser = (0.0, -3.5, ("DASH_SOLID_YELLOW", "SOLID_BLUE"), "VEHICLE")
    eastbound = [street(town, -RIM, lane, RIM, east) for lane in (inner, outer, bike)]
    westbound = [street(town, -RIM, lane, RIM, west) for lane in (inner, bus)]
    northbound, southbound = street(town, -TILE, lesser, TILE, north), street(town, -TILE, lesser, TILE, south)
    for parts in (*zip(eastbound[0], eastbound[1]), *zip(eastbound[1], eastbound[2]), *zip(westbound[0], westbound[1])):
        town.beside(*parts)
    # Oncoming traffic is a neighbour too, in this data set.
    for one, other in zip(eastbound[0], reversed(westbound[0])):
        town.lanes[one]["left_neighbor_id"], town.lanes[other]["left_neighbor_id"] = other, one
    # To the right, from the east into the south; boundaries of different lengths and numbers of points.
    turn = town.lane(arc((-12.0, -12.0), 8.5, 90, 0, 9), arc((-12.0, -12.0), 5.0, 90, 0, 5), inside=True)
    town.chain(eastbound[1][1], turn)
    town.chain(turn, southbound[2])
    wide = 8.5
    curb = lambda sx, sy: [(sx * x, sy * y) for x, y in [(TILE, wide), (14.0, wide), (12.8, 8.8), (8.8, 12.8), (3.5, 14.0), (3.5, ARM)]]
    middle = [*reversed(curb(1, 1)), *curb(1, -1), *reversed(curb(-1, -1)), *curb(-1, 1)]
    tile = lambda x1, x2: [(x1, -wide), (x2, -wide), (x2, wide), (x1, wide)]
    # One goes round the other way, and one repeats its first corner: both are found.
    areas = [middle, list(reversed(tile(TILE, RIM))), tile(-RIM, -TILE) + [(-RIM, -wide)]]
    crossing = lambda x: {"edge1": [place(x, -wide), place(x, wide)], "edge2": [place(x + 2.5, -wide), place(x + 2.5, wide)]}
    other_way = {"edge1": [place(-3.5, 13.0), place(3.5, 13.0)], "edge2": [place(3.5, 15.5), place(-3.5, 15.5)]}
    return {
        "drivable_areas": {str(k): {"id": k, "area_boundary": [place(*p) for p in area]} for k, area in enumerate(areas, 11055391)},
        "lane_segments": {str(k): lane for k, lane in town.lanes.items()},
        "pedestrian_crossings": {str(k): {**c, "id": k} for k, c in enumerate([crossing(-16.5), crossing(14.0), other_way], 2997377)},
    }


def drive(x, y, heading, speed, acceleration=0.0, steps=range(STEPS), wobble=0.0):
    """States of somebody who goes straight on."""
    states = []
    for step in steps:
        t = 0.1 * (step - OBSERVED)
        along, now = speed * t + 0.5 * acceleration * t * t, speed + acceleration * t
        turned = heading + wobble * math.sin(0.3 * step)
        # As the data set has them, within half a turn either way.
        turned = (turned + math.pi) % (2 * math.pi) - math.pi
        position = (x + along * math.cos(heading), y + along * math.sin(heading))
        states.append(ObjectState(step < OBSERVED, step, position, turned, (now * math.cos(heading), now * math.sin(heading))))
    return states


def tracks():
    focal, scored, unscored, fragment = (TrackCategory(k) for k in (3, 2, 1, 0))
    track = lambda name, kind, category, states: Track(name, states, ObjectType(kind), category)
    return [
        track("139344", "vehicle", focal, drive(20, -1.75, 0.0, 9.0, 0.2)),
        track("139399", "bus", scored, drive(30, 5.25, math.pi, 7.0, wobble=0.01)),
        track("139400", "pedestrian", unscored, drive(-15.2, 3.0, math.pi / 2, 1.2)),
        track("139402", "cyclist", unscored, drive(-5, -7.75, 0.0, 4.0)),
        track("139405", "motorcyclist", fragment, drive(1.75, -20, math.pi / 2, 6.0, steps=range(37, 45))),
        track("139407", "riderless_bicycle", unscored, drive(40, -10, 1.0, 0.0)),
        track("139410", "construction", unscored, drive(-30, 9.5, 0.0, 0.0)),
        track("139411", "static", fragment, drive(25, 11, 0.5, 0.0, steps=[3, 4, 5, 80])),
        track("139412", "background", fragment, drive(-25, 12, 0.5, 0.0, steps=range(0, 110, 2))),
        track("139413", "unknown", fragment, drive(33, -11, 0.5, 0.1, steps=range(60, 70))),
        track("AV", "vehicle", unscored, drive(-5, -1.75, 0.0, 9.5)),
    ]


def write(folder, name, all_tracks):
    name = str(uuid.uuid5(uuid.NAMESPACE_URL, name))
    begin = 315969904359876000
    stamps = np.linspace(begin, begin + (STEPS - 1) * 100_000_000, STEPS).astype(np.int64)
    scenario = ArgoverseScenario(name, stamps, all_tracks, "139344", "austin", 7, "slice")
    path = folder / name
    path.mkdir(parents=True, exist_ok=True)
    serialize_argoverse_scenario_parquet(path / f"scenario_{name}.parquet", scenario)
    (path / f"log_map_archive_{name}.json").write_text(json.dumps(build()))
    return path


def points(xyz):
    return np.asarray(xyz, dtype=float)[:, :2].tolist()


def length(line):
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def read(path):
    name = path.name
    scenario = load_argoverse_scenario_parquet(path / f"scenario_{name}.parquet")
    town = ArgoverseStaticMap.from_json(path / f"log_map_archive_{name}.json")

    def lane(segment):
        left, right = segment.left_lane_boundary.xyz, segment.right_lane_boundary.xyz
        count = math.ceil(0.5 * (length(left) + length(right)) / SPACING) + 1
        line, _ = compute_midpoint_line(left, right, count)
        return {
            "id": segment.id, "type": segment.lane_type.value, "inside": segment.is_intersection, "centerline": points(line),
            "predecessors": segment.predecessors, "successors": segment.successors,
            "left": segment.left_neighbor_id, "right": segment.right_neighbor_id,
            "left_mark": segment.left_mark_type.value, "right_mark": segment.right_mark_type.value,
        }

    state = lambda s: [s.timestep, *s.position, s.heading, *s.velocity]
    return {
        "id": scenario.scenario_id,
        "folder": str(path.relative_to(path.parents[1])),
        "focal": scenario.focal_track_id,
        "seconds": ((scenario.timestamps_ns - scenario.timestamps_ns[0]) * 1e-9).tolist(),
        "observed": sum(s.observed for t in scenario.tracks if t.track_id == "AV" for s in t.object_states),
        "tracks": [
            {"id": t.track_id, "type": t.object_type.value, "category": t.category.value, "states": [state(s) for s in t.object_states]}
            for t in scenario.tracks
        ],
        "lanes": [lane(segment) for segment in town.get_scenario_lane_segments()],
        "crossings": [points(crossing.polygon)[:4] for crossing in town.get_scenario_ped_crossings()],
        "areas": [points(area.xyz) for area in town.get_scenario_vector_drivable_areas()],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    whole = write(folder / "train", "reloop/town", tracks())
    seen = [Track(t.track_id, [s for s in t.object_states if s.observed], t.object_type, t.category) for t in tracks()]
    write(folder / "test", "reloop/withheld", [t for t in seen if t.object_states])
    (folder / "read.json").write_text(json.dumps(read(whole)))


if __name__ == "__main__":
    main()
