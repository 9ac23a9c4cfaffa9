#!/usr/bin/env python3
"""A planner of one's own, in Python: follows the reference line at the present speed, and stops for nobody.

    python -m venv venv && venv/bin/pip install eclipse-zenoh==1.10.2 grpcio-tools
    sim run --planner-command 'venv/bin/python examples/python/planner.py'

`sim run` starts one process for each worker and tells it by arguments, and by RELOOP_ENDPOINT, RELOOP_RUN,
RELOOP_WORKER and RELOOP_NAME, where to connect. docs/bus.md describes the keys and the messages; wire/proto/reloop.proto is the contract.
"""

import argparse
import math
import os
import pathlib
import queue
import sys
import tempfile

import zenoh
from grpc_tools import protoc

WIRE_VERSION = 1  # of wire/proto/reloop.proto; the simulator refuses any other
PLAN_STEPS = 50  # 0.1 s to 5.0 s ahead
STEP_SECONDS = 0.1
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


def plan(pb, observation):
    """The plan for this observation. This is the part to make one's own."""
    av, line = observation.av, observation.window
    speed = math.hypot(av.velocity_x, av.velocity_y)
    answer = pb.Plan(step=observation.step, status="follows the line")
    if not line.x:
        answer.error = "there is no reference line here"
        return answer
    here = min(range(len(line.x)), key=lambda i: (line.x[i] - av.x) ** 2 + (line.y[i] - av.y) ** 2)
    for k in range(1, PLAN_STEPS + 1):
        ahead = here + round(k * STEP_SECONDS * speed / SAMPLE_SPACING)
        i = min(ahead, len(line.x) - 1)
        answer.states.add(x=line.x[i], y=line.y[i], heading=line.heading[i], speed=speed)
    return answer


def options():
    """Where to connect, and as whom."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--endpoint", default=os.environ.get("RELOOP_ENDPOINT"))
    parser.add_argument("--run", default=os.environ.get("RELOOP_RUN"))
    parser.add_argument("--worker", default=os.environ.get("RELOOP_WORKER", "*"))
    parser.add_argument("--name", default=os.environ.get("RELOOP_NAME", f"python-{os.getpid()}"))
    return parser.parse_known_args()[0]


def main():
    pb = messages()
    asked = options()
    endpoint, run, worker = asked.endpoint, asked.run, asked.worker

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)

    # Callbacks belong to the session's threads: they only pass on what came.
    todo = queue.Queue()
    observations = session.declare_subscriber(f"reloop/{run}/{worker}/*/observation", todo.put)
    # The simulator's own token: when it goes, so do we.
    sim = session.liveliness().declare_subscriber(
        f"reloop/{run}/@node/sim/*/*/*",
        lambda sample: todo.put(None) if sample.kind == zenoh.SampleKind.DELETE else None,
        history=True,
    )
    # Last, because who sees it may count on the subscribers above.
    serves = "all" if worker == "*" else worker
    token = session.liveliness().declare_token(
        f"reloop/{run}/@node/planner/{serves}/{asked.name}/{WIRE_VERSION}"
    )

    while (sample := todo.get()) is not None:
        observation = pb.Observation.FromString(bytes(sample.payload))
        try:
            answer = plan(pb, observation)
        except Exception as error:  # an honest refusal is better than silence: that would cost the deadline
            answer = pb.Plan(step=observation.step, error=f"{type(error).__name__}: {error}")
        key = str(sample.key_expr).removesuffix("observation") + "plan"
        session.put(
            key,
            answer.SerializeToString(),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
    for declared in (token, sim, observations):
        declared.undeclare()
    session.close()


if __name__ == "__main__":
    main()
