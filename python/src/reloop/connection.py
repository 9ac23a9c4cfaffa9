"""The session of a node: it subscribes, then shows its token, and leaves when there is a reason to."""

from __future__ import annotations

import os
import queue
import threading
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import zenoh

from . import messages
from .bus_session import open_session
from .errors import NodeError
from .keys import Place, answer, worker_of
from .options import Options

#: How long a node waits for the run to show itself, and to be let in (s).
RUN_TIMEOUT = 10.0
#: How often it asks for the run's settings meanwhile (s).
_INFO_INTERVAL = 0.02


class Stop(Enum):
    """Why a node left."""

    SIM_GONE = "the sim is gone"
    PARENT_GONE = "who started it is gone"


@dataclass(frozen=True)
class _Sim:
    """The sim's token is there."""

    version: str


@dataclass(frozen=True)
class _Admission:
    """The sim's word on whether this node is let in."""

    payload: bytes


@dataclass(frozen=True)
class Telling:
    """What came under a ``told`` key."""

    key: str
    payload: bytes

    @property
    def worker(self) -> str:
        """Whose episode it is about."""
        return worker_of(self.key)


@dataclass(frozen=True)
class RunInfo:
    """What the sim says of its run."""

    #: Whether each step has a prediction.
    predictor: bool
    #: How long the sim waits for an answer (s); None where it does not say.
    deadline: float | None


class Connection:
    """A node's place on the bus, while it lives: ``with Connection.open(options) as connection``."""

    def __init__(self, options: Options, session: zenoh.Session) -> None:
        self._options = options
        self._session = session
        self._place = Place(options.run, options.secret)
        # Callbacks run in the session's threads: they only pass on what came.
        self._inbox: queue.SimpleQueue[_Sim | _Admission | Telling | Stop] = queue.SimpleQueue()
        #: Kept, because what nobody holds is gone.
        self._declared: list[Any] = []

    @classmethod
    def open(cls, options: Options) -> Connection:
        """Connects to the sim.

        Raises ``NodeError`` where there is none, or the Zenoh configuration cannot be used.
        """
        return cls(options, open_session(options))

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        # The session's threads outlive a main thread that raised: whatever ends this, they end.
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]

    @property
    def id(self) -> str:
        """The id of the session, which no other node has."""
        return str(self._session.zid())

    def run_info(self) -> RunInfo:
        """What the run is: asks the sim until it says so.

        Raises ``NodeError`` where nobody answers.
        """
        until = time.monotonic() + RUN_TIMEOUT
        while time.monotonic() < until:
            for reply in self._ask(self._place.info):
                told = messages.RunInfo.FromString(reply)
                settings = tomllib.loads(told.settings).get("settings", {})
                return RunInfo(told.predictor, settings.get("deadline-s"))
            # The sim is on the bus a moment before it has settings to tell.
            time.sleep(_INFO_INTERVAL)
        raise self._no_run()

    def scene(self, worker: str) -> Any:
        """The message ``Scene`` of the episode that ``worker`` drives now; None where there is none."""
        for reply in self._ask(self._place.scene(worker)):
            return messages.Scene.FromString(reply)
        return None

    def _ask(self, selector: str) -> list[bytes]:
        replies = self._session.get(selector, timeout=RUN_TIMEOUT)
        return [bytes(reply.ok.payload) for reply in replies if reply.ok is not None]

    def serve(self, role: str, hear: Callable[[Telling], None]) -> Stop:
        """Shows the token of ``role``, hands on what is told, and returns when there is a reason to leave.

        Raises ``NodeError`` where the run is not there, of another version, or does not let this node in.
        """
        options = self._options
        self._subscribe(self._place.told(options.worker), lambda s: Telling(str(s.key_expr), bytes(s.payload)))
        self._subscribe(self._place.door(self.id), lambda s: _Admission(bytes(s.payload)))
        watch = self._session.liveliness().declare_subscriber(self._place.sim, self._direct(_sim), history=True)
        self._declared.append(watch)
        if options.exit_with_parent:
            threading.Thread(target=self._watch_standard_input, daemon=True).start()
        # Last: who sees the token may count on the subscribers above.
        token = self._place.token(role, options.worker, options.name, self.id)
        self._declared.append(self._session.liveliness().declare_token(token))
        return self._wait(role, hear)

    def say(self, told: str, channel: str, message: Any) -> None:
        """Answers what came under the key ``told``."""
        self._session.put(
            answer(told, channel, self.id),
            message.SerializeToString(),
            congestion_control=zenoh.CongestionControl.BLOCK,
            # One priority for all: messages of different priorities overtake each other.
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def _wait(self, role: str, hear: Callable[[Telling], None]) -> Stop:
        sim_is_there = admitted = False
        until = time.monotonic() + RUN_TIMEOUT
        while True:
            try:
                notice = self._inbox.get(timeout=None if admitted else max(until - time.monotonic(), 0.001))
            except queue.Empty:
                raise self._no_seat(role) if sim_is_there else self._no_run() from None
            match notice:
                case Stop():
                    return notice
                case _Sim(version):
                    sim_is_there = True
                    if version != str(messages.WIRE_VERSION):
                        raise NodeError(
                            f"the sim speaks version {version} of the messages, this package version "
                            f"{messages.WIRE_VERSION}\n  hint: take both from the same revision: pip install ./python"
                        )
                case _Admission(payload):
                    word = messages.Admission.FromString(payload)
                    admitted = word.accepted
                    if not admitted:
                        raise self._refused(role, word.reason)
                # What is told before is told another.
                case Telling() if admitted:
                    hear(notice)

    def _subscribe(self, key: str, notice: Callable[[Any], Any]) -> None:
        self._declared.append(self._session.declare_subscriber(key, self._direct(notice)))

    def _direct(self, notice: Callable[[Any], Any]) -> Any:
        """Puts what came into the inbox, in the session's own thread.

        With Zenoh's default, a thread for each subscriber, admission and scene could overtake each other.
        """

        def hear(sample: Any) -> None:
            item = notice(sample)
            if item is not None:
                self._inbox.put(item)

        return zenoh.handlers.Callback(hear, indirect=False)

    def _watch_standard_input(self) -> None:
        """Nothing is ever written there; it ends when the parent closes it or dies."""
        try:
            while os.read(0, 64):
                pass
        except OSError:
            pass
        self._inbox.put(Stop.PARENT_GONE)

    def _no_run(self) -> NodeError:
        return NodeError(
            f"no run {self._options.run} at {self._options.endpoint} within {RUN_TIMEOUT:.0f} s\n"
            "  hint: `sim run -v` names its run and its endpoint in its log"
        )

    def _no_seat(self, role: str) -> NodeError:
        return NodeError(
            f"run {self._options.run} has not let this {role} in within {RUN_TIMEOUT:.0f} s\n"
            "  hint: RELOOP_SECRET is probably not the one that `sim run` printed for this run"
        )

    def _refused(self, role: str, reason: str) -> NodeError:
        hint = (
            "\n  hint: whoever runs the sim decides it; its log says the same"
            if self._options.secret
            else "\n  hint: `sim run` says the secret of a planner that it waits for; put it into RELOOP_SECRET"
        )
        return NodeError(f"{role} {self._options.name} (worker {self._options.worker}) is refused: {reason}{hint}")


def _sim(sample: Any) -> _Sim | Stop:
    if sample.kind == zenoh.SampleKind.DELETE:
        return Stop.SIM_GONE
    return _Sim(str(sample.key_expr).rsplit("/", 1)[1])
