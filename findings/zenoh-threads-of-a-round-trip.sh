#!/usr/bin/env bash
# version: eclipse-zenoh 1.10.2 (PyPI)
# eclipse-zenoh 1.10.2: a round trip between two processes wakes three of Zenoh's threads on each side, and no key of its configuration
# changes that. Expected: the thread that waits for the socket reads it. Seen: a link's readiness is noticed by the runtime that opened it
# (`app` in a client, `acc` in a router), read by `rx`, and answers are written by `tx`: twice the context switches of one thread for all,
# which only the environment variable ZENOH_RUNTIME gives, read before the first session.
# What we do: nodes get it in their environment, the sim starts itself anew with it; docs/performance.md has the figures.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet eclipse-zenoh==1.10.2
cat >pong.py <<'PY'
import sys

import zenoh
from zenoh.handlers import Callback

config = zenoh.Config()
for key, value in [("mode", '"client"'), ("connect/endpoints", f'["{sys.argv[1]}"]'), ("scouting/multicast/enabled", "false")]:
    config.insert_json5(key, value)
session = zenoh.open(config)
pong = session.declare_publisher("demo/pong", express=True)
ping = session.declare_subscriber("demo/ping", Callback(lambda sample: pong.put(sample.payload), indirect=False))
print("ready", flush=True)
sys.stdin.read()
session.close()
PY
cat >ping.py <<'PY'
import os
import queue
import socket
import subprocess
import sys
import time

import zenoh
from zenoh.handlers import Callback

ROUNDS = 3000
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
config = zenoh.Config()
for key, value in [("mode", '"router"'), ("listen/endpoints", f'["{endpoint}"]'), ("scouting/multicast/enabled", "false")]:
    config.insert_json5(key, value)
session = zenoh.open(config)
heard = queue.SimpleQueue()
pong = session.declare_subscriber("demo/pong", Callback(lambda sample: heard.put(1), indirect=False))
ping = session.declare_publisher("demo/ping", express=True)
other = subprocess.Popen([sys.executable, "pong.py", endpoint], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
other.stdout.readline()
time.sleep(0.5)


def switches():
    total = 0
    for process in (os.getpid(), other.pid):
        for thread in os.listdir(f"/proc/{process}/task"):
            with open(f"/proc/{process}/task/{thread}/status") as status:
                total += sum(int(line.split()[1]) for line in status if line.startswith("voluntary_ctxt"))
    return total


before = switches()
for _ in range(ROUNDS):
    ping.put(b"x" * 4000)
    heard.get(timeout=10)
print(f"{(switches() - before) / ROUNDS:.2f}")
other.stdin.close()
other.wait()
session.close()
PY
default=$(env -u ZENOH_RUNTIME venv/bin/python ping.py)
one=$(ZENOH_RUNTIME='(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), app: (handover: rx), net: (handover: rx))' venv/bin/python ping.py)
echo "voluntary context switches a round trip, both processes: $default by default, $one with one thread for all"
python3 -c "import sys; sys.exit(0 if $default > 1.5 * $one else 1)"
