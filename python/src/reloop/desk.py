"""One worker's episodes as a node sees them, without IO: messages in, answers out."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import messages
from .errors import ReadError
from .moves import Moves
from .nodes import Node, Planner, Predictor
from .plan import Plan
from .prediction import Prediction
from .views.history import History
from .views.scene import Scene
from .views.step import Step
from .views.step import step as view
from .views.taken import KnownWays, Taken

log = logging.getLogger("reloop")

#: Where the answers of a role belong, which is what their field in ``Answer`` is called too.
CHANNELS = {"planner": "plan", "predictor": "prediction", "traffic": "moves"}
#: Of an exception's text, as many characters are told.
_LONGEST_ERROR = 1_500
#: Of a traceback, as many frames of the user's are logged.
_FRAMES = 6


class _Episode:
    """An episode that is on."""

    def __init__(self, number: int, scene: Any, make: Callable[[], Node]) -> None:
        self.number = number
        self.name = scene.scene
        self.make = make
        #: Why it cannot be driven: then every observation is answered with that.
        self.error = ""
        #: Whichever comes first waits for what belongs to it.
        self.observation: Any = None
        self.prediction: Any = None
        #: Who is taken over, and at which step.
        self.taken: tuple[int, tuple[Taken, ...]] | None = None
        self.ways = KnownWays()
        if scene.wire_version != messages.WIRE_VERSION:
            self.error = (
                f"the simulator speaks version {scene.wire_version} of the messages, "
                f"this node version {messages.WIRE_VERSION}"
            )
            return
        self.told = scene

    def start(self) -> None:
        """Looks at the scene and makes who answers.

        May raise whatever the user's code raises, and what a scene that is none does.
        """
        self.scene = Scene(self.told)
        self.history = History.before(self.told)
        del self.told
        self.node = self.make()
        self.node.start(self.scene)


class Desk:
    """A worker drives its episodes one after the other, so a desk has one at a time."""

    def __init__(
        self, role: str, make: Callable[[], Node], *, needs_prediction: bool, ask_scene: Callable[[], Any]
    ) -> None:
        """``ask_scene`` asks the sim for the scene of the episode that is on; None where it has none."""
        self._role = role
        self._make = make
        self._needs_prediction = needs_prediction
        self._ask_scene = ask_scene
        self._episode: _Episode | None = None

    def take(self, told: Any) -> Any:
        """The message ``Answer`` to a message ``Told``; None where none is due."""
        what, is_on = told.WhichOneof("what"), self._episode is not None and self._episode.number == told.episode
        if what == "scene":
            if is_on:
                log.warning("a second scene of episode %d is not believed", told.episode)
            else:
                self._start(told.episode, told.scene)
            return None
        if what == "observation":
            return self._observe(told.episode, told.observation)
        if what == "prediction":
            if self._episode is None or not is_on:
                return None
            self._episode.prediction = told.prediction
            return self._answer()
        if what == "taken":
            return self._take_over(told.taken) if is_on else None
        if what == "end":
            if is_on:
                self._episode = None
            answer = messages.Answer(episode=told.episode)
            answer.done.SetInParent()
            return answer
        log.warning("a message of a kind that this version does not know is passed over")
        return None

    def _start(self, number: int, scene: Any) -> None:
        self._episode = episode = _Episode(number, scene, self._make)
        if episode.error:
            log.error("%s: %s", episode.name, episode.error)
            return
        try:
            episode.start()
        except Exception as error:
            episode.error = _told(error)
            log.error("%s: %s", episode.name, _traceback(error))

    def _observe(self, number: int, observation: Any) -> Any:
        if self._episode is None or self._episode.number != number:
            # A node that comes late, to an episode that is on, was not told its scene: it asks.
            scene = self._ask_scene()
            if scene is None:
                return self._refusal(number, observation.step, "its scene never came")
            self._start(number, scene)
        episode = self._episode
        assert episode is not None
        if episode.error:
            return self._refusal(number, observation.step, episode.error)
        episode.observation = observation
        return self._answer()

    def _take_over(self, told: Any) -> Any:
        episode = self._episode
        assert episode is not None
        try:
            episode.taken = (told.step, episode.ways.taken(told))
        except (ReadError, ValueError) as error:
            log.error("%s: it cannot be read who is taken over: %s", episode.name, error)
            if episode.observation is None:
                return None
            step, episode.observation = episode.observation.step, None
            return self._refusal(episode.number, step, f"it cannot be read who is taken over: {error}")
        return self._answer()

    def _answer(self) -> Any:
        """The answer, once all that it needs is there."""
        episode = self._episode
        if episode is None or episode.error or episode.observation is None:
            return None
        told, prediction, taken = episode.observation, episode.prediction, episode.taken
        if self._needs_prediction and (prediction is None or prediction.step != told.step):
            return None
        if self._role == "traffic" and (taken is None or taken[0] != told.step):
            return None
        episode.observation = episode.prediction = episode.taken = None
        answer = messages.Answer(episode=episode.number)
        try:
            step = view(told, episode.scene, episode.history, prediction and Prediction.read(prediction))
            episode.history = step.history
            channel, message = _asked(episode.node, step, taken[1] if taken else ())
            getattr(answer, channel).CopyFrom(message)
        except Exception as error:
            # What it was in the middle of is unknown: it is not asked again.
            episode.error = _told(error)
            log.error("%s step %d: %s", episode.name, told.step, _traceback(error))
            return self._refusal(episode.number, told.step, episode.error)
        return answer

    def _refusal(self, number: int, step: int, error: str) -> Any:
        answer = messages.Answer(episode=number)
        refused = getattr(answer, CHANNELS[self._role])
        refused.step, refused.error = step, error
        return answer


def _asked(node: Node, step: Step, taken: tuple[Taken, ...]) -> tuple[str, Any]:
    """What a node says at a step: its field in ``Answer``, and the message. May raise whatever it raises."""
    if isinstance(node, Planner):
        return "plan", Plan.of(node.plan(step)).message(step.number)
    if isinstance(node, Predictor):
        return "prediction", node.predict(step).message(step.number)
    return "moves", Moves.of(node.moves(step, taken)).message(step.number, taken)


def _users_frames(error: BaseException) -> list[traceback.FrameSummary]:
    """The frames of an exception, without those of this package that led there."""
    own = str(Path(__file__).parent)
    frames = list(traceback.extract_tb(error.__traceback__))
    first = next((place for place, frame in enumerate(frames) if not frame.filename.startswith(own)), len(frames))
    return frames[first:]


def _told(error: BaseException) -> str:
    """An exception in a line: its type, its words, and where it was raised."""
    frames = _users_frames(error)
    where = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}"[:_LONGEST_ERROR] + where


def _traceback(error: BaseException) -> str:
    """An exception for the log: its words, and the last frames of the user's own code."""
    frames = _users_frames(error)[-_FRAMES:]
    lines = [f"  {Path(f.filename).name}:{f.lineno} in {f.name}: {f.line}" for f in frames]
    return "\n".join([_told(error), *lines])
