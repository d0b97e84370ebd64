"""The command line's verbs: one module each, with ``add`` for its options and ``run`` for its work.

A module imports at its top only what every start may pay for (argparse, errors); what a verb works
with is imported when it runs.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from importlib import import_module
from typing import Protocol, cast

NAMES = (
    *("run", "validate", "draw", "explain", "blocks"),
    *("ablate", "sweep", "compare", "report", "render", "clean"),
)


class Command(Protocol):
    """What a verb's module offers."""

    HELP: str

    def add(self, parser: ArgumentParser) -> None:
        """Declare the verb's options."""

    def run(self, options: Namespace) -> int:
        """Do the work; returns the exit code."""


def command(name: str) -> Command:
    """A verb's module by its name."""
    return cast(Command, import_module(f"{__name__}.{name}"))
