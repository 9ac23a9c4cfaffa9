#!/usr/bin/env bash
# version: rerun-sdk 0.36.3 (PyPI)
# rerun-sdk 0.36.3: of two lines that are logged at one step, a dataframe by step has the second alone.
# Expected: a row for each. Seen: one row, and the first line is nowhere.
# What we do: docs/recordings.md says to count events in the MCAP file or in the results.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet 'rerun-sdk[datafusion]==0.36.3'
venv/bin/python - > seen <<'PY'
import pathlib

import rerun as rr

path = pathlib.Path("events.rrd").absolute()
recording = rr.RecordingStream("findings", recording_id="rows")
recording.save(path)
for step in range(3):
    recording.set_time("step", sequence=step)
    recording.log("events", rr.TextLog(f"first of {step}"))
    if step == 1:
        recording.log("events", rr.TextLog(f"second of {step}"))
recording.flush()
del recording

with rr.server.Server(datasets={"run": [str(path)]}) as server:
    # Each is kept: what goes out of scope is gone on the other side of the foreign interface too.
    client = server.client()
    dataset = client.get_dataset("run")
    frame = dataset.reader(index="step")
    table = frame.to_arrow_table()
for step, text in zip(table["step"].to_pylist(), table["/events:TextLog:text"].to_pylist()):
    print(step, *text)
PY
cat seen
diff - seen <<'TXT'
0 first of 0
1 second of 1
2 first of 2
TXT
