"""The verbs of the command line, one module each: ``add`` declares options, ``run`` does the work.

At its top, a module imports only what is cheap (argparse, errors), since every start imports all
of them; the rest is imported when the verb runs.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from importlib import import_module
from typing import Protocol, cast

NAMES = (
    *("run", "validate", "draw", "explain", "blocks"),
    *("ablate", "sweep", "compare", "report", "render", "clean"),
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


def at_least(low: float) -> Callable[[str], float]:
    """The type of an option that is a finite number of at least ``low``."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value < math.inf:
            raise ArgumentTypeError(f"expected a number of at least {low:g}, got '{text}'")
        return value

    return read


def command(name: str) -> Command:
    """The module of a verb."""
    return cast(Command, import_module(f"{__name__}.{name}"))
