#!/usr/bin/env python3
"""Vectors of the `paper` protocol, by an implementation of their own.

Reads scenes (WOMD TFRecord files, as `scenarios export` writes them), drives each in the authors' simulator as
`closed-loop.md` specifies it, by the policies `human` and `constant-velocity`, and writes what happened in the format that
`sim verify` reads. It shares nothing with the Rust code but that specification: where the two agree, both follow it.

    paper_vectors.py --out FOLDER SCENE.tfrecord ...     write vectors
    paper_vectors.py --check FOLDER SCENE.tfrecord ...   compare with the vectors in FOLDER, print the worst deviations

Needs numpy. Section numbers are those of the specification.
"""

import argparse
import json
import struct
import sys
from pathlib import Path

import numpy as np

START, LAST_TIMESTEP = 19, 169
NEIGHBORS = 10
RED = (1, 4, 7)  # arrow stop, stop, flashing stop
SINGLE = np.float32


# --- Scenes -------------------------------------------------------------------------------------------------------------


def varint(data, at):
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


def fields(data):
    """The fields of a protobuf message: number and value (an int, or bytes to be read as what the field is)."""
    at = 0
    while at < len(data):
        key, at = varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == 0:
            value, at = varint(data, at)
            value -= (value >> 63) << 64
        else:
            size = {1: 8, 5: 4}.get(kind)
            if size is None:
                size, at = varint(data, at)
            value, at = data[at : at + size], at + size
        yield number, value


def message(data):
    """A message whose fields come once each; the last one counts."""
    return dict(fields(data))


def double(value):
    return struct.unpack("<d", value)[0] if value else 0.0


def single(value):
    return struct.unpack("<f", value)[0] if value else 0.0


def point(data):
    found = message(data)
    return [double(found.get(1)), double(found.get(2))]


def integers(found, number):
    """A repeated integer field, packed or not."""
    for known, value in found:
        if known == number:
            if isinstance(value, int):
                yield value
                continue
            at = 0
            while at < len(value):
                one, at = varint(value, at)
                yield one - ((one >> 63) << 64)


class Scene:
    """Tracks as stored (x, y, heading, vx, vy, length, width, height), validity, lanes, crosswalks, signals."""

    def __init__(self, payload):
        tracks, signals, self.lanes, self.crosswalks, self.dropped = [], [], {}, [], 0
        self.av = 0
        for number, value in fields(payload):
            if number == 2:
                tracks.append([message(v) for n, v in fields(value) if n == 3])
            elif number == 5:
                self.id = value.decode()
            elif number == 6:
                self.av = value
            elif number == 7:
                signals.append([message(v) for n, v in fields(value) if n == 1])
            elif number == 8:
                self.add_feature(message(value))
        numbers = lambda s: [double(s.get(2)), double(s.get(3)), *(single(s.get(f)) for f in (8, 9, 10, 5, 6, 7))]
        self.tracks = np.array([[numbers(state) for state in track] for track in tracks])
        self.valid = np.array([[bool(state.get(11)) for state in track] for track in tracks])
        self.red_points = [
            [point(s[3]) if 3 in s else [0.0, 0.0] for s in states if s.get(2, 0) in RED] for states in signals
        ]
        self.length = self.tracks.shape[1]

    def add_feature(self, feature):
        identity = feature.get(1, 0)
        if 3 in feature:
            lane = list(fields(feature[3]))
            points = np.array([point(v) for n, v in lane if n == 8]).reshape(-1, 2)
            limit = next((double(v) for n, v in lane if n == 1), 0.0)
            self.lanes[identity] = (points, limit, list(integers(lane, 9)), list(integers(lane, 10)))
        elif 8 in feature:
            self.crosswalks.append(np.array([point(v) for n, v in fields(feature[8]) if n == 1]))
        elif 10 in feature:
            self.dropped += 1


def scenes(path):
    data = Path(path).read_bytes()
    at = 0
    while at < len(data):
        size = struct.unpack_from("<Q", data, at)[0]
        yield Scene(data[at + 12 : at + 12 + size])
        at += 16 + size


# --- The route, section 4 -----------------------------------------------------------------------------------------------


class NoRoute(Exception):
    pass


class LaneSearch:
    def __init__(self, scene):
        owners, indices, points, headings = [], [], [], []
        for lane, (line, *_) in scene.lanes.items():
            if lane <= 0 or not len(line):
                continue
            steps = np.diff(line, axis=0)
            heading = np.arctan2(steps[:, 1], steps[:, 0])
            heading = np.append(heading, heading[-1]) if len(heading) else np.zeros(1)
            owners += [lane] * len(line)
            indices += range(len(line))
            points.append(line)
            headings.append(heading)
        if not points:
            raise NoRoute("no lanes")
        self.owners, self.indices = owners, indices
        self.points, self.headings = np.concatenate(points), np.concatenate(headings)

    def match(self, x, y, heading):
        """Lane and point index of the nearest lane point of about this heading."""
        turn = np.abs(heading - self.headings)
        turn = np.where(turn > np.pi, 2 * np.pi - turn, turn)
        far = np.hypot(self.points[:, 0] - x, self.points[:, 1] - y)
        far[turn > np.radians(10)] = np.inf
        best = int(np.argmin(far))
        if not np.isfinite(far[best]):
            raise NoRoute("no lane matches")
        return self.owners[best], self.indices[best]


def waypoints(scene, search):
    poses = scene.tracks[scene.av][:, :3]
    line = lambda lane: scene.lanes[lane][0]
    lane, at = search.match(*poses[0])
    before = []
    if at < 40:
        entries = scene.lanes[lane][2]
        if entries and entries[0] in scene.lanes:
            before += list(line(entries[0]))
    before += list(line(lane)[:at])
    if not before:
        raise NoRoute("nothing behind")
    path = []
    for pose in poses[::10]:
        lane, at = search.match(*pose)
        path.append(line(lane)[at])
    lane, at = search.match(*poses[-1])
    after = list(line(lane)[at:])
    if len(after) < 40:
        exits = scene.lanes[lane][3]
        if exits and exits[0] in scene.lanes:
            after += list(line(exits[0]))
    return np.array(before[::5] + path + after[::5])


class Cubic:
    """A natural cubic spline whose coefficients are made over intervals 1 mm longer than those it is evaluated over."""

    def __init__(self, knots, values):
        count, h = len(values), np.diff(knots) + 0.001
        system, right = np.zeros((count, count)), np.zeros(count)
        system[0, 0] = system[-1, -1] = 1.0
        for i in range(1, count - 1):
            system[i, i - 1 : i + 2] = h[i - 1], 2 * (h[i - 1] + h[i]), h[i]
            right[i] = 3 * (values[i + 1] - values[i]) / h[i] - 3 * (values[i] - values[i - 1]) / h[i - 1]
        c = np.linalg.solve(system, right)
        self.knots, self.a, self.c = knots, values, c
        self.d = np.diff(c) / (3 * h)
        self.b = np.diff(values) / h - h * (c[1:] + 2 * c[:-1]) / 3

    def at(self, s):
        i = np.minimum(np.searchsorted(self.knots, s, side="right") - 1, len(self.d) - 1)
        t = s - self.knots[i]
        a, b, c, d = self.a[i], self.b[i], self.c[i], self.d[i]
        return a + t * (b + t * (c + t * d)), b + t * (2 * c + 3 * d * t), 2 * c + 6 * d * t


def route(points):
    """Rows x, y, heading, curvature."""
    knots = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    s = np.arange(0, knots[-1], 0.1)
    (x, dx, ddx), (y, dy, ddy) = Cubic(knots, points[:, 0]).at(s), Cubic(knots, points[:, 1]).at(s)
    return np.stack([x, y, np.arctan2(dy, dx), (ddy * dx - ddx * dy) / (dx**2 + dy**2) ** 1.5], axis=1)


def inside(polygon, places):
    """Which places lie strictly inside (even-odd rule)."""
    within = np.zeros(len(places), bool)
    for (x1, y1), (x2, y2) in zip(polygon, np.roll(polygon, -1, axis=0)):
        if y1 == y2:
            continue
        crosses = (y1 > places[:, 1]) != (y2 > places[:, 1])
        within ^= crosses & (places[:, 0] < (x2 - x1) * (places[:, 1] - y1) / (y2 - y1) + x1)
    return within


# --- Frames and discs, sections 3 and 5 ---------------------------------------------------------------------------------


def wrap(angle, kind=float):
    return (angle + kind(np.pi)) % kind(2 * np.pi) - kind(np.pi)


def turned(vectors, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[..., 0] - s * vectors[..., 1], s * vectors[..., 0] + c * vectors[..., 1]], axis=-1)


def normalised(states, av):
    """Logged states in the AV's frame: single precision but for the turning of places. What is exactly 0 stays 0, each component
    for itself."""
    states = states.astype(SINGLE)
    own = states.copy()
    own[..., :2] = turned(states[..., :2].astype(float) - av[:2], -av[2])
    own[..., 2] = wrap(states[..., 2] - SINGLE(av[2]), SINGLE)
    c, s = SINGLE(np.cos(av[2])), SINGLE(np.sin(av[2]))
    own[..., 3] = states[..., 3] * c + states[..., 4] * s
    own[..., 4] = states[..., 4] * c - states[..., 3] * s
    own[..., :5][states[..., :5] == 0] = 0
    return own


def own_state(av):
    """The driven AV in its own frame: never rounded before the end."""
    velocity = np.where(av[3:5] == 0, 0, turned(av[3:5], -av[2]))
    return np.concatenate([np.zeros(3), velocity, av[5:]]).astype(SINGLE)


def discs(x, y, heading, length, width):
    half = (length - width) / 2
    along = [half, -half] if length < 4 else [0, half, -half] if length < 8 else [0, half, -half, half / 2, -half / 2]
    along = np.array(along)
    return np.stack([x + along * np.cos(heading), y + along * np.sin(heading)], axis=1)


def margin(a, b):
    pose = lambda state: (*state[:3], *state[5:7])
    apart = discs(*pose(a))[:, None] - discs(*pose(b))[None]
    return np.min(np.hypot(apart[..., 0], apart[..., 1])) - (a[6] + b[6]) / np.sqrt(3.8)


def predictions(windows):
    """Constant turn rate and velocity, section 9, of normalised windows (agents x 20 x 8)."""
    windows = windows.astype(float)
    last, heading = windows[:, -1], windows[:, -1, 2]
    rate = np.clip((heading - windows[:, -2, 2]) / 0.1, -0.5, 0.5)
    speed = np.hypot(last[:, 3], last[:, 4])[:, None]
    headings = np.fmod(heading[:, None] + 0.1 * rate[:, None] * np.arange(1, 51), 2 * np.pi)
    x = last[:, :1] + 0.1 * speed * np.cumsum(np.cos(headings), axis=1)
    y = last[:, 1:2] + 0.1 * speed * np.cumsum(np.sin(headings), axis=1)
    return np.stack([x, y, headings], axis=2)


# --- The episode, sections 1 to 6 ---------------------------------------------------------------------------------------


class Episode:
    def __init__(self, scene, policy):
        self.scene, self.policy = scene, policy
        self.search = LaneSearch(scene)
        self.waypoints = waypoints(scene, self.search)
        self.route = route(self.waypoints)
        self.crosswalk = np.zeros(len(self.route), bool)
        for polygon in scene.crosswalks:
            self.crosswalk |= inside(polygon, self.route[:, :2])
        self.t = START
        self.state = scene.tracks[scene.av, START].copy()
        self.speed = np.hypot(self.state[3], self.state[4])
        self.out = {}
        self.observe()

    def record(self, **values):
        for name, value in values.items():
            self.out.setdefault(name, []).append(value)

    def observe(self):
        scene, state, t = self.scene, self.state, self.t
        far = np.hypot(*(scene.tracks[:, t, :2] - state[:2]).T)
        others = [i for i in range(len(far)) if i != scene.av and scene.valid[i, t]]
        self.neighbors = sorted(others, key=lambda i: far[i])[:NEIGHBORS]
        lane, _ = self.search.match(*state[:3])
        limit = scene.lanes[lane][1] / 2.237
        location = int(np.argmin(np.hypot(*(self.route[:, :2] - state[:2]).T)))
        start = max(location - 200, 0)
        rows = self.route[start : start + 1200]
        info = np.where(self.crosswalk[start : start + 1200], 1.0, limit)
        for stop in scene.red_points[t]:
            info[np.hypot(*(rows[:, :2] - stop).T) < 0.2] = 0.0
        self.line = np.column_stack([rows, info]).astype(SINGLE)
        self.line = np.concatenate([self.line, np.repeat(self.line[-1:], 1200 - len(rows), axis=0)])
        red = np.flatnonzero(info == 0)
        self.record(
            av_state=state.copy(),
            neighbor_tracks=self.neighbors + [-1] * (NEIGHBORS - len(self.neighbors)),
            route_start=start,
            route_rows=len(rows),
            lane_id=lane,
            speed_limit=float(self.line[:, 4].max()),
            red_first=red[0] if len(red) else -1,
            red_count=len(red),
            crosswalk_count=np.count_nonzero(info == 1),
        )

    def windows(self):
        """The neighbors' last 20 states in the AV's frame, backward fill done; rows of zeros for absent ones."""
        windows = np.zeros((NEIGHBORS, 20, 8))
        for row, track in enumerate(self.neighbors):
            past = slice(self.t - 19, self.t + 1)
            window = np.where(self.scene.valid[track, past, None], self.scene.tracks[track, past], 0.0)
            for k in range(18, -1, -1):
                if window[k, 0] == 0:
                    window[k, 2:5] = window[k + 1, 2:5]
                    window[k, :2] = window[k + 1, :2] - 0.1 * window[k + 1, 3:5]
            windows[row] = window
        return normalised(windows, self.state)

    def plan(self):
        if self.policy == "constant-velocity":
            return np.stack([0.1 * self.speed * np.arange(1, 51), np.zeros(50), np.zeros(50)], axis=1)
        logged = self.scene.tracks[self.scene.av]
        ahead = logged[np.minimum(np.arange(self.t + 1, self.t + 51), len(logged) - 1), :3]
        place = turned(ahead[:, :2] - self.state[:2], -self.state[2])
        return np.column_stack([place, wrap(ahead[:, 2] - self.state[2])])

    def step(self):
        plan = self.plan()
        step = self.t - START
        if step % 10 == 0:
            windows = self.windows()
            # The first state is a logged one.
            own = own_state(self.state) if step else normalised(self.state, self.state)
            self.record(
                every10_step=step,
                every10_ref_line=self.line[::10],
                every10_current_state=np.concatenate([own[None], windows[:, -1]]),
                every10_predictions=predictions(windows)[:, 9::10],
                every10_plan=plan[9::10],
            )
        checked = self.neighbors
        self.t += 1
        old = self.state
        self.state = old.copy()
        self.state[:2] = old[:2] + turned(plan[0, :2], old[2])
        self.state[2] = old[2] + np.clip(plan[0, 2], -0.1, 0.1)
        self.state[3:5] = (self.state[:2] - old[:2]) / 0.1
        least = min((margin(self.state, self.scene.tracks[track, self.t]) for track in checked), default=np.inf)
        self.record(plan_first=plan[0], plan_first_global=self.state[:2].copy(), collision_margin=least)
        self.record(control_first=[0.0, 0.0], plan_objective=0.0)
        try:
            self.observe()
        except NoRoute:
            self.record(collision=0, off_route=0, route_distance=np.nan)
            return "route_failed"
        distance = np.min(np.hypot(*(self.line[:, :2].astype(float) - self.state[:2]).T))
        self.record(collision=int(least < 0), off_route=int(distance > 5), route_distance=distance)
        if least < 0:
            return "collision"
        if distance > 5:
            return "off_route"
        if self.t > LAST_TIMESTEP:
            return "horizon"
        return "log_end" if self.t >= self.scene.length - 1 else None


# --- Metrics, section 7 -------------------------------------------------------------------------------------------------


def mean(values):
    return float(np.mean(np.abs(values))) if len(values) else float("nan")


def comfort(poses):
    velocity = np.diff(poses[:, :2], axis=0) / 0.1
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    along, across = velocity[:, 0] * c + velocity[:, 1] * s, velocity[:, 1] * c - velocity[:, 0] * s
    return [mean(np.diff(along)) / 0.1, mean(np.diff(along, 2)) / 0.01, mean(np.diff(across)) / 0.1]


def metrics(scene, driven):
    """The ten numbers, and the position errors."""
    logged = scene.tracks[scene.av][:, :3]
    human = logged[START + 1 : START + 1 + len(driven)]
    progress = float(np.sum(np.hypot(*np.diff(driven[:, :2], axis=0).T)))
    held = driven[np.minimum(np.arange(100), len(driven) - 1), :2]
    errors = np.hypot(*(held - logged[START + 1 : START + 101, :2]).T)
    return [progress, *comfort(driven), *comfort(human), *errors[[29, 49, 99]]], errors


NAMES = "progress acc jerk lat_acc human_acc human_jerk human_lat_acc l2_3s l2_5s l2_10s".split()
KINDS = {"lane_id": np.int64, "every10_ref_line": SINGLE, "every10_current_state": SINGLE}
INTEGERS = "neighbor_tracks route_start route_rows red_first red_count crosswalk_count collision off_route every10_step"
KINDS.update({name: np.int32 for name in INTEGERS.split()})


def drive(scene, policy):
    """The arrays of an episode, what is said of it in words, and those of its route."""
    episode = Episode(scene, policy)
    ended = None
    while ended is None:
        ended = episode.step()
    arrays = {name: np.array(values, KINDS.get(name, float)) for name, values in episode.out.items()}
    arrays["metrics"], arrays["position_error"] = map(np.array, metrics(scene, arrays["av_state"][1:]))
    flags = {name: bool(arrays[name][-1]) for name in ("collision", "off_route")}
    numbers = {name: None if np.isnan(value) else value for name, value in zip(NAMES, arrays["metrics"].tolist())}
    words = {
        "scene": scene.id,
        "policy": policy,
        "steps": len(arrays["collision"]),
        "end_reason": ended,
        "log_length": scene.length,
        "dropped_map_features": scene.dropped,
        "metrics": {**flags, **numbers},
    }
    way = {"waypoints": episode.waypoints, "route": episode.route, "track_poses": scene.tracks[scene.av][:, :3]}
    return arrays, words, way


# --- The command --------------------------------------------------------------------------------------------------------


def worst(ours, theirs):
    if ours.shape != theirs.shape:
        return f"shape {ours.shape} instead of {theirs.shape}"
    off = np.abs(ours.astype(float) - theirs.astype(float))
    off[np.isnan(ours) & np.isnan(theirs)] = 0
    off[ours == theirs] = 0
    return float(np.max(off, initial=0.0))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    to = arguments.add_mutually_exclusive_group(required=True)
    to.add_argument("--out", type=Path, help="folder to write vectors to")
    to.add_argument("--check", type=Path, help="folder of vectors to compare with")
    arguments.add_argument("scenes", nargs="+", help="TFRecord files")
    given = arguments.parse_args()
    found = {}
    compare = lambda name, ours, theirs: found.setdefault(name, []).append(worst(ours, theirs))
    for scene in (scene for path in given.scenes for scene in scenes(path)):
        for policy in ("human", "constant-velocity"):
            stem = f"{scene.id}__{policy}"
            if given.check and not (given.check / f"{stem}.npz").exists():
                continue
            arrays, words, way = drive(scene, policy)
            if given.out:
                given.out.mkdir(parents=True, exist_ok=True)
                np.savez_compressed(given.out / f"{stem}.npz", **arrays)
                np.savez_compressed(given.out / f"{scene.id}__route.npz", **way)
                (given.out / f"{stem}.json").write_text(json.dumps(words, indent=1) + "\n")
                continue
            theirs = json.loads((given.check / f"{stem}.json").read_text())
            if any(words[name] != theirs[name] for name in words if name != "metrics"):
                print(f"{stem}: {words} instead of {theirs}")
                found.setdefault("words", []).append(float("inf"))
            for ours, file in ((arrays, stem), (way, f"{scene.id}__route")):
                with np.load(given.check / f"{file}.npz") as theirs:
                    for name in theirs:
                        compare(name, ours[name], theirs[name])
    for name, values in found.items():
        wrong = [value for value in values if isinstance(value, str)]
        print(f"{name:24} {wrong[0] if wrong else f'{max(values):.1e}'}")
    return 0 if given.out or found else "nothing to compare"


if __name__ == "__main__":
    sys.exit(main())
