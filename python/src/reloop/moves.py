"""Moves: where the agents that react are a step later."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import messages
from .errors import AnswerError
from .plan import check
from .views.arrays import Floats, Ints, frozen
from .views.taken import Taken

_COLUMNS = ("x", "y", "heading", "velocity_x", "velocity_y")


class Moves:
    """What traffic answers with: a state a step later for each agent that is taken over."""

    def __init__(
        self,
        states: npt.ArrayLike,
        *,
        track: npt.ArrayLike | None = None,
        z: npt.ArrayLike | None = None,
        error: str = "",
    ) -> None:
        """Moves from their states.

        ``states``: shape (agents, 5), x, y (m), heading (rad), velocity_x and velocity_y (m/s, along the axes of the
        log's frame) at 0.1 s from now. ``track``: whom each row is about, shape (agents,); without it the rows are in
        the order of ``taken``. ``z``: heights of the centres (m), shape (agents,); without it each stays as high above
        the ground of its way as it is. Sizes stay what they are. ``error`` is why there are none: in recordings.
        """
        array = np.array(states, dtype=np.float64)
        self.states: Floats = frozen(array if array.size else array.reshape(0, len(_COLUMNS)))
        self.track: Ints | None = None if track is None else frozen(np.array(track, dtype=np.int64).reshape(-1))
        self.z: Floats | None = None if z is None else frozen(np.array(z, dtype=np.float64).reshape(-1))
        self.error = error

    def __repr__(self) -> str:
        if self.error:
            return f"Moves({len(self.states)} states, error={self.error!r})"
        return f"Moves({self.states!r}, track={self.track!r})"

    @classmethod
    def read(cls, message: Any) -> Moves:
        """The view of a message ``TrafficMoves``."""
        states = [[getattr(agent.state, column) for column in _COLUMNS] for agent in message.agents]
        track = [agent.track for agent in message.agents]
        return cls(states, track=track, z=[agent.state.z for agent in message.agents], error=message.error)

    @classmethod
    def of(cls, answer: Moves | npt.ArrayLike) -> Moves:
        """What traffic gave back: moves, or their states alone.

        Raises ``AnswerError`` where it is neither.
        """
        if isinstance(answer, cls):
            return answer
        if answer is None:
            raise AnswerError("moves() gave back nothing: return an array of shape (agents, 5), or a reloop.Moves")
        try:
            return cls(answer)  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise AnswerError(f"moves() gave back no array of numbers: {error}") from error

    def message(self, step: int, taken: Sequence[Taken]) -> Any:
        """The message ``TrafficMoves`` that answers ``step``, at which ``taken`` were to be moved.

        Raises ``AnswerError`` where a state is missing, too many, or no number. Whether a body can move so is for the
        sim to see.
        """
        row = self._rows(taken)
        check("states", self.states, (len(taken), len(_COLUMNS)), _COLUMNS)
        if self.z is not None:
            check("heights", self.z[:, None], (len(taken), 1), ("z",))
        moves = messages.TrafficMoves(step=step)
        for agent in taken:
            x, y, heading, velocity_x, velocity_y = self.states[row[agent.track]].tolist()
            moved = moves.agents.add(track=agent.track).state
            moved.x, moved.y, moved.heading, moved.velocity_x, moved.velocity_y = x, y, heading, velocity_x, velocity_y
            moved.z = _height(agent, x, y) if self.z is None else float(self.z[row[agent.track]])
            moved.length, moved.width, moved.height = agent.state.length, agent.state.width, agent.state.height
        return moves

    def _rows(self, taken: Sequence[Taken]) -> dict[int, int]:
        """The row of each track."""
        given = [agent.track for agent in taken]
        told = given if self.track is None else self.track.tolist()
        row = {track: place for place, track in enumerate(told)}
        for track in given:
            if track not in row:
                raise AnswerError(f"moves() does not say where track {track} is next")
        for track in told:
            if told.count(track) > 1:
                raise AnswerError(f"moves() says twice where track {track} is next")
            if track not in given:
                raise AnswerError(f"moves() moves track {track}, which it was not given")
        return row


def _height(agent: Taken, x: float, y: float) -> float:
    """As high above the ground of its way as it is now (m)."""
    ground = [agent.way.height(agent.way.project(*place)[0]) for place in ((agent.state.x, agent.state.y), (x, y))]
    return agent.state.z + float(ground[1] - ground[0])
