#!/usr/bin/env python3
"""Writes the figures of the demo set into README.md and docs/planner.md anew, after a change of generated scenes or of drivers.

    demo_figures.py [SIM]     by target/release/sim, or by that program

Nothing else in these files changes.
"""

import csv
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SIM = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/sim").resolve()
COLUMNS = {"collision %": "collision_percent", "at fault %": "at_fault_collision_percent", "off route %": "off_route_percent",
           "progress m": "progress_m", "nuPlan score": "nuplan_score"}  # fmt: skip


def run(*arguments, folder):
    environment = {**os.environ, "COLUMNS": "200"}
    done = subprocess.run([SIM, *arguments], cwd=folder, env=environment, check=True, capture_output=True, text=True)
    return done.stdout


def replace(path, pattern, text):
    """The one place in the file that looks like `pattern`, by `text`."""
    page, count = re.subn(pattern, lambda _: text, path.read_text(), flags=re.MULTILINE)
    if count != 1:
        sys.exit(f"{path.relative_to(ROOT)}: {count} places look like {pattern}, not one")
    path.write_text(page)


def main():
    with tempfile.TemporaryDirectory() as folder:
        for driver in ("dipp", "idm", "gn-ctrv", "gn-oracle"):
            run("run", "--driver", driver, "--record", "none", "--out", driver, folder=folder)
        table = run("table", "dipp", folder=folder).rstrip().splitlines()
        rows = list(csv.DictReader(run("table", "--format", "csv", "gn-ctrv", "gn-oracle", "idm", folder=folder).splitlines()))
    scenes = rows[0]["episodes"]
    # What follows the row of figures is of warnings and footnotes.
    end = next(index for index, line in enumerate(table) if line.startswith("dipp "))
    notes = [line for line in table[end + 1 :] if line.startswith("* ") and "*" in table[end]]
    block = "".join(f"    {line}".rstrip() + "\n" for line in table[: end + 1] + [""] * len(notes) + notes)
    old = r"^    driver dipp, protocol strict.*\n(?:(?:    .*)?\n)+?    dipp  .*\n(?:\n    \* .*\n)?"
    replace(ROOT / "README.md", old, block)
    figures = [f"Over the {scenes} demo scenes:\n", "| driver | " + " | ".join(COLUMNS) + " |", "| --- " * (len(COLUMNS) + 1) + "|"]
    for row in rows:
        numbers = [f"{float(row[column]):.{3 if 'score' in column else 1}f}" for column in COLUMNS.values()]
        figures.append(f"| `{row['driver']}` | " + " | ".join(numbers) + " |")
    replace(ROOT / "docs/planner.md", r"^Over the \w+ demo scenes.*\n(?:\n(?:^\|.*\n)+)?", "\n".join(figures) + "\n")


if __name__ == "__main__":
    main()
