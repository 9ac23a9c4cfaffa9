#!/usr/bin/env bash
# Makes the vectors in sim/tests/fixtures/paper anew, after a change of generated scenes. Needs Python with numpy (PYTHON=... names it).
set -euo pipefail
cd "$(dirname "$0")/../.."

fixture=sim/tests/fixtures/paper
scenes=$(mktemp -d)
trap 'rm -r "$scenes"' EXIT

cargo run --quiet --locked -p scenarios -- export "$fixture/scenes.toml" --out "$scenes"
rm -f "$fixture"/*.npz "$fixture"/*.json
"${PYTHON:-python3}" sim/checks/paper_vectors.py --out "$fixture" "$scenes"/*.tfrecord
