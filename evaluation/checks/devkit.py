"""Imports a checkout of nuplan-devkit without all that it depends on: what its modules import for files, pictures and clouds, and a
score does not need, is stood in for where it is not installed."""

import importlib.abc
import importlib.machinery
import sys
import types
from unittest import mock


class _Absent(types.ModuleType):
    __path__ = []

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return mock.MagicMock()


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    absent = set()

    def find_spec(self, name, _path, _target=None):
        root = name.split(".")[0]
        frame = sys._getframe(1)
        while "importlib" in frame.f_code.co_filename:
            frame = frame.f_back
        wanted_by_nuplan = frame.f_globals.get("__name__", "").startswith("nuplan.")
        if root == "nuplan" or (root not in self.absent and not wanted_by_nuplan):
            return None
        self.absent.add(root)
        return importlib.machinery.ModuleSpec(name, self, is_package=True)

    def create_module(self, spec):
        return _Absent(spec.name)

    def exec_module(self, module):
        pass


def load_devkit(path):
    """Makes `import nuplan` find the checkout."""
    if not (path / "nuplan" / "planning").is_dir():
        sys.exit(f"{path} is no checkout of nuplan-devkit")
    # Last of all: what is installed is taken.
    sys.meta_path.append(_Finder())
    sys.path.insert(0, str(path))
