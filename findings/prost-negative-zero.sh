#!/usr/bin/env bash
# version: prost 0.14.4 for Rust, protobuf 7.36.2 for Python
# prost 0.14.4 (Rust) writes nothing for a double of -0.0; protobuf 7.36.2 (Python) writes it. Both are "proto3".
# Expected: one number, one encoding. Seen: 0 bytes and 9, so a sign is lost by one writer and kept by the other: two nodes that
# compute the same plan in two languages differ in a bit.
# What we do: numbers that arrive have their zeros made positive at the door.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet protobuf==7.36.2
cargo init --quiet --vcs none --name zero .
cat >> Cargo.toml <<'TOML'
prost = { version = "=0.14.4", default-features = false, features = ["derive"] }
TOML
cat > src/main.rs <<'RS'
#[derive(Clone, PartialEq, prost::Message)]
struct Number {
    #[prost(double, tag = "1")]
    value: f64,
}

fn main() {
    for value in [-0.0, 0.0, 1.0] {
        println!("prost {value:?}: {} bytes", prost::Message::encoded_len(&Number { value }));
    }
}
RS
{
    cargo run --quiet
    venv/bin/python -c '
from google.protobuf.wrappers_pb2 import DoubleValue
for value in (-0.0, 0.0, 1.0):
    print(f"protobuf {value}: {len(DoubleValue(value=value).SerializeToString())} bytes")'
} > seen
cat seen
diff - seen <<'TXT'
prost -0.0: 0 bytes
prost 0.0: 0 bytes
prost 1.0: 9 bytes
protobuf -0.0: 9 bytes
protobuf 0.0: 0 bytes
protobuf 1.0: 9 bytes
TXT
