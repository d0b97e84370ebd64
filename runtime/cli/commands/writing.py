"""``--write``: values that were found, written into the file of an experiment or a graph.

In: an experiment, and values by path. Out: its file, in which these numbers differ and nothing
else::

    {"lqr.q.1": 3.2}  ->  of a graph: q: [1, 3.2, 1]; of an experiment: set: {lqr.q.1: 3.2}
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.errors import GraphError, UsageError

if TYPE_CHECKING:
    from runtime.experiments.design import Experiment


def check_writable(experiment: Experiment) -> Path:
    """The file that values would be written into.

    Raises
    ------
    UsageError : there is none, or it is part of the package.
    """
    from runtime.document import SHIPPED

    path = experiment.path
    if path is None:
        raise UsageError("--write: the graph comes from no file")
    if path.resolve().is_relative_to(SHIPPED.resolve()):
        raise UsageError(f"--write: '{path.name}' is shipped with the package; copy it first")
    return path


def write_values(experiment: Experiment, values: Mapping[str, Any]) -> Path:
    """Set values in the file of an experiment or a graph; everything else stays as it is.

    Of an experiment, they become entries of ``set``; of a graph, they are written where they belong
    (of a block that its parent defines, as an entry that overlays it).

    Parameters
    ----------
    values : by path into the graph.

    Raises
    ------
    UsageError : the file cannot be read or written, or has no place for a value.
    """
    from runtime.document import full_path
    from runtime.files import system_errors, write_whole
    from runtime.language import Model, write_entries

    path = check_writable(experiment)
    try:
        model = Model.of_file(str(path))
    except GraphError as error:
        raise UsageError(f"--write: {error}") from None
    graph = experiment.graph.document
    entries = {tuple(full_path(graph, name).split(".")): value for name, value in values.items()}
    if model.kind == "experiment":
        section = model.tree.get("set")
        written = {full_path(graph, key): key for key in (section.value if section else {})}
        paths = {name: full_path(graph, name) for name in values}
        entries = {("set", written.get(paths[n], n)): value for n, value in values.items()}
    with system_errors(f"write '{path}'"):
        write_whole(path, write_entries(model, entries))
    return path
