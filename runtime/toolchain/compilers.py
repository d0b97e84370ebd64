"""Finds a C compiler, and what identifies it, without starting it twice.

In: ``$CC`` and ``$PATH``. Out: a :class:`Compiler`; its answers to ``--version`` and
``-dumpmachine`` are in the cache as long as its file does not change: two more processes would be
most of a start from the cache::

    Compiler(("/usr/bin/cc",), "cc (Debian 12.2.0-14) 12.2.0", "x86_64-linux-gnu")
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from runtime.errors import SpikeblocksError
from runtime.toolchain import store

NAMES = ("cc", "gcc", "clang")
EXTRA = "compiler"
SECONDS = 60.0  # for a compiler to say who it is
# The option for the very processor that it runs on, by kind of processor. Its wider instructions
# compute the same bits as long as none of them multiplies and adds at once.
TUNING = {"x86_64": "-march=native", "aarch64": "-mcpu=native"}
PROCESSOR = Path("/proc/cpuinfo")
KNOWN_BY = ("vendor_id", "model name", "flags", "features", "cpu implementer", "cpu part")
# The first of these that knows the system's distribution (ID or ID_LIKE in os-release).
INSTALL = {
    "debian": "sudo apt install gcc libc6-dev",
    "ubuntu": "sudo apt install gcc libc6-dev",
    "fedora": "sudo dnf install gcc",
    "rhel": "sudo dnf install gcc",
    "suse": "sudo zypper install gcc",
    "arch": "sudo pacman -S gcc",
    "alpine": "sudo apk add gcc musl-dev",
}
# Zig compiles for the very processor it runs on, and adds checks, unless it is told not to.
ZIG_FLAGS = ("-mcpu=baseline", "-fno-sanitize=undefined")


class MissingCompilerError(SpikeblocksError):
    """There is no C compiler; the message names the command that installs one."""

    exit_code = 4

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason}; install one with: {install_command()}")


@dataclass(frozen=True)
class Compiler:
    """A C compiler: how it is called, and who it says it is.

    command : the program and its first arguments. version : the first line of its ``--version``.
    target : what it compiles for, such as x86_64-linux-gnu.
    """

    command: tuple[str, ...]
    version: str
    target: str

    @property
    def identity(self) -> str:
        """What objects depend on, apart from their text and flags; for manifests and caches."""
        return f"{self.version} ({self.target})"

    @property
    def is_clang(self) -> bool:
        """Whether it is clang, also under the name of cc or gcc (macOS), and as zig's."""
        return "clang" in self.version.lower()


@dataclass(frozen=True)
class _CompilerCommand:
    """A compiler that may work: its command, and the files whose change makes it another one."""

    command: tuple[str, ...]
    files: tuple[Path, ...]


def available() -> bool:
    """Whether there is a C compiler."""
    try:
        find_compiler()
    except MissingCompilerError:
        return False
    return True


def find_compiler() -> Compiler:
    """The C compiler: ``$CC``, cc, gcc or clang, or the one of the package ziglang.

    Raises
    ------
    MissingCompilerError : there is none.
    """
    return _find(os.environ.get("CC", ""), os.environ.get("PATH", ""))


@cache
def _find(chosen: str, path: str) -> Compiler:
    silent: list[str] = []
    for candidate in _candidates(chosen, path):
        compiler = _identify(candidate)
        if compiler is not None:
            return compiler
        silent.append(shlex.join(candidate.command))
    if chosen.strip():
        raise MissingCompilerError(f"CC is '{chosen}', which is not a C compiler on this computer")
    reason = f" ('{silent[0]}' does not answer to --version)" if silent else ""
    raise MissingCompilerError(
        f"the compiled engine needs a C compiler, and none was found{reason}"
    )


def _candidates(chosen: str, path: str) -> Iterator[_CompilerCommand]:
    if chosen.strip():
        try:
            words = shlex.split(chosen)
        except ValueError:  # a quotation mark without its partner
            return
        # As in 'ccache gcc -m64': every word that is a program.
        programs = [shutil.which(word, path=path) for word in words]
        if programs[0] is not None:
            files = tuple(Path(program) for program in programs if program)
            yield _CompilerCommand((programs[0], *words[1:]), files)
        return
    for name in NAMES:
        program = shutil.which(name, path=path)
        if program is not None:
            yield _CompilerCommand((program,), (Path(program),))
    # Imported last: a start from the cache takes a few ms.
    from importlib.util import find_spec

    spec = find_spec("ziglang")
    if spec is not None and spec.origin is not None:
        command = (sys.executable, "-m", "ziglang", "cc", *ZIG_FLAGS)
        yield _CompilerCommand(command, (Path(spec.origin),))


def _identify(candidate: _CompilerCommand) -> Compiler | None:
    """The compiler, from the cache if its files are as they were; None if it does not work."""
    stamps = []
    for file in candidate.files:
        real = file.resolve()
        status = real.stat()
        stamps.append(f"{real} {status.st_mtime_ns} {status.st_size}")
    name = f"compiler_{store.digest(machine(), *candidate.command, *stamps)}.json"
    record = store.read(name)
    if record is not None:
        fields = json.loads(record)
        return Compiler(tuple(fields["command"]), fields["version"], fields["target"])
    version, target = (_answer(candidate, flag) for flag in ("--version", "-dumpmachine"))
    if not version:
        return None
    compiler = Compiler(candidate.command, version, target or machine())
    with suppress(OSError):  # asked again next time
        store.write(name, json.dumps(asdict(compiler)).encode())
    return compiler


def _answer(candidate: _CompilerCommand, flag: str) -> str:
    """The first line that a compiler prints; empty if it fails."""
    import subprocess

    try:
        process = subprocess.run(
            [*candidate.command, flag],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=environment(),
            timeout=SECONDS,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return process.stdout.decode("utf-8", "replace").strip().partition("\n")[0].strip()


@cache
def machine() -> str:
    """The kind of processor, such as x86_64."""
    import platform

    return platform.machine()


@cache
def processor() -> str:
    """What the processor is and can do; empty where that is not known."""
    try:
        # One paragraph for each of its cores; some lines are different on each read.
        lines = PROCESSOR.read_text(encoding="utf-8", errors="replace").split("\n\n")[0].split("\n")
    except OSError:
        return ""
    relevant = [line for line in lines if line.lower().startswith(KNOWN_BY)]
    return "\n".join(relevant)


def tuning(compiler: Compiler) -> tuple[str, ...]:
    """The options for the processor of this computer, if it is known and they are understood."""
    option = TUNING.get(machine())
    can = option is not None and bool(processor()) and not set(ZIG_FLAGS) & set(compiler.command)
    return (option,) if can and option is not None else ()


def environment() -> dict[str, str]:
    """The environment for a compiler: its messages in English."""
    return {**os.environ, "LC_ALL": "C"}


def install_command() -> str:
    """The command that installs a C compiler on this system."""
    import platform

    from blocks.core import pip_line

    pip = pip_line(EXTRA)
    if sys.platform == "darwin":
        return f"xcode-select --install (or {pip})"
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        return pip
    for name in (release.get("ID", ""), *release.get("ID_LIKE", "").split()):
        if name in INSTALL:
            return f"{INSTALL[name]} (or {pip})"
    return pip
