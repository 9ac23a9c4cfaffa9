"""What a user writes: a planner, a predictor, or traffic.

One object serves one episode. ``reloop.serve`` is given what makes them: a class, a decorated function, or any callable
without arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy.typing as npt

from .moves import Moves
from .plan import Plan
from .prediction import Prediction
from .views.scene import Scene
from .views.step import Step
from .views.taken import Taken


class Planner:
    """Plans for one episode: subclass it and write ``plan``.

    An exception in ``start`` or ``plan`` is told the sim: the episode ends as failed with its words, and the process
    goes on with the next. So ``raise ValueError("no way ahead")`` is the way to refuse.
    """

    #: Whether ``plan`` waits for the step's prediction. Such a planner leaves a run without a predictor as it starts.
    needs_prediction: bool = False

    def start(self, scene: Scene) -> None:
        """Called once, before the first step."""

    def plan(self, step: Step) -> Plan | npt.ArrayLike:
        """The plan for this step: a ``Plan``, or its states alone, an array of shape (50, 4).

        Columns: x, y (m), heading (rad), speed (m/s), at 0.1 s, 0.2 s, ... 5.0 s from now.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method plan(self, step)")


class Predictor:
    """Predicts for one episode: subclass it and write ``predict``. Exceptions are told as a planner's are."""

    def start(self, scene: Scene) -> None:
        """Called once, before the first step."""

    def predict(self, step: Step) -> Prediction:
        """The prediction for this step; ``step.prediction`` is None here."""
        raise NotImplementedError(f"{type(self).__name__} has no method predict(self, step)")


class Traffic:
    """Drives the agents that react through one episode: subclass it and write ``moves``.

    Exceptions are told as a planner's are.
    """

    def start(self, scene: Scene) -> None:
        """Called once, before the first step."""

    def moves(self, step: Step, taken: tuple[Taken, ...]) -> Moves | npt.ArrayLike:
        """Where each of ``taken`` is a step later: a ``Moves``, or its states alone, an array of shape (agents, 5).

        Columns: x, y (m), heading (rad), velocity_x, velocity_y (m/s), at 0.1 s from now; rows in the order of
        ``taken``. Called at each step, also while nobody is taken over: then ``[]`` is right. What no body can do is
        refused by the sim; ``docs/traffic.md`` has the numbers.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method moves(self, step, taken)")


Node: TypeAlias = Planner | Predictor | Traffic


def planner(function: Callable[[Step], Plan | npt.ArrayLike]) -> type[Planner]:
    """Makes a planner of a function that is given each step; for planners that remember nothing.

    ::

        @reloop.planner
        def mine(step):
            return ...  # (50, 4)

        reloop.serve(mine)
    """

    class Decorated(Planner):
        def plan(self, step: Step) -> Plan | npt.ArrayLike:
            return function(step)

    return _named(Decorated, function)


def predictor(function: Callable[[Step], Prediction]) -> type[Predictor]:
    """Makes a predictor of a function that is given each step; for predictors that remember nothing."""

    class Decorated(Predictor):
        def predict(self, step: Step) -> Prediction:
            return function(step)

    return _named(Decorated, function)


def traffic(function: Callable[[Step, tuple[Taken, ...]], Moves | npt.ArrayLike]) -> type[Traffic]:
    """Makes traffic of a function that is given each step and who is taken over; for traffic that remembers nothing."""

    class Decorated(Traffic):
        def moves(self, step: Step, taken: tuple[Taken, ...]) -> Moves | npt.ArrayLike:
            return function(step, taken)

    return _named(Decorated, function)


def _named(decorated: type, function: Callable[..., object]) -> type:
    decorated.__name__ = decorated.__qualname__ = function.__name__
    decorated.__doc__, decorated.__module__ = function.__doc__, function.__module__
    return decorated
