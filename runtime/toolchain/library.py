"""Compiles units of C, links them into one shared library, and loads it."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from runtime.errors import SpikeblocksError
from runtime.files import slug, system_errors
from runtime.toolchain import store
from runtime.toolchain.compilers import Compiler, environment, find_compiler, processor, tuning

# Functions of math.h whose results are rounded in one way by the C library and in another by a
# compiler that computes them itself, as it does for arguments that it knows.
INEXACT = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh"),
    *("acosh", "atanh", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "cbrt", "hypot"),
    *("pow", "erf", "erfc", "tgamma", "lgamma"),
)
# How much a unit is optimised. At -O2, gcc leaves loops of unknown length without vector
# instructions, and case A takes 1.3 times as long; a plan, which only calls, is compiled in half of
# the time at -O1.
THOROUGH, QUICK = "-O3", "-O1"
# No flag changes the result of an operation: neither fused multiply-add nor fast-math.
# -fno-math-errno and -fno-trapping-math say that nobody reads errno or floating-point exceptions,
# which lets sqrt be one instruction.
FLAGS = (
    *("-std=c99", "-fPIC", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-trapping-math"),
    *(f"-fno-builtin-{name}" for name in INEXACT),
)
CHECKED = "SPIKEBLOCKS_CHECKED"  # defined in a build that checks indices
LINK = ("-shared", "-fPIC")
LIBRARIES = ("-lm",)
OBJECT = ".o"
LIBRARY = ".dylib" if sys.platform == "darwin" else ".so"
SECONDS = 600.0  # for one unit
NOTHING: tuple[str, ...] = ()
SHOWN = 5  # lines of a compiler's message


class BuildError(SpikeblocksError):
    """The compiler did not accept a unit, or its result cannot be loaded.

    unit : its name, empty for the library. output : all that the compiler printed.
    """

    exit_code = 4

    def __init__(self, message: str, unit: str = "", output: str = "") -> None:
        self.unit, self.output = unit, output
        shown = [line for line in output.splitlines() if line.strip()][:SHOWN]
        super().__init__("\n".join([message, *shown]))


@dataclass(frozen=True)
class Unit:
    """One translation unit: its name, as compilers' messages show it, and its text in C99."""

    name: str
    text: str
    level: str = THOROUGH


@dataclass(frozen=True)
class Library:
    """A loaded library.

    path : its file. functions : its functions, by name; a call releases the GIL.
    compiled : the names of the units that were not in the cache.
    """

    path: Path
    functions: ctypes.CDLL
    compiled: tuple[str, ...] = ()


def build(
    units: Sequence[Unit],
    checked: bool = False,
    note: Callable[[tuple[str, ...]], None] | None = None,
) -> Library:
    """Compile what is not in the cache, link, and load.

    Parameters
    ----------
    units : their texts include all that they need, and no symbol is defined twice.
    checked : define ``SPIKEBLOCKS_CHECKED``, under which a text checks its indices.
    note : called with the names of units that are not in the cache, before they are compiled.

    Raises
    ------
    MissingCompilerError : there is no compiler.
    BuildError : the compiler fails, or the library cannot be loaded.
    UsageError : the cache cannot be written.
    """
    compiler = find_compiler()
    flags = (*FLAGS, f"-D{CHECKED}=1") if checked else FLAGS
    tuned = tuning(compiler)
    flags = (*flags, *tuned)
    made_with = (compiler.identity, *compiler.command, *flags, processor() if tuned else "")
    # One text is one object, however many units have it.
    objects = {
        f"unit_{store.digest(*made_with, unit.level, unit.text)}{OBJECT}": unit for unit in units
    }
    name = f"library_{store.digest(*LINK, *LIBRARIES, *objects)}{LIBRARY}"
    path, compiled = store.verified(name), NOTHING
    if path is None:
        with system_errors(f"keep compiled code in '{store.folder()}'"):
            path, compiled = _made(name, objects, compiler, flags, note)
            store.bound()
    try:
        return Library(path, ctypes.CDLL(str(path)), compiled)
    except OSError as error:
        advice = f"does its folder forbid execution? {store.VARIABLE} names another one"
        raise BuildError(f"cannot load compiled code ({advice}): {error}") from None


def _made(
    name: str,
    objects: dict[str, Unit],
    compiler: Compiler,
    flags: Sequence[str],
    note: Callable[[tuple[str, ...]], None] | None,
) -> tuple[Path, tuple[str, ...]]:
    """Compile and link; returns the library and the names of the units that were compiled."""
    with store.work_folder() as work:
        missing = {}
        for key, unit in objects.items():
            content = store.read(key)
            if content is None:
                missing[key] = unit
            else:
                # Linked from a copy of what was verified.
                (work / key).write_bytes(content)
        compiled = tuple(sorted({unit.name for unit in missing.values()}))
        if missing and note is not None:
            note(compiled)
        _side_by_side(
            partial(_compile, work, key, unit, compiler, flags) for key, unit in missing.items()
        )
        for key in missing:
            store.write(key, (work / key).read_bytes())
        words = [*compiler.command, *LINK, *objects, *LIBRARIES, "-o", name]
        _call(words, work, "cannot link the compiled units", "")
        return store.write(name, (work / name).read_bytes()), compiled


def _compile(work: Path, key: str, unit: Unit, compiler: Compiler, flags: Sequence[str]) -> None:
    """One unit's object, in a folder of its own that compilers' messages do not show."""
    place = work / key.removesuffix(OBJECT)
    place.mkdir()
    source = f"{slug(unit.name, 'unit')}.c"
    (place / source).write_text(unit.text, encoding="utf-8")
    words = [*compiler.command, *flags, unit.level, "-c", source, "-o", str(work / key)]
    _call(words, place, f"the C compiler did not accept '{unit.name}'", unit.name)


def _call(words: Sequence[str], folder: Path, problem: str, unit: str) -> None:
    import subprocess

    try:
        done = subprocess.run(
            words,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment(),
            timeout=SECONDS,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise BuildError(f"{problem}: {error}", unit) from None
    if done.returncode:
        output = done.stdout.decode("utf-8", "replace")
        raise BuildError(f"{problem} ({words[0]} ended with {done.returncode})", unit, output)


def _side_by_side(calls: Iterable[Callable[[], None]]) -> None:
    """Call functions, as many at a time as there are processors; the first error ends it."""
    # Imported where something is compiled: a start from the cache takes a few ms.
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(processors()) as pool:
        running = [pool.submit(call) for call in calls]
        try:
            for task in running:
                task.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
