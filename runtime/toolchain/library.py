"""Compiles units of C, links them into one shared library, and loads it.

In: translation units and the flags for this compiler. Out: a :class:`Library`. Objects and library
are named by a hash of text, flags and compiler, so that a second build starts no process.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.errors import SpikeblocksError
from runtime.files import slug, system_errors
from runtime.toolchain import store
from runtime.toolchain.compilers import Compiler, environment, find_compiler, processor, tuning

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

# Functions of math.h whose results are rounded in one way by the C library and in another by a
# compiler that computes them itself, as it does for arguments that it knows.
INEXACT = tuple(
    """
    sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10
    log1p cbrt hypot pow erf erfc tgamma lgamma
""".split()
)
# How much a unit is optimised; a plan, which only calls, is compiled in half of the time at -O1.
# Not -O3: gcc 12.2 then computes wrong numbers for a comparison of a clipped value in loops of
# constant, small length (test_library.py has one). Without -fno-trapping-math it does not, but
# 10,000 neurons take 1.4 times as long.
THOROUGH, QUICK = "-O2", "-O1"
# At -O2 alone, gcc leaves loops of unknown length without vector instructions, and case A takes 1.3
# times as long. clang has them anyway, and does not know these options.
VECTORS = ("-ftree-vectorize", "-fvect-cost-model=dynamic")
# No flag changes the result of an operation: neither fused multiply-add nor fast-math.
# -fno-math-errno and -fno-trapping-math say that nobody reads errno or floating-point exceptions,
# which lets sqrt be one instruction.
FLAGS = (
    "-std=c99",
    "-fPIC",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
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
        lines = [line for line in output.splitlines() if line.strip()][:SHOWN]
        super().__init__("\n".join([message, *lines]))


@dataclass(frozen=True)
class TranslationUnit:
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


class Builder:
    """Compiles units while others are still being written, then links and loads them.

    A context manager; at its end nothing is left of what was begun and not used.

    Parameters
    ----------
    checked : define ``SPIKEBLOCKS_CHECKED``, under which generated code checks its indices.
    portable : compile for any processor of this kind, and not for this very one.

    Raises
    ------
    MissingCompilerError : there is no compiler.
    """

    def __init__(self, checked: bool = False, portable: bool = False) -> None:
        self.compiler = compiler = find_compiler()
        options = () if portable else tuning(compiler)
        checks = (f"-D{CHECKED}=1",) if checked else ()
        self.flags = (*FLAGS, *checks, *options)
        kind = processor() if options else ""
        self._settings = (compiler.identity, *compiler.command, *self.flags, kind)
        self._futures: dict[str, Future[None]] = {}
        self._open = ExitStack()

    def __enter__(self) -> Builder:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @cached_property
    def _work(self) -> Path:
        return self._open.enter_context(store.work_folder())

    @cached_property
    def _pool(self) -> ThreadPoolExecutor:
        # Imported where something is compiled: a start from the cache takes a few ms.
        from concurrent.futures import ThreadPoolExecutor

        pool = ThreadPoolExecutor(processors())
        self._open.callback(pool.shutdown, cancel_futures=True)
        return pool

    def begin(self, unit: TranslationUnit) -> None:
        """Start to compile a unit that is not in the cache; an error is raised by :meth:`build`.

        Raises
        ------
        UsageError : the cache cannot be written.
        """
        key = self._key(unit)
        if key not in self._futures:
            with self._writing():
                work = self._work
            flags = (*self.flags, *self._level(unit))
            self._futures[key] = self._pool.submit(_compile, work, key, unit, self.compiler, flags)

    def build(
        self,
        units: Sequence[TranslationUnit],
        note: Callable[[tuple[str, ...]], None] | None = None,
    ) -> Library:
        """Compile what is not in the cache, link, and load.

        Parameters
        ----------
        units : each includes all that it needs, and no symbol is defined twice.
        note : called with the names of units that are not in the cache.

        Raises
        ------
        BuildError : the compiler fails, or the library cannot be loaded.
        UsageError : the cache cannot be written.
        """
        # One text is one object, however many units have it.
        objects = {self._key(unit): unit for unit in units}
        name = f"library_{store.digest(*LINK, *LIBRARIES, *objects)}{LIBRARY}"
        path, compiled = store.verified_path(name), NOTHING
        if path is None:
            with self._writing():
                path, compiled = self._link(name, objects, note)
                store.shrink_at_times()
        try:
            return Library(path, ctypes.CDLL(str(path)), compiled)
        except OSError as error:
            advice = f"does its folder forbid execution? {store.VARIABLE} names another one"
            raise BuildError(f"cannot load compiled code ({advice}): {error}") from None

    def _level(self, unit: TranslationUnit) -> tuple[str, ...]:
        vectors = unit.level == THOROUGH and not self.compiler.is_clang
        return (unit.level, *(VECTORS if vectors else ()))

    def _key(self, unit: TranslationUnit) -> str:
        return f"unit_{store.digest(*self._settings, *self._level(unit), unit.text)}{OBJECT}"

    def _writing(self) -> AbstractContextManager[None]:
        return system_errors(f"keep compiled code in '{store.folder()}'")

    def _link(
        self,
        name: str,
        objects: dict[str, TranslationUnit],
        note: Callable[[tuple[str, ...]], None] | None,
    ) -> tuple[Path, tuple[str, ...]]:
        """Compile and link; returns the library and the names of the units that were compiled."""
        work, missing = self._work, {}
        for key, unit in objects.items():
            content = None if key in self._futures else store.read(key)
            if content is None:
                missing[key] = unit
            else:
                # Linked from a copy of what was verified.
                (work / key).write_bytes(content)
        compiled = tuple(sorted({unit.name for unit in missing.values()}))
        if missing and note is not None:
            note(compiled)
        for unit in missing.values():
            self.begin(unit)
        for key in missing:
            self._futures[key].result()
            store.write(key, (work / key).read_bytes())
        words = [*self.compiler.command, *LINK, *objects, *LIBRARIES, "-o", name]
        _call(words, work, "cannot link the compiled units", "")
        return store.write(name, (work / name).read_bytes()), compiled


def build(
    units: Sequence[TranslationUnit],
    checked: bool = False,
    note: Callable[[tuple[str, ...]], None] | None = None,
) -> Library:
    """:meth:`Builder.build` of units that are all written."""
    with Builder(checked) as builder:
        return builder.build(units, note)


def _compile(
    work: Path, key: str, unit: TranslationUnit, compiler: Compiler, flags: Sequence[str]
) -> None:
    """One unit's object, in a folder of its own that compilers' messages do not show."""
    place = work / key.removesuffix(OBJECT)
    place.mkdir()
    source = f"{slug(unit.name, 'unit')}.c"
    (place / source).write_text(unit.text, encoding="utf-8")
    words = [*compiler.command, *flags, "-c", source, "-o", str(work / key)]
    _call(words, place, f"the C compiler did not accept '{unit.name}'", unit.name)


def _call(words: Sequence[str], folder: Path, problem: str, unit: str) -> None:
    import subprocess

    try:
        process = subprocess.run(
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
    if process.returncode:
        output = process.stdout.decode("utf-8", "replace")
        raise BuildError(f"{problem} ({words[0]} ended with {process.returncode})", unit, output)


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
