#!/usr/bin/env bash
# version: @mcap/core 2.2.2 (npm), Node.js as installed
# @mcap/core 2.2.2 (JavaScript): a file that its writer makes without chunks has a metadata index that its own reader refuses.
# Expected: the metadata. Seen: the index points at the first schema record; readMetadata raises.
# What we do: our recordings are chunked, and written by the Rust crate.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm init --yes > /dev/null
npm install --silent --no-fund --no-audit @mcap/core@2.2.2
cat > run.mjs <<'JS'
import { McapIndexedReader, McapWriter } from "@mcap/core";

class Memory {
  parts = [];
  length = 0n;
  async write(bytes) {
    this.parts.push(Buffer.from(bytes));
    this.length += BigInt(bytes.length);
  }
  position() {
    return this.length;
  }
}

for (const useChunks of [true, false]) {
  const out = new Memory();
  const writer = new McapWriter({ writable: out, useChunks });
  await writer.start({ profile: "", library: "" });
  const schemaId = await writer.registerSchema({ name: "step", encoding: "jsonschema", data: new TextEncoder().encode("{}") });
  const channelId = await writer.registerChannel({ schemaId, topic: "step", messageEncoding: "json", metadata: new Map() });
  await writer.addMessage({ channelId, sequence: 0, logTime: 0n, publishTime: 0n, data: new TextEncoder().encode("1") });
  await writer.addMetadata({ name: "settings", metadata: new Map([["driver", "idm"]]) });
  await writer.end();
  const bytes = Buffer.concat(out.parts);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const label = useChunks ? "with chunks" : "without";
  const opcode = bytes[Number(reader.metadataIndexes[0].offset)];
  try {
    for await (const metadata of reader.readMetadata()) {
      console.log(`${label}: the index points at opcode ${opcode}, read ${metadata.name}`);
    }
  } catch {
    console.log(`${label}: the index points at opcode ${opcode}, readMetadata raised`);
  }
}
JS
node run.mjs > seen
cat seen
diff - seen <<'TXT'
with chunks: the index points at opcode 12, read settings
without: the index points at opcode 3, readMetadata raised
TXT
