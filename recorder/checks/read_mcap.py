"""Reads a recording with the public MCAP reader: every checksum, every message decoded, counts and times as they should be."""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

STEP_NS = 100_000_000

path = sys.argv[1]
with open(path, "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    assert "run.toml" in metadata["reloop"], metadata
    counts, entities, end = Counter(), 0, None
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        counts[channel.topic] += 1
        assert decoded.DESCRIPTOR.full_name == schema.name
        assert message.log_time == message.publish_time and message.log_time % STEP_NS == 0
        if schema.name == "foxglove.SceneUpdate":
            entities += len(decoded.entities)
            for entity in decoded.entities:
                assert entity.frame_id == "scene"
        if channel.topic == "/reloop/end":
            end = decoded

assert sum(counts.values()) == summary.statistics.message_count
assert end is not None, "no end"
for topic, expected in [
    ("observation", end.observations),
    ("prediction", end.predictions),
    ("plan", end.plans),
    ("record", end.records),
    ("event", end.events),
]:
    assert counts[f"/reloop/{topic}"] == expected, (topic, counts, expected)
print(f"{path}: {sum(counts.values())} messages, {entities} entities, {end.steps} steps, metrics {len(end.metrics)}: all decoded")
