#!/usr/bin/env bash
# version: mcap 1.6.0 (PyPI)
# mcap 1.6.0 (Python): iter_messages(reverse=True) goes forwards through a file without chunks, and says nothing.
# Expected: the last message first, or an error. Seen: the first first.
# What we do: our recordings are chunked.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet mcap==1.6.0
venv/bin/python - > seen <<'PY'
import io

from mcap.reader import make_reader
from mcap.writer import Writer

for chunked in (True, False):
    out = io.BytesIO()
    writer = Writer(out, use_chunking=chunked)
    writer.start()
    schema = writer.register_schema("step", "jsonschema", b"{}")
    channel = writer.register_channel("step", "json", schema)
    for step in range(3):
        writer.add_message(channel, log_time=step, publish_time=step, data=str(step).encode())
    writer.finish()
    messages = make_reader(io.BytesIO(out.getvalue())).iter_messages(reverse=True)
    print("with chunks:" if chunked else "without:", *[message.data.decode() for _, _, message in messages])
PY
cat seen
diff - seen <<'TXT'
with chunks: 2 1 0
without: 0 1 2
TXT
