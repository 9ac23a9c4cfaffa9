"""Plans: where the AV wants to be in the next 5 s."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from . import messages
from .errors import AnswerError
from .views.arrays import Floats, frozen

#: Length of a step (s).
STEP_SECONDS = 0.1
#: States of a plan, and poses of a predicted trajectory: 0.1 s to 5.0 s ahead.
PLAN_STEPS = 50
#: The sim takes no greater number, either way.
LARGEST_NUMBER = 1e7


class Plan:
    """A plan: what a planner answers with, and what a recording holds."""

    def __init__(
        self,
        states: npt.ArrayLike,
        controls: npt.ArrayLike | None = None,
        *,
        objective: Mapping[str, float] | None = None,
        iterations: int = 0,
        status: str = "",
        error: str = "",
    ) -> None:
        """A plan from its states, and for whoever watches, why it is so.

        ``states``: shape (50, 4), x, y (m), heading (rad) and speed (m/s) at 0.1 s, 0.2 s, ... 5.0 s from now.
        ``controls``: shape (50, 2), acceleration (m/s²) and angle of the front wheels (rad, positive to the left) of
        each of these steps. Where there are some, the first is what is driven; else the states are tracked.
        ``objective``: terms by name. ``iterations`` and ``status``: how the search went. Never the time it took: that
        would not repeat.
        """
        self.states: Floats = frozen(np.array(states, dtype=np.float64))
        self.controls: Floats | None = None if controls is None else frozen(np.array(controls, dtype=np.float64))
        self.objective = dict(objective or {})
        self.iterations = iterations
        self.status = status
        #: Of a recorded plan that was none: why.
        self.error = error

    def __repr__(self) -> str:
        return f"Plan({len(self.states)} states, error={self.error!r})" if self.error else f"Plan({self.states!r})"

    @classmethod
    def of(cls, answer: Plan | npt.ArrayLike) -> Plan:
        """What a planner gave back: a plan, or its states alone.

        Raises ``AnswerError`` where it is neither.
        """
        if isinstance(answer, cls):
            return answer
        if answer is None:
            raise AnswerError("plan() gave back nothing: return an array of shape (50, 4), or a reloop.Plan")
        try:
            return cls(answer)  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise AnswerError(f"plan() gave back no array of numbers: {error}") from error

    @classmethod
    def read(cls, message: Any) -> Plan:
        """The view of a message ``Plan``."""
        states = [(s.x, s.y, s.heading, s.speed) for s in message.states]
        controls = [(c.acceleration, c.steering) for c in message.controls]
        return cls(
            np.reshape(states, (-1, 4)),
            np.reshape(controls, (-1, 2)) if controls else None,
            objective={term.name: term.value for term in message.objective},
            iterations=message.iterations,
            status=message.status,
            error=message.error,
        )

    def message(self, step: int) -> Any:
        """The message ``Plan`` that answers ``step``.

        Raises ``AnswerError`` where the sim would refuse it.
        """
        check("states", self.states, (PLAN_STEPS, 4), ("x", "y", "heading", "speed"))
        if self.controls is not None:
            check("controls", self.controls, (PLAN_STEPS, 2), ("acceleration", "steering"))
        plan = messages.Plan(step=step, iterations=int(self.iterations), status=str(self.status))
        for x, y, heading, speed in self.states.tolist():
            plan.states.add(x=x, y=y, heading=heading, speed=speed)
        for acceleration, steering in [] if self.controls is None else self.controls.tolist():
            plan.controls.add(acceleration=acceleration, steering=steering)
        for name, value in self.objective.items():
            plan.objective.add(name=name, value=float(value))
        return plan


def check(what: str, numbers: Floats, shape: tuple[int, ...], columns: tuple[str, ...]) -> None:
    """Whether ``numbers`` are ``what`` the sim takes.

    Raises ``AnswerError`` that names the first that is not.
    """
    if numbers.shape != shape:
        raise AnswerError(f"the {what} have the shape {numbers.shape}, and {shape} is needed: {', '.join(columns)}")
    # NaN is in no range either.
    wrong = np.argwhere(~(np.abs(numbers) <= LARGEST_NUMBER))
    if len(wrong):
        *row, column = wrong[0].tolist()
        value = numbers[tuple(wrong[0])]
        raise AnswerError(f"the {what}, row {', '.join(map(str, row))}: {columns[column]} is {value}")
