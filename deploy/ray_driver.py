#!/usr/bin/env python3
"""Drives the shards of a run by Ray: a cluster of its own on this host, or by --address one that is there."""

import contextlib
import ctypes
import importlib.util
import os
import secrets
import subprocess
import sys
import tempfile
import time

import shards

INSTALL = "python3 -m venv venv && venv/bin/pip install ray==2.60.0, then start this by venv/bin/python"
OBJECT_STORE = 80 << 20  # bytes; no shard hands anything over, and Ray takes no less


def run_shard(command, folder, out, err, pause):
    """One shard in a worker of Ray; its exit code. It ends with the worker, for Ray leaves children behind when one is lost.

    Ray carries this function to its workers by value: it uses nothing of this file."""
    libc = ctypes.CDLL(None)
    time.sleep(pause)
    with open(out, "wb") as output, open(err, "wb") as diagnostics:
        process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=diagnostics,
            preexec_fn=lambda: libc.prctl(1, 15),  # PR_SET_PDEATHSIG, SIGTERM
        )
        return process.wait()


def drive(settings, address):
    """All shards, tried again where they did not end by themselves. Their exit codes."""
    import ray

    with tempfile.TemporaryDirectory(prefix="reloop-ray-", ignore_cleanup_errors=True) as folder:
        quiet = {"log_to_driver": False, "logging_level": "error"}
        try:
            if address:
                ray.init(address=address, **quiet)
            else:
                ray.init(
                    num_cpus=settings.workers, num_gpus=0, include_dashboard=False, _node_ip_address="127.0.0.1",
                    object_store_memory=OBJECT_STORE, _temp_dir=folder, **quiet,
                )
            shards.end_by_sigterm_too()  # Ray has set a handler of its own
            shards.say(f"Ray: {ray.cluster_resources().get('CPU', 0):.0f} cores, the shards' logs in {settings.logs}")
            with contextlib.redirect_stdout(sys.stderr):  # where Ray prints of workers that died, whatever it is told
                return submit(ray, settings)
        except (ConnectionError, ray.exceptions.AuthenticationError) as error:
            raise shards.Problem(f"Ray: {str(error).strip().splitlines()[0]}") from None
        finally:
            ray.shutdown()


def submit(ray, settings):
    """Hands out all shards, and again what did not end by itself."""
    task = ray.remote(num_cpus=1, max_retries=0)(run_shard)  # retries are ours: Ray knows of lost workers alone, not of killed shards
    tries = dict.fromkeys(range(1, settings.shards + 1), 0)
    codes, running = {}, {}

    def start(shard, pause):
        tries[shard] += 1
        arguments = (settings.command(shard), os.getcwd(), settings.log(shard, "out"), settings.log(shard, "err"), pause)
        running[task.remote(*arguments)] = shard

    for shard in tries:
        start(shard, 0)
    while running:
        for ended in ray.wait(list(running), timeout=1.0)[0]:
            shard = running.pop(ended)
            codes[shard], why = result(ray, ended)
            if codes[shard] in shards.DONE:
                continue
            shards.say(f"shard {shard} {shards.told(codes[shard])}{why or shards.last_line(settings.log(shard, 'err'))}")
            if tries[shard] < settings.tries:
                shards.say(f"shard {shard}: try {tries[shard] + 1} of {settings.tries}")
                start(shard, settings.pause)
    return codes


def result(ray, ended):
    """The exit code, or None and why Ray has none."""
    try:
        return ray.get(ended), ""
    except ray.exceptions.RayError as error:
        return None, f" ({str(error).strip().splitlines()[0]})"


def main():
    parser = shards.parser("Drives the shards of a run by Ray, then merges them.", "cores of the cluster that is started, one a shard")
    parser.add_argument("--address", metavar="HOST:PORT", help="a cluster that is there (default: one is started on this host, for this run)")
    options = parser.parse_args()
    if importlib.util.find_spec("ray") is None:
        shards.say(f"error: this Python has no package ray\nhint: {INSTALL}")
        return shards.UNUSABLE
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "error")
    if options.address:
        options.any_interface = True
    elif "RAY_AUTH_MODE" not in os.environ:
        os.environ["RAY_AUTH_MODE"] = "token"
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)  # else Ray leaves one in ~/.ray for everybody who can read there
    return shards.main(options, lambda settings: drive(settings, options.address))


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # Python's own way out goes through Ray's, which crashes (signal 11) where its start was interrupted
