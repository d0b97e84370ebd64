"""Write the values that were found into the file that was tuned, its comments kept.

In: an experiment, and values by path. Out: its file, changed in these places::

    {"lqr.q.1": 3.2}  ->  of a graph: q: [1, 3.2, 1]; of an experiment: set: {lqr.q.1: 3.2}
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from blocks.core import MissingPackageError, require
from blocks.files import read_text
from runtime.document import full_path
from runtime.errors import MissingExtraError, UsageError
from runtime.experiments.design import Experiment
from runtime.files import write_whole

EXTRA = "tune"
WIDE = 4096  # so that no line is wrapped
SHIPPED = Path(__file__).parents[3] / "graphs"


def check_writable(experiment: Experiment) -> Path:
    """The file that values would be written into.

    Raises
    ------
    UsageError : there is none, or it is part of the package.
    MissingExtraError : ruamel.yaml is not installed.
    """
    _yaml()
    path = experiment.path
    if path is None:
        raise UsageError("--write: the graph comes from no file")
    if path.resolve().is_relative_to(SHIPPED.resolve()):
        raise UsageError(f"--write: '{path.name}' is shipped with the package; copy it first")
    return path


def write_values(experiment: Experiment, values: Mapping[str, Any]) -> Path:
    """Set values in the file of an experiment or a graph; everything else stays as it is.

    Of an experiment, they become entries of ``set``; of a graph, they are written where they belong
    (into a block that its parent defines, as an entry that is laid over it).

    Parameters
    ----------
    values : by path into the graph.

    Raises
    ------
    UsageError : the file cannot be read or written, or has no place for a value.
    """
    path = check_writable(experiment)
    yaml = _yaml()
    try:
        document = yaml.load(read_text(path))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"--write: cannot read '{path}': {error}") from None
    is_graph = not any(key in document for key in ("experiment", "vary", "variants", "training"))
    for name, value in values.items():
        if is_graph:
            _place(document, full_path(experiment.graph.document, name).split("."), value, path)
        else:
            section = document.setdefault("set", {})
            known = {full_path(experiment.graph.document, key): key for key in section}
            section[known.get(full_path(experiment.graph.document, name), name)] = value
    buffer = io.StringIO()
    yaml.dump(document, buffer)
    try:
        write_whole(path, buffer.getvalue())
    except OSError as error:
        raise UsageError(f"--write: cannot write '{path}': {error.strerror or error}") from None
    return path


def _place(node: Any, names: list[str], value: Any, path: Path) -> None:
    """Set one entry; mappings on the way to it are made."""
    for name in names[:-1]:
        if isinstance(node, list):
            node = node[_item(node, name, path)]
        else:
            node = node.setdefault(name, {})
        if not isinstance(node, (dict, list)):
            raise UsageError(f"--write: '{path}' has no place for {'.'.join(names)}")
    if isinstance(node, list):
        node[_item(node, names[-1], path)] = value
    else:
        node[names[-1]] = value


def _item(node: list[Any], name: str, path: Path) -> int:
    if not name.isdecimal() or int(name) >= len(node):
        raise UsageError(f"--write: '{path}' has no item {name} there")
    return int(name)


def _yaml() -> Any:
    try:
        module = require("ruamel.yaml", "--write", EXTRA)
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None
    yaml = module.YAML()
    yaml.width = WIDE
    yaml.preserve_quotes = True
    return yaml
