"""What was seen so far."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .agents import Agents, agents
from .arrays import Floats, Ints, floats, frozen, ints
from .state import State, state

#: The last axis of ``History.of``.
FIELDS = ("x", "y", "heading", "velocity_x", "velocity_y", "length", "width")


@dataclass(frozen=True, eq=False, slots=True)
class Moment:
    """The AV and the agents at one step."""

    log_index: int
    av: State
    agents: Agents


class History(Sequence[Moment]):
    """The last steps, oldest first; the newest is the observation of now.

    As many steps are kept as the scene told, and one more: 2 s under the usual settings.
    """

    def __init__(self, moments: Iterable[Moment], keep: int) -> None:
        self._moments = list(moments)
        self._keep = keep

    @classmethod
    def before(cls, scene: Any) -> History:
        """That of a message ``Scene``."""
        told = (Moment(m.log_index, state(m.av), agents(m.agents)) for m in scene.history)
        # Two steps at least, so that there is always a difference to take.
        return cls(told, keep=max(len(scene.history) + 1, 2))

    def and_now(self, now: Moment) -> History:
        """This history with ``now`` as its newest step; one that it has already, or a later one, is replaced."""
        earlier = [moment for moment in self._moments if moment.log_index < now.log_index]
        return History([*earlier, now][-self._keep :], self._keep)

    def __len__(self) -> int:
        return len(self._moments)

    def __getitem__(self, which: Any) -> Any:
        return self._moments[which]

    def __iter__(self) -> Iterator[Moment]:
        return iter(self._moments)

    @property
    def log_index(self) -> Ints:
        """Log index of each step, shape (steps,)."""
        return ints([moment.log_index for moment in self._moments])

    @property
    def av(self) -> Floats:
        """The AV at each step, shape (steps, 7): ``FIELDS``."""
        return floats([[getattr(moment.av, name) for name in FIELDS] for moment in self._moments])

    def of(self, tracks: Iterable[int]) -> Floats:
        """The states of these tracks at each step, shape (tracks, steps, 7): ``FIELDS``, NaN where one was not seen.

        Metres, rad, m/s. ``history.of(step.agents.track)`` is everybody who is there now.
        """
        row = {int(track): place for place, track in enumerate(tracks)}
        states = np.full((len(row), len(self), len(FIELDS)), np.nan)
        for column, moment in enumerate(self._moments):
            columns = np.column_stack([getattr(moment.agents, name) for name in FIELDS])
            for place, track in enumerate(moment.agents.track.tolist()):
                if track in row:
                    states[row[track], column] = columns[place]
        return frozen(states)
