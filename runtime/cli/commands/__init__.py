"""The verbs of the command line, one module each: ``add`` declares options, ``run`` does the work.

At its top, a module imports only what is cheap (argparse, errors), since every start imports all
of them; the rest is imported when the verb runs.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from runtime.terminal import show

NAMES = (
    *("new", "run", "validate", "draw", "explain", "linearize", "blocks", "check", "graphs"),
    *("ablate", "sweep", "tune", "compare", "report", "render"),
    *("export", "clean", "completion", "lsp", "schema"),
)


class Command(Protocol):
    """The interface of a verb's module."""

    HELP: str

    def add(self, parser: ArgumentParser) -> None:
        """Declare the verb's options."""

    def run(self, options: Namespace) -> int:
        """Do the work; returns the exit code."""


def add_json(parser: ArgumentParser) -> None:
    """Declare ``--json``."""
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")


def add_output(parser: ArgumentParser, folder: str, of: str) -> None:
    """Declare the options of a verb that writes folders: where to, with pictures, and how much."""
    parser.add_argument("--out", default=folder, metavar="DIR", help=f"folder for {of} ({folder})")
    parser.add_argument("--no-plots", action="store_true", help="draw nothing")
    add_json(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress, no notes")


def show_folder(kind: str, folder: Path, files: Iterable[Path]) -> None:
    """Print a folder that was written, and the pictures in it."""
    show(f"{kind} folder: {folder}")
    for path in files:
        show(f"  {path.relative_to(folder)}")


def at_least(low: float, *, above: bool = False) -> Callable[[str], float]:
    """The type of an option that is a finite number of at least ``low``, or above it."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value < math.inf or (above and value == low):
            bound = f"above {low:g}" if above else f"of at least {low:g}"
            raise ArgumentTypeError(f"expected a number {bound}, got '{text}'")
        return value

    return read


def integer(low: int, high: int, *, even: bool = False) -> Callable[[str], int]:
    """The type of an option that is an integer between two bounds."""

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() else -1
        if not low <= value <= high or (even and value % 2):
            kind = "an even number" if even else "an integer"
            raise ArgumentTypeError(f"expected {kind} from {low} to {high}, got '{text}'")
        return value

    return read


def command(name: str) -> Command:
    """The module of a verb."""
    return cast(Command, import_module(f"{__name__}.{name}"))
