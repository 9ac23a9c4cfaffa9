"""Serving: the program of a node, from its arguments to its exit code."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable
from typing import Any

from google.protobuf.message import DecodeError

from . import messages
from .connection import Connection, Stop, Telling
from .desk import CHANNELS, Desk
from .errors import NodeError
from .nodes import Node, Planner, Predictor, Traffic
from .options import Options

log = logging.getLogger("reloop")

#: Exit code of a node that could not join its run, or was not let in.
EXIT_REFUSED = 2
#: Exit code after Ctrl-C.
EXIT_INTERRUPTED = 130


def serve(make: Callable[[], Node], options: Options | None = None) -> None:
    """Answers the sim's observations until the run ends. This is the last line of a node's program.

    ``make``: a subclass of ``Planner``, ``Predictor`` or ``Traffic``, a decorated function, or any callable
    without arguments that gives one; it is called once for each episode. ``options``: where to connect to; from
    arguments and environment by default.

    Returns when the sim is done. Where the run cannot be joined it says why on standard error and exits with code 2.
    """
    logging.basicConfig(stream=sys.stderr, format="%(message)s", level=logging.INFO)
    # What the user prints is to appear as it is said, through a pipe too.
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(line_buffering=True)
    try:
        stop = join(make, options or Options.read())
        log.debug("leaving: %s", stop.value)
    except NodeError as error:
        sys.exit(_said(error))
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)


def _said(error: NodeError) -> int:
    print(f"error: {error}", file=sys.stderr, flush=True)
    return EXIT_REFUSED


def join(make: Callable[[], Node], options: Options) -> Stop:
    """As ``serve``, for programs that are more than a node: says why the run ended.

    Raises ``NodeError`` where it cannot be joined.
    """
    # The first is made now: what is wrong with it is said before anything is driven. It serves the first episode.
    first = make()
    role = _role(first)
    waiting = [first]

    def next_node() -> Node:
        return waiting.pop() if waiting else make()

    with Connection.open(options) as connection:
        info = connection.run_info()
        needs_prediction = isinstance(first, Planner) and first.needs_prediction
        if needs_prediction and not info.predictor:
            raise NodeError(
                f"this planner needs a predictor, and run {options.run} has none\n"
                "  hint: give it one with `sim run --predictor ctrv`"
            )
        desks: dict[str, Desk] = {}
        channel = CHANNELS[role]

        def hear(telling: Telling) -> None:
            worker = telling.worker
            if worker not in desks:
                desks[worker] = Desk(
                    role, next_node, needs_prediction=needs_prediction, ask_scene=lambda: connection.scene(worker)
                )
            began = time.monotonic()
            told = _told(telling)
            answer = None if told is None else desks[worker].take(told)
            if answer is not None:
                connection.say(telling.key, channel, answer)
                _complain(answer, time.monotonic() - began, info.deadline)

        return connection.serve(role, hear)


def _role(node: object) -> str:
    if isinstance(node, Planner):
        return "planner"
    if isinstance(node, Predictor):
        return "predictor"
    if isinstance(node, Traffic):
        return "traffic"
    raise TypeError(
        f"reloop.serve wants a Planner, a Predictor or Traffic, and what it was given makes a {type(node).__name__}"
    )


def _told(telling: Telling) -> Any:
    """What the sim tells; None where that cannot be read, which ends no drive: no answer comes, and the sim says so."""
    try:
        return messages.Told.FromString(telling.payload)
    except DecodeError as error:
        log.error("a message of worker %s is passed over: %s", telling.worker, error)
        return None


def _complain(answer: Any, seconds: float, deadline: float | None) -> None:
    """Says so where an answer came too late: the sim has ended the episode by then."""
    if deadline is None or seconds <= deadline:
        return
    step = getattr(getattr(answer, answer.WhichOneof("what")), "step", 0)
    log.error(
        "step %d took %.1f s; the sim waits %g s (`sim run --deadline 30s` has it wait longer)", step, seconds, deadline
    )
