"""Where a node connects to, and as whom: from arguments and the environment."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .errors import NodeError
from .keys import checked


@dataclass(frozen=True)
class Options:
    """Where a node connects to, and as whom. ``sim run`` tells it all."""

    endpoint: str
    #: Name of the run.
    run: str
    #: The worker that it serves; ``*`` is all of them.
    worker: str = "*"
    #: Its name, for people.
    name: str = field(default_factory=lambda: f"python-{os.getpid()}")
    #: Leave when standard input ends.
    exit_with_parent: bool = False
    #: What it must know to be let in.
    secret: str | None = field(default=None, repr=False)
    #: A Zenoh configuration (JSON5) with this node's certificate, for a sim on another host.
    zenoh_config: str | None = None

    @classmethod
    def read(cls, arguments: Sequence[str] | None = None, environment: Mapping[str, str] | None = None) -> Options:
        """From arguments (``sys.argv`` by default) and the environment; what is said twice is taken from the arguments.

        Arguments that are none of these are left to the program.

        Raises ``NodeError`` where endpoint or run are missing, or a name cannot be part of a key.
        """
        env = os.environ if environment is None else environment
        parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
        parser.add_argument("--endpoint", default=env.get("RELOOP_ENDPOINT"))
        parser.add_argument("--run", default=env.get("RELOOP_RUN"))
        parser.add_argument("--worker", default=env.get("RELOOP_WORKER") or "*")
        parser.add_argument("--name", default=env.get("RELOOP_NAME") or f"python-{os.getpid()}")
        parser.add_argument("--zenoh-config", default=env.get("RELOOP_ZENOH_CONFIG") or None)
        parser.add_argument("--exit-with-parent", action="store_true", default=_flag(env))
        asked, _ = parser.parse_known_args(sys.argv[1:] if arguments is None else list(arguments))
        missing = [f"--{name}" for name in ("endpoint", "run") if not getattr(asked, name)]
        if missing:
            raise NodeError(
                f"nobody said where the sim is ({' and '.join(missing)})\n"
                '  hint: let the sim start this program: sim run --planner-command "python my_planner.py"'
            )
        worker = "*" if asked.worker in ("*", "all") else checked("worker", asked.worker)
        secret = env.get("RELOOP_SECRET") or None
        return cls(
            endpoint=asked.endpoint,
            run=checked("run name", asked.run),
            worker=worker,
            name=checked("node name", asked.name),
            exit_with_parent=asked.exit_with_parent,
            zenoh_config=asked.zenoh_config,
            secret=secret and checked("secret", secret),
        )


def _flag(environment: Mapping[str, str]) -> bool:
    return environment.get("RELOOP_EXIT_WITH_PARENT", "").lower() in ("1", "true", "yes", "on")
