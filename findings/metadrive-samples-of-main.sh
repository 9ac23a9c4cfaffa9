#!/usr/bin/env bash
# version: metadrive-simulator 0.2.6.0 (PyPI), NumPy 2.3.5
# metadrive-simulator 0.2.6.0: the three scenes that the package brings along (metadrive/assets/waymo) name classes of `__main__`, the script that
# wrote them: AgentType, RoadLineType, RoadEdgeType. Expected: whoever has the package and NumPy can unpickle its scenes. Seen:
# `pickle.load` raises AttributeError in every program that does not define classes of these names at its top.
# What we do: the classes are known by name as the numbers that they stand for, and nothing of a pickle is run.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet numpy==2.3.5
venv/bin/pip download --quiet --no-deps metadrive-simulator==0.2.6.0
cat >seen.py <<'PY'
import pickle
import sys
import zipfile

wheel = zipfile.ZipFile("metadrive_simulator-0.2.6.0-py3-none-any.whl")
for number in range(3):
    scene = wheel.read(f"metadrive/assets/waymo/{number}.pkl")
    try:
        pickle.loads(scene)
        print(number, "is loaded")
    except AttributeError as error:
        print(number, error)


class Stands:
    """Anything of the right name will do."""

    def __init__(self, number):
        self.number = number


main = sys.modules["__main__"]
main.AgentType = main.RoadLineType = main.RoadEdgeType = Stands
for number in range(3):
    print(number, sorted(pickle.loads(wheel.read(f"metadrive/assets/waymo/{number}.pkl")))[:3])
PY
venv/bin/python seen.py | tee seen
grep -c "AgentType" seen | grep -qx 3
