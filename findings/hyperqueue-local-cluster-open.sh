#!/usr/bin/env bash
# version: hyperqueue 0.27.0 (PyPI), Python as installed
# hyperqueue 0.27.0 (Python): LocalCluster, "a local HyperQueue cluster", listens on every interface, without a key.
# Expected: a loopback address, or keys as `hq server start` makes them. Seen: 0.0.0.0, and secret_key null for clients and workers;
# who knows the two ports (no more than a scan) has programs run as the cluster's user. No argument of LocalCluster changes it.
# What we do: deploy/hq_driver.py starts it in a network namespace that has a loopback alone.
# Needs root, to play two users of one machine.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
chmod 755 .
python3 -m venv venv
venv/bin/pip install --quiet hyperqueue==0.27.0
cat > cluster.py <<'PY'
import json, os, time

from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig

cluster = LocalCluster(server_dir=os.path.abspath("server"), worker_config=WorkerConfig(cores=1))
access = json.load(open("server/hq-current/access.json"))
listening = {line.split()[1] for line in list(open("/proc/self/net/tcp"))[1:] if line.split()[3] == "0A"}
for who in ("client", "worker"):
    everywhere = f"00000000:{access[who]['port']:04X}" in listening
    print(f"{who}s: listens on {'0.0.0.0' if everywhere else 'less'}, secret_key {json.dumps(access[who]['secret_key'])}", flush=True)
with open("port.new", "w") as file:
    file.write(str(access["client"]["port"]))
os.rename("port.new", "port")
time.sleep(60)
PY
# Another user, who may not read the server's folder, and has but the port.
cat > other.py <<'PY'
import json, os, sys, tempfile

from hyperqueue import Client, Job

os.setuid(65534)
folder = tempfile.mkdtemp(dir="/tmp")
os.makedirs(f"{folder}/hq-current")
end = {"host": "127.0.0.1", "port": int(sys.argv[1]), "secret_key": None}
with open(f"{folder}/hq-current/access.json", "w") as file:
    json.dump({"version": "v0.27.0", "server_uid": "unknown", "client": end, "worker": end}, file)
client = Client(folder)
job = Job(default_workdir=folder)
os.chmod(folder, 0o777)
job.program(["sh", "-c", "id -u"], stdout=f"{folder}/out", stderr=f"{folder}/err")
client.connection.wait_for_jobs([client.submit(job).id], lambda _: None)
print(f"user {os.getuid()} submits `id -u`, and it prints {open(f'{folder}/out').read().strip()}")
PY
venv/bin/python cluster.py > told 2> log &
cluster=$!
trap 'kill "$cluster" 2> /dev/null || true; rm -rf "$work"' EXIT
for _ in $(seq 100); do
    [[ -s port ]] && break
    sleep 0.2
done
venv/bin/python other.py "$(cat port)" > other 2>> log || cat log
grep -h secret_key told > seen
cat other >> seen
cat seen
diff - seen <<'TXT'
clients: listens on 0.0.0.0, secret_key null
workers: listens on 0.0.0.0, secret_key null
user 65534 submits `id -u`, and it prints 0
TXT
