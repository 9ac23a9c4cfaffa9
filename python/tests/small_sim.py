"""The sim's part on the bus, small: a router, one seat, and messages for whoever sits there.

For nodes as real processes without a real sim: what `sim run` does not start (predictors), and what it would not do.
"""

from __future__ import annotations

import json
import os
import queue
import socket
import subprocess
import sys
from pathlib import Path

import zenoh

from reloop import messages

PATIENCE = 20.0


def message_scene(version: int = messages.WIRE_VERSION, samples: int = 2000):
    """A straight road along +x from the origin, 200 m, and two steps of history."""
    scene = messages.Scene(wire_version=version, scene="straight", protocol="strict", start=2, horizon=3, wheelbase=3.0)
    line = scene.reference_line
    line.x.extend(0.1 * k for k in range(samples))
    for column in (line.y, line.z, line.heading, line.curvature):
        column.extend([0.0] * samples)
    line.speed_limit.extend([10.0] * samples)
    line.crosswalk.extend([False] * samples)
    lane = scene.map.lanes.add(id=7, kind=2, speed_limit_mph=25.0, exits=[8]).centerline
    for column, numbers in ((lane.x, [0.0, 0.5]), (lane.y, [0.0, 0.0]), (lane.z, [0.0, 0.0])):
        column.extend(numbers)
    for log_index in range(2):
        moment = scene.history.add(log_index=log_index)
        moment.av.x = 20.0 + log_index - 2
        moment.agents.add(track=5, kind=1).state.x = 60.0 + 0.5 * (log_index - 2)
    return scene


def message_observation(step: int, version_2: bool = False):
    """The AV at 20 m + 1 m a step, 10 m/s; a car 40 m ahead at 5 m/s."""
    seen = messages.Observation(step=step, log_index=2 + step, window_first_sample=0, window_samples=1200)
    seen.av.x, seen.av.velocity_x, seen.av.length, seen.av.width = 20.0 + step, 10.0, 4.5, 2.0
    car = seen.agents.add(track=5, kind=1).state
    car.x, car.velocity_x, car.length, car.width = 60.0 + 0.5 * step, 5.0, 4.0, 1.8
    return seen


def message_taken(step: int, since: int = 0):
    """The car of ``message_observation``, taken over at step ``since``: it goes along +x, on lane 7 at first."""
    told = messages.TakenAgents(step=step)
    one = told.agents.add(since_step=since)
    one.agent.CopyFrom(message_observation(step).agents[0])
    one.agent.state.height, one.agent.state.z = 1.5, 0.75
    if step == since:
        one.way.samples.x.extend(50.0 + 0.5 * k for k in range(100))
        one.way.samples.y.extend([0.0] * 100)
        one.way.samples.z.extend(0.01 * k for k in range(100))
        one.way.lanes.add(lane=7)
        one.way.lanes.add(**{"from": 30.0})
    return told


class SmallSim:
    """A run with one seat. Use it by ``with``."""

    def __init__(
        self, *, run: str = "small", secret: str = "s3cret", predictor: bool = False, version: int = 3
    ) -> None:
        self.run, self.secret, self.predictor, self.version = run, secret, predictor, version
        self.answers: queue.SimpleQueue = queue.SimpleQueue()
        self.tokens: queue.SimpleQueue = queue.SimpleQueue()
        #: Answered to who asks for the scene of the episode that is on.
        self.scene_document: bytes | None = None

    def __enter__(self) -> SmallSim:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
        config = zenoh.Config()
        for key, value in {
            "mode": "router",
            "listen/endpoints": [self.endpoint],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
        }.items():
            config.insert_json5(key, json.dumps(value))
        self._session = zenoh.open(config)
        seat = f"reloop/{self.run}/@seat-{self.secret}"
        self._told = f"{seat}/w0/told"
        self._seat = seat
        self._declared = [
            self._session.declare_subscriber(f"{seat}/w0/*/*", self._hear),
            self._session.declare_queryable(f"reloop/{self.run}/info", self._info),
            self._session.declare_queryable(f"reloop/{self.run}/@tape/w0/*/scene", self._scene),
            self._session.liveliness().declare_subscriber(f"{seat}/@node/**", self._see, history=True),
            self._session.liveliness().declare_token(f"reloop/{self.run}/@node/sim/all/sim/{self.version}"),
        ]
        return self

    def __exit__(self, *_: object) -> None:
        self.leave()

    def leave(self) -> None:
        """The sim goes away."""
        if self._declared:
            self._declared.clear()
            self._session.close()

    def _hear(self, sample) -> None:
        self.answers.put((str(sample.key_expr), messages.Answer.FromString(bytes(sample.payload))))

    def _see(self, sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self.tokens.put(str(sample.key_expr).removeprefix(f"{self._seat}/@node/").split("/"))

    def _info(self, query) -> None:
        info = messages.RunInfo(run=self.run, predictor=self.predictor, settings="[settings]\ndeadline-s = 0.5\n")
        query.reply(str(query.key_expr), info.SerializeToString())

    def _scene(self, query) -> None:
        if self.scene_document is not None:
            query.reply(f"reloop/{self.run}/@tape/w0/straight/scene", self.scene_document)

    def admit(self, accepted: bool = True, reason: str = "") -> list[str]:
        """Waits for a node and answers it; its token's parts: role, worker, name, session, version."""
        token = self.tokens.get(timeout=PATIENCE)
        word = messages.Admission(accepted=accepted, reason=reason)
        self._put(f"{self._seat}/@door/{token[3]}", word)
        return token

    def tell(self, episode: int, **what) -> None:
        """Tells the node a scene, an observation, a prediction, who is taken over, or an end."""
        self._put(self._told, messages.Told(episode=episode, **what))

    def answer(self):
        """The node's next answer: its key behind the worker, and the message."""
        key, message = self.answers.get(timeout=PATIENCE)
        return key.removeprefix(f"{self._seat}/w0/"), message

    def _put(self, key: str, message) -> None:
        self._session.put(
            key,
            message.SerializeToString(),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def start(self, program: str | Path, *arguments: str, **environment: str | None) -> subprocess.Popen:
        """A node as a process: a program's text, or its file. Told where to connect as `sim run` tells it."""
        told = {
            "RELOOP_ENDPOINT": self.endpoint,
            "RELOOP_RUN": self.run,
            "RELOOP_WORKER": "w0",
            "RELOOP_NAME": "mine",
            "RELOOP_SECRET": self.secret,
        }
        env = {**os.environ, **told, **environment}
        what = [str(program)] if isinstance(program, Path) else ["-c", program]
        return subprocess.Popen(
            [sys.executable, *what, *arguments],
            env={name: value for name, value in env.items() if value is not None},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
