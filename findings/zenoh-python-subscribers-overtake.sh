#!/usr/bin/env bash
# version: eclipse-zenoh 1.10.2 (PyPI)
# eclipse-zenoh 1.10.2 (Python): two callback subscribers of one session do not keep the order of what one peer put on two keys.
# Expected: a scene's callback before that of the observation put after it. Seen: in hundreds of 1,000 pairs the other way round,
# because each callback has a thread of its own unless it is wrapped in Callback(f, indirect=False).
# What we do: docs/bus.md says which order holds, and for whom.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet eclipse-zenoh==1.10.2
venv/bin/python - <<'PY'
import socket
import sys
import time

import zenoh
from zenoh.handlers import Callback

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"


def session(mode, end):
    config = zenoh.Config()
    config.insert_json5("mode", f'"{mode}"')
    config.insert_json5(end, f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def overtaken(sim, node, wrap):
    """Of 1,000 pairs, how many observations are called back before their scene."""
    heard, keys = [], ("demo/scene", "demo/observation")
    subscribers = [node.declare_subscriber(k, wrap(lambda s, k=k: heard.append((k, bytes(s.payload))))) for k in keys]
    publishers = [sim.declare_publisher(k, congestion_control=zenoh.CongestionControl.BLOCK) for k in keys]
    time.sleep(0.5)
    for pair in range(1000):
        for publisher in publishers:
            publisher.put(str(pair))
    for _ in range(100):
        if len(heard) == 2000:
            break
        time.sleep(0.1)
    for one in subscribers + publishers:
        one.undeclare()
    scenes, early = set(), 0
    for key, pair in heard:
        if key == keys[0]:
            scenes.add(pair)
        else:
            early += pair not in scenes
    return len(heard), early


sim, node = session("router", "listen/endpoints"), session("client", "connect/endpoints")
default = overtaken(sim, node, lambda f: f)
direct = overtaken(sim, node, lambda f: Callback(f, indirect=False))
node.close()
sim.close()
print(f"default: {default[0]} messages, {default[1]} observations before their scene")
print(f"indirect=False: {direct[0]} messages, {direct[1]} observations before their scene")
sys.exit(0 if default[1] > 0 and direct == (2000, 0) else 1)
PY
