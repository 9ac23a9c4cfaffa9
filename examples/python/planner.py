#!/usr/bin/env python3
"""A planner of one's own, in Python: follows the reference line at the present speed, and stops for nobody.

    python -m venv venv && venv/bin/pip install eclipse-zenoh==1.10.2 grpcio-tools
    sim run --planner-command 'venv/bin/python examples/python/planner.py'

`sim run` starts one process for each worker and tells it by arguments, and by RELOOP_ENDPOINT, RELOOP_RUN,
RELOOP_WORKER and RELOOP_NAME, where to connect; and by RELOOP_SECRET, in the environment alone, what it must know to be
heard. docs/bus.md describes the keys and the messages; wire/proto/reloop.proto is the contract.
"""

import argparse
import math
import os
import pathlib
import queue
import sys
import tempfile
import threading

import zenoh
from google.protobuf.message import DecodeError
from grpc_tools import protoc

WIRE_VERSION = 3  # of wire/proto/reloop.proto; the simulator refuses any other
PLAN_STEPS = 50  # 0.1 s to 5.0 s ahead
STEP_SECONDS = 0.1
ADMISSION_SECONDS = 10  # after which who is not let in is not known
SAMPLE_SPACING = 0.1  # metres between two samples of the reference line


def messages():
    """The module of the messages, made from the .proto file."""
    proto = pathlib.Path(__file__).resolve().parents[2] / "wire" / "proto"
    out = tempfile.mkdtemp(prefix="reloop-")
    if protoc.main(["protoc", f"-I{proto}", f"--python_out={out}", "reloop.proto"]) != 0:
        sys.exit("cannot compile reloop.proto")
    sys.path.insert(0, out)
    import reloop_pb2

    return reloop_pb2


class Planner:
    """Plans for one episode. This is the part to make one's own."""

    def __init__(self, pb, scene):
        self.pb, self.scene = pb, scene  # the scene holds the map, the route, and what was before the first step

    def plan(self, observation):
        """The plan for this observation."""
        av, line = observation.av, self.scene.reference_line
        first = observation.window_first_sample
        window = range(first, first + observation.window_samples)  # the stretch around the AV
        speed = math.hypot(av.velocity_x, av.velocity_y)
        answer = self.pb.Plan(step=observation.step, status="follows the line")
        if not window:
            answer.error = "there is no reference line here"
            return answer
        here = min(window, key=lambda i: (line.x[i] - av.x) ** 2 + (line.y[i] - av.y) ** 2)
        for k in range(1, PLAN_STEPS + 1):
            ahead = here + round(k * STEP_SECONDS * speed / SAMPLE_SPACING)
            i = min(ahead, window[-1])
            answer.states.add(x=line.x[i], y=line.y[i], heading=line.heading[i], speed=speed)
        return answer


class Desk:
    """One worker's episodes, one after the other: what the simulator tells goes in, answers come out."""

    def __init__(self, pb):
        self.pb, self.episode, self.planner = pb, None, None

    def take(self, told):
        """The answer to what was told; None where none is due."""
        what = told.WhichOneof("what")
        answer = self.pb.Answer(episode=told.episode)
        if what == "scene":
            self.episode, self.planner = told.episode, Planner(self.pb, told.scene)
            return None
        if what == "observation":
            answer.plan.CopyFrom(self.plan(told.episode, told.observation))
            return answer
        if what == "end":
            self.planner = None
            answer.done.SetInParent()
            return answer
        return None  # a prediction, which this planner makes nothing of

    def plan(self, episode, observation):
        try:
            if self.planner is None or episode != self.episode:
                raise ValueError("the scene never came")
            if self.planner.scene.wire_version != WIRE_VERSION:
                raise ValueError(f"the scene is of version {self.planner.scene.wire_version}, not {WIRE_VERSION}")
            return self.planner.plan(observation)
        except Exception as error:  # an honest refusal is better than silence: that would cost the deadline
            return self.pb.Plan(step=observation.step, error=f"{type(error).__name__}: {error}")


def options():
    """Where to connect, and as whom."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--endpoint", default=os.environ.get("RELOOP_ENDPOINT"))
    parser.add_argument("--run", default=os.environ.get("RELOOP_RUN"))
    parser.add_argument("--worker", default=os.environ.get("RELOOP_WORKER", "*"))
    parser.add_argument("--name", default=os.environ.get("RELOOP_NAME", f"python-{os.getpid()}"))
    leave = os.environ.get("RELOOP_EXIT_WITH_PARENT") == "true"
    parser.add_argument("--exit-with-parent", action="store_true", default=leave)
    return parser.parse_known_args()[0]


def main():
    pb = messages()
    asked = options()
    endpoint, run, worker = asked.endpoint, asked.run, asked.worker
    # Where this planner sits: only who knows the secret can speak or listen there.
    seat = f"reloop/{run}/@seat-{os.environ['RELOOP_SECRET']}"

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("transport/link/tx/lease", "2592000000")  # however long everybody is paused, nobody is given up
    # `with`: whatever ends this block, an exception too, ends the session, and the simulator sees that the planner is gone.
    with zenoh.open(config) as session:
        me = str(session.zid())
        # Callbacks belong to the session's threads: they only pass on what came.
        todo = queue.Queue()
        told = session.declare_subscriber(f"{seat}/{worker}/told", todo.put)
        door = session.declare_subscriber(f"{seat}/@door/{me}", todo.put)
        # The simulator's own token: when it goes, so do we.
        sim = session.liveliness().declare_subscriber(
            f"reloop/{run}/@node/sim/**",
            lambda sample: todo.put(None) if sample.kind == zenoh.SampleKind.DELETE else None,
            history=True,
        )
        # Last, because who sees it may count on the subscribers above. Kept, because a token that nobody holds is gone.
        serves = "all" if worker == "*" else worker
        token = session.liveliness().declare_token(f"{seat}/@node/planner/{serves}/{asked.name}/{me}/{WIRE_VERSION}")

        # Nothing is ever written there: it ends with whoever started this.
        if asked.exit_with_parent:
            threading.Thread(target=lambda: (sys.stdin.read(), todo.put(None)), daemon=True).start()

        desks, patience = {}, ADMISSION_SECONDS
        while True:
            try:
                sample = todo.get(timeout=patience)
            except queue.Empty:
                sys.exit(f"run {run} has not let this planner in: is RELOOP_SECRET what it said?")
            if sample is None:
                break
            key, payload = str(sample.key_expr), bytes(sample.payload)
            if "/@door/" in key:
                word = pb.Admission.FromString(payload)
                if not word.accepted:
                    sys.exit(f"planner {asked.name} is refused: {word.reason}")
                patience = None
                continue
            try:
                told_now = pb.Told.FromString(payload)
            except DecodeError as error:  # ends no drive: no answer comes, and the simulator says so
                print(f"a message is passed over: {error}", file=sys.stderr)
                continue
            answer = desks.setdefault(key, Desk(pb)).take(told_now)
            if answer is not None:
                session.put(
                    f"{key.removesuffix('told')}plan/{me}",
                    answer.SerializeToString(),
                    congestion_control=zenoh.CongestionControl.BLOCK,
                    priority=zenoh.Priority.REAL_TIME,
                    express=True,
                )
        for declared in (token, sim, door, told):
            declared.undeclare()


if __name__ == "__main__":
    main()
