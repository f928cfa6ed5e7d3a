"""Numba's machine code of a package, cached, never stale; rsmkit/ and sim/core/machine_code.py are alike.

Numba keys the cache of a function by the file that defines it, so editing a function it *calls* in another
file would leave old machine code in use. Here the cache folder is named after a hash of every source file of
the package and of numba's version: change one byte and everything is compiled afresh. Of several processes
that need a function for the first time one compiles it, the others wait and load what it has made.

``rsmkit`` is installed without ``sim``, and neither imports the other. So this file exists twice, the same
byte for byte, and a test sees to it: change both.
"""

from __future__ import annotations

import gc
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numba
import numba.core.cgutils
import numba.extending
from llvmlite import ir
from numba.core.compiler_lock import global_compiler_lock

fcntl: Any
try:
    import fcntl
except ImportError:  # not a POSIX system: every process works for itself
    fcntl = None

__all__ = ["FolderLocks", "MachineCode", "Reference", "call", "reference"]

PATIENCE_S = 600.0
_STRICT = {"cache": True, "error_model": "numpy"}
_POLL_S = 0.05
_KEEP_S = 7 * 24 * 3600.0

cgutils: Any = numba.core.cgutils
types: Any = numba.types

Function = TypeVar("Function", bound=Callable[..., Any])
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class MachineCode:
    """The machine code of one package.

    Parameters
    ----------
    package : path
        Folder of the package; each of its source files shapes the name of the cache folder.
    name : str
        Of the package, in names of folders that others share.
    variable : str
        Environment variable that may name the folder to keep machine code in.
    """

    def __init__(self, package: Path, name: str, variable: str) -> None:
        self._package = package
        self._name = name
        self._variable = variable
        self._folder: Path | None = None
        self._locks: FolderLocks | None = None
        self._entries: dict[Any, Any] = {}

    @property
    def folder(self) -> Path:
        """Folder of the machine code that belongs to the present sources.

        Where the environment variable says, when set; else the package's own ``__pycache__``; else, when the
        package is read-only, the user's cache folder; else a temporary one.
        """
        if self._folder is None:
            self._folder = self._first_writable()
        return self._folder

    def compile(self, function: Function, **options: bool) -> Function:
        """Compile a function at its first call with new argument types, or load what was compiled before.

        Strict IEEE arithmetic (no fast-math), so that results do not depend on how the compiler reorders
        sums; a division by zero gives inf or NaN, as in NumPy.

        Parameters
        ----------
        function : callable
            Function in numba's nopython subset.
        **options
            Further options of ``numba.njit``.
        """
        made, part = self._dispatcher(function, **options), self._dispatcher(function, bare=True, **options)
        # what machine code asks of a function that it calls
        made.get_call_template, made.get_overload = part.get_call_template, part.get_overload
        return cast(Function, made)

    def _dispatcher(self, function: Callable[..., Any], *, bare: bool = False, **options: bool) -> Any:
        """What numba makes of a function; bare without the wrapper through which Python calls it.

        Most functions are called by machine code alone, and the wrappers are a fifth of the compiler's work.
        """
        njit: Any = numba.njit
        with self._cache_here("parts" if bare else ""):
            # nothing calls them as C functions, either
            wrappers = {"no_cfunc_wrapper": True, "no_cpython_wrapper": bare}
            dispatcher = njit(**_STRICT, **wrappers, **options)(function)
        compile_or_load = dispatcher.compile

        def one_at_a_time(signature: Any) -> Any:
            with self._turn(function):
                return compile_or_load(signature)

        dispatcher.compile = one_at_a_time
        return dispatcher

    def entry(self, function: Callable[..., None], *arguments: Any, **options: bool) -> int:
        """Compile or load a function that returns nothing, to be called by address from other machine code.

        Machine code that calls a function by name is compiled together with it, and with all that it calls.

        Parameters
        ----------
        function : callable
            A function that :meth:`compile` has made.
        *arguments
            Types of its arguments.
        **options
            Further options of ``numba.cfunc``.

        Returns
        -------
        int
            Its address in this process.
        """
        cfunc: Any = numba.cfunc
        void: Any = numba.types.void
        body = cast(Any, function).py_func
        made = self._entries.get((body, arguments))
        if made is None:
            with self._turn(function), self._cache_here():
                made = self._entries[body, arguments] = self._entries.get((body, arguments)) or cfunc(
                    void(*arguments), **_STRICT, **options
                )(body)
        return int(made.address)

    def share(self, jobs: Mapping[Callable[..., Any], Callable[[], object]]) -> None:
        """Do jobs that each have one function compiled, beginning with one that no other process is at.

        Processes that have the same jobs at the same time thus share the work.

        Parameters
        ----------
        jobs : mapping
            What to do, by the function that :meth:`compile` has made.
        """
        waiting = dict(jobs)
        while waiting:
            with self._turn(*waiting) as function:
                waiting.pop(function)()

    @contextmanager
    def _cache_here(self, room: str = "") -> Iterator[None]:
        config: Any = numba.config
        before, config.CACHE_DIR = config.CACHE_DIR, str(self.folder / room)
        try:
            yield
        finally:
            config.CACHE_DIR = before

    @contextmanager
    def _turn(self, *functions: Any) -> Iterator[Any]:
        """Hold the lock of one of these functions, the first that no other process compiles."""
        self._locks = self._locks or FolderLocks(self.folder)
        names = {f"{function.__module__}.{function.__qualname__}": function for function in functions}
        # numba's own lock first, as everywhere: two threads that took them crosswise would wait for ever
        with global_compiler_lock, self._locks.turn(names) as name, _uncollected():
            yield names[name]

    def _first_writable(self) -> Path:
        chosen = os.environ.get(self._variable)
        parents = [Path(chosen)] if chosen else []
        parents.append(self._package / "__pycache__")
        parents.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / self._name)
        for parent in parents:
            folder = parent / f"machine-code-{self._source_hash()}"
            try:
                folder.mkdir(parents=True, exist_ok=True)
                with tempfile.TemporaryFile(dir=folder):
                    pass
            except OSError:
                continue
            _remove_outdated(parent, keep=folder)
            return folder
        return Path(tempfile.mkdtemp(prefix=f"{self._name}-"))

    def _source_hash(self) -> str:
        digest = hashlib.sha256(f"{self._name} {numba.__version__}".encode())
        for source in sorted(self._package.glob("**/*.py")):
            digest.update(source.relative_to(self._package).as_posix().encode())
            digest.update(source.read_bytes())
        digest.update(Path(__file__).read_bytes())
        return digest.hexdigest()[:16]


class FolderLocks:
    """Named turns to work in a folder; a process has one at a time, and keeps it for work within that work.

    The kernel gives a turn back when its holder dies. It is a courtesy: where there is no locking (some
    network file systems, a folder that cannot be written), or after ten minutes of waiting, work goes on
    without it. Threads of one process must take turns by other means.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._busy = False

    @contextmanager
    def turn(self, names: Iterable[str]) -> Iterator[str]:
        """Wait for a turn under any of these names, the first that is free; gives the name."""
        names = list(names)
        if self._busy or fcntl is None:
            yield names[0]
            return
        name, handle = self._taken(names)
        self._busy = True
        try:
            yield name
        finally:
            self._busy = False
            if handle is not None:
                # Said explicitly: a process forked meanwhile shares the lock, which closing leaves it.
                fcntl.flock(handle, fcntl.LOCK_UN)
                os.close(handle)

    def _taken(self, names: list[str]) -> tuple[str, int | None]:
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            for name in names:
                try:
                    return name, self._locked(name)
                except BlockingIOError:
                    continue
                except OSError:
                    return name, None
            time.sleep(_POLL_S)
        return names[0], None

    def _locked(self, name: str) -> int:
        handle = os.open(self._folder / f"{name}.lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BaseException:
            os.close(handle)
            raise
        return handle


@contextmanager
def _uncollected() -> Iterator[None]:
    """Leave garbage alone: to search for it among the compiler's objects is a tenth of its work."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _remove_outdated(parent: Path, keep: Path) -> None:
    """Drop machine code of earlier sources that nobody has written to for a week."""
    for folder in parent.glob("machine-code-*"):
        with suppress(OSError):  # another process may be at it, too
            if folder != keep and time.time() - folder.stat().st_mtime > _KEEP_S:
                shutil.rmtree(folder)


class Reference(Protocol[T_co]):
    """Where a value lies in memory; at index 0 is the value itself."""

    def __getitem__(self, index: int) -> T_co: ...


def _place_on_stack(typing_context: Any, value: Any) -> Any:
    """Give a value a place that lasts until the compiled function that asks for it returns.

    By value, each of the hundreds of numbers in a nested tuple of arrays is an argument of its own, which
    costs the compiler more than the functions themselves. In compiled functions only; truth values have no
    place.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = cgutils.alloca_once(builder, context.get_data_type(value))
        context.pack_value(builder, value, values[0], place)
        return place

    return types.CPointer(value)(value), generate


def _call_by_address(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call what :meth:`.MachineCode.entry` has made, with a tuple of exactly its arguments."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = cgutils.unpack_tuple(builder, values[1])
        kind = ir.FunctionType(context.get_value_type(types.void), [part.type for part in given])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), given)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), generate


reference: Callable[[T], Reference[T]] = cast(Any, numba.extending.intrinsic)(_place_on_stack)
call: Callable[[int, tuple[Any, ...]], None] = cast(Any, numba.extending.intrinsic)(_call_by_address)
