"""What a user writes: a planner or a predictor.

One object serves one episode. ``reloop.serve`` is given what makes them: a class, a decorated function, or any callable
without arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy.typing as npt

from .plan import Plan
from .prediction import Prediction
from .views.scene import Scene
from .views.step import Step


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


Node: TypeAlias = Planner | Predictor


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


def _named(decorated: type, function: Callable[..., object]) -> type:
    decorated.__name__ = decorated.__qualname__ = function.__name__
    decorated.__doc__, decorated.__module__ = function.__doc__, function.__module__
    return decorated
