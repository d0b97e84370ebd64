"""The verbs of the command line, one module each: ``add`` declares options, ``run`` does the work.

At its top, a module imports only what is cheap (argparse, errors), since ``runtime --help`` imports
all of them; the rest is imported when the verb runs. Packages offer further verbs as they offer
blocks::

    [project.entry-points."spikeblocks.verbs"]
    tabulate = "my_package.tabulate"                # a module with HELP, add and run
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from blocks.library.extensions import Registry


@runtime_checkable
class Verb(Protocol):
    """The interface of a verb's module.

    It may also have ABOUT, paragraphs after its first sentence, EXAMPLES, commands one a line, and
    GROUP, the title of its group in ``runtime --help`` ("tools").
    """

    HELP: str

    def add(self, parser: ArgumentParser) -> None:
        """Declare the verb's options."""

    def run(self, options: Namespace) -> int:
        """Do the work; returns the exit code."""


# The order of 'runtime --help': the six verbs of the first hour, then the others by what they do.
GROUPS: dict[str, tuple[str, ...]] = {
    "begin here": ("new", "run", "validate", "draw", "blocks", "ablate"),
    "run": ("resume", "replay"),
    "compare and report": ("compare", "report"),
    "experiments": ("sweep", "tune", "contest", "fit"),
    "analyse": ("explain", "linearize", "check"),
    "export and import": ("export",),
    "tools": ("graphs", "clean", "plugins", "completion", "schema", "help"),
}
OTHERS = "of installed packages"
_VERB: Any = Verb
VERBS: Registry[Verb] = Registry(
    "verbs",
    _VERB,
    "a module with HELP, add and run",
    lazy={name: f"{__name__}.{name}" for names in GROUPS.values() for name in names},
)


def groups_of(verbs: Mapping[str, Verb]) -> dict[str, list[str]]:
    """The names of verbs by the titles of their groups; of a package's verb, the one it names."""
    groups: dict[str, list[str]] = {
        title: [name for name in names if name in verbs] for title, names in GROUPS.items()
    }
    known = {name for names in groups.values() for name in names}
    for name, verb in verbs.items():
        if name not in known:
            groups.setdefault(str(getattr(verb, "GROUP", OTHERS)), []).append(name)
    return groups
