"""The map: lanes, road edges and lines, crosswalks, stop signs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

from .arrays import Floats, floats, points

#: m/s in a mile an hour.
_MPH = 0.44704


class LaneKind(IntEnum):
    """What a lane is for."""

    UNDEFINED = 0
    FREEWAY = 1
    SURFACE_STREET = 2
    BIKE_LANE = 3


class RoadLineKind(IntEnum):
    """How a line is painted."""

    UNKNOWN = 0
    BROKEN_SINGLE_WHITE = 1
    SOLID_SINGLE_WHITE = 2
    SOLID_DOUBLE_WHITE = 3
    BROKEN_SINGLE_YELLOW = 4
    BROKEN_DOUBLE_YELLOW = 5
    SOLID_SINGLE_YELLOW = 6
    SOLID_DOUBLE_YELLOW = 7
    PASSING_DOUBLE_YELLOW = 8


class RoadEdgeKind(IntEnum):
    """What lies beyond an edge."""

    UNKNOWN = 0
    BOUNDARY = 1
    MEDIAN = 2


@dataclass(frozen=True, slots=True)
class Boundary:
    """A stretch of a lane's boundary."""

    #: First and last point of the lane's centreline that it lies beside.
    lane_start: int
    lane_end: int
    #: Id of the road line or edge.
    feature: int
    kind: RoadLineKind


@dataclass(frozen=True, slots=True)
class Neighbor:
    """A lane beside a lane, and where: points of both centrelines, the last ones included."""

    lane: int
    self_start: int
    self_end: int
    neighbor_start: int
    neighbor_end: int
    boundaries: tuple[Boundary, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Lane:
    """A lane."""

    id: int
    kind: LaneKind
    #: m/s, 0 where it is not known.
    speed_limit: float
    #: Laid between two others, as within an intersection.
    interpolating: bool
    #: x, y, z along its middle (m), shape (points, 3).
    centerline: Floats
    #: Ids of the lanes that lead into it, and that it leads to.
    entries: tuple[int, ...]
    exits: tuple[int, ...]
    left_neighbors: tuple[Neighbor, ...]
    right_neighbors: tuple[Neighbor, ...]
    left_boundaries: tuple[Boundary, ...]
    right_boundaries: tuple[Boundary, ...]


@dataclass(frozen=True, eq=False, slots=True)
class RoadLine:
    """A painted line."""

    id: int
    kind: RoadLineKind
    #: x, y, z (m), shape (points, 3).
    points: Floats


@dataclass(frozen=True, eq=False, slots=True)
class RoadEdge:
    """An edge of the road; the road lies to its left."""

    id: int
    kind: RoadEdgeKind
    #: x, y, z (m), shape (points, 3).
    points: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Area:
    """A crosswalk, a speed bump or a driveway."""

    id: int
    #: x, y, z of its corners (m), shape (corners, 3); the first is not repeated.
    polygon: Floats


@dataclass(frozen=True, eq=False, slots=True)
class StopSign:
    """A stop sign."""

    id: int
    #: Ids of the lanes that it is for.
    lanes: tuple[int, ...]
    #: x, y, z (m), shape (3,).
    position: Floats


class Map:
    """The map of a scene. Each kind of feature is read when it is first asked for."""

    def __init__(self, message: Any) -> None:
        self._message = message

    @cached_property
    def lanes(self) -> dict[int, Lane]:
        """Lanes by id, in the map's order."""
        return {lane.id: _lane(lane) for lane in self._message.lanes}

    @cached_property
    def road_lines(self) -> dict[int, RoadLine]:
        """Painted lines by id."""
        return {m.id: RoadLine(m.id, RoadLineKind(m.kind), points(m.polyline)) for m in self._message.road_lines}

    @cached_property
    def road_edges(self) -> dict[int, RoadEdge]:
        """Road edges by id."""
        return {m.id: RoadEdge(m.id, RoadEdgeKind(m.kind), points(m.polyline)) for m in self._message.road_edges}

    @cached_property
    def stop_signs(self) -> dict[int, StopSign]:
        """Stop signs by id."""
        return {m.id: StopSign(m.id, tuple(m.lanes), floats([m.x, m.y, m.z])) for m in self._message.stop_signs}

    @cached_property
    def crosswalks(self) -> dict[int, Area]:
        """Crosswalks by id."""
        return _areas(self._message.crosswalks)

    @cached_property
    def speed_bumps(self) -> dict[int, Area]:
        """Speed bumps by id."""
        return _areas(self._message.speed_bumps)

    @cached_property
    def driveways(self) -> dict[int, Area]:
        """Driveways by id."""
        return _areas(self._message.driveways)


def _lane(message: Any) -> Lane:
    return Lane(
        id=message.id,
        kind=LaneKind(message.kind),
        speed_limit=message.speed_limit_mph * _MPH,
        interpolating=message.interpolating,
        centerline=points(message.centerline),
        entries=tuple(message.entries),
        exits=tuple(message.exits),
        left_neighbors=_neighbors(message.left_neighbors),
        right_neighbors=_neighbors(message.right_neighbors),
        left_boundaries=_boundaries(message.left_boundaries),
        right_boundaries=_boundaries(message.right_boundaries),
    )


def _neighbors(messages: Any) -> tuple[Neighbor, ...]:
    return tuple(
        Neighbor(
            m.lane,
            m.self_start_index,
            m.self_end_index,
            m.neighbor_start_index,
            m.neighbor_end_index,
            _boundaries(m.boundaries),
        )
        for m in messages
    )


def _boundaries(messages: Any) -> tuple[Boundary, ...]:
    return tuple(Boundary(m.lane_start_index, m.lane_end_index, m.feature, RoadLineKind(m.kind)) for m in messages)


def _areas(messages: Any) -> dict[int, Area]:
    return {m.id: Area(m.id, points(m.polygon)) for m in messages}
