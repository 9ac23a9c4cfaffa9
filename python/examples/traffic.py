"""Everybody goes along his way behind whoever is ahead: the intelligent driver model, with the AV as one of them.

    sim run --driver idm --traffic-command "python python/examples/traffic.py"

Nobody looks at red lights, gives way or changes lanes; `sim run --traffic idm` does.
"""

import math

import numpy as np

import reloop

WISH = 12.0  # m/s
ACCELERATION, BRAKING = 1.5, 2.0  # m/s², comfortable
GAP, HEADWAY = 2.0, 1.5  # m, s
HARDEST = 6.0  # m/s²
ASIDE = 0.5  # m; who is farther aside of what one sweeps is passed


def gap_ahead(agent, station, others):
    """Free metres to the nearest of `others` on the way ahead, and its speed along the way."""
    ahead, left = agent.way.project(others.x, others.y)  # m, (agents,)
    along = agent.way.pose(ahead)[:, 2]
    free = ahead - station - 0.5 * (others.length + agent.state.length)
    reach = 0.5 * (others.width + agent.state.width) + ASIDE
    is_ahead = (ahead > station) & (np.abs(left) < reach) & (np.abs(others.z - agent.state.z) < 3.0)
    if not is_ahead.any():
        return math.inf, 0.0
    nearest = np.argmin(np.where(is_ahead, free, np.inf))
    speed = others.velocity_x[nearest] * np.cos(along[nearest]) + others.velocity_y[nearest] * np.sin(along[nearest])
    return max(float(free[nearest]), 0.1), max(float(speed), 0.0)


def go(step, agent, others):
    """Where an agent is 0.1 s later: x, y, heading, velocity_x, velocity_y."""
    state, speed = agent.state, agent.state.speed
    station, left = (float(value) for value in agent.way.project(state.x, state.y))
    gap, its_speed = gap_ahead(agent, station, others)
    wish = max(WISH, speed)
    space = GAP + max(HEADWAY * speed + speed * (speed - its_speed) / (2 * math.sqrt(ACCELERATION * BRAKING)), 0.0)
    acceleration = ACCELERATION * (1 - (speed / wish) ** 4 - (space / gap) ** 2)
    if step.number == agent.since_step:
        acceleration = max(acceleration, -BRAKING)  # nobody brakes hard the moment he is taken over
    next_speed = max(speed + reloop.STEP_SECONDS * max(acceleration, -HARDEST), 0.0)
    way = 0.5 * (speed + next_speed) * reloop.STEP_SECONDS
    if way < 1e-3:
        return state.x, state.y, state.heading, 0.0, 0.0
    # What he is aside of his way, and what he does not point along it, goes by and by: nobody jumps.
    x, y, along = (float(value) for value in agent.way.pose(station + way))
    left *= math.exp(-way / (8.0 + 2.0 * speed))
    x, y = x - left * math.sin(along), y + left * math.cos(along)
    course = math.atan2(y - state.y, x - state.x)
    turn = math.remainder(along - state.heading, math.tau)
    heading = state.heading + min(max(turn, -0.15 * way), 0.15 * way)
    return x, y, heading, next_speed * math.cos(course), next_speed * math.sin(course)


def everybody(step):
    """All agents, and the AV as one of them, with the track -1."""
    av = {name: getattr(step.av, name) for name in reloop.State.__slots__}
    last = {"track": -1, "kind": reloop.AgentKind.VEHICLE, "speed": step.av.speed, "unseen": 0, **av}
    return reloop.Agents(*(np.append(getattr(step.agents, name), last[name]) for name in reloop.Agents.__slots__))


@reloop.traffic
def mine(step, taken):
    others = everybody(step)
    return [go(step, agent, others[others.track != agent.track]) for agent in taken]


reloop.serve(mine)
