"""A session of a service: one scene, driven step by step, to see what a planner does and why."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import cached_property
from typing import Any

from . import messages
from .errors import ServiceError
from .settings import settings as _settings
from .views.agents import Agents, agents
from .views.scene import Scene
from .views.state import State, state

#: The most steps that one question asks for.
_MANY = 1_000_000


class Session:
    """A session. ``with service.open("demo-curve", "idm") as session: session.step(10)``.

    Nothing is driven unless it is asked for. One that nobody asks anything for a while is closed by the service.
    """

    def __init__(self, ask: Callable[..., Any], opened: Any) -> None:
        self._ask = ask
        self._now = opened
        self._opened = opened
        #: Each step that was driven here, as messages ``StepRecord``, and what happened, as messages ``Event``.
        self.records: list[Any] = []
        self.events: list[Any] = []

    def __repr__(self) -> str:
        return f"Session({self.id!r}, {self.driver!r} in {self._now.scene!r}, step {self.number})"

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def id(self) -> str:
        """The session's name."""
        return str(self._now.session)

    @property
    def driver(self) -> str:
        """Who drives."""
        return str(self._now.driver)

    @cached_property
    def scene(self) -> Scene:
        """The scene, as its driver was told it."""
        return Scene(self._opened.briefing)

    @property
    def number(self) -> int:
        """The step that comes next, from 0."""
        return int(self._now.step)

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return bool(self._now.HasField("end"))

    @property
    def end(self) -> Any:
        """How it ended: the message ``EpisodeEnd``, None before that."""
        return self._now.end if self.is_over else None

    @property
    def metrics(self) -> dict[str, float | None]:
        """The metrics of an episode that is over, by name; None where one is not defined."""
        return {each.name: each.value if each.HasField("value") else None for each in self._now.end.metrics}

    @property
    def av(self) -> State | None:
        """The AV, before the next step; None once the episode is over."""
        return state(self._now.observation.av) if self._now.HasField("observation") else None

    @property
    def agents(self) -> Agents:
        """All others that are seen now."""
        return agents(self._now.observation.agents)

    @property
    def plan(self) -> Any:
        """The plan that was driven last: the message ``Plan``; None before the first."""
        return self._now.plan if self._now.HasField("plan") else None

    @property
    def prediction(self) -> Any:
        """What was predicted for it: the message ``Prediction``; None where nobody predicts."""
        return self._now.prediction if self._now.HasField("prediction") else None

    def step(self, steps: int = 1) -> Session:
        """Drives so many steps, or to the end of the episode. An interrupt, Ctrl-C, pauses between two questions.

        Raises ``ServiceError`` where the session is closed.
        """
        while steps > 0 and not self.is_over:
            self._hear(self._ask(step=messages.service("Step")(session=self.id, steps=steps)).session)
            steps -= self._driven
        return self

    def run(self) -> Session:
        """Drives to the end."""
        return self.step(_MANY)

    def look(self) -> Session:
        """Asks where the session is, and drives nothing."""
        self._hear(self._ask(step=messages.service("Step")(session=self.id, steps=0)).session)
        return self

    def fork(self, step: int, driver: str, **settings: Any) -> Session:
        """Another session, in which ``driver`` takes over at ``step``; what was driven here leads up to it.

        ``settings`` are those of ``Service.submit``, as far as they say who drives: scenes and rules stay.
        """
        asked = messages.service("Fork")(session=self.id, step=step, settings=_settings(driver=driver, **settings))
        return Session(self._ask, self._ask(fork=asked).session)

    def close(self) -> None:
        """Closes it. One that is gone is closed."""
        with contextlib.suppress(ServiceError):
            self._ask(close=messages.service("Close")(session=self.id))

    def _hear(self, told: Any) -> None:
        self._now = told
        self._driven = len(told.records)
        self.records.extend(told.records)
        self.events.extend(told.events)
