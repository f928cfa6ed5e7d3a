"""Provoke every fault of docs/reliability.md for real and print its table, with what happened this time.

Run with ``python benchmarks/runs_reliability.py [KILLS [MUTATIONS]]``: 200 kills at random moments and 10,000
mutations of each kind of file unless told otherwise (about half an hour; ``6 150`` takes a few minutes). Exit
code 1 if any outcome is not the documented one.
"""

import csv
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]

with (ROOT / "benchmarks" / "runs_faults.csv").open(newline="", encoding="utf-8") as _stream:
    HEAD, *FAULTS = csv.reader(_stream)
"""What goes wrong, what happens, what is lost, and the test that provokes it."""


def table():
    """The table of docs/reliability.md."""
    rows = [f"| {' | '.join(HEAD[:3])} |", "|---|---|---|"]
    return "\n".join([*rows, *(f"| {fault} | {outcome} | {lost} |" for fault, outcome, lost, _ in FAULTS)])


def main(kills="200", mutations="10000"):
    files = sorted({test.partition("::")[0] for *_, test in FAULTS})
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *files],
            cwd=ROOT,
            env={**os.environ, "RSMKIT_KILLS": kills, "RSMKIT_MUTATIONS": mutations},
            check=False,
        )
        cases = ElementTree.parse(report).getroot().iter("testcase")
        verdicts = {f"{case.get('classname')}::{case.get('name')}": len(case) == 0 for case in cases}
    bad = 0
    print("\n| what goes wrong | as documented |\n|---|---|")
    for fault, _, _, test in FAULTS:
        wanted = test.replace("/", ".").replace(".py::", "::")
        found = [good for name, good in verdicts.items() if name.startswith(wanted)]
        good = bool(found) and all(found)
        bad += not good
        print(f"| {fault} | {'yes' if good else 'NO'} |")
    print(f"\n{len(FAULTS) - bad} of {len(FAULTS)} faults end as documented")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
