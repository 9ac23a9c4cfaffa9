"""Columns of messages as arrays that nobody can write to by mistake."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same array, read-only."""
    array.flags.writeable = False
    return array


def floats(values: Iterable[Any]) -> Floats:
    """A column of numbers."""
    return frozen(np.array(values, dtype=np.float64))


def ints(values: Iterable[int]) -> Ints:
    """A column of integers."""
    return frozen(np.array(values, dtype=np.int64))


def points(polyline: Any) -> Floats:
    """A message ``Polyline`` as an array (points, 3) of x, y, z."""
    return frozen(np.column_stack([np.array(c, dtype=np.float64) for c in (polyline.x, polyline.y, polyline.z)]))
