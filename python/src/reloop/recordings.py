"""Recordings of episodes: MCAP files, read by the messages that this package knows."""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import messages
from .errors import ReadError
from .moves import Moves
from .plan import STEP_SECONDS, Plan
from .prediction import Prediction
from .views.history import History
from .views.scene import Scene
from .views.step import Step
from .views.step import step as view

if TYPE_CHECKING:
    import pandas

_KINDS = {
    "/reloop/scene": messages.Scene,
    "/reloop/observation": messages.Observation,
    "/reloop/prediction": messages.Prediction,
    "/reloop/plan": messages.Plan,
    "/reloop/moves": messages.TrafficMoves,
    "/reloop/record": messages.StepRecord,
    "/reloop/event": messages.Event,
    "/reloop/end": messages.EpisodeEnd,
}


@dataclass
class RecordedStep:
    """All that was said at a step."""

    number: int
    #: What the planner was told, as it was told: ``observation.agents``, ``observation.window`` and so on.
    observation: Step
    #: None where the run had no predictor.
    prediction: Prediction | None = None
    #: None where there was none; one that was refused has an ``error``, or is followed by no record.
    plan: Plan | None = None
    #: Where the agents that reacted were after the step; None where the run had none.
    moves: Moves | None = None
    #: The message ``StepRecord``: the AV after the step, and what the judges say. None where the step was not driven.
    record: Any = None
    #: Messages ``Event``: what happened.
    events: list[Any] = field(default_factory=list)

    @property
    def time(self) -> float:
        """Simulated time before the step, from the first one driven (s)."""
        return self.number * STEP_SECONDS


class Episode(Sequence[RecordedStep]):
    """A recorded drive: a sequence of its steps."""

    def __init__(
        self, scene: Scene, steps: list[RecordedStep], end: Any, metadata: dict[str, str], damage: str | None
    ) -> None:
        #: What was told before the first step.
        self.scene = scene
        #: In order.
        self.steps = steps
        #: The message ``EpisodeEnd``; None in a recording that is cut off.
        self.end = end
        #: Name of the run on the bus.
        self.run = metadata.get("run", "")
        #: Why the recording was not read to its end; None where it was.
        self.damage = damage
        self._toml = metadata.get("run.toml", "")

    def __repr__(self) -> str:
        return f"Episode({self.scene.id!r}, {len(self)} steps, {self.end_reason or 'cut off'})"

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, which: Any) -> Any:
        return self.steps[which]

    def __iter__(self) -> Iterator[RecordedStep]:
        return iter(self.steps)

    @property
    def end_reason(self) -> str:
        """``horizon``, ``collision`` and so on, as in ``results.parquet``; empty in a recording that is cut off."""
        if self.end is None:
            return ""
        reasons = self.end.DESCRIPTOR.fields_by_name["reason"].enum_type.values_by_number
        return str(reasons[self.end.reason].name).removeprefix("END_REASON_").lower().replace("_", "-")

    @property
    def metrics(self) -> dict[str, float | None]:
        """Every metric by name (docs/metrics.md); None where one is not defined."""
        told = [] if self.end is None else self.end.metrics
        return {metric.name: metric.value if metric.HasField("value") else None for metric in told}

    @property
    def events(self) -> list[Any]:
        """The messages ``Event`` of all steps."""
        return [event for step in self.steps for event in step.events]

    @cached_property
    def settings(self) -> dict[str, Any]:
        """``run.toml`` of the run."""
        return tomllib.loads(self._toml)

    @cached_property
    def records(self) -> pandas.DataFrame:
        """A row a step that was driven: where it led, and what the judges say.

        Columns are the fields of ``StepRecord``, those of the AV and the control with the field's name before:
        ``av_x``, ``control_acceleration``. What is not defined is NaN. Under ``strict`` and ``paper`` alike,
        ``logged_av_...`` is where the log has the AV.
        """
        import pandas

        return pandas.DataFrame([_flat(step.record) for step in self.steps if step.record is not None])


def episode(path: str | PathLike[str]) -> Episode:
    """Reads the recording of an episode, ``runs/.../episodes/SCENE.mcap``.

    One that is cut off (a ``.partial``) or damaged is read as far as it goes: ``Episode.damage`` says why no further.

    Raises ``ReadError`` where the file cannot be opened, or holds no scene.
    """
    path = Path(path)
    told, metadata, damage = _messages(path)
    scenes = told["/reloop/scene"]
    if not scenes:
        raise ReadError(
            f"{path} holds no scene{f': {damage}' if damage else ''}\n"
            "  hint: recordings are the .mcap files in episodes/ of a run's folder"
        )
    scene = Scene(scenes[0])
    steps: dict[int, RecordedStep] = {}
    history = History.before(scenes[0])
    for message in told["/reloop/observation"]:
        seen = view(message, scene, history)
        history = seen.history
        steps.setdefault(seen.number, RecordedStep(seen.number, seen))
    # An answer too many, of a node that lies, comes after the one that counted.
    for message in reversed(told["/reloop/prediction"]):
        if message.step in steps:
            steps[message.step].prediction = Prediction.read(message)
    for message in reversed(told["/reloop/plan"]):
        if message.step in steps:
            steps[message.step].plan = Plan.read(message)
    for message in reversed(told["/reloop/moves"]):
        if message.step in steps:
            steps[message.step].moves = Moves.read(message)
    for message in told["/reloop/record"]:
        if message.step in steps:
            steps[message.step].record = message
    for message in told["/reloop/event"]:
        if message.step in steps:
            steps[message.step].events.append(message)
    ends = told["/reloop/end"]
    return Episode(scene, list(steps.values()), ends[0] if ends else None, metadata, damage)


def _messages(path: Path) -> tuple[dict[str, list[Any]], dict[str, str], str | None]:
    """The messages of each kind in the order of the file, the metadata, and why reading stopped before the end."""
    import zstandard
    from google.protobuf.message import DecodeError
    from mcap.exceptions import McapError
    from mcap.records import Channel, Message, Metadata
    from mcap.stream_reader import StreamReader

    told: dict[str, list[Any]] = {topic: [] for topic in _KINDS}
    topics: dict[int, str] = {}
    metadata: dict[str, str] = {}
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    topic = topics.get(record.channel_id, "")
                    if kind := _KINDS.get(topic):
                        told[topic].append(kind.FromString(record.data))
                elif isinstance(record, Metadata) and record.name == "reloop":
                    metadata = record.metadata
    except OSError as error:
        raise ReadError(f"{path} cannot be read: {error.strerror}") from error
    except (McapError, DecodeError, zstandard.ZstdError, EOFError, ValueError, struct.error) as error:
        return told, metadata, f"{type(error).__name__}: {error}"
    return told, metadata, None


def _flat(message: Any, before: str = "") -> dict[str, Any]:
    row: dict[str, Any] = {}
    for descriptor in message.DESCRIPTOR.fields:
        name = descriptor.name
        if descriptor.message_type is not None:
            if message.HasField(name):
                row |= _flat(getattr(message, name), f"{before}{name}_")
        elif descriptor.has_presence and not message.HasField(name):
            row[f"{before}{name}"] = float("nan")
        else:
            row[f"{before}{name}"] = getattr(message, name)
    return row
