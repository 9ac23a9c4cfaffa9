#!/usr/bin/env python3
"""Holds our nuPlan terms to nuPlan's own code.

nuplan-devkit's metric classes score the states that a run of ours left, on the map and the traffic that our judges saw; so do they
real lanes driven backwards, random pairs of boxes, and S-curves for the tracker. A row for each comparison that fails, a summary, and
exit code 1 if any did. Not part of CI: it needs a checkout of nuplan-devkit at ce3c323a, of which nothing is in this repository.

    git clone https://github.com/motional/nuplan-devkit && git -C nuplan-devkit checkout ce3c323a
    python -m venv venv && venv/bin/pip install "numpy<2.4" scipy shapely pandas geopandas pyogrio pyarrow sympy tqdm
    sim run --driver idm --scenarios DATA --out runs/idm
    venv/bin/python evaluation/checks/nuplan.py --devkit nuplan-devkit --run runs/idm --scenarios DATA
    venv/bin/python evaluation/checks/nuplan.py --devkit nuplan-devkit --scenarios DATA --lanes 150 --boxes 2000 --curves 100
"""

import argparse
import collections
import json
import math
import pathlib
import random
import subprocess
import sys

from devkit import load_devkit

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
TOLERANCES = {"EP": 0.002, "score": 0.001}
COLUMNS = {
    "NC": "nuplan_no_at_fault_collision",
    "DAC": "nuplan_drivable_area",
    "DDC": "nuplan_driving_direction",
    "MP": "nuplan_making_progress",
    "EP": "nuplan_progress",
    "TTC": "nuplan_time_to_collision",
    "SL": "nuplan_speed_limit",
    "C": "nuplan_comfort",
    "score": "nuplan_score",
}


class Judge:
    """Our judges, in a process of their own."""

    def __init__(self, command):
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, cwd=REPOSITORY)

    def ask(self, **question):
        print(json.dumps(question), file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"no answer to {question['op']}: the reason is above")
        return json.loads(answer)


class Tally:
    """Comparisons, and those that fail."""

    def __init__(self, verbose):
        self.verbose = verbose
        self.counts, self.failed, self.unjudged = (collections.Counter() for _ in range(3))

    def compare(self, what, term, ours, theirs, tolerance=1e-6):
        same = ours == theirs if None in (ours, theirs) else abs(ours - theirs) <= tolerance
        self.counts[term] += 1
        self.unjudged[term] += ours is None
        self.failed[term] += not same
        if not same or self.verbose:
            difference = "" if None in (ours, theirs) else f"{ours - theirs:+.6f}"
            print(f"{what:45} {term:6} ours {ours!s:22} nuPlan {theirs!s:22} {difference}{'' if same else '  DIFFERS'}")

    def end(self):
        for term, count in self.counts.items():
            unjudged = f", {self.unjudged[term]} of them without a value" if self.unjudged[term] else ""
            print(f"{term:24} {count - self.failed[term]:6} of {count} agree{unjudged}")
        sys.exit(1 if sum(self.failed.values()) else 0)


def scene_files(inputs):
    """The TFRecords of files and folders; each holds one scene."""
    for path in map(pathlib.Path, inputs):
        yield from sorted(path.rglob("*.tfrecord*")) if path.is_dir() else [path]


def check_run(folder, worlds, tally, nuplan):
    import pyarrow.parquet as parquet

    results = parquet.read_table(folder / "results.parquet").to_pylist()
    steps = collections.defaultdict(list)
    for row in parquet.read_table(folder / "steps.parquet").to_pylist():
        steps[row["scene"]].append(row)
    for result in results:
        if result["failed"] or result["scene"] not in worlds or not steps[result["scene"]]:
            continue
        # What our judges cannot tell from the scene is null, and nuPlan's aggregator leaves what it has not out as well.
        unjudged = {term for term, column in COLUMNS.items() if result[column] is None} - {"score"}
        theirs = nuplan.score(worlds[result["scene"]], result, steps[result["scene"]], unjudged)
        for term, column in COLUMNS.items():
            what = f"{result['scene']} {result['driver']}"
            tally.compare(what, term, result[column], theirs[term], TOLERANCES.get(term, 1e-6))


def check_lanes(count, worlds, judge, tally, nuplan):
    """Real lanes driven backwards at 8 m/s for 3 s."""
    rng = random.Random(1)
    lanes = [(world, lane) for world in worlds.values() for lane in world["lanes"] if length(lane["line"]) > 30]
    for number, (world, lane) in enumerate(rng.sample(lanes, min(count, len(lanes)))):
        question = backward_case(world, lane)
        answer = judge.ask(**question)
        theirs, travel = nuplan.direction(answer["world"], question)
        what = f"lane {number} of {world['id']}"
        tally.compare(what, "lanes: DDC", answer["metrics"][COLUMNS["DDC"]], theirs)
        # A step does not know yet which of several connectors is driven: next to the same.
        ours = max(step["backward_travel"] for step in answer["steps"])
        tally.compare(what, "lanes: m", ours, travel, 0.01)


def length(line):
    return sum(math.dist(a, b) for a, b in zip(line, line[1:]))


def backward_case(world, lane):
    near = [
        index
        for index, other in enumerate(world["lanes"])
        if min(math.dist(a, b) for a in other["line"][::4] for b in lane["line"][::4]) < 30
    ]
    links = lambda ids: [index for index in ids if index in near]
    lanes = [
        {
            "id": index,
            "line": other["line"],
            "mph": other["speed_limit"] / 0.44704,
            "interpolating": other["connector"],
            "entries": links(other["entries"]),
            "exits": links(other["exits"]),
        }
        for index, other in ((index, world["lanes"][index]) for index in near)
    ]

    def row(station, back):
        for a, b in zip(lane["line"], lane["line"][1:]):
            if station <= math.dist(a, b):
                break
            station -= math.dist(a, b)
        heading = math.atan2(b[1] - a[1], b[0] - a[0])
        x, y = a[0] + station * math.cos(heading), a[1] + station * math.sin(heading)
        turned = heading + math.pi * back
        return [x, y, math.remainder(turned, math.tau), 8.0, 5.286, 2.332]

    start = length(lane["line"]) - 1.0
    human = [row(max(start - 15.2 + 0.8 * step, 0.1), False) for step in range(19)] + [row(start, True)]
    human += [None] * 30
    av = [row(start - 0.8 * step, True) for step in range(1, 31) if start - 0.8 * step > 0.1]
    return {"op": "episode", "lanes": lanes, "human": human, "av": av}


def check_boxes(count, judge, tally, nuplan):
    rng = random.Random(2)
    for number in range(count):
        near = 3.0 if number % 2 else 25.0
        speed = lambda: rng.choice([0.0, 0.004, 0.049, 0.051, rng.uniform(0, 15), rng.uniform(0, 15)])
        av = [0.0, 0.0, rng.uniform(-3.1, 3.1), speed(), 5.286, 2.332]
        agent = [rng.uniform(-near, near), rng.uniform(-near, near), rng.uniform(-3.1, 3.1), speed()]
        agent += [rng.uniform(0.4, 12), rng.uniform(0.4, 2.6)]
        ours, theirs = judge.ask(op="boxes", av=av, agent=agent), nuplan.boxes(av, agent)
        for term in ("contact", "ahead", "behind"):
            tally.counts[f"boxes: {term}"] += 1
            if ours[term] != theirs[term]:
                tally.failed[f"boxes: {term}"] += 1
                print(f"pair {number}: {term} ours {ours[term]} nuPlan {theirs[term]}: {av} {agent}")
        if ours["contact"] is None:
            time = theirs["time_to_collision"] if av[3] > 0.005 else ours["time_to_collision"]
            tally.compare(f"pair {number}", "boxes: time", ours["time_to_collision"], time)


def check_curves(count, judge, tally, nuplan):
    """S-curves at even speed, the AV beside them: what the trackers command."""
    rng = random.Random(3)
    for number in range(count):
        speed, bend = rng.uniform(2, 15), rng.uniform(0.01, 0.12)
        period, phase = rng.uniform(2, 6), rng.uniform(0, math.tau)
        bend = min(bend, 4.0 / speed**2)
        path, (x, y, heading) = [], (0.0, 0.0, 0.0)
        for step in range(51):
            path.append([x, y, heading, speed])
            for fine in range(100):
                time = 0.1 * (step + fine / 100)
                heading += speed * 0.001 * bend * math.sin(math.tau * time / period + phase)
                x, y = x + speed * 0.001 * math.cos(heading), y + speed * 0.001 * math.sin(heading)
        steering = math.atan(3.089 * bend * math.sin(phase)) + rng.uniform(-0.02, 0.02)
        state = [0.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.1, 0.1), speed + rng.uniform(-1, 1), steering]
        ours, theirs = judge.ask(op="track", state=state, plan=path[1:]), nuplan.track(state, path)
        tally.compare(f"curve {number}", "curves: acceleration", ours["acceleration"], theirs[0], 2e-3)
        tally.compare(f"curve {number}", "curves: steering rate", ours["steering_rate"], theirs[1], 1e-2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--devkit", required=True, type=pathlib.Path, help="checkout of nuplan-devkit")
    parser.add_argument("--run", action="append", default=[], type=pathlib.Path, help="folder of a finished strict run")
    parser.add_argument("--scenarios", nargs="*", default=[], help="TFRecords of one scene each, or folders of them")
    parser.add_argument("--lanes", type=int, default=0, metavar="N", help="real lanes driven backwards")
    parser.add_argument("--boxes", type=int, default=0, metavar="N", help="random pairs of boxes")
    parser.add_argument("--curves", type=int, default=0, metavar="N", help="S-curves for the tracker")
    parser.add_argument("--judge", nargs="+", help="command of our judges", default=[
        "cargo", "run", "--quiet", "--locked", "-p", "evaluation", "--example", "judge"])
    parser.add_argument("--verbose", action="store_true", help="a row for what agrees too")
    args = parser.parse_args()
    load_devkit(args.devkit)
    import nuplan_scores as nuplan

    judge, tally = Judge(args.judge), Tally(args.verbose)
    worlds = {}
    for path in scene_files(args.scenarios):
        world = judge.ask(op="world", scene=str(path.resolve()))
        worlds[world["id"]] = world
    for folder in args.run:
        check_run(folder, worlds, tally, nuplan)
    check_lanes(args.lanes, worlds, judge, tally, nuplan)
    check_boxes(args.boxes, judge, tally, nuplan)
    check_curves(args.curves, judge, tally, nuplan)
    tally.end()


if __name__ == "__main__":
    main()
