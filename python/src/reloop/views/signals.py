"""Traffic lights at one step, as columns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from .arrays import Flags, Floats, Ints, floats, ints


class SignalState(IntEnum):
    """What a signal shows."""

    UNKNOWN = 0
    ARROW_STOP = 1
    ARROW_CAUTION = 2
    ARROW_GO = 3
    STOP = 4
    CAUTION = 5
    GO = 6
    FLASHING_STOP = 7
    FLASHING_CAUTION = 8


@dataclass(frozen=True, eq=False, slots=True)
class Signals:
    """All signals at one step: columns of shape (signals,)."""

    #: Id of the lane behind the stop line.
    lane: Ints
    #: ``SignalState``.
    state: Ints
    #: Stop point (m).
    x: Floats
    y: Floats
    z: Floats
    #: Steps since it was last listed; more than 0 where it is supposed to show the same still (``strict`` alone).
    unseen: Ints

    def __len__(self) -> int:
        return len(self.lane)

    @property
    def red(self) -> Flags:
        """Whether the lane must not be entered, shape (signals,): a flashing stop is a stop sign, not a red light."""
        return np.isin(self.state, [SignalState.STOP, SignalState.ARROW_STOP])


def signals(messages: Any) -> Signals:
    """The view of repeated messages ``Signal``."""
    return Signals(
        lane=ints([signal.lane for signal in messages]),
        state=ints([signal.state for signal in messages]),
        x=floats([signal.stop_x for signal in messages]),
        y=floats([signal.stop_y for signal in messages]),
        z=floats([signal.stop_z for signal in messages]),
        unseen=ints([signal.unseen for signal in messages]),
    )
