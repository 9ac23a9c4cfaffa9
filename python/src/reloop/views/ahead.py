"""What is in the AV's way along the reference line now: a start for planners that follow it. Nobody is predicted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .arrays import Floats, Ints, frozen

if TYPE_CHECKING:
    from .step import Step

#: Room to either side of the AV (m).
_MARGIN = 0.3
#: The track of what is no agent: a red light, the end of the line.
NOBODY = -1


@dataclass(frozen=True, eq=False, slots=True)
class Ahead:
    """What to stop before or to follow, nearest first: columns of shape (things,)."""

    #: Where its near end is, along the window (m). The AV's front is at its own station plus half its length.
    station: Floats
    #: Its speed along the line (m/s), never negative.
    speed: Floats
    #: Its track; -1 for a red light, and for the end of the line.
    track: Ints

    def __len__(self) -> int:
        return len(self.station)


def ahead(step: Step) -> Ahead:
    """See ``Step.ahead``."""
    line, av, agents = step.window, step.av, step.agents
    own = float(line.project(av.x, av.y)[0])
    station, aside = line.project(agents.x, agents.y)
    turn = agents.heading - line.heading[line.sample(station)]
    # Half of the box that the agent takes of the line, along it and across.
    along = (np.abs(np.cos(turn)) * agents.length + np.abs(np.sin(turn)) * agents.width) / 2
    across = (np.abs(np.sin(turn)) * agents.length + np.abs(np.cos(turn)) * agents.width) / 2
    there = (np.abs(aside) - across < av.width / 2 + _MARGIN) & (station > own)
    stops = line.station[line.red_stops]
    stops = stops[stops > own]
    if line.first_sample + len(line) >= len(step.scene.line):
        stops = np.append(stops, line.station[-1])
    stations = np.concatenate([(station - along)[there], stops])
    speeds = np.concatenate([np.maximum(agents.speed * np.cos(turn), 0.0)[there], np.zeros(len(stops))])
    tracks = np.concatenate([agents.track[there], np.full(len(stops), NOBODY)])
    order = np.argsort(stations, kind="stable")
    return Ahead(frozen(stations[order]), frozen(speeds[order]), frozen(tracks[order]))
