"""A service of the simulator, ``sim serve``, asked from Python: runs that it drives, and scenes step by step.

::

    import reloop

    with reloop.Service() as service:
        run = service.submit(driver="idm", sets=["demo"])
        for end in service.watch(run.name):
            print(end.scene, end.reason)
        frame = service.table(run.name)
"""

from __future__ import annotations

import io
import os
import re
import secrets
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import zenoh

from . import messages
from .bus_session import config
from .errors import ServiceError
from .keys import service_key
from .session import Session
from .settings import settings as _settings

if TYPE_CHECKING:
    import pandas

#: Where a service is, unless somebody says otherwise.
ENDPOINT = "tcp/127.0.0.1:7461"
#: How long an answer may take (s). The service itself answers within a second.
_PATIENCE = 20.0
#: How long a service that is gone is waited for (s), and while a run is watched.
_GONE, _GONE_WHILE_WATCHED = 5.0, 600.0
_PAUSE = 0.25
#: States in which a run is over.
_OVER = frozenset({"done", "failed", "cancelled"})


@dataclass(frozen=True)
class Run:
    """How a run is."""

    name: str
    client: str
    #: ``queued``, ``running``, ``done``, ``failed`` or ``cancelled``.
    state: str
    #: Why it failed.
    detail: str
    #: How many there are, how many are driven, and how many of those have no result.
    episodes: int
    done: int
    failed: int
    #: Runs that are to begin before it, as things are.
    before: int
    #: The options of ``sim run``.
    arguments: tuple[str, ...]
    #: SHA-256 of the results; of one that is done.
    digest: str

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self.state in _OVER


@dataclass(frozen=True)
class End:
    """An episode's end."""

    scene: str
    #: As in ``results.parquet``: ``horizon``, ``collision`` ...
    reason: str
    detail: str
    #: Steps driven.
    steps: int
    #: It has no result.
    failed: bool


@dataclass(frozen=True)
class Offer:
    """What a service drives, and how much."""

    version: str
    git_revision: str
    #: Name and words of each driver.
    drivers: dict[str, str]
    #: The scenes of each set; of many, the first 1,000.
    sets: dict[str, tuple[str, ...]]
    weights: tuple[str, ...]
    #: Whether commands of clients are started.
    commands: bool
    workers: int
    runs_at_once: int
    running: int
    queued: int


class Service:
    """A service, seen by a client; it may be stopped and started again meanwhile."""

    def __init__(
        self,
        endpoint: str | None = None,
        *,
        secret: str | None = None,
        client: str | None = None,
        zenoh_config: str | None = None,
    ) -> None:
        """The service at ``endpoint``, else at ``$RELOOP_SERVICE``, else on this machine.

        Its secret is ``secret``, else ``$RELOOP_SECRET``, else where a service of the same user on this machine leaves
        it. The queue is fair between clients: ``client`` is who you are, else ``$USER``. ``zenoh_config`` is a file
        with your certificate (JSON5, docs/hosts.md), for a service that listens by TLS.

        Raises ``ServiceError`` where the secret is not known.
        """
        self.endpoint = endpoint or os.environ.get("RELOOP_SERVICE") or ENDPOINT
        self._key = service_key(secret or os.environ.get("RELOOP_SECRET") or _left_secret(self.endpoint))
        self._client = client or os.environ.get("USER") or "somebody"
        self._zenoh_config = zenoh_config
        self._session: zenoh.Session | None = None

    def __enter__(self) -> Service:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection. What was submitted goes on."""
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
            self._session = None

    def offer(self) -> Offer:
        """What can be driven there."""
        told = self._ask(offer=messages.service("AskOffer")()).offer
        return Offer(
            version=told.version,
            git_revision=told.git_revision,
            drivers={driver.name: driver.about for driver in told.drivers},
            sets={each.name: tuple(each.ids) for each in told.scene_sets},
            weights=tuple(told.weights),
            commands=told.commands,
            workers=told.workers,
            runs_at_once=told.runs_at_once,
            running=told.running,
            queued=told.queued,
        )

    def submit(self, driver: str = "", *, name: str = "", sets: Iterable[str] = (), **settings: Any) -> Run:
        """Has a run driven: how it is at first.

        ``settings`` are options of ``sim run``, with underlines: ``record="none"``, ``set=["horizon=80"]``,
        ``deadline="2s"``. Once this returns, the run will be driven whatever happens to the service. A run of the same
        ``name`` that failed or was cancelled goes on.

        Raises ``ServiceError`` where the service refuses, and says why.
        """
        asked = messages.service("Submit")(
            client=self._client,
            name=name,
            settings=_settings(driver=driver, scenes=sets, **settings),
            # Asked again for want of an answer it is the same run.
            submission=secrets.token_hex(16),
        )
        return _run(self._ask(submit=asked).run)

    def status(self, name: str | None = None) -> list[Run] | Run:
        """How one run is; or how all are that are not over, and the last that are."""
        runs = [_run(run) for run in self._ask(status=messages.service("AskStatus")(run=name or "")).runs.runs]
        return runs if name is None else runs[0]

    def cancel(self, name: str) -> Run:
        """Stops a run. What it has driven is kept."""
        return _run(self._ask(cancel=messages.service("Cancel")(run=name)).run)

    def watch(self, name: str, on_run: Callable[[Run], None] | None = None) -> Iterator[End]:
        """The ends of a run's episodes, each once, as they come, until it is over. ``on_run`` hears how the run is.

        Raises ``ServiceError`` where the service is gone for ten minutes, or the run failed.
        """
        asked = messages.service("Watch")(run=name)
        known: set[str] = set()
        while True:
            news = self._ask(_patience=_GONE_WHILE_WATCHED, watch=asked).news
            asked.epoch, asked.known, asked.state = news.epoch, news.known, news.run.state
            run = _run(news.run)
            if on_run is not None:
                on_run(run)
            for end in news.ends:
                if end.scene not in known:
                    known.add(end.scene)
                    yield End(end.scene, end.reason, end.detail, end.steps, end.failed)
            if run.state == "failed":
                raise ServiceError(f"the run {name} failed: {run.detail}")
            if run.is_over:
                return

    def wait(self, name: str) -> Run:
        """Waits until a run is over: how it is then."""
        states: list[Run] = []
        for _ in self.watch(name, states.append):
            pass
        return states[-1]

    def table(self, name: str, format: str | None = None) -> pandas.DataFrame | str:
        """What came of a run that is done: a row an episode, as ``reloop.results(...).results`` has it.

        With a ``format``, ``text``, ``markdown`` or ``csv``, the table that ``sim table`` prints.
        """
        asked = messages.service("AskTable")(run=name, format=format or "", results=format is None)
        told = self._ask(table=asked).table
        if format is not None:
            return str(told.text)
        # Here, for who submits needs neither.
        import pandas

        from .runs import with_units

        return with_units(pandas.read_parquet(io.BytesIO(told.results_parquet)))

    def open(self, scene: str, driver: str = "", *, sets: Iterable[str] = (), **settings: Any) -> Session:
        """Opens a session: one scene, which is driven step by step. ``settings`` are those of ``submit``."""
        asked = messages.service("Open")(
            client=self._client, scene=scene, settings=_settings(driver=driver, scenes=sets, **settings)
        )
        return Session(self._ask_once, self._ask_once(open=asked).session)

    def _ask(self, _patience: float = _GONE, **what: Any) -> Any:
        """Asks what may be asked twice, again while the service is gone for no longer than that."""
        until = time.monotonic() + _patience
        while True:
            try:
                return self._ask_once(**what)
            except _Gone:
                if time.monotonic() >= until:
                    raise
                time.sleep(_PAUSE)

    def _ask_once(self, **what: Any) -> Any:
        payload = messages.service("Ask")(**what).SerializeToString()
        try:
            if self._session is None:
                self._session = zenoh.open(_config(self.endpoint, self._zenoh_config))
            for reply in self._session.get(self._key, payload=payload, timeout=_PATIENCE):
                if reply.ok is not None:
                    return _answer(bytes(reply.ok.payload))
        except zenoh.ZError as error:
            self.close()
            raise _Gone(f"no service at {self.endpoint}: {error}\n  hint: `sim serve` says where it is") from None
        # Where there was one, it is gone.
        self.close()
        raise _Gone(
            f"no service at {self.endpoint} knows this secret\n"
            "  hint: is it a service, and RELOOP_SECRET the one that `sim serve` tells of?"
        )


class _Gone(ServiceError):
    """Asking again may help."""


def _run(message: Any) -> Run:
    state = messages.service_enum("RunState").values_by_number[message.state].name
    return Run(
        name=message.name,
        client=message.client,
        state=state.removeprefix("RUN_STATE_").lower(),
        detail=message.detail,
        episodes=message.episodes,
        done=message.done,
        failed=message.failed,
        before=message.before,
        arguments=tuple(message.arguments),
        digest=message.digest,
    )


def _answer(payload: bytes) -> Any:
    reply = messages.service("Reply").FromString(payload)
    if reply.WhichOneof("what") == "refusal":
        raise ServiceError(reply.refusal.text)
    return reply


def _config(endpoint: str, zenoh_config: str | None) -> zenoh.Config:
    settings = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 5000,
        "connect/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    return config(zenoh_config, settings)


def _left_secret(endpoint: str) -> str:
    """What a service of the same user on this machine left: ``sim/src/serve/secret.rs`` says where."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local/state")
    path = Path(state, "reloop/services", re.sub(r"[^A-Za-z0-9.]", "_", endpoint))
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        raise ServiceError(
            f"the secret of the service at {endpoint} is not known here\n  hint: put it into RELOOP_SECRET; "
            "`sim serve` says where it is kept, and a service of your own on this machine needs none"
        ) from None
