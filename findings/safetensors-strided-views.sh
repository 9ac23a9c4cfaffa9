#!/usr/bin/env bash
# version: safetensors 0.8.0, numpy 2.4.6 (PyPI)
# safetensors 0.8.0 for numpy writes a transposed or strided array with wrong values, and says nothing.
# Expected: the array's values, or an error. Seen: the buffer in memory order under the view's shape. 0.7.0 was right.
# What we do: nothing of ours writes by it; `np.ascontiguousarray` before saving is the cure.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet safetensors==0.8.0 numpy==2.4.6
venv/bin/python - > seen <<'PY'
import numpy as np
from safetensors.numpy import load, save

rows = np.arange(6, dtype=np.float32).reshape(2, 3)
views = {"contiguous": rows, "transposed": rows.T, "every second": np.arange(10, dtype=np.float32)[::2]}
for name, array in views.items():
    print(f"{name}: {array.tolist()} came back as {load(save({'x': array}))['x'].tolist()}")
PY
cat seen
diff - seen <<'TXT'
contiguous: [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]] came back as [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
transposed: [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]] came back as [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]
every second: [0.0, 2.0, 4.0, 6.0, 8.0] came back as [0.0, 1.0, 2.0, 3.0, 4.0]
TXT
