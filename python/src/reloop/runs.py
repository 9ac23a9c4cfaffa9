"""What a run leaves, as pandas frames."""

from __future__ import annotations

import tomllib
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import ReadError

if TYPE_CHECKING:
    import pandas

#: What the end of a column's name says of its unit (docs/running.md, docs/metrics.md). Longer ends first.
_UNITS = {
    "_radps2": "rad/s²",
    "_radps": "rad/s",
    "_rad": "rad",
    "_mps3": "m/s³",
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_s": "s",
    "_m": "m",
}


class Results:
    """A finished run. Each file is read when it is first asked for."""

    def __init__(self, folder: str | PathLike[str]) -> None:
        """The run in ``folder``.

        Raises ``ReadError`` where there is none, or it is not finished.
        """
        self.folder = Path(folder)
        if not (self.folder / "run.toml").is_file():
            raise ReadError(f"{self.folder} is no run: it has no run.toml\n  hint: `sim run` prints the run's folder")
        if not (self.folder / "digest").is_file():
            raise ReadError(
                f"the run in {self.folder} is not finished\n  hint: the same `sim run` command once more continues it"
            )

    def __repr__(self) -> str:
        return f"Results({str(self.folder)!r})"

    @cached_property
    def results(self) -> pandas.DataFrame:
        """A row an episode: how it ended, and every metric. ``attrs["units"]`` has the units by column."""
        return self._frame("results.parquet")

    @cached_property
    def steps(self) -> pandas.DataFrame:
        """A row a step: the AV after it, and what the judges say. ``attrs["units"]`` has the units by column."""
        return self._frame("steps.parquet")

    @cached_property
    def timing(self) -> pandas.DataFrame:
        """A row an episode: where the time went, seconds of wall clock. ``attrs["units"]`` has the units by column."""
        return self._frame("timing.parquet")

    @cached_property
    def settings(self) -> dict[str, Any]:
        """``run.toml``: every setting, the build, the scenes."""
        return tomllib.loads((self.folder / "run.toml").read_text(encoding="utf-8"))

    @property
    def digest(self) -> str:
        """SHA-256 over ``results.parquet`` and ``steps.parquet``, as ``sim`` prints it."""
        return (self.folder / "digest").read_text(encoding="utf-8").split()[0]

    @property
    def recordings(self) -> list[Path]:
        """The MCAP files of its episodes, for ``reloop.episode``, by name."""
        return sorted((self.folder / "episodes").glob("*.mcap"))

    def _frame(self, name: str) -> pandas.DataFrame:
        # Here, for a planner's process needs neither.
        import pandas
        import pyarrow

        path = self.folder / name
        try:
            frame = pandas.read_parquet(path)
        except (OSError, pyarrow.ArrowException) as error:
            raise ReadError(f"{path} cannot be read: {error}") from error
        return with_units(frame)


def with_units(frame: pandas.DataFrame) -> pandas.DataFrame:
    """The same frame; ``attrs["units"]`` has the units by column."""
    frame.attrs["units"] = {column: unit for column in frame.columns if (unit := unit_of(column))}
    return frame


def unit_of(column: str) -> str:
    """The unit of a column by its name; empty for what has none: texts, counts, flags, shares."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), "")


def results(folder: str | PathLike[str]) -> Results:
    """The finished run in ``folder``, as pandas frames: ``reloop.results("runs/idm-strict-1").steps``.

    Raises ``ReadError`` where there is none, or it is not finished.
    """
    return Results(folder)
