"""As much of OpenPBS as ``qsub``, ``qstat`` and ``qdel`` show of it: ``python pbs.py HOME COMMAND WORDS...``.

Jobs are processes of this computer, two at a time; a killed one ends with 256 and the signal's number, as the
administrator's guide says. What is known of jobs lies in the folder HOME.
"""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

SERVER = "here"
AT_ONCE = 2


def qsub(home, words):
    """Take an array, and leave it to a process of its own."""
    script, options = Path(words[-1]), dict(pairwise(words))
    first, last = map(int, options["-J"].split("-"))
    number = 1
    while True:
        try:
            (home / str(number)).mkdir(parents=True)
            break
        except FileExistsError:
            number += 1
    job = home / str(number)
    put(job / "job", {"Job_Name": options["-N"], "job_state": "B"})
    for index in range(first, last + 1):
        put(job / str(index), {"Job_Name": options["-N"], "job_state": "Q"})
    server = [sys.executable, __file__, str(home), "serve", str(job), str(script), options["-o"]]
    silent = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    subprocess.Popen(server, start_new_session=True, **silent)
    print(f"{number}[].{SERVER}")


def serve(_, words):
    """Run the tasks of an array to their end."""
    job, script, output = Path(words[0]), words[1], words[2]
    waiting = sorted((path for path in job.iterdir() if path.name.isdigit()), key=lambda path: int(path.name))
    running = {}
    while waiting or running:
        for path, process in list(running.items()):
            code = process.poll()
            if code is not None:
                del running[path]
                put(path, {**get(path), "job_state": "X", "Exit_status": code if code >= 0 else 256 - code})
        while waiting and len(running) < AT_ONCE:
            path = waiting.pop(0)
            if get(path)["job_state"] != "Q":
                continue
            with open(output.replace("^array_index^", path.name), "ab") as log:
                environment = {**os.environ, "PBS_ARRAY_INDEX": path.name}
                running[path] = subprocess.Popen(
                    ["sh", script], env=environment, stdout=log, stderr=log, start_new_session=True
                )
            put(path, {**get(path), "job_state": "R", "exec_host": f"{SERVER}/0", "pid": running[path].pid})
        time.sleep(0.05)
    put(job / "job", {**get(job / "job"), "job_state": "F"})


def qstat(home, words):
    """Tell of jobs, or of all, with their tasks."""
    asked = [word for word in words if word.endswith(f".{SERVER}")]
    told = {}
    for job in sorted(home.glob("*")):
        if asked and f"{job.name}[].{SERVER}" not in asked:
            continue
        for path in job.glob("*"):
            index = "" if path.name == "job" else path.name
            if index or not asked:
                told[f"{job.name}[{index}].{SERVER}"] = get(path)
    print(json.dumps({"Jobs": told}))


def qdel(home, words):
    """Take jobs back."""
    for word in words:
        for path in (home / word.partition("[")[0]).glob("[0-9]*"):
            known = get(path)
            if known["job_state"] == "Q":
                put(path, {**known, "job_state": "X", "Exit_status": 271})
            elif known["job_state"] == "R":
                with suppress(ProcessLookupError):
                    os.killpg(known["pid"], signal.SIGTERM)


def put(path, known):
    """Write in one step: others read meanwhile."""
    fresh = path.parent / f".{path.name}.{os.getpid()}"
    fresh.write_text(json.dumps(known))
    fresh.replace(path)


def get(path):
    return json.loads(path.read_text())


if __name__ == "__main__":
    {"qsub": qsub, "qstat": qstat, "qdel": qdel, "serve": serve}[sys.argv[2]](Path(sys.argv[1]), sys.argv[3:])
