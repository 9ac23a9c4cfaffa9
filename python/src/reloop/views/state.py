"""One box, and what drives it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class State:
    """The box of one road user at one step."""

    #: Centre of the box (m).
    x: float
    y: float
    z: float
    #: rad, counter-clockwise from +x.
    heading: float
    #: m/s, along the axes of the log's frame.
    velocity_x: float
    velocity_y: float
    #: Size (m).
    length: float
    width: float
    height: float

    @property
    def speed(self) -> float:
        """m/s, never negative."""
        return math.hypot(self.velocity_x, self.velocity_y)


@dataclass(frozen=True, slots=True)
class Control:
    """What drives the AV through one step."""

    #: m/s².
    acceleration: float
    #: Angle of the front wheels (rad), positive to the left.
    steering: float


def state(message: Any) -> State:
    """The view of a message ``AgentState``."""
    return State(
        message.x,
        message.y,
        message.z,
        message.heading,
        message.velocity_x,
        message.velocity_y,
        message.length,
        message.width,
        message.height,
    )


def control(message: Any) -> Control:
    """The view of a message ``Control``."""
    return Control(message.acceleration, message.steering)
