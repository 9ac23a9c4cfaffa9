"""reloop in Python: planners, predictors and traffic on its bus, its results and recordings, and a service that drives.

A planner::

    import reloop

    @reloop.planner
    def mine(step):
        line = step.window
        station, _ = line.project(step.av.x, step.av.y)
        ...  # x, y, heading, speed of the next 50 steps of 0.1 s
        return states

    reloop.serve(mine)

It is started by ``sim run --planner-command "python mine.py"``. The guide is ``docs/python.md``;
``docs/serve.md`` tells of ``reloop.Service``.

SI units, radians, the log's frame, heading counter-clockwise from +x.
"""

from __future__ import annotations

from .connection import Stop
from .errors import AnswerError, NodeError, ReadError, ReloopError, ServiceError
from .messages import WIRE_VERSION
from .moves import Moves
from .nodes import Planner, Predictor, Traffic, planner, predictor, traffic
from .options import Options
from .plan import PLAN_STEPS, STEP_SECONDS, Plan
from .prediction import Future, Prediction
from .recordings import Episode, RecordedStep, episode
from .runs import Results, results
from .serve import join, serve
from .service import End, Offer, Run, Service
from .session import Session
from .views.agents import AgentKind, Agents
from .views.history import History, Moment
from .views.line import Line, Window
from .views.roads import Map
from .views.scene import Scene
from .views.signals import Signals, SignalState
from .views.state import Control, State
from .views.step import Step
from .views.taken import LaneStretch, Taken, Way

__all__ = [
    "PLAN_STEPS",
    "STEP_SECONDS",
    "WIRE_VERSION",
    "AgentKind",
    "Agents",
    "AnswerError",
    "Control",
    "End",
    "Episode",
    "Future",
    "History",
    "LaneStretch",
    "Line",
    "Map",
    "Moment",
    "Moves",
    "NodeError",
    "Offer",
    "Options",
    "Plan",
    "Planner",
    "Prediction",
    "Predictor",
    "ReadError",
    "RecordedStep",
    "ReloopError",
    "Results",
    "Run",
    "Scene",
    "Service",
    "ServiceError",
    "Session",
    "SignalState",
    "Signals",
    "State",
    "Step",
    "Stop",
    "Taken",
    "Traffic",
    "Way",
    "Window",
    "episode",
    "join",
    "planner",
    "predictor",
    "results",
    "serve",
    "traffic",
]
