"""The reference line along the route, and its window around the AV.

Samples are 0.1 m apart. At each step the sim names the stretch of the line from 20 m behind the AV to 100 m ahead, by
its first sample and their number: that stretch is the window. It is a view of the line's own arrays, nothing is copied.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import ReadError
from .arrays import Flags, Floats, Ints, floats, frozen, ints

#: m/s: 25 mph, where the map gives no limit.
_UNKNOWN_LIMIT = 11.176
#: 1.5 m.
_BEND_SAMPLES = 15

_COLUMNS = ("x", "y", "z", "heading", "curvature", "speed_limit")


@dataclass(frozen=True, eq=False)
class Line:
    """Samples of the reference line: columns of shape (samples,)."""

    #: m.
    x: Floats
    y: Floats
    z: Floats
    #: rad.
    heading: Floats
    #: 1/m, positive to the left.
    curvature: Floats
    #: m/s, 0 where it is not known.
    speed_limit: Floats
    #: Whether the sample lies on a crosswalk.
    crosswalk: Flags

    def __len__(self) -> int:
        return len(self.x)

    @cached_property
    def station(self) -> Floats:
        """Distance along the line from its first sample (m), shape (samples,)."""
        return frozen(np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(self.x), np.diff(self.y)))])[: len(self)])

    def nearest(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Ints:
        """Index of the sample nearest to each point; the shape is that of ``x`` and ``y`` (m).

        Raises ``ValueError`` where the line has no sample.
        """
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if not len(self):
            raise ValueError("the reference line has no sample here")
        squared = (x[..., None] - self.x) ** 2 + (y[..., None] - self.y) ** 2
        return np.asarray(np.argmin(squared, axis=-1))

    def project(self, x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Station of the sample nearest to each point, and the distance to it, positive to the left (m).

        Both have the shape of ``x`` and ``y``. A point before or behind the line gets the station of that end, and its
        distance to it: so what is far away is far from the line.

        Raises ``ValueError`` where the line has no sample.
        """
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        at = self.nearest(x, y)
        dx, dy = x - self.x[at], y - self.y[at]
        left = np.cos(self.heading[at]) * dy - np.sin(self.heading[at]) * dx
        return self.station[at], np.copysign(np.hypot(dx, dy), left)

    def sample(self, station: npt.ArrayLike) -> Ints:
        """Index of the sample at each station (m); beyond an end it is that end's. The shape is that of ``station``."""
        index = np.searchsorted(self.station, np.asarray(station) - 0.05)
        return np.asarray(np.clip(index, 0, max(len(self) - 1, 0)))

    def pose(self, station: npt.ArrayLike) -> Floats:
        """x, y (m) and heading (rad) at each station (m), between samples too: shape (..., 3). Beyond an end it is that
        end's."""
        station = np.asarray(station, dtype=np.float64)
        columns = (self.x, self.y, self._winding)
        return np.stack([np.interp(station, self.station, column) for column in columns], axis=-1)

    def cruise(self, station: npt.ArrayLike, lateral_acceleration: float = 2.0) -> Floats:
        """The speed (m/s) at each station (m) where nobody is in the way; the shape is that of ``station``.

        It is the speed limit, 11.2 m/s where that is not known, and less in bends: no more than
        ``lateral_acceleration`` (m/s²) across. Not less before them: how to brake is the planner's own.
        """
        at = self.sample(station)
        limit = np.where(self.speed_limit[at] > 0.0, self.speed_limit[at], _UNKNOWN_LIMIT)
        return np.asarray(np.minimum(limit, np.sqrt(lateral_acceleration / np.maximum(self._bend[at], 1e-6))))

    @cached_property
    def _winding(self) -> Floats:
        """Heading (rad) without jumps by a full turn."""
        return frozen(np.unwrap(self.heading))

    @cached_property
    def _bend(self) -> Floats:
        """Magnitude of the curvature (1/m), from headings 1.5 m before and after: the column's own has kinks."""
        before = np.maximum(np.arange(len(self)) - _BEND_SAMPLES, 0)
        after = np.minimum(np.arange(len(self)) + _BEND_SAMPLES, max(len(self) - 1, 0))
        length = np.maximum(self.station[after] - self.station[before], 1e-6)
        return frozen(np.abs(self._winding[after] - self._winding[before]) / length)


@dataclass(frozen=True, eq=False)
class Window(Line):
    """The stretch of the reference line around the AV, at most 1,200 samples; stations count from its first."""

    #: Number of its first sample in the whole line.
    first_sample: int
    #: Samples of the window at which a red signal's stop point lies on the line at this step, ascending.
    red_stops: Ints


def line(message: Any) -> Line:
    """The view of a message ``ReferenceLine``."""
    columns = {name: floats(getattr(message, name)) for name in _COLUMNS}
    return Line(crosswalk=frozen(np.array(message.crosswalk, dtype=np.bool_)), **columns)


def window(observation: Any, whole: Line) -> Window:
    """The window of a message ``Observation``, in an episode whose reference line is ``whole``.

    One of version 2 (old recordings) brings its samples along, and they are what counts.

    Raises ``ReadError`` where it lies beyond the line.
    """
    first, samples = observation.window_first_sample, observation.window_samples
    if observation.HasField("window"):
        of, stretch = line(observation.window), slice(None)
    else:
        of, stretch = whole, slice(first, first + samples)
        if first + samples > len(whole):
            raise ReadError(f"the window ends at sample {first + samples} of a line that has {len(whole)}")
    columns = {name: getattr(of, name)[stretch] for name in (*_COLUMNS, "crosswalk")}
    if observation.HasField("window_speed_limit"):
        columns["speed_limit"] = frozen(np.full(len(columns["x"]), observation.window_speed_limit))
    return Window(first_sample=first, red_stops=ints(observation.red_stops), **columns)
