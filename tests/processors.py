"""Run the tests whose numbers could depend on the processor as if on other processors.

    python tests/processors.py                  # every processor this one can stand in for
    python tests/processors.py haswell oldest   # only these
    python tests/processors.py --few oldest     # only what everything else comes together in

Linear algebra (OpenBLAS), NumPy's loops, compiled code (numba) and the C library's elementary functions each
choose instructions by processor, and round otherwise with others. All four can be told, before a process
starts, to choose as on an older one.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

ROOT = Path(__file__).parents[1]
TESTS = (
    "tests/validation/surfaces",
    "tests/unit/surfaces",
    "tests/validation/design",
    "tests/unit/design",
    "tests/validation/optimum",
    "tests/validation/sim/test_golden_flights.py",
    "tests/regression",
    "tests/e2e/cli/test_readme.py",
)
FEW = (
    "tests/validation/surfaces/test_strd.py",
    "tests/validation/surfaces/test_exact.py",
    "tests/validation/sim/test_golden_flights.py",
    "tests/regression",
    "tests/e2e/cli/test_readme.py::test_the_four_stages_say_what_is_shown",
)
"""Published digits, and whole studies from the design to the verified optimum."""
OPTIONS = ("-n", "auto", "--dist", "loadfile", "-m", "not slow or e2e")
"""Each file by one worker, so that the pinned study is flown once; of the slow tests only whole studies."""
LOOKS = (
    "import numpy, scipy.linalg, threadpoolctl as t; print({x['architecture'] for x in t.threadpool_info()})"
)


@dataclass(frozen=True)
class Processor:
    """What to imitate.

    Parameters
    ----------
    kernel : str
        OpenBLAS's name; the processor's own when empty.
    needs : str
        Instructions the kernel is made of, in NumPy's words.
    known_as : tuple of str
        What OpenBLAS reports when it uses the kernel.
    without : tuple of str
        Instructions NumPy may not use.
    plain : bool
        Compiled code and elementary functions without AVX and fused multiply-add.
    busy : bool
        Another process keeps one core busy.
    """

    kernel: str = ""
    needs: str = "SSE2"
    known_as: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    plain: bool = False
    busy: bool = False

    @property
    def environment(self) -> dict[str, str]:
        """Variables that every one of the four reads at its start."""
        found = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        if self.kernel:
            found["OPENBLAS_CORETYPE"] = self.kernel
        if self.without:
            found["NPY_DISABLE_CPU_FEATURES"] = ",".join(self.without)
        if self.plain:
            found["NUMBA_CPU_NAME"] = "generic"
            names = ("AVX2", "FMA", "FMA4", "AVX2_Usable", "FMA_Usable", "FMA4_Usable")  # glibc renamed them
            found["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=" + ",".join(f"-{name}" for name in names)
        return found


WIDE = tuple(name for name in __cpu_dispatch__ if __cpu_features__.get(name))
WIDEST = tuple(name for name in WIDE if "512" in name or name == "X86_V4")
PROCESSORS = {
    "oldest": Processor("Prescott", "SSE3", ("Prescott", "Katmai"), WIDE, plain=True),
    "nehalem": Processor("Nehalem", "SSE42", ("Nehalem",), WIDE),
    "sandybridge": Processor("Sandybridge", "AVX", ("Sandybridge",), WIDE),
    "haswell": Processor("Haswell", "AVX2", ("Haswell",), WIDEST),
    "zen": Processor("Zen", "AVX2", ("Zen", "Haswell"), WIDEST),
    "skylakex": Processor("SkylakeX", "AVX512F", ("SkylakeX",)),
    "generic": Processor(plain=True),
    "busy": Processor(busy=True),
}


def main(names: list[str]) -> int:
    """Run the tests as on each processor; 0 when all pass."""
    tests = FEW if "--few" in names else TESTS
    names = [name for name in names if name != "--few"]
    unknown = set(names) - set(PROCESSORS)
    if unknown:
        print(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(PROCESSORS)}", file=sys.stderr)
        return 2
    results = {name: passes(name, PROCESSORS[name], tests) for name in names or PROCESSORS}
    print("\n" + "\n".join(f"{name:12} {result}" for name, result in results.items()))
    return int("FAILED" in results.values())


def passes(name: str, processor: Processor, tests: tuple[str, ...]) -> str:
    """Run the tests as on one processor, and say how they went."""
    if not __cpu_features__.get(processor.needs):
        return f"left out: this processor has no {processor.needs}"
    environment = {**os.environ, **processor.environment}
    look = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", LOOKS], env=environment, capture_output=True, text=True
    )
    used = look.stdout.strip()
    print(f"\n== {name}: linear algebra by {used}", flush=True)
    if processor.known_as and not any(used == f"{{'{kernel}'}}" for kernel in processor.known_as):
        print(f"OPENBLAS_CORETYPE={processor.kernel} has no effect here")
        return "FAILED"
    start = time.monotonic()
    with other_work(processor.busy):
        done = subprocess.run([sys.executable, "-m", "pytest", *OPTIONS, *tests], cwd=ROOT, env=environment)
    return "FAILED" if done.returncode else f"passed in {time.monotonic() - start:.0f} s"


@contextmanager
def other_work(wanted: bool) -> Iterator[None]:
    """Keep one core busy meanwhile."""
    if not wanted:
        yield
        return
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as spinning:
        try:
            yield
        finally:
            spinning.kill()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
