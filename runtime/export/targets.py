"""What blocks of a graph can be exported to; packages offer further targets.

    [project.entry-points."spikeblocks.exports"]
    rust = "my_package:RUST"

The options of all targets are read for ``runtime --help``: this module imports only what is cheap,
and so do those of packages; what writes is imported when it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.library.extensions import Registry
from runtime.arguments import at_least

if TYPE_CHECKING:
    from runtime.export.controller import Exported
    from runtime.graph import Graph


@dataclass(frozen=True)
class ExportTarget:
    """A language or format that blocks of a graph are written in.

    Parameters
    ----------
    doc : what it is, in a few words.
    write : writes the files, with the arguments of :func:`runtime.export.export`.
    options : further options, given to ``write`` if they are set: by their name, what
        ``add_argument`` of :mod:`argparse` takes, with ``help`` as it is shown.
    """

    doc: str
    write: Callable[..., Exported]
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def _write_c(graph: Graph, folder: str | Path, **options: Any) -> Exported:
    from runtime.export.controller import export

    return export(graph, folder, **options)


def _write_library(graph: Graph, folder: str | Path, **options: Any) -> Exported:
    from runtime.export.library import export_library

    return export_library(graph, folder, **options)


_TOLERANCE = "of the test with --float32: a share of each output's range (0.001)"
_OPTIONS = {
    "tolerance": {"type": at_least(0.0, above=True), "metavar": "X", "help": _TOLERANCE},
}
OWN = {
    "c": ExportTarget("C99", _write_c, _OPTIONS),
    "library": ExportTarget("compiled, for Python and C", _write_library, _OPTIONS),
}
TARGETS: Registry[ExportTarget] = Registry("exports", ExportTarget, "an ExportTarget", own=OWN)
