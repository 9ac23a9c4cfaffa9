"""A scene as our judges see it, behind nuPlan's map interface.

What stands for nuPlan's polygons is in docs/metrics.md: strips of ground for lanes and connectors, the left of road edges for the
drivable area. nuPlan asks objects for `contains_point`, `polygon.distance`, `baseline_path.linestring` and the like; these answer.
"""

import math

import numpy as np
from nuplan.common.maps.abstract_map_objects import Lane, LaneConnector
from nuplan.common.maps.maps_datatypes import SemanticMapLayer
from shapely.geometry import LineString, Point, Polygon

ALIGNED = math.cos(math.pi / 4)
BESIDE_INTERSECTION = 5.0  # m
EDGE_REACH = 10.0  # m


class Segments:
    """Line segments, to find the one nearest to a point."""

    def __init__(self, lines):
        lines = [np.asarray(line, float) for line in lines] or [np.empty((0, 2))]
        self.start = np.concatenate([line[:-1] for line in lines])
        self.along = np.concatenate([line[1:] - line[:-1] for line in lines])
        self.length = np.hypot(*self.along.T)

    def nearest(self, point):
        """Number of the nearest segment, fraction along it, distance."""
        offset = np.asarray(point) - self.start
        fraction = np.clip((offset * self.along).sum(1) / self.length**2, 0, 1)
        distance = np.hypot(*(offset - fraction[:, None] * self.along).T)
        index = int(distance.argmin())
        return index, fraction[index], distance[index]

    def ahead(self, index, point):
        """How far the point is along and to the left of a segment's start."""
        direction = self.along[index] / self.length[index]
        x, y = np.asarray(point) - self.start[index]
        return direction[0] * x + direction[1] * y, direction[0] * y - direction[1] * x


class Strip:
    """What a lane covers; stands for its polygon and its road block too."""

    def __init__(self, lane):
        self.segments = Segments([lane["line"]])
        self.widths = np.asarray(lane["widths"])

    def outside(self, point, heading=None):
        """How far the point is outside, its distance to the center line, and the cosine to the lane."""
        index, fraction, distance = self.segments.nearest(point)
        ahead, left = self.segments.ahead(index, point)
        last = len(self.segments.length) - 1
        beyond = max(-ahead if index == 0 else 0, ahead - self.segments.length[index] if index == last else 0, 0)
        side = int(left < 0)
        width = self.widths[index][side] * (1 - fraction) + self.widths[index + 1][side] * fraction
        beside = max((abs(left) if beyond else distance) - width, 0)
        direction = self.segments.along[index] / self.segments.length[index]
        aligned = 0 if heading is None else direction[0] * math.cos(heading) + direction[1] * math.sin(heading)
        return math.hypot(beyond, beside), distance, aligned

    def distance(self, point):
        """shapely's name: to a shapely point."""
        return self.outside((point.x, point.y))[0]


class Baseline:
    """A lane's center line."""

    def __init__(self, line):
        self.linestring = LineString(line)


def lane_class(base):
    """A lane or a connector of nuPlan's interface."""

    class Of(base):
        """One of ours."""

        def __init__(self, index, lane, world):
            super().__init__(str(index))
            self.strip, self.lane, self.world = Strip(lane), lane, world
            self._baseline = Baseline(lane["line"])

        def _linked(self, key):
            return [self.world.lanes[index] for index in self.lane[key]]

        def _speed_limit(self):
            return self.lane["speed_limit"] or None

        polygon = property(lambda self: self.strip)
        incoming_edges = property(lambda self: self._linked("entries"))
        outgoing_edges = property(lambda self: self._linked("exits"))
        baseline_path = property(lambda self: self._baseline)
        speed_limit_mps = property(_speed_limit)

        def contains_point(self, point):
            return self.strip.outside((point.x, point.y))[0] == 0

        def get_roadblock_id(self):
            return self.id

    Of.__abstractmethods__ = frozenset()
    return Of


class RoadBlock:
    """The way along one of the expert's lanes: what is beside it, as far as a drive gets that ends as off route."""

    def __init__(self, lane, reach):
        self.strip, self.reach = lane.strip, reach

    def contains_point(self, point):
        index, _, distance = self.strip.segments.nearest((point.x, point.y))
        ahead, _ = self.strip.segments.ahead(index, (point.x, point.y))
        last = len(self.strip.segments.length) - 1
        beyond = (index == 0 and ahead < 0) or (index == last and ahead > self.strip.segments.length[index])
        return not beyond and distance <= 2 * self.reach


class World:
    """nuPlan's map API over one scene. `headings` holds, for each point that will be asked for, where the body looks."""

    def __init__(self, seen, off_route_distance=5.0):
        kinds = lane_class(Lane), lane_class(LaneConnector)
        self.lanes = [kinds[lane["connector"]](i, lane, self) for i, lane in enumerate(seen["lanes"])]
        for lane in self.lanes:
            if lane.lane["connector"] and not lane.incoming_edges + lane.outgoing_edges:
                # nuPlan's connectors always join something: one that does not has its own limit.
                lane._linked = lambda key, lane=lane: [Own(lane)] if key == "exits" else []
        self.boxes = np.array([self._box(lane) for lane in seen["lanes"]]).reshape(-1, 4)
        self.edges = Edges(seen["edges"])
        self.driveways = [Polygon(corners) for corners in seen["driveways"] if len(corners) > 2]
        self.off_route_distance = off_route_distance
        self.headings = {}
        self._found = {}

    @staticmethod
    def _box(lane):
        line = np.asarray(lane["line"])
        return np.concatenate([line.min(0) - 10, line.max(0) + 10])

    def holding(self, point):
        """(lane, how far outside, distance, alignment) of the lanes around a point."""
        key = (point.x, point.y)
        if key not in self._found:
            near = (self.boxes[:, :2] <= key).all(1) & (self.boxes[:, 2:] >= key).all(1)
            heading = self.headings.get(key)
            self._found[key] = [(self.lanes[i], *self.lanes[i].strip.outside(key, heading)) for i in np.flatnonzero(near)]
        return self._found[key]

    def _ranked(self, point, connector):
        held = [row for row in self.holding(point) if row[1] == 0 and row[0].lane["connector"] == connector]
        return sorted(held, key=lambda row: (0, row[2]) if row[3] >= ALIGNED else (1, -row[3]))

    def get_one_map_object(self, point, layer):
        assert layer == SemanticMapLayer.LANE
        lanes, connectors = self._ranked(point, False), self._ranked(point, True)
        if not lanes or (lanes[0][3] < ALIGNED and connectors and connectors[0][3] >= ALIGNED):
            return None
        return lanes[0][0]

    def get_all_map_objects(self, point, layer):
        assert layer == SemanticMapLayer.LANE_CONNECTOR
        return [row[0] for row in self._ranked(point, True)]

    def is_in_layer(self, point, layer):
        if layer == SemanticMapLayer.DRIVABLE_AREA:
            return self._beyond(point) <= 0
        assert layer == SemanticMapLayer.INTERSECTION
        rows = self.holding(point)
        inside = [row for row in rows if row[1] == 0]
        return any(row[0].lane["connector"] and row[1] < BESIDE_INTERSECTION for row in inside or rows)

    def get_distance_to_nearest_map_object(self, point, layer):
        assert layer == SemanticMapLayer.DRIVABLE_AREA
        return "", max(self._beyond(point), 0)

    def _beyond(self, point):
        """How far beyond the road's edge; driveways are road."""
        beyond = self.edges.beyond((point.x, point.y))
        is_driveway = beyond > 0 and any(area.contains(Point(point.x, point.y)) for area in self.driveways)
        return -beyond if is_driveway else beyond

    def get_map_object(self, object_id, _layer):
        return RoadBlock(self.lanes[int(object_id)], self.off_route_distance)


class Own:
    """Stands for what a connector without links leads to: itself, for its speed limit."""

    def __init__(self, lane):
        self.id, self.speed_limit_mps = "own", lane.speed_limit_mps

    def contains_point(self, _point):
        return False


class Edges:
    """Road edges; the road is to their left."""

    def __init__(self, chains):
        self.segments = Segments(chains)
        self.before, self.after = [], []
        first = 0
        starts, ends = {}, {}
        for chain in chains:
            count = len(chain) - 1
            self.before += [None, *range(first, first + count - 1)]
            self.after += [*range(first + 1, first + count), None]
            starts.setdefault(tuple(chain[0]), first)
            ends[first + count - 1] = tuple(chain[-1])
            first += count
        for last, end in sorted(ends.items()):
            if end in starts:
                self.after[last] = starts.pop(end)
                self.before[self.after[last]] = last

    def beyond(self, point):
        """How far the point is beyond the nearest edge (m); far within the road where none is near."""
        if not len(self.segments.length):
            return -math.inf
        index, fraction, distance = self.segments.nearest(point)
        if distance > EDGE_REACH:
            return -math.inf
        ahead, left = self.segments.ahead(index, point)
        is_left = left > 0
        corner = None
        if fraction <= 0:
            corner = (self.before[index], index)
        elif fraction >= 1:
            corner = (index, self.after[index])
        if corner and None not in corner:
            sides = [self.segments.ahead(i, point)[1] > 0 for i in corner]
            (ax, ay), (bx, by) = self.segments.along[list(corner)]
            is_left = all(sides) if ax * by - ay * bx >= 0 else any(sides)
        elif corner and (ahead < 0 or ahead > self.segments.length[index]):
            return -distance  # past a free end there is no side to be on
        return -distance if is_left else distance
