#!/usr/bin/env python3
"""Drives the shards of a run by HyperQueue's Python package, for where there is no `hq` program (with one: hq.sh).

Three kinds of processes, all of this file: the driver, which decides; a server, which holds HyperQueue's queue; and the workers.
The package can start workers only inside the server's process. A worker of ours is a cluster of its own whose access file is
the server's: its worker joins there, and can be lost without the rest."""

import importlib.util
import json
import os
import re
import select
import subprocess
import sys
import tempfile
import time

import shards

INSTALL = "python3 -m venv venv && venv/bin/pip install hyperqueue==0.27.0, then start this by venv/bin/python"
LOST_WORKERS = 3  # replacements for each worker


def drive(settings):
    """All shards, tried again where they did not end by themselves. Their exit codes."""
    with tempfile.TemporaryDirectory(prefix="reloop-hq-") as folder:
        cluster = Cluster(folder, settings)
        try:
            return rounds(cluster, settings)
        finally:
            cluster.stop()


def rounds(cluster, settings):
    """Submits what is not whole, at most `tries` times."""
    codes = {}
    missing = list(range(1, settings.shards + 1))
    for turn in range(settings.tries):
        if turn > 0:
            time.sleep(settings.pause)
            shards.say(f"try {turn + 1} of {settings.tries}: shards {', '.join(map(str, missing))}")
        codes.update(cluster.run(missing))
        missing = [shard for shard in missing if codes[shard] not in shards.DONE]
        for shard in missing:
            shards.say(f"shard {shard} {shards.told(codes[shard])}{shards.last_line(settings.log(shard, 'err'))}")
        if not missing:
            break
    return codes


class Cluster:
    """The server and its workers, each a process that ends with this one."""

    def __init__(self, folder, settings):
        self.folder, self.settings = folder, settings
        self.server = self.start("server", stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.hear()  # until it says that it listens
        self.started = 0
        self.left = LOST_WORKERS * settings.workers
        self.workers = [self.start_worker() for _ in range(settings.workers)]
        shards.say(f"HyperQueue: a server and {settings.workers} workers, their logs in {settings.logs}")

    def start(self, role, *arguments, **pipes):
        """One more process of this file. A session of its own: Ctrl-C is for the driver, who ends the rest."""
        log = open(os.path.join(self.settings.logs, f"{role}.log"), "ab")
        with log:
            return subprocess.Popen(
                [sys.executable, os.path.abspath(__file__), f"--as-{role}", self.folder, *arguments],
                stderr=log, start_new_session=True, **{"stdin": subprocess.DEVNULL, "stdout": log, **pipes},
            )

    def start_worker(self):
        self.started += 1
        return self.start("worker", str(self.started))

    def run(self, wanted):
        """Has the server run these shards; returns their exit codes, None where HyperQueue gave one up."""
        tasks = [{"command": self.settings.command(shard), "stdout": self.settings.log(shard, "out"),
                  "stderr": self.settings.log(shard, "err")} for shard in wanted]
        self.server.stdin.write(json.dumps(tasks).encode() + b"\n")
        self.server.stdin.flush()
        return dict(zip(wanted, self.hear()))

    def hear(self):
        """The server's next line. Meanwhile workers that are gone are replaced."""
        while not select.select([self.server.stdout], [], [], 1.0)[0]:
            self.replace_lost()
        line = self.server.stdout.readline()
        if not line:
            raise shards.Problem(f"HyperQueue's server {shards.told(self.server.wait())}\nhint: {self.settings.logs}/server.log; the same command goes on")
        return json.loads(line)

    def replace_lost(self):
        for at, worker in enumerate(getattr(self, "workers", [])):
            if worker.poll() is None:
                continue
            shards.say(f"worker {worker.pid} {shards.told(worker.returncode)}: its shard goes to another")
            if self.left == 0:
                raise shards.Problem(f"workers are lost again and again\nhint: {self.settings.logs}/worker.log; the same command goes on")
            self.left -= 1
            self.workers[at] = self.start_worker()

    def stop(self):
        """Workers first: they take their shards with them."""
        everybody = [*getattr(self, "workers", []), self.server]
        for process in everybody:
            process.kill()
        for process in everybody:
            process.wait()


def serve(folder):
    """The server's process: reads a list of tasks a line, answers with their exit codes."""
    from hyperqueue import Job, LocalCluster

    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)  # the package prints its own table to standard output
    client = LocalCluster(server_dir=os.path.join(folder, "server")).client()
    print(json.dumps("listening"), file=answers, flush=True)
    for line in sys.stdin:
        job = Job(default_workdir=os.getcwd(), max_fails=None)
        tasks = json.loads(line)
        for task in tasks:
            job.program(task["command"], stdout=task["stdout"], stderr=task["stderr"])
        submitted = client.submit(job)
        failed = {}
        if client.connection.wait_for_jobs([submitted.id], lambda _: None):
            failed = client.get_failed_tasks(submitted)
        codes = [code_of(failed[at].error) if at in failed else 0 for at in range(len(tasks))]
        print(json.dumps(codes), file=answers, flush=True)


def code_of(error):
    """The exit code in HyperQueue's sentence on a failed task; a signal is negative, as subprocess has it."""
    for pattern, sign in ((r"Received signal (\d+)", -1), (r"exit code (\d+)", 1)):
        found = re.search(pattern, error)
        if found:
            return sign * int(found.group(1))
    return None


def work(folder, number):
    """A worker's process: a cluster of its own, whose access file is the server's."""
    from hyperqueue import LocalCluster
    from hyperqueue.cluster import WorkerConfig

    own = os.path.join(folder, f"worker-{number}")
    cluster = LocalCluster(server_dir=own)
    current = os.path.join(own, "hq-current")
    os.remove(current)
    os.symlink(os.path.join(folder, "server", "hq-current"), current)
    cluster.start_worker(WorkerConfig(cores=1))
    while True:
        time.sleep(3600)


def main():
    role = sys.argv[1] if len(sys.argv) > 1 else ""
    if role.startswith("--as-"):
        shards.die_with_parent()
        return serve(sys.argv[2]) if role == "--as-server" else work(*sys.argv[2:4])
    options = shards.parser(
        "Drives the shards of a run by HyperQueue's Python package, then merges them.", "workers, each a process with one core"
    ).parse_args()
    if importlib.util.find_spec("hyperqueue") is None:
        shards.say(f"error: this Python has no package hyperqueue\nhint: {INSTALL}")
        return shards.UNUSABLE
    return shards.main(options, drive)


if __name__ == "__main__":
    sys.exit(main())
