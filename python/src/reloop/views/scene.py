"""What is told before the first step of an episode."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from .history import History
from .line import Line, line
from .roads import Map


class Scene:
    """A scene: its map, the route, and what was before the first step. Never a logged state of the future."""

    def __init__(self, message: Any) -> None:
        self._message = message

    def __repr__(self) -> str:
        return f"Scene({self.id!r}, protocol={self.protocol!r})"

    @property
    def id(self) -> str:
        """The scene's id."""
        return str(self._message.scene)

    @property
    def protocol(self) -> str:
        """By which rules it is driven: ``strict`` or ``paper``."""
        return str(self._message.protocol)

    @property
    def start(self) -> int:
        """Log index of step 0."""
        return int(self._message.start)

    @property
    def horizon(self) -> int:
        """The most steps that will be driven."""
        return int(self._message.horizon)

    @property
    def wheelbase(self) -> float:
        """The AV's distance between axles (m), as the sim's vehicle model has it."""
        return float(self._message.wheelbase)

    @cached_property
    def map(self) -> Map:
        """The map."""
        return Map(self._message.map)

    @cached_property
    def route(self) -> tuple[int, ...]:
        """Ids of the lanes that the AV is to follow, in order."""
        return tuple(self._message.route)

    @cached_property
    def line(self) -> Line:
        """The smooth line along the route, whole, samples 0.1 m apart."""
        return line(self._message.reference_line)

    @cached_property
    def history(self) -> History:
        """What was before, up to log index ``start`` - 1, oldest first."""
        return History.before(self._message)
