"""Predictions: joint futures of the others, with probabilities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import messages
from .errors import AnswerError
from .plan import PLAN_STEPS, check
from .views.arrays import Floats, Ints, frozen


@dataclass(frozen=True, eq=False)
class Future:
    """One joint future of the agents."""

    #: From 0 to 1; those of a prediction sum to 1.
    probability: float
    #: Whom it is about, shape (agents,).
    track: Ints
    #: x, y (m) and heading (rad) at 0.1 s, 0.2 s, ... 5.0 s from now, shape (agents, 50, 3).
    poses: Floats
    #: The AV's own acceleration (m/s²) and steering (rad) in this future as the predictor sees it, shape (50, 2); None
    #: where it says nothing of it.
    controls: Floats | None = None

    def __post_init__(self) -> None:
        track = np.array(self.track, dtype=np.int64).reshape(-1)
        poses = np.array(self.poses, dtype=np.float64)
        object.__setattr__(self, "probability", float(self.probability))
        object.__setattr__(self, "track", frozen(track))
        object.__setattr__(self, "poses", frozen(poses if poses.size else poses.reshape(len(track), PLAN_STEPS, 3)))
        if self.controls is not None:
            object.__setattr__(self, "controls", frozen(np.array(self.controls, dtype=np.float64)))


class Prediction:
    """What a predictor answers with, and what a planner or a recording is told."""

    def __init__(
        self,
        futures: Iterable[Future],
        *,
        initial_controls: npt.ArrayLike | None = None,
        cost_weights: npt.ArrayLike = (),
        error: str = "",
    ) -> None:
        """A prediction. No future at all is allowed: nobody to predict.

        ``initial_controls``: shape (50, 2), acceleration (m/s²) and steering (rad) that a planner may start its search
        from. ``cost_weights``: shape (terms,), for a planner that takes them.
        """
        self.futures = tuple(futures)
        self.initial_controls: Floats | None = (
            None if initial_controls is None else frozen(np.array(initial_controls, dtype=np.float64))
        )
        self.cost_weights: Floats = frozen(np.array(cost_weights, dtype=np.float64).reshape(-1))
        #: Of a recorded prediction that was none: why.
        self.error = error

    def __repr__(self) -> str:
        return f"Prediction({len(self.futures)} futures, error={self.error!r})"

    @property
    def likeliest(self) -> Future | None:
        """The future with the highest probability, the first of equals; None where there is no future."""
        return max(self.futures, key=lambda future: future.probability, default=None)

    @classmethod
    def read(cls, message: Any) -> Prediction:
        """The view of a message ``Prediction``, packed as in recordings or not."""
        controls = [(c.acceleration, c.steering) for c in message.initial_controls]
        return cls(
            [_future(future) for future in message.futures],
            initial_controls=controls or None,
            cost_weights=list(message.cost_weights),
            error=message.error,
        )

    def message(self, step: int) -> Any:
        """The message ``Prediction`` that answers ``step``.

        Raises ``AnswerError`` where the sim would refuse it.
        """
        if self.initial_controls is not None:
            check("initial controls", self.initial_controls, (PLAN_STEPS, 2), ("acceleration", "steering"))
        check("cost weights", self.cost_weights[:, None], (len(self.cost_weights), 1), ("weight",))
        total = sum(future.probability for future in self.futures)
        if self.futures and not (abs(total - 1.0) <= 1e-3 and all(0 <= f.probability <= 1 for f in self.futures)):
            shown = ", ".join(f"{future.probability:g}" for future in self.futures)
            raise AnswerError(f"the futures' probabilities ({shown}) are no distribution: they sum to {total:g}")
        prediction = messages.Prediction(step=step, cost_weights=self.cost_weights.tolist())
        for future in self.futures:
            check("poses", future.poses, (len(future.track), PLAN_STEPS, 3), ("x", "y", "heading"))
            told = prediction.futures.add(probability=future.probability)
            for track, poses in zip(future.track.tolist(), future.poses, strict=True):
                x, y, heading = poses.T.tolist()
                told.trajectories.add(track=track, x=x, y=y, heading=heading)
            if future.controls is not None:
                check("controls of a future", future.controls, (PLAN_STEPS, 2), ("acceleration", "steering"))
                for acceleration, steering in future.controls.tolist():
                    told.controls.add(acceleration=acceleration, steering=steering)
        for acceleration, steering in [] if self.initial_controls is None else self.initial_controls.tolist():
            prediction.initial_controls.add(acceleration=acceleration, steering=steering)
        return prediction


def _future(message: Any) -> Future:
    columns = [
        (_column(t.x, t.x_bits), _column(t.y, t.y_bits), _column(t.heading, t.heading_bits))
        for t in message.trajectories
    ]
    # A prediction that was refused may be ragged: what it lacks is NaN.
    steps = max((len(column) for each in columns for column in each), default=PLAN_STEPS)
    poses = np.full((len(columns), steps, 3), np.nan)
    for agent, each in enumerate(columns):
        for axis, column in enumerate(each):
            poses[agent, : len(column), axis] = column
    track = np.array([t.track for t in message.trajectories], dtype=np.int64)
    return Future(message.probability, track, poses, _controls(message))


def _controls(message: Any) -> Floats | None:
    columns = (
        _column([c.acceleration for c in message.controls], message.acceleration_bits),
        _column([c.steering for c in message.controls], message.steering_bits),
    )
    steps = max(len(column) for column in columns)
    if not steps:
        return None
    controls = np.full((steps, 2), np.nan)
    for axis, column in enumerate(columns):
        controls[: len(column), axis] = column
    return controls


def _column(numbers: Any, bits: Any) -> Floats:
    return unpacked(bits) if len(bits) and not len(numbers) else np.array(numbers, dtype=np.float64)


def unpacked(bits: Any) -> Floats:
    """The numbers of a column that a recording holds as the fourth differences of their bits, modulo 2^64.

    Of the first four numbers they are the differences of order 0 to 3 (``docs/recordings.md``).
    """
    column = np.array(bits, dtype=np.int64)
    for order in (3, 2, 1, 0):
        column[order:] = np.cumsum(column[order:])
    return column.view(np.float64)
