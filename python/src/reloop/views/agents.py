"""The other road users at one step, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from .arrays import Flags, Floats, Ints, floats, frozen, ints


class AgentKind(IntEnum):
    """What a road user is."""

    OTHER = 0
    VEHICLE = 1
    PEDESTRIAN = 2
    CYCLIST = 3


@dataclass(frozen=True, eq=False, slots=True)
class Agents:
    """All agents at one step but the AV: columns of one length, shape (agents,), in the log's order."""

    #: Number of the track: the same agent has the same at every step.
    track: Ints
    #: ``AgentKind``.
    kind: Ints
    #: Centre of the box (m).
    x: Floats
    y: Floats
    z: Floats
    #: rad.
    heading: Floats
    #: m/s, along the axes of the log's frame.
    velocity_x: Floats
    velocity_y: Floats
    #: m/s, never negative.
    speed: Floats
    #: Size (m).
    length: Floats
    width: Floats
    height: Floats
    #: Steps since it was last seen; more than 0 where the state is supposed from the past (``strict`` alone).
    unseen: Ints

    def __len__(self) -> int:
        return len(self.track)

    def __getitem__(self, which: Flags | Ints | slice | Sequence[int]) -> Agents:
        """The agents that a mask, a slice or indices pick: ``agents[agents.kind == AgentKind.PEDESTRIAN]``."""
        return Agents(*(frozen(getattr(self, name)[which]) for name in self.__slots__))

    @property
    def position(self) -> Floats:
        """Centres, shape (agents, 2) (m)."""
        return np.column_stack([self.x, self.y])

    @property
    def velocity(self) -> Floats:
        """Shape (agents, 2) (m/s)."""
        return np.column_stack([self.velocity_x, self.velocity_y])


_STATE = ("x", "y", "z", "heading", "velocity_x", "velocity_y")
_SIZE = ("length", "width", "height")


def agents(messages: Any) -> Agents:
    """The view of repeated messages ``Agent``."""
    states = [agent.state for agent in messages]
    column = {name: floats([getattr(s, name) for s in states]) for name in _STATE + _SIZE}
    return Agents(
        track=ints([agent.track for agent in messages]),
        kind=ints([agent.kind for agent in messages]),
        speed=frozen(np.hypot(column["velocity_x"], column["velocity_y"])),
        unseen=ints([agent.unseen for agent in messages]),
        **column,
    )
