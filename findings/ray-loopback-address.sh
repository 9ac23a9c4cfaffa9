#!/usr/bin/env bash
# version: ray 2.60.0 (PyPI), Python as installed
# ray 2.60.0 (Python): `ray.init(_node_ip_address="127.0.0.1")` does not keep Ray on the loopback, and the token that then protects it
# is written for everybody to read.
# Expected: listeners on 127.0.0.1, and a file that its user alone can read. Seen: Ray puts the machine's own address in place of
# 127.0.0.1 and listens on all; ~/.ray/auth_token has the mode that the umask gives (0644).
# What we do: deploy/ray_driver.py starts Ray in a network namespace that has a loopback alone, with a token by RAY_AUTH_TOKEN.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet ray==2.60.0
cat > run.py <<'PY'
import os, stat, subprocess

os.umask(0o022)
os.environ.pop("RAY_AUTH_MODE", None)
import ray

ray.init(num_cpus=1, include_dashboard=False, _node_ip_address="127.0.0.1", object_store_memory=80 << 20, log_to_driver=False, logging_level="error")
ours = {"gcs_server", "raylet"}
inodes = {}
for pid in filter(str.isdigit, os.listdir("/proc")):
    try:
        name = open(f"/proc/{pid}/comm").read().strip()
        if name in ours and os.environ["HOME"] in open(f"/proc/{pid}/environ").read():
            for fd in os.listdir(f"/proc/{pid}/fd"):
                inodes[os.readlink(f"/proc/{pid}/fd/{fd}")] = name
    except OSError:
        pass
everywhere = set()
for line in list(open("/proc/self/net/tcp6"))[1:]:
    fields = line.split()
    owner = inodes.get(f"socket:[{fields[9]}]")
    if fields[3] == "0A" and fields[1].startswith("0" * 32) and owner:
        everywhere.add(owner)
print("asked for 127.0.0.1; listening on every interface:", ", ".join(sorted(everywhere)) or "none")
print("the node's address is", "127.0.0.1" if ray.nodes()[0]["NodeManagerAddress"] == "127.0.0.1" else "the machine's")
print("mode of ~/.ray/auth_token:", oct(stat.S_IMODE(os.stat(os.path.expanduser("~/.ray/auth_token")).st_mode)))
ray.shutdown()
PY
env -u RAY_AUTH_TOKEN HOME="$work" RAY_USAGE_STATS_ENABLED=0 venv/bin/python run.py 2> log > seen || cat log
cat seen
diff - seen <<'TXT'
asked for 127.0.0.1; listening on every interface: gcs_server, raylet
the node's address is the machine's
mode of ~/.ray/auth_token: 0o644
TXT
