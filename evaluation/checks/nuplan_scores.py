"""What nuPlan's classes say of drives, boxes and paths of ours."""

import math
import pathlib
import re
import tempfile
from types import SimpleNamespace

import nuplan.planning as planning
import numpy as np
from nuplan.common.actor_state.agent import Agent
from nuplan.common.actor_state.car_footprint import CarFootprint
from nuplan.common.actor_state.dynamic_car_state import DynamicCarState
from nuplan.common.actor_state.ego_state import EgoState
from nuplan.common.actor_state.oriented_box import OrientedBox, in_collision
from nuplan.common.actor_state.scene_object import SceneObjectMetadata
from nuplan.common.actor_state.state_representation import StateSE2, StateVector2D, TimePoint
from nuplan.common.actor_state.tracked_objects import TrackedObjects
from nuplan.common.actor_state.tracked_objects_types import TrackedObjectType as Kind
from nuplan.common.actor_state.vehicle_parameters import VehicleParameters
from nuplan.common.maps.abstract_map_objects import Lane
from nuplan.planning.metrics.aggregator.weighted_average_metric_aggregator import WeightedAverageMetricAggregator
from nuplan.planning.metrics.evaluation_metrics.common import (
    drivable_area_compliance,
    driving_direction_compliance,
    ego_is_comfortable,
    ego_is_making_progress,
    ego_jerk,
    ego_lane_change,
    ego_lat_acceleration,
    ego_lon_acceleration,
    ego_lon_jerk,
    ego_progress_along_expert_route,
    ego_yaw_acceleration,
    ego_yaw_rate,
    no_ego_at_fault_collisions,
    speed_limit_compliance,
    time_to_collision_within_bound,
)
from nuplan.planning.simulation.controller.tracker.lqr import LQRTracker
from nuplan.planning.simulation.history.simulation_history import SimulationHistory
from nuplan.planning.simulation.observation.idm.utils import is_agent_ahead, is_agent_behind
from nuplan.planning.simulation.observation.observation_type import DetectionsTracks
from nuplan.planning.simulation.trajectory.interpolated_trajectory import InterpolatedTrajectory

from world import World

STEP_US = 100_000
WHEELBASE, REAR_AXLE_TO_CENTER = 3.089, 1.461
STOREY = 3.0  # m
KINDS = {"vehicle": Kind.VEHICLE, "pedestrian": Kind.PEDESTRIAN, "cyclist": Kind.BICYCLE}


def vehicle(length, width, wheelbase=WHEELBASE):
    rear = length / 2 - REAR_AXLE_TO_CENTER * wheelbase / WHEELBASE
    return VehicleParameters(width, length - rear, rear, 1.67, wheelbase, "ours", "ours", 1.5)


def ego(row, step, wheelbase=WHEELBASE, acceleration=0.0, yaw_rate=0.0, yaw_acceleration=0.0, steering=0.0):
    """nuPlan's state from x, y, heading, speed, length, width of ours."""
    x, y, heading, speed, length, width = row[:6]
    footprint = CarFootprint(StateSE2(x, y, heading), vehicle(length, width, wheelbase))
    dynamics = DynamicCarState.build_from_rear_axle(
        footprint.rear_axle_to_center_dist,
        StateVector2D(speed, 0.0),
        StateVector2D(acceleration, 0.0),
        yaw_rate,
        yaw_acceleration,
    )
    return EgoState(footprint, dynamics, steering, True, TimePoint(step * STEP_US))


def agent(row, token, kind=Kind.VEHICLE):
    x, y, heading, speed, length, width = row[:6]
    box = OrientedBox(StateSE2(x, y, heading), length, width, 1.5)
    velocity = StateVector2D(speed * math.cos(heading), speed * math.sin(heading))
    return Agent(kind, box, velocity, SceneObjectMetadata(0, str(token), 0, str(token)))


def history(world, egos, observations):
    samples = [
        SimpleNamespace(ego_state=state, observation=DetectionsTracks(TrackedObjects(agents)), iteration=None)
        for state, agents in zip(egos, observations)
    ]
    for state in egos:
        heading = state.center.heading
        for point in [state.center, state.rear_axle, *state.car_footprint.all_corners()]:
            world.headings[(point.x, point.y)] = heading
    return SimulationHistory(world, None, samples)


def score(seen, result, rows, unjudged):
    """nuPlan's terms of a drive of ours but for the unjudged ones, and its score over them."""
    world = World(seen)
    egos = drive(seen, result, rows)
    whole = history(world, egos, [[]] + traffic(seen, egos[1:], rows))
    driven = SimulationHistory(world, None, whole.data[1:])
    expert = [
        ego(state, step)
        for step, state in enumerate(seen["tracks"][seen["av_index"]]["states"][seen["start"] :][: seen["horizon"] + 1])
        if state
    ]
    for state in expert:
        world.headings[(state.center.x, state.center.y)] = state.center.heading
    scenario = SimpleNamespace(get_expert_ego_trajectory=lambda: expert)

    def measure(metric, over):
        return metric.compute(over, scenario)[0].metric_score

    lanes = ego_lane_change.EgoLaneChangeStatistics("ego_lane_change", "", 0.3)
    lanes.compute(whole, scenario)
    terms = {}
    direction = driving_direction_compliance.DrivingDirectionComplianceStatistics("DDC", "", lanes, 2, 6, 1)
    terms["DDC"] = measure(direction, whole)
    # The start is the log's own: it is not judged, and the time of the first step counts.
    lanes.ego_driven_route[0] = []
    # nuPlan's connectors lead to one lane each; where ours lead to several, which lie on each other, the first is driven.
    lanes.ego_driven_route = [
        driven[:1] if driven and isinstance(driven[0], Lane) else driven for driven in lanes.ego_driven_route
    ]
    limits = speed_limit_compliance.SpeedLimitComplianceStatistics("SL", "", lanes, 1, 2.23)
    terms["SL"] = measure(limits, whole)
    del lanes.ego_driven_route[0], lanes.corners_route[0]
    area = drivable_area_compliance.DrivableAreaComplianceStatistics("DAC", "", lanes, 0.3)
    terms["DAC"] = measure(area, driven)
    collisions = no_ego_at_fault_collisions.EgoAtFaultCollisionStatistics("NC", "", lanes)
    terms["NC"] = float(measure(collisions, driven))
    time = time_to_collision_within_bound.TimeToCollisionStatistics("TTC", "", lanes, collisions, 0.1, 3.0, 0.95)
    terms["TTC"] = measure(time, driven)
    progress = ego_progress_along_expert_route.EgoProgressAlongExpertRouteStatistics("EP", "", 2)
    # Where the human's log ends before the drive, both are compared up to there.
    shared = [sample for sample in whole.data if sample.ego_state.time_us <= expert[-1].time_us]
    terms["EP"] = float(measure(progress, SimulationHistory(world, None, shared)))
    making = ego_is_making_progress.EgoIsMakingProgressStatistics("MP", "", progress, 0.2)
    terms["MP"] = measure(making, driven)
    terms["C"] = comfort(driven, scenario) if len(rows) >= 4 else None
    terms |= dict.fromkeys(unjudged)
    terms["score"] = composite(terms)
    if result["off_route"]:
        terms["score"] = 0.0
    elif len(rows) < 4:
        terms["score"] = 0.0 if terms["score"] == 0 else None
    return terms


def drive(seen, result, rows):
    """The states of a drive, the start first."""
    start = seen["tracks"][seen["av_index"]]["states"][seen["start"]]
    speed = math.hypot(result["start_velocity_x_mps"], result["start_velocity_y_mps"])
    egos = [ego([*start[:3], speed, *start[4:]], 0, seen["wheelbase"])]
    before = speed * math.tan(seen["steering"]) / seen["wheelbase"]
    for row in rows:
        speed = math.hypot(row["av_velocity_x_mps"], row["av_velocity_y_mps"])
        yaw_rate = speed * math.tan(row["steering_rad"]) / seen["wheelbase"]
        yaw_acceleration, before = (yaw_rate - before) / 0.1, yaw_rate
        state = [row["av_x_m"], row["av_y_m"], row["av_heading_rad"], speed, row["av_length_m"], row["av_width_m"]]
        dynamics = dict(acceleration=row["acceleration_mps2"], yaw_rate=yaw_rate, yaw_acceleration=yaw_acceleration)
        egos.append(ego(state, row["step"] + 1, seen["wheelbase"], steering=row["steering_rad"], **dynamics))
    return egos


def traffic(seen, egos, rows):
    """Who is near enough to matter at each step; left out are other levels, and contacts while they are netted."""
    others = [track for index, track in enumerate(seen["tracks"]) if index != seen["av_index"]]
    netted, steps = set(), []
    reach = lambda length, width, speed: math.hypot(length, width) / 2 + 3 * speed
    for state, row in zip(egos, rows):
        for line in row["events"].splitlines():
            if "not counted" in line and (found := re.search(r"(?:vehicle|pedestrian|cyclist|other|object) (\d+)", line)):
                netted.add(int(found[1]))
        agents = []
        own = reach(state.car_footprint.length, state.car_footprint.width, state.dynamic_car_state.speed)
        for track in others:
            at = track["states"][row["log_index"]]
            if not at or abs(at[6] - row["av_z_m"]) > STOREY:
                continue
            if math.dist(at[:2], (state.center.x, state.center.y)) > own + reach(at[4], at[5], at[3]):
                continue
            other = agent(at, track["id"], KINDS.get(track["kind"], Kind.GENERIC_OBJECT))
            if track["id"] in netted:
                if in_collision(state.car_footprint, other.box):
                    continue
                netted.discard(track["id"])
            agents.append(other)
        steps.append(agents)
    return steps


def comfort(driven, scenario):
    metrics = [
        ego_jerk.EgoJerkStatistics("jerk", "", 8.37),
        ego_lat_acceleration.EgoLatAccelerationStatistics("lat", "", 4.89),
        ego_lon_acceleration.EgoLonAccelerationStatistics("lon", "", -4.05, 2.40),
        ego_lon_jerk.EgoLonJerkStatistics("lon jerk", "", 4.13),
        ego_yaw_acceleration.EgoYawAccelerationStatistics("yaw acceleration", "", 1.93),
        ego_yaw_rate.EgoYawRateStatistics("yaw rate", "", 0.95),
    ]
    for metric in metrics:
        metric.compute(driven, scenario)
    whole = ego_is_comfortable.EgoIsComfortableStatistics("C", "", *metrics)
    return whole.compute(driven, scenario)[0].metric_score


def composite(terms):
    """The score of the terms, by the aggregator with its own weights."""
    folder = pathlib.Path(planning.__path__[0]) / "script/config/simulation/metric_aggregator"
    text = (folder / "closed_loop_nonreactive_agents_weighted_average.yaml").read_text()
    weights = {name: float(weight) for name, weight in re.findall(r"^    (\w+): ([\d.]+)", text, re.M)}
    names = {
        "NC": "no_ego_at_fault_collisions",
        "DAC": "drivable_area_compliance",
        "DDC": "driving_direction_compliance",
        "MP": "ego_is_making_progress",
        "EP": "ego_progress_along_expert_route",
        "TTC": "time_to_collision_within_bound",
        "SL": "speed_limit_compliance",
        "C": "ego_is_comfortable",
    }
    factors = re.findall(r"^    - (\w+)", text, re.M)
    aggregator = WeightedAverageMetricAggregator("", weights, "", pathlib.Path(tempfile.gettempdir()), factors)
    columns = {"scenario": {names[term]: value for term, value in terms.items()}}
    aggregator._compute_scenario_score(columns)
    return columns["scenario"]["score"]


def direction(seen, case):
    """Direction's score and the greatest travel against it, of a drive that is given state by state."""
    world = World(seen, 1e6)
    egos = [ego(row, step) for step, row in enumerate([case["human"][seen["start"]], *case["av"]])]
    whole = history(world, egos, [[] for _ in egos])
    lanes = ego_lane_change.EgoLaneChangeStatistics("ego_lane_change", "", 0.3)
    lanes.compute(whole, None)
    metric = driving_direction_compliance.DrivingDirectionComplianceStatistics("DDC", "", lanes, 2, 6, 1)
    result = metric.compute(whole, None)[0]
    return result.metric_score, max(0.0, -min(result.time_series.values[1:]))


def boxes(av, other):
    """Contact and time to collision of two boxes."""
    state, track = ego(av, 0), agent(other, "track")
    contact = None
    if in_collision(state.car_footprint, track.box):
        contact = CONTACTS_BY_TYPE[no_ego_at_fault_collisions._get_collision_type(state, track)]
    time = time_to_collision_within_bound._compute_time_to_collision_at_timestamp(
        0, state, av[3], np.array([[*track.center]], float), np.array([other[3]]), np.array([track.box]), [], 0.1, 3.0, 5e-3
    )
    return {
        "contact": contact,
        "ahead": is_agent_ahead(state.rear_axle, track.center),
        "behind": is_agent_behind(state.rear_axle, track.center),
        "time_to_collision": time,
    }


CONTACTS_BY_TYPE = {
    kind: name
    for kind, name in zip(
        no_ego_at_fault_collisions.CollisionType, ["STANDING", "STOPPED_TRACK", "FRONT", "REAR", "LATERAL"]
    )
}


def track(state, path):
    """Acceleration and steering rate that the LQR tracker commands, given a path of 51 states from now on."""
    shape = (5.286, 2.332)
    tracker = LQRTracker([10.0], [1.0], [1.0, 10.0, 0.0], [1.0], 0.1, 10, 1e-4, 1e-2, 0.5, 0.2, vehicle(*shape))

    def from_rear_axle(x, y, heading, speed, step, steering=0.0):
        ahead = REAR_AXLE_TO_CENTER
        center = [x + ahead * math.cos(heading), y + ahead * math.sin(heading), heading, speed, *shape]
        return ego(center, step, steering=steering)

    now = SimpleNamespace(time_point=TimePoint(0))
    trajectory = InterpolatedTrajectory([from_rear_axle(*row, step) for step, row in enumerate(path)])
    own = from_rear_axle(*state[:4], 0, steering=state[4])
    command = tracker.track_trajectory(now, now, own, trajectory)
    return command.rear_axle_acceleration_2d.x, command.tire_steering_rate
