"""Everybody goes on as now: constant velocity, one future.

Under a sim of your own or a test; `sim run` starts no predictor of others yet (docs/python.md).
"""

import numpy as np

import reloop

AHEAD = reloop.STEP_SECONDS * np.arange(1, reloop.PLAN_STEPS + 1)  # s, (50,)


@reloop.predictor
def constant_velocity(step):
    others = step.agents
    places = others.position[:, None] + others.velocity[:, None] * AHEAD[:, None]  # m, (agents, 50, 2)
    headings = np.broadcast_to(others.heading[:, None, None], (len(others), reloop.PLAN_STEPS, 1))
    return reloop.Prediction([reloop.Future(1.0, others.track, np.concatenate([places, headings], axis=2))])


reloop.serve(constant_velocity)
