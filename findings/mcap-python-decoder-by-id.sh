#!/usr/bin/env bash
# version: mcap-protobuf-support 0.6.0, mcap 1.6.0, protobuf 7.36.2 (PyPI)
# mcap-protobuf-support 0.6.0 (Python): a DecoderFactory that is kept for several files decodes by schema id alone.
# Expected: each file's messages by that file's schema. Seen: the second file's messages come out under the first file's type,
# without an error, with the values in whatever field has the same number.
# What we do: our schema ids are the same in every file and stay so (docs/recordings.md), so a shared factory is right with ours.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet mcap==1.6.0 mcap-protobuf-support==0.6.0 protobuf==7.36.2
venv/bin/python - > seen <<'PY'
import io

from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import build_file_descriptor_set


def file(message):
    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    kind = type(message)
    definition = build_file_descriptor_set(kind).SerializeToString()
    schema = writer.register_schema(kind.DESCRIPTOR.full_name, "protobuf", definition)
    channel = writer.register_channel("topic", "protobuf", schema)
    writer.add_message(channel, log_time=0, publish_time=0, data=message.SerializeToString())
    writer.finish()
    return out.getvalue()


shared = DecoderFactory()
for data in (file(Timestamp(seconds=7)), file(Duration(seconds=9))):
    for name, factory in (("own", DecoderFactory()), ("shared", shared)):
        for schema, _, _, message in make_reader(io.BytesIO(data), decoder_factories=[factory]).iter_decoded_messages():
            print(f"schema {schema.name}, {name} factory: {type(message).__name__}")
PY
cat seen
diff - seen <<'TXT'
schema google.protobuf.Timestamp, own factory: Timestamp
schema google.protobuf.Timestamp, shared factory: Timestamp
schema google.protobuf.Duration, own factory: Duration
schema google.protobuf.Duration, shared factory: Timestamp
TXT
