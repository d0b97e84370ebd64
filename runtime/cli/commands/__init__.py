"""The verbs of the command line, one module each: ``add`` declares options, ``run`` does the work.

At its top, a module imports only what is cheap (argparse, errors), since ``runtime --help`` imports
all of them; the rest is imported when the verb runs. Packages offer further verbs as they offer
blocks::

    [project.entry-points."spikeblocks.verbs"]
    tabulate = "my_package.tabulate"                # a module with HELP, add and run
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any, Protocol, runtime_checkable

from blocks.extensions import Registry


@runtime_checkable
class Verb(Protocol):
    """The interface of a verb's module.

    It may also have ABOUT, paragraphs after its first sentence, and EXAMPLES, commands one a line.
    """

    HELP: str

    def add(self, parser: ArgumentParser) -> None:
        """Declare the verb's options."""

    def run(self, options: Namespace) -> int:
        """Do the work; returns the exit code."""


_HERE = (
    *("new", "run", "resume", "replay", "validate", "draw", "explain", "linearize"),
    *("blocks", "check", "graphs", "ablate", "sweep", "tune", "contest", "fit"),
    *("compare", "report", "export", "clean", "plugins", "completion", "schema", "help"),
)
_VERB: Any = Verb
VERBS: Registry[Verb] = Registry(
    "verbs",
    _VERB,
    "a module with HELP, add and run",
    lazy={
        **{name: f"{__name__}.{name}" for name in _HERE},
        # Rooms that can be removed bring their own.
        "render": "runtime.rendering",
        "lsp": "runtime.lsp",
        "import": "runtime.nengo",
    },
)
