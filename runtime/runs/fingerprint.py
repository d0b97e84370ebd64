"""Which program computes: a fingerprint of the sources that the numbers of a run depend on.

In: the packages whose blocks a graph uses. Out: :class:`Program`, which is recorded beside what it
computed. The version alone does not tell: all commits between two releases have the same one::

    program()                ->  spikeblocks 0.1.0 (3f2a91c04b12)
    program(("my_blocks",))  ->  the same with the sources of that package
"""

from __future__ import annotations

import hashlib
import importlib.util
import platform
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import TYPE_CHECKING

from blocks.files import read
from blocks.library.extensions import OURS
from blocks.library.registry import block_texts
from blocks.limits import MODULE
from runtime.errors import UsageError

if TYPE_CHECKING:
    from runtime.network import Network

PACKAGES = (
    *("spikeblocks", "numpy", "scipy", "networkx", "pyyaml", "matplotlib"),
    "mujoco-core",
)
CORE = ("blocks", "runtime")
# Rooms of ``runtime`` that present what was computed, or convert: they change no number of a run.
PRESENTING = frozenset(
    ("checking", "cli", "compare", "diagrams", "export", "language", "plots", "reports")
)
SOURCES = frozenset((".py", ".h"))
LENGTH = 12  # hexadecimal digits that are kept


@dataclass(frozen=True)
class Program:
    """A version and the fingerprint of the sources, of ``packages`` as well."""

    version: str
    fingerprint: str
    packages: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"spikeblocks {self.version} ({self.fingerprint})"


def program_of(*networks: Network) -> Program:
    """The program that computes graphs: this package, and those whose blocks they use.

    Their own Python files are no part of it: they are stored with the graph.
    """
    kinds = {entry.cls for network in networks for entry in network.entries.values()}
    places = (kind.__module__.split(".") for kind in kinds if not block_texts(kind, None))
    # A bridge is a package for itself.
    packages = {".".join(place[: 2 if place[0] == OURS else 1]) for place in places}
    return program(tuple(sorted(packages - {*CORE})))


@lru_cache(16)
def program(packages: tuple[str, ...] = ()) -> Program:
    """The program of this process.

    Raises
    ------
    ImportError : one of the packages is not installed here.
    """
    content = hashlib.sha256()
    for name in (*CORE, *packages):
        for label, path in _sources(name):
            # Line ends are not compared: a checkout on Windows has others.
            text = read(path, MODULE).replace(b"\r\n", b"\n")
            content.update(f"{label} {len(text)}\n".encode() + text)
    return Program(versions()["spikeblocks"], content.hexdigest()[:LENGTH], packages)


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a run's results depend on."""
    result = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            # Parsing the metadata, which may contain a long description, takes 10 ms a package.
            text = distribution(name).read_text("METADATA") or ""
            line = text.partition("\nVersion: ")[2].partition("\n")[0]
            result[name] = line.strip() or version(name)
        except PackageNotFoundError:
            result[name] = "not installed"
    return result


def check_same_program(
    recorded: Iterable[str], here: Program, what: str, way_out: str, mixed: bool = False
) -> None:
    """Check that what goes on was computed by this very program so far.

    Parameters
    ----------
    recorded : the programs as strings; '' where none was recorded.
    what : that goes on, for the message. way_out : what to do instead.
    mixed : whether results of several programs may be mixed.

    Raises
    ------
    UsageError : it was computed by another one.
    """
    others = [f"'{each}'" if each else "one that left no record" for each in recorded]
    others = [each for each in dict.fromkeys(others) if each != f"'{here}'"]
    if others and not mixed:
        raise UsageError(
            f"{what} was computed by another program, {' and '.join(others)}; this is '{here}', "
            f"and its numbers may differ. {way_out}"
        )


def _sources(package: str) -> Iterator[tuple[str, Path]]:
    """The source files of a package, or of a module, with their names in it."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        raise ImportError(f"no module named '{package}'")
    if not spec.submodule_search_locations:
        if spec.origin is not None:
            yield package, Path(spec.origin)
        return
    for folder in map(Path, spec.submodule_search_locations):
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.suffix in SOURCES and not (
                package == "runtime" and inside.parts[0] in PRESENTING
            ):
                yield f"{package}/{inside.as_posix()}", path
