"""The agents that are taken over from the log, and where they go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import ReadError
from .agents import AgentKind
from .arrays import Floats, frozen, points
from .state import State, state

#: Distance between samples of a way (m).
WAY_SPACING = 0.5
#: Headings are of chords over so many samples to either side (1 m), as ``world/src/traffic/way.rs`` has them.
_CHORD = 2


@dataclass(frozen=True, slots=True)
class LaneStretch:
    """A lane under a way, from a station on."""

    #: How far along the way it begins (m).
    start: float
    #: Its id in ``scene.map.lanes``; None off the lanes.
    lane: int | None


@dataclass(frozen=True, eq=False)
class Way:
    """Where an agent goes: where, never when. It begins a little behind the place where the agent was taken over."""

    #: Samples 0.5 m apart, shape (samples, 3): x, y, z (m).
    points: Floats
    #: The lanes under it, one after the other.
    lanes: tuple[LaneStretch, ...]

    @property
    def length(self) -> float:
        """m."""
        return (len(self.points) - 1) * WAY_SPACING

    @cached_property
    def heading(self) -> Floats:
        """Direction at each sample (rad), without jumps by a full turn, shape (samples,)."""
        at = np.arange(len(self.points))
        chord = self.points[np.minimum(at + _CHORD, len(at) - 1)] - self.points[np.maximum(at - _CHORD, 0)]
        return frozen(np.unwrap(np.arctan2(chord[:, 1], chord[:, 0])))

    def project(self, x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Station along the way of each point (m), and its distance to the left of it (m); both have the shape of ``x``
        and ``y`` (m). Beyond an end the station is that end's."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        squared = (x[..., None] - self.points[:, 0]) ** 2 + (y[..., None] - self.points[:, 1]) ** 2
        at = np.argmin(squared, axis=-1)
        dx, dy = x - self.points[at, 0], y - self.points[at, 1]
        cos, sin = np.cos(self.heading[at]), np.sin(self.heading[at])
        station = np.clip(at * WAY_SPACING + cos * dx + sin * dy, 0.0, self.length)
        return station, np.asarray(cos * dy - sin * dx)

    def pose(self, station: npt.ArrayLike) -> Floats:
        """x, y (m) and heading (rad) at each station (m), between samples too: shape (..., 3). Beyond an end it is that
        end's."""
        columns = (self.points[:, 0], self.points[:, 1], self.heading)
        return np.stack([self._between(station, column) for column in columns], axis=-1)

    def height(self, station: npt.ArrayLike) -> Floats:
        """z of the ground at each station (m); the shape is that of ``station``."""
        return self._between(station, self.points[:, 2])

    def lane_at(self, station: float) -> int | None:
        """The lane at a station (m); None off the lanes."""
        under = [stretch.lane for stretch in self.lanes if stretch.start <= station]
        return under[-1] if under else None

    def _between(self, station: npt.ArrayLike, column: Floats) -> Floats:
        sample = np.asarray(station, dtype=np.float64) / WAY_SPACING
        return np.asarray(np.interp(sample, np.arange(len(column)), column))


@dataclass(frozen=True, eq=False, slots=True)
class Taken:
    """An agent that is taken over from the log for the coming step."""

    #: Number of its track.
    track: int
    kind: AgentKind
    #: Number of the step at which it was taken over: there it still is where it was logged.
    since_step: int
    #: Where it is now.
    state: State
    #: Where it goes.
    way: Way


class KnownWays:
    """The ways that were told of an episode's agents: each is told once."""

    def __init__(self) -> None:
        self._ways: dict[int, Way] = {}

    def taken(self, message: Any) -> tuple[Taken, ...]:
        """The view of a message ``TakenAgents``, in its order.

        Raises ``ReadError`` where a way is none, or none was told.
        """
        return tuple(self._one(place, told) for place, told in enumerate(message.agents))

    def _one(self, place: int, told: Any) -> Taken:
        track = told.agent.track
        if told.HasField("way"):
            self._ways[track] = _way(place, told.way)
        if track not in self._ways:
            raise ReadError(f"agents[{place}].way is missing: none was told of track {track}")
        state_now, kind = state(told.agent.state), AgentKind(told.agent.kind)
        return Taken(track, kind, told.since_step, state_now, self._ways[track])


def _way(place: int, message: Any) -> Way:
    sizes = {len(column) for column in (message.samples.x, message.samples.y, message.samples.z)}
    if len(sizes) != 1 or min(sizes) < 2:
        raise ReadError(f"agents[{place}].way.samples is no line: its columns have {sorted(sizes)} numbers")
    samples = points(message.samples)
    if not np.isfinite(samples).all():
        raise ReadError(f"agents[{place}].way.samples is not finite")
    # `from` is a word of Python's own.
    lanes = [LaneStretch(getattr(each, "from"), each.lane if each.HasField("lane") else None) for each in message.lanes]
    return Way(samples, tuple(lanes))
