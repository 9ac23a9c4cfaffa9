#!/usr/bin/env python3
"""Holds the statistics of `sim compare` to SciPy and statsmodels.

Wilson's interval, McNemar's exact test, the BCa interval of a mean, the sign-flip test and the detectable difference, each on the same
numbers in both. A line for each quantity: cases, worst deviation, tolerance; exit code 1 if any is out. Not part of CI.

    python -m venv venv && venv/bin/pip install scipy statsmodels
    venv/bin/python evaluation/checks/statistics.py
    venv/bin/python evaluation/checks/statistics.py --command target/release/examples/statistics
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys

# This file's folder is searched first, and it has the name of a module that SciPy needs.
sys.path.pop(0)

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402
from statsmodels.stats.contingency_tables import mcnemar  # noqa: E402
from statsmodels.stats.power import TTestPower  # noqa: E402
from statsmodels.stats.proportion import proportion_confint  # noqa: E402

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
CARGO = ["cargo", "run", "--quiet", "--release", "--package", "evaluation", "--example", "statistics"]
RESAMPLES = 40_000


def ask(command, questions):
    """One process answers all questions, in their order."""
    text = "\n".join(json.dumps(question) for question in questions) + "\n"
    answers = subprocess.run(command, input=text, text=True, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True).stdout
    return [json.loads(line) for line in answers.splitlines()]


class Report:
    def __init__(self):
        self.holds = True

    def line(self, name, deviations, tolerance, what):
        worst = max(deviations)
        good = worst <= tolerance
        self.holds &= good
        print(f"{name:42} {len(deviations):5} cases  worst {worst:.2e}  tolerance {tolerance:.1e} {what:28} {'ok' if good else 'OUT'}")


def wilson(command, report):
    cases = [(hits, trials) for trials in range(1, 61) for hits in range(trials + 1)]
    cases += [(hits, trials) for trials in (200, 1000, 10000, 123456) for hits in (0, 1, trials // 3, trials - 1, trials)]
    answers = ask(command, [{"op": "wilson", "hits": hits, "trials": trials} for hits, trials in cases])
    deviations = []
    for (hits, trials), answer in zip(cases, answers):
        low, high = proportion_confint(hits, trials, alpha=0.05, method="wilson")
        deviations.append(max(abs(answer["low"] - low), abs(answer["high"] - high)))
    report.line("Wilson (statsmodels proportion_confint)", deviations, 1e-12, "absolute")


def exact(command, report):
    cases = [(one, other) for one in range(41) for other in range(41)] + [(300, 200), (5000, 4700), (1, 400)]
    answers = ask(command, [{"op": "mcnemar", "one_way": one, "other_way": other} for one, other in cases])
    deviations, needs = [], []
    for (one, other), answer in zip(cases, answers):
        # Without a flip statsmodels divides nothing by nothing.
        wanted = mcnemar([[0, one], [other, 0]], exact=True).pvalue if one + other else 1.0
        deviations.append(abs(answer["p"] - wanted) / max(wanted, 1e-300))
        fewer = min(one, other)
        flips = next(flips for flips in range(fewer, 10**6) if flips and mcnemar([[0, flips], [fewer, 0]]).pvalue < 0.05) if fewer < 41 else None
        needs.append(0.0 if flips is None else abs(flips - answer["needs"]))
    report.line("McNemar, exact (statsmodels mcnemar)", deviations, 1e-9, "relative")
    report.line("fewest flips with p < 0.05 (statsmodels)", needs, 0, "")


def samples():
    """Differences as figures have them, in 1024ths: sums are exact in any order, so ties are ties in both."""
    generator = np.random.default_rng(20260101)
    for n in (3, 5, 8, 11, 20, 50, 200, 1000):
        for name, values in (
            ("normal", generator.normal(0.3, 1.0, n)),
            ("skewed", generator.lognormal(0.0, 1.0, n) - 1.2),
            ("mostly 0", np.where(generator.random(n) < 0.3, generator.normal(0.5, 2.0, n), 0.0)),
            ("flags", generator.integers(-1, 2, n).astype(float)),
        ):
            yield f"{name}, n = {n}", np.round(values * 1024.0) / 1024.0


def bca(values):
    """SciPy's interval by several seeds: the range of each end."""
    ends = [
        stats.bootstrap(
            (values,), np.mean, vectorized=True, n_resamples=RESAMPLES, batch=2000, method="BCa", rng=np.random.default_rng(seed)
        ).confidence_interval
        for seed in range(5)
    ]
    low, high = np.array([end.low for end in ends]), np.array([end.high for end in ends])
    return (low.min(), low.max()), (high.min(), high.max())


def outside(value, ends):
    """How far a number lies outside of a range."""
    return max(ends[0] - value, value - ends[1], 0.0)


def means(command, report):
    cases = [(name, values) for name, values in samples() if np.unique(values).size > 1]
    questions = [{"op": "mean", "values": list(values), "seed": 1, "resamples": RESAMPLES} for _, values in cases]
    interval, chances, drawn, detectable, detectable_few = [], [], [], [], []
    for (name, values), answer in zip(cases, ask(command, questions)):
        error = values.std() / math.sqrt(len(values))
        low, high = bca(values)
        if all(map(math.isfinite, low + high)):
            interval.append(max(outside(answer["low"], low), outside(answer["high"], high)) / error)
        else:
            print(f"SciPy has no BCa interval of {name}; ours is {answer['low']} to {answer['high']}")
        theirs = stats.permutation_test(
            (values,), np.mean, permutation_type="samples", vectorized=True, n_resamples=RESAMPLES, batch=2000,
            rng=np.random.default_rng(7)
        ).pvalue
        (chances if np.count_nonzero(values) <= 13 and len(values) <= 13 else drawn).append(abs(answer["p"] - theirs))
        wanted = TTestPower().solve_power(nobs=len(values), alpha=0.05, power=0.8) * values.std(ddof=1)
        (detectable_few if len(values) < 8 else detectable).append(abs(answer["detectable"] / wanted - 1.0))
    report.line("BCa (SciPy bootstrap, five seeds)", interval, 5e-2, "standard errors (resampling)")
    report.line("sign flips, all (SciPy permutation_test)", chances, 1e-12, "absolute")
    report.line("sign flips, drawn (SciPy permutation_test)", drawn, 1.5e-2, "absolute (drawing)")
    report.line("detectable, n >= 8 (statsmodels TTestPower)", detectable, 2e-2, "relative (approximation)")
    report.line("detectable, n < 8 (statsmodels TTestPower)", detectable_few, 1e-1, "relative (approximation)")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--command", help="what answers [default: cargo run]")
    arguments = parser.parse_args()
    command = arguments.command.split() if arguments.command else CARGO
    report = Report()
    wilson(command, report)
    exact(command, report)
    means(command, report)
    sys.exit(0 if report.holds else 1)


if __name__ == "__main__":
    main()
