"""What is told at a step, before it is driven."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .agents import Agents, agents
from .ahead import Ahead, ahead
from .history import History, Moment
from .line import Window, window
from .scene import Scene
from .signals import Signals, signals
from .state import Control, State, control, state

if TYPE_CHECKING:
    from ..prediction import Prediction


@dataclass(frozen=True, eq=False, slots=True)
class Step:
    """All that is known at a step."""

    #: What was told before the first step.
    scene: Scene
    #: Number of the step, from 0; a step is 0.1 s.
    number: int
    #: ``scene.start + number``.
    log_index: int
    #: The simulated AV.
    av: State
    #: What brought the AV here; zero at step 0.
    control: Control
    #: All others that are seen now; under ``strict`` also those that were within the last 3 s.
    agents: Agents
    signals: Signals
    #: The reference line from 20 m behind the AV to 100 m ahead.
    window: Window
    #: What was seen before, this step included.
    history: History = field(repr=False)
    #: What the predictor expects; None where the run has none.
    prediction: Prediction | None = None

    def ahead(self) -> Ahead:
        """What is in the AV's way on the line now, nearest first.

        These are agents whose box is in the AV's way, red lights, and the end of the line; nobody who will cross later.

        Raises ``ValueError`` where the window has no sample.
        """
        return ahead(self)


def step(observation: Any, scene: Scene, before: History, prediction: Prediction | None = None) -> Step:
    """The view of a message ``Observation``.

    Raises ``ReadError`` where its window lies beyond the scene's line.
    """
    now = Moment(observation.log_index, state(observation.av), agents(observation.agents))
    return Step(
        scene=scene,
        number=observation.step,
        log_index=observation.log_index,
        av=now.av,
        control=control(observation.control),
        agents=now.agents,
        signals=signals(observation.signals),
        window=window(observation, scene.line),
        history=before.and_now(now),
        prediction=prediction,
    )
