"""What hq_driver.py and ray_driver.py share: their options, what an exit code of `sim run --shard` asks for, the loopback
that nobody else is on, and the merge. Standard library alone."""

import argparse
import ctypes
import fcntl
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time

DONE = (0, 1)  # 1: whole, but episodes failed. Driving on changes neither.
INTERRUPTED = 130
UNUSABLE = 2
LIBC = ctypes.CDLL(None, use_errno=True)


class Problem(Exception):
    """Said to the user in a sentence or two; the exit code is 2."""


def parser(description, workers):
    """The options that every driver has."""
    it = argparse.ArgumentParser(
        description=description,
        usage="%(prog)s [options] -- SET... [options of sim run] --out RUN",
        epilog="Exit code: that of `sim merge` (0; 1 with failed episodes; 2 if something is missing), 130 if interrupted. "
        "The same command again goes on where it stopped.",
    )
    it.add_argument("--shards", type=count, required=True, metavar="N", help="in how many shards to drive")
    it.add_argument("--workers", type=count, default=os.cpu_count(), metavar="N", help=workers + " (default: one a core)")
    it.add_argument("--tries", type=count, default=4, metavar="N", help="how often a shard is tried that does not end by itself (default: 4)")
    it.add_argument("--pause", type=float, default=2.0, metavar="SECONDS", help="before a shard is tried again (default: 2)")
    it.add_argument("--sim", default="sim", metavar="PROGRAM", help="the sim (default: the one on PATH)")
    it.add_argument("--logs", metavar="FOLDER", help="what each shard printed (default: RUN.logs)")
    it.add_argument("--any-interface", action="store_true", help="do without a network of its own: see the page before you do")
    it.add_argument("sim_arguments", nargs="*", metavar="ARGUMENT", help="after --: what `sim run` is to be told")
    return it


def count(text):
    """An argument that is at least 1."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return number


class Settings:
    """What was asked for, resolved. Paths are absolute: a worker's folder may be another."""

    def __init__(self, options):
        sim = shutil.which(options.sim)
        if sim is None:
            raise Problem(f"no program {options.sim}\nhint: --sim PROGRAM, or put the folder with sim on PATH")
        self.sim = os.path.abspath(sim)
        self.arguments = options.sim_arguments
        self.run = os.path.abspath(out_of(self.arguments))
        self.logs = os.path.abspath(options.logs) if options.logs else self.run + ".logs"
        self.shards, self.workers, self.tries, self.pause = options.shards, options.workers, options.tries, options.pause
        os.makedirs(self.logs, exist_ok=True)

    def command(self, shard):
        """How shard I of N is driven."""
        return [self.sim, "run", *self.arguments, "--shard", f"{shard}/{self.shards}"]

    def log(self, shard, kind):
        """Where the shard's output (`out`) or diagnostics (`err`) go."""
        return os.path.join(self.logs, f"shard-{shard}.{kind}")


def out_of(arguments):
    """The run's folder, as `sim run` will read it."""
    if "--shard" in arguments:
        raise Problem("--shard is the driver's to say\nhint: --shards N before the --")
    for at, argument in enumerate(arguments):
        if argument.startswith("--out="):
            return argument[len("--out="):]
        if argument == "--out" and at + 1 < len(arguments):
            return arguments[at + 1]
    raise Problem("no --out RUN among sim's arguments: all shards store in one folder\nhint: -- SET... --driver idm --out runs/a")


def loopback_only():
    """Moves this process, and all that it starts, into a network that has nothing but a loopback.

    HyperQueue and Ray listen on every interface of the machine, whatever they are told. Here there is but one."""
    new_user, new_uts, new_net = 0x10000000, 0x04000000, 0x40000000
    user, group = os.getuid(), os.getgid()
    if LIBC.unshare(new_uts | new_net) != 0:  # root may; everybody else needs a user namespace for it
        if LIBC.unshare(new_user | new_uts | new_net) != 0:
            why = os.strerror(ctypes.get_errno())
            raise Problem(
                f"cannot make a network of its own ({why}); without it the scheduler would listen on every interface\n"
                "hint: let users make namespaces (sysctl kernel.unprivileged_userns_clone, kernel.apparmor_restrict_unprivileged_userns), "
                "or say --any-interface where you trust all who reach this machine"
            )
        for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
            with open(f"/proc/self/{name}", "w", encoding="ascii") as file:
                file.write(text)
    socket.sethostname("localhost")  # the schedulers call each other by the host's name
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        up = struct.pack("16sh14x", b"lo", 0x1 | 0x40)  # IFF_UP, IFF_RUNNING
        fcntl.ioctl(any_socket, 0x8914, up)  # SIOCSIFFLAGS


def end_by_sigterm_too():
    """SIGTERM ends as Ctrl-C does, also where a shell has Ctrl-C ignored (a script's `&`)."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


def die_with_parent(how=signal.SIGKILL):
    """Asks the kernel to end this process with the one that started it, however that ends."""
    LIBC.prctl(1, int(how))  # PR_SET_PDEATHSIG


def say(text):
    """A line on standard error; data goes to standard output."""
    print(text, file=sys.stderr, flush=True)


def told(code):
    """An exit code, as subprocess tells it, in words."""
    if code is None:
        return "was lost"
    return f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"


def last_line(path):
    """The last thing that a shard said, for a message."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            lines = [line.strip() for line in file if line.strip()]
    except FileNotFoundError:
        lines = []
    return f" ({lines[-1][:200]})" if lines else ""


def merge(settings):
    """`sim merge RUN`; its table goes to our standard output."""
    say(f"sim merge {settings.run}")
    return subprocess.run([settings.sim, "merge", settings.run], check=False).returncode


def main(options, drive):
    """Drives by `drive(settings)`, merges; returns the exit code."""
    try:
        settings = Settings(options)
        if not options.any_interface:
            loopback_only()
        end_by_sigterm_too()
        began = time.monotonic()
        codes = drive(settings)
        done = sum(code in DONE for code in codes.values())
        say(f"{done} of {settings.shards} shards are whole, after {time.monotonic() - began:.0f} s")
        return merge(settings)
    except Problem as problem:
        say(f"error: {problem}")
        return UNUSABLE
    except KeyboardInterrupt:
        say("interrupted; the same command goes on")
        return INTERRUPTED
