"""PyTorch's training step of DIPP, written by us from its description: the peer for `trainer`'s speed, and a second opinion on its gradients.

    python torch_step.py verify  --vectors DIR [--all]
    python torch_step.py time    --vectors DIR
    python torch_step.py compare --vectors DIR --trainer BINARY
    python torch_step.py follow  --vectors DIR --trainer BINARY [--weights FILE]

DIR is `shared/dipp/training-vectors`. Needs torch (2.9 or later; written with 2.15.0), numpy and safetensors; no part of the tests. README.md beside this file says how to
read the figures.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys

# Nothing here imports torch: a process started by a large one counts its starter's memory as its own peak.

STEP_LINE = re.compile(r"^\s*step\s+([0-9.eE+-]+)\s*s\b", re.MULTILINE)
PEAK_LINE = re.compile(r"^\s*peak memory\s+([0-9.]+)\s*MB\b", re.MULTILINE)


def verify(settings):
    from torch_port import verify as checks

    return 0 if checks.run(settings.vectors, settings.all) else 1


def step(settings):
    from torch_port import step as steps

    print(json.dumps(steps.run(settings)))
    return 0


def run_torch(settings, planner, threads, products):
    """One configuration in a process of its own, so that its peak memory is its own."""
    command = [sys.executable, __file__, "step", "--vectors", settings.vectors, "--batch", str(settings.batch), "--steps", str(settings.steps)]
    command += ["--warm-up", str(settings.warm_up), "--dropout", str(settings.dropout), "--threads", str(threads), "--products", products]
    command += [] if planner else ["--no-planner"]
    command += [] if settings.keep_heap else ["--no-keep-heap"]
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), MKL_NUM_THREADS=str(threads))
    answer = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    return json.loads(answer.stdout.splitlines()[-1])


def parse_trainer(text):
    """Seconds of each step and the peak memory (MB) from `trainer bench`: lines `step 0.512 s`, and `peak memory 512 MB`."""
    steps = [float(value) for value in STEP_LINE.findall(text)]
    peaks = PEAK_LINE.findall(text)
    if not steps or not peaks:
        raise SystemExit(f"`trainer bench` printed no `step ... s` or no `peak memory ... MB`:\n{text}")
    return steps, float(peaks[-1])


def run_trainer(settings, planner, threads):
    """Seconds of the steps after the warm-up, CPU seconds of the whole process by its steps, the peak memory it prints."""
    count = settings.steps + settings.warm_up
    command = [settings.trainer, "bench", "--vectors", settings.vectors, "--batch", str(settings.batch), "--steps", str(count)]
    command += ["--threads", str(threads)] + ([] if planner else ["--no-planner"])
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    text = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {child.returncode}:\n{text}")
    steps, peak = parse_trainer(text)
    if len(steps) < count:
        raise SystemExit(f"`trainer bench` printed {len(steps)} steps, {count} were asked for:\n{text}")
    # The last of them: whether or not the binary warms up by itself, ours and torch's first steps stay out.
    return steps[-settings.steps :], (usage.ru_utime + usage.ru_stime) / len(steps), peak


def figures(seconds):
    return f"{statistics.median(seconds):7.3f} {min(seconds):7.3f}"


def configurations(settings):
    for threads in settings.thread_counts:
        for planner in (True, False):
            for products in settings.products:
                what = f"{'with' if planner else 'no'} planner, {threads} thread{'s' if threads > 1 else ''}, {products}"
                yield what, planner, threads, products


def timed(settings):
    print(f"batch {settings.batch}, dropout {settings.dropout}, {settings.steps} steps after {settings.warm_up} to warm up; seconds a step: median, minimum")
    print(f"{'':<34}      wall             CPU         peak MB (after import)  joining s  load before")
    for what, planner, threads, products in configurations(settings):
        load = os.getloadavg()[0]
        run = run_torch(settings, planner, threads, products)
        memory = f"{run['peak']:7.0f} ({run['imported']:.0f})"
        print(f"{what:<34} {figures(run['wall'])}  {figures(run['cpu'])}   {memory:>14}  {run['joining']:14.3f}  {load:10.2f}", flush=True)
    print(f"torch {run['torch']}")
    return 0


def compare(settings):
    """Ours, torch, ours, torch ...: ratios of the medians and of the minima over all rounds."""
    print(f"batch {settings.batch}, {settings.rounds} rounds of {settings.steps} steps after {settings.warm_up} to warm up")
    print("wall seconds a step: median, minimum")
    for what, planner, threads, products in configurations(settings):
        ours, theirs, ours_cpu, theirs_cpu, ours_peak, theirs_peak, load = [], [], [], [], 0.0, 0.0, []
        for _ in range(settings.rounds):
            load.append(os.getloadavg()[0])
            steps, burnt, peak = run_trainer(settings, planner, threads)
            run = run_torch(settings, planner, threads, products)
            ours, theirs = ours + steps, theirs + run["wall"]
            ours_cpu, theirs_cpu = [*ours_cpu, burnt], theirs_cpu + run["cpu"]
            ours_peak, theirs_peak = max(ours_peak, peak), max(theirs_peak, run["peak"])
        print(f"{what} (load before a round at most {max(load):.1f})")
        print(f"  ours  {figures(ours)}   CPU {statistics.median(ours_cpu):7.3f} (whole process)   peak memory {ours_peak:6.0f} MB")
        print(f"  torch {figures(theirs)}   CPU {statistics.median(theirs_cpu):7.3f} (steps alone)     peak memory {theirs_peak:6.0f} MB")
        ratios = statistics.median(theirs) / statistics.median(ours), min(theirs) / min(ours)
        print(f"  torch / ours: {ratios[0]:.2f} by median, {ratios[1]:.2f} by minimum; memory {theirs_peak / ours_peak:.2f}", flush=True)
    print(f"torch {run['torch']}")
    return 0


LOSS_LINE = re.compile(r"^\s*step\s+[0-9.eE+-]+\s*s, loss\s+([0-9.eE+-]+)", re.MULTILINE)


def follow(settings):
    """The same steps by both, of the vectors' windows with nothing dropped out: where the losses part, and how far apart they end."""
    worst = 0.0
    for planner in (False, True):
        extra = (["--weights", settings.weights] if settings.weights else []) + ([] if planner else ["--no-planner"])
        common = ["--vectors", settings.vectors, "--batch", "8"]
        ours = [settings.trainer, "bench", *common, "--steps", str(settings.steps), "--set", "rules=authors", "--set", "dropout=0", *extra]
        ours = [float(loss) for loss in LOSS_LINE.findall(subprocess.run(ours, check=True, stdout=subprocess.PIPE, text=True).stdout)]
        theirs = [sys.executable, __file__, "step", *common, "--steps", str(settings.steps), "--warm-up", "0", "--dropout", "0", "--products", "mkl"]
        theirs = subprocess.run([*theirs, "--coupled", *extra], check=True, stdout=subprocess.PIPE, text=True).stdout
        theirs = json.loads(theirs.splitlines()[-1])["losses"]
        print(f"{'with' if planner else 'without'} planner\n{'step':>6}  {'ours':>11}  {'torch':>11}  apart")
        for step, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            if step < 10 or (step + 1) % 25 == 0:
                print(f"{step:6}  {a:11.5f}  {b:11.5f}  {abs(a - b) / b:.1e}")
        # With the planner single precision parts them from the first step on: it is f64 in ours.
        worst = max([worst] + [abs(a - b) / b for a, b in zip(ours[:5], theirs[:5], strict=True)] if not planner else [worst])
    print(f"without planner, worst of the first five steps {worst:.1e} (tolerance 1e-4)")
    return 0 if worst < 1e-4 else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name, function in (("verify", verify), ("time", timed), ("compare", compare), ("follow", follow), ("step", step)):
        command = commands.add_parser(name)
        command.set_defaults(function=function)
        command.add_argument("--vectors", required=True, help="folder with batch.npz and the stored losses and gradients")
        if name == "verify":
            command.add_argument("--all", action="store_true", help="print every gradient's deviation")
            continue
        if name in ("follow", "step"):
            command.add_argument("--weights", help="first weights, a safetensors file (by the formula if left out)")
        if name == "follow":
            command.add_argument("--trainer", required=True, help="our binary")
            command.add_argument("--steps", type=int, default=150)
            continue
        command.add_argument("--batch", type=int, default=32)
        command.add_argument("--steps", type=int, default=5)
        command.add_argument("--warm-up", type=int, default=2)
        command.add_argument("--dropout", type=float, default=0.1)
        command.add_argument("--keep-heap", action=argparse.BooleanOptionalAction, default=True, help="let malloc keep freed memory")
        if name == "step":
            command.add_argument("--threads", type=int, default=1)
            command.add_argument("--no-planner", action="store_true")
            command.add_argument("--coupled", action="store_true", help="the authors' bug of lengths chosen by the batch's first sample")
            command.add_argument("--products", default="fastest", choices=("fastest", "mkl"))
            continue
        products = ["fastest", "mkl"] if name == "time" else ["fastest"]
        command.add_argument("--products", nargs="+", default=products, choices=("fastest", "mkl"), help="which library multiplies: see README.md")
        command.add_argument("--thread-counts", type=int, nargs="+", default=[1, len(os.sched_getaffinity(0))])
        if name == "compare":
            command.add_argument("--trainer", required=True, help="our binary")
            command.add_argument("--rounds", type=int, default=2)
    settings = parser.parse_args()
    sys.exit(settings.function(settings))


if __name__ == "__main__":
    main()
