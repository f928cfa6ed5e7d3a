"""Keep what rsmkit says and writes, and show later that it says and writes the same.

    python tests/golden.py record FOLDER [--only PATTERN] [-j N]
    python tests/golden.py compare FOLDER [--only PATTERN] [-j N] [--show]

``record`` runs every scenario of ``golden_scenarios.py`` with the rsmkit that Python finds and keeps plain
files. ``compare`` runs them again in a temporary folder and shows, scenario by scenario, each file that
differs; the exit code is 1 if any does. The numbers depend on the processor and on the libraries, so record
and compare belong on one computer. Only the command line and the names in ``rsmkit.__all__`` are used:
modules may move as they like.

Not kept, because it never is the same twice or says where the code lies:

- absolute paths of the temporary folder, of this repository, of Python and of the installed packages
- times of day, durations, shares of time, and lines that tell how long something has taken so far, in what is
  printed; ``seconds``, ``started``, ``host``, ``pid``, ``since`` in JSON; the order of the lines of
  ``runs.jsonl``; the column ``seconds`` of ``responses.csv``
- version of rsmkit
- frames of tracebacks that lie outside the study's folder, and the module of the error they end with
- ``rsmkit.log``, which names modules and processes, lock files, and what Python caches
"""

from __future__ import annotations

import argparse
import csv
import difflib
import hashlib
import io
import json
import os
import platform
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from threading import Lock

ROOT = Path(__file__).resolve().parents[1]
COMPUTER_FILE = "computer.json"
FIXED = {
    "COLUMNS": "120",
    "NO_COLOR": "1",
    "TZ": "UTC",
    "LC_ALL": "C.UTF-8",
    "PYTHONHASHSEED": "0",
    "PYTHONIOENCODING": "utf-8",
    "MPLBACKEND": "agg",
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
}
DROPPED = ("FORCE_COLOR", "CLICOLOR_FORCE", "PYTHONWARNINGS", "PYTHONDEVMODE")
UNKEPT = re.compile(r"(^|/)(rsmkit\.log|__pycache__|\.rsmkit[^/]*|[^/]*\.lock)(/|$)")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
SHOWN_LINES, SHOWN_WIDTH = 12, 160
LONGEST_STEP_S = 1800

RULES = [
    (re.compile(pattern), replacement)
    for pattern, replacement in (
        (r"\b20\d\d-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d+)?(?:\+00:00|Z| UTC)?", "<time>"),
        (r'"(seconds|started|host|pid|since)": ?("[^"]*"|[-\d.e+]+)', r'"\1": "<\1>"'),
        (r"\brsmkit[ -]\d+\.\d+\.\d+\w*", "rsmkit <version>"),
        (r'  File "(?:<python>|<root>|<frozen)[^\n]*\n(?:    [^\n]*\n)*', ""),
        (r"(?m)^rsmkit(?:\.\w+)+\.(\w+)(?=:)", r"\1"),
    )
]
SPOKEN = [
    (re.compile(pattern), replacement)
    for pattern, replacement in (
        (r"\b\d+(?:\.\d+)? (?:ms|s|min|h)\b", "<duration>"),
        (r"used \d+ % of the time", "used <share> of the time"),
        (r"(?m)^[^\n]*<duration> so far\n", ""),
    )
]
"""For what is printed only: in an artefact these would be results."""


def main() -> int:
    """Record or compare."""
    if sys.argv[1:] == ["one-process"]:
        return one_process()
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=["record", "compare"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", metavar="PATTERN", default="", help="scenarios whose name has this regex")
    parser.add_argument("-j", "--jobs", type=int, default=1, help="scenarios at a time")
    parser.add_argument("--show", action="store_true", help="whole differences, not only their beginnings")
    asked = parser.parse_args()
    folder = asked.folder.resolve()
    recorded = (folder / COMPUTER_FILE).is_file()
    if asked.what == "record" and folder.exists() and any(folder.iterdir()) and not recorded:
        parser.error(f"{folder} holds something else; name a new folder")
    if asked.what == "compare" and not recorded:
        parser.error(f"{folder} holds no record; make one with: python tests/golden.py record {folder}")
    if asked.what == "record":
        record(folder, asked.only, asked.jobs)
        return 0
    with tempfile.TemporaryDirectory(prefix="golden-new-") as again:
        return compare(folder, Path(again), asked.only, asked.jobs, whole=asked.show)


def record(folder: Path, only: str, jobs: int, after: Callable[[str], None] | None = None) -> None:
    """Run the chosen scenarios and keep their outputs; call `after` with the name of each that is done.

    One that breaks (not: one in which rsmkit fails) is kept as the file ``broken.txt`` and stops no other.
    """
    from golden_scenarios import SCENARIOS

    chosen = {name: steps for name, steps in SCENARIOS.items() if re.search(only, name)}
    if not chosen:
        raise SystemExit(f"no scenario has {only!r}; there are {', '.join(SCENARIOS)}")
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        if old.is_dir() and (old.name in chosen or old.name not in SCENARIOS):
            shutil.rmtree(old)
    (folder / COMPUTER_FILE).write_text(json.dumps(computer(), indent=1) + "\n")
    print(f"rsmkit in {code_folder()}: {len(chosen)} scenarios", file=sys.stderr)
    began = time.monotonic()

    def keep(name: str) -> None:
        start = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="golden-") as work:
            try:
                outputs = run_scenario(chosen[name], Path(work).resolve())
            except Exception as error:
                outputs = {"broken.txt": normal(f"{type(error).__name__}: {error}\n", Path(work).resolve())}
        for path, text in outputs.items():
            target = folder / name / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8", newline="")
        seconds = time.monotonic() - start
        print(f"{name:22} {len(outputs):4} files {seconds:6.1f} s", file=sys.stderr, flush=True)
        if after is not None:
            after(name)

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(keep, chosen))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = used.ru_utime + used.ru_stime
    print(f"{time.monotonic() - began:.0f} s in all, {spent:.0f} s of processor time", file=sys.stderr)


def run_scenario(steps, work: Path) -> dict[str, str]:
    """Do the steps in the folder `work`; give what they printed and what they left there.

    A text is a command line of rsmkit, or of Python when it begins with ``python``; a tuple of texts are
    command lines of rsmkit that share one process, which is quicker; a function prepares the folder.
    """
    outputs: dict[str, str] = {}
    given: dict[Path, bytes] = {}
    numbers = count(1)

    def said(line: str, code: int, out: str, err: str) -> None:
        name = re.sub(r"[^\w.=-]+", "-", line)[:60].strip("-")
        text = f"$ {line}\nexit code {code}\n--- stdout\n{out}\n--- stderr\n{err}\n"
        outputs[f"said/{next(numbers):02} {name}.txt"] = spoken(text, work)

    for step in steps:
        if callable(step):
            before = {path: path.read_bytes() for path in files_of(work)}
            step(work)
            after = {path: path.read_bytes() for path in files_of(work)}
            given |= {path: content for path, content in after.items() if before.get(path) != content}
        elif isinstance(step, tuple):
            done = run([str(Path(__file__).resolve()), "one-process"], work, json.dumps(step))
            if done.returncode:
                raise RuntimeError(f"{step}: {done.stderr}")
            for line, result in zip(step, json.loads(done.stdout), strict=True):
                said(line, *result)
        else:
            words = shlex.split(step)
            done = run(words[1:] if words[0] == "python" else ["-m", "rsmkit", *words], work)
            said(step, done.returncode, done.stdout, done.stderr)
    for path in files_of(work):
        content = path.read_bytes()
        if given.get(path) != content:
            name = str(path.relative_to(work))
            outputs |= {f"left/{part}": text for part, text in kept(name, content, work)}
    return outputs


def run(arguments: list[str], work: Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """Run Python in the fixed environment."""
    environment = {key: value for key, value in os.environ.items() if key not in DROPPED} | FIXED
    found = [str(Path(path).resolve()) for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    environment["PYTHONPATH"] = os.pathsep.join([str(code_folder()), *found])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=work,
        env=environment,
        input=stdin,
        capture_output=True,
        encoding="utf-8",
        timeout=LONGEST_STEP_S,
    )


def one_process() -> int:
    """Run the command lines on standard input one after the other; print exit codes and what they said."""
    import runpy

    sys.path[0] = os.getcwd()
    results, screen = [], sys.stdout
    for line in json.load(sys.stdin):
        sys.argv = ["rsmkit", *shlex.split(line)]
        sys.stdout, sys.stderr = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
        code = 0
        try:
            runpy.run_module("rsmkit", run_name="__main__")
        except SystemExit as end:
            code = end.code or 0
        texts = []
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
            texts.append(stream.buffer.getvalue().decode())
        results.append([code, *texts])
    sys.stdout, sys.stderr = screen, sys.__stderr__
    json.dump(results, screen)
    return 0


def files_of(work: Path) -> list[Path]:
    """All files that are kept."""
    found = sorted(path for path in work.rglob("*") if path.is_file())
    return [path for path in found if not UNKEPT.search(str(path.relative_to(work)))]


def kept(name: str, content: bytes, work: Path) -> Iterator[tuple[str, str]]:
    """What is kept of one file, as (path, text)."""
    if name.endswith(".png"):
        yield f"{name}.sha256", hashlib.sha256(content).hexdigest() + "\n"
        return
    text = normal(content.decode(), work)
    if name.endswith("explorer.html"):
        yield from page_parts(name, text)
    elif name.endswith("runs.jsonl"):
        yield name, "".join(sorted(text.splitlines(keepends=True), key=journal_order))
    elif name.endswith("responses.csv"):
        yield name, without_seconds(text)
    else:
        yield name, text


def journal_order(line: str) -> tuple[str, int]:
    """Key and attempt of a line of the journal."""
    run = json.loads(line)
    return run["key"], run["attempt"]


def without_seconds(table: str) -> str:
    """A CSV table with its durations taken out."""
    rows = list(csv.reader(io.StringIO(table)))
    if "seconds" in rows[0]:
        column = rows[0].index("seconds")
        for row in rows[1:]:
            row[column] = "<seconds>"
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def page_parts(name: str, page: str) -> Iterator[tuple[str, str]]:
    """The data of an explorer page, and digests of the whole and of its other parts."""
    pieces = re.split(r"(<script[^>]*>.*?</script>)", page, flags=re.DOTALL)
    digests = [f"{hashlib.sha256(''.join(pieces).encode()).hexdigest()} all"]
    for number, piece in enumerate(filter(str.strip, pieces)):
        found = re.search(r'<script type="application/json" id="data">(.*)</script>', piece, re.DOTALL)
        if found:
            data = json.dumps(json.loads(found[1]), indent=1, ensure_ascii=False)
            yield f"{name}.data.json", data + "\n"
            continue
        source = re.search(r"//# sourceURL=(\S+)", piece)
        title = source[1] if source else f"part {number}"
        digests.append(f"{hashlib.sha256(piece.encode()).hexdigest()} {title}")
        if "<section" in piece:
            yield f"{name}.verdict.html", piece[piece.index("<body") :]
    yield f"{name}.sha256", "\n".join(digests) + "\n"


def normal(text: str, work: Path) -> str:
    """Replace what never is the same twice."""
    places = {str(work): "<work>", str(code_folder()): "<root>", str(ROOT): "<root>"}
    places |= {str(Path(path).resolve()): "<python>" for path in (sys.prefix, sys.base_prefix)}
    places |= {os.path.dirname(os.__file__): "<python>"}
    for place in sorted(places, key=len, reverse=True):
        text = text.replace(place, places[place])
    for pattern, replacement in RULES:
        text = pattern.sub(replacement, text)
    return text


def spoken(text: str, work: Path) -> str:
    """The same for what a command printed."""
    text = normal(text, work)
    for pattern, replacement in SPOKEN:
        text = pattern.sub(replacement, text)
    return text


def code_folder() -> Path:
    """The folder from which rsmkit is imported."""
    found = find_spec("rsmkit")
    if found is None or found.origin is None:
        raise SystemExit("rsmkit cannot be imported; install it, or set PYTHONPATH")
    return Path(found.origin).resolve().parents[1]


def computer() -> dict[str, str]:
    """What numbers depend on besides the code."""
    cpu = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", cpu.read_text()) if cpu.exists() else None
    libraries = (
        "numpy",
        "scipy",
        "pandas",
        "scikit-learn",
        "pymoo",
        "numba",
        "pyDOE3",
        "statsmodels",
        "rich",
    )
    return {
        "processor": model[1] if model else platform.processor(),
        "python": platform.python_version(),
        **{name: version(name) for name in libraries},
    }


def compare(old: Path, again: Path, only: str, jobs: int, *, whole: bool) -> int:
    """Run the scenarios again and print the differences of each as it ends; 1 if there are any."""
    before = json.loads((old / COMPUTER_FILE).read_text())
    for key, value in computer().items():
        if before.get(key) != value:
            print(f"note: recorded with {key} {before.get(key)}, compared with {value}: numbers may differ")
    counts: dict[str, tuple[int, int]] = {}
    one_at_a_time = Lock()

    def differences(name: str) -> None:
        with one_at_a_time:
            counts[name] = compare_scenario(old, again, name, whole=whole)
            sys.stdout.flush()

    record(again, only, jobs, differences)
    recorded = {path.name for path in old.iterdir() if path.is_dir() and re.search(only, path.name)}
    for name in sorted(recorded - counts.keys()):
        differences(name)
    different, files = (sum(of) for of in zip(*counts.values(), strict=True))
    print(f"{different} of {files} files of {len(counts)} scenarios differ")
    return 1 if different else 0


def compare_scenario(old: Path, new: Path, name: str, *, whole: bool) -> tuple[int, int]:
    """Print what differs in one scenario; how many files do, and of how many."""
    if not (old / name).is_dir():
        print(f"== {name}: was not recorded")
        return 0, 0
    paths = [path for folder in (old, new) for path in (folder / name).rglob("*") if path.is_file()]
    files = {str(path.relative_to(old if path.is_relative_to(old) else new)) for path in paths}
    different = 0
    for file in sorted(files):
        texts = [read(folder / file) for folder in (old, new)]
        if texts[0] != texts[1]:
            different += 1
            print(f"== {file}: {kind_of_difference(*texts)}")
            print_difference(*(text or "" for text in texts), whole=whole)
    return different, len(files)


def read(path: Path) -> str | None:
    """The text, None where there is no file."""
    return path.read_bytes().decode() if path.is_file() else None


def kind_of_difference(old: str | None, new: str | None) -> str:
    """Say in a few words how two texts differ."""
    if old is None or new is None:
        return "is new" if old is None else "is missing"
    if NUMBER.sub("#", old) != NUMBER.sub("#", new):
        return "differs"
    pairs = zip(map(float, NUMBER.findall(old)), map(float, NUMBER.findall(new)), strict=True)
    worst = max(abs(a - b) / max(abs(a), abs(b)) for a, b in pairs if a != b)
    return f"only numbers differ, by {worst:.1e} of their size at most"


def print_difference(old: str, new: str, *, whole: bool) -> None:
    """Print a unified difference, or its beginning."""
    lines = difflib.unified_diff(old.splitlines(), new.splitlines(), "recorded", "now", lineterm="", n=1)
    if whole:
        print("\n".join(lines))
        return
    for number, line in enumerate(lines):
        if number == SHOWN_LINES:
            print("  ... (all of it with --show)")
            return
        print(line if len(line) <= SHOWN_WIDTH else f"{line[:SHOWN_WIDTH]} ...")


if __name__ == "__main__":
    sys.exit(main())
