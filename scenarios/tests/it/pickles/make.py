"""Writes the pickles beside it, of invented values: by Python of today in all protocols, and by NumPy 2 in those that it is used with."""

import collections
import pathlib
import pickle

import numpy as np

HERE = pathlib.Path(__file__).parent

VALUES = {
    "a": [1, -2, 70000, 2**40, 2.5, None, True, (1,), (), "é~ \\ ☃\n", "long" * 2],
    "b": b"\x00\xff",
    7: {"x"},
    "d": (1, 2, 3, 4),
}
ARRAYS = {
    "f4": np.array([[1, 2], [3, 4.5], [5, 6]], "f4"),
    "F": np.asfortranarray(np.array([[1, 2], [3, 4.5], [5, 6]])),
    "b": np.array([True, False]),
    "big": np.array([1.5, 2.5], ">f8"),
    "s": np.float64(2.5),
    "i": np.int64(-3),
    "f2": np.array([0.5, -65504, 6e-8], "f2"),
    "u1": np.array([200], "u1"),
    "i2": np.array([-200], "i2"),
    "U": np.array(["text"]),
    "d": collections.defaultdict(int, {"k": 1}),
    "o": collections.OrderedDict(k=2),
}
for protocol in range(6):
    (HERE / f"values-{protocol}.pkl").write_bytes(pickle.dumps(VALUES, protocol))
for protocol in range(2, 6):
    (HERE / f"arrays-{protocol}.pkl").write_bytes(pickle.dumps(ARRAYS, protocol))
