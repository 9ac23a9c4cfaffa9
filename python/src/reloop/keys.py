"""Every key of the bus that a node uses. ``docs/bus.md`` has the table."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .errors import NodeError
from .messages import SERVICE_VERSION, WIRE_VERSION

_PART = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,127}")


def checked(what: str, text: str) -> str:
    """``text``, if it can be part of a key.

    Raises ``NodeError``.
    """
    if not _PART.fullmatch(text):
        shown = "***" if what == "secret" else repr(text)
        raise NodeError(
            f"the {what} {shown} cannot be part of a bus key\n"
            "  hint: use 1 to 128 of A-Z a-z 0-9 _ . -, not beginning with a dot"
        )
    return text


@dataclass(frozen=True)
class Place:
    """A seat of a run, or its open floor, where whoever was told no secret stands."""

    run: str
    secret: str | None

    def __repr__(self) -> str:
        return f"Place({self.run!r}, {'a seat' if self.secret else 'open floor'})"

    @property
    def prefix(self) -> str:
        """What all keys of this place begin with."""
        return f"reloop/{self.run}" + (f"/@seat-{self.secret}" if self.secret else "")

    def told(self, worker: str) -> str:
        """Where the sim tells of the episodes of ``worker``, ``*`` for all."""
        return f"{self.prefix}/{worker}/told"

    def door(self, session: str) -> str:
        """Where the sim says whether the node of ``session`` is let in."""
        return f"{self.prefix}/@door/{session}"

    def token(self, role: str, worker: str, name: str, session: str) -> str:
        """The liveliness token of a node."""
        serves = "all" if worker == "*" else worker
        return f"{self.prefix}/@node/{role}/{serves}/{name}/{session}/{WIRE_VERSION}"

    @property
    def sim(self) -> str:
        """Selects the sim's own token."""
        return f"reloop/{self.run}/@node/sim/**"

    @property
    def info(self) -> str:
        """Where the run's settings are asked for."""
        return f"reloop/{self.run}/info"

    def scene(self, worker: str) -> str:
        """Selects the scene of the episode that ``worker`` drives now, to be asked for."""
        return f"reloop/{self.run}/@tape/{worker}/*/scene"


def worker_of(told: str) -> str:
    """The worker of a ``told`` key."""
    return told.rsplit("/", 2)[1]


def answer(told: str, channel: str, session: str) -> str:
    """Where to answer what came under the key ``told``: ``channel`` is ``plan``, ``prediction`` or ``moves``."""
    return f"{told.removesuffix('told')}{channel}/{session}"


def service_key(secret: str) -> str:
    """The key under which a service is asked.

    Raises ``NodeError`` where the secret cannot be part of a key.
    """
    return f"reloop/@service-{checked('secret', secret)}/{SERVICE_VERSION}/ask"
