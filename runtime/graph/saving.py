"""A graph as text and as files, from which :func:`runtime.load` reads an equal one.

In: ``graph.to_dict(modules=True)``, whose arrays are one value each. Out: a text with all numbers,
or ``my.yaml`` that names the arrays of ``my.npz`` beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from blocks.core import Block
from runtime.document import FILE_SECTIONS, arrays_beside, arrays_in, dump_yaml
from runtime.errors import UsageError
from runtime.files import Content, system_errors, write_files
from runtime.network import source_file
from runtime.streaming import save_arrays

MAX_TEXT = 100_000  # numbers of an array that a text may hold


def with_modules(plain: dict[str, Any], classes: Mapping[str, type[Block]]) -> dict[str, Any]:
    """Plain values in which each block whose class was given in Python names its file."""
    for entry in plain.get("blocks", {}).values():
        cls = classes.get(entry.get("type", ""))
        if cls is not None and "module" not in entry:
            entry["module"] = source_file(cls)
    return plain


def without_modules(plain: dict[str, Any]) -> dict[str, Any]:
    """Plain values that two graphs with the same blocks share, wherever their classes are."""
    for section in ("blocks", *FILE_SECTIONS):
        for entry in plain.get(section, {}).values():
            entry.pop("module", None)
    return plain


def as_text(plain: dict[str, Any]) -> str:
    """The text; UsageError for an array with too many numbers for one."""
    for address, array in arrays_in(plain):
        if not array.origin and array.values.size > MAX_TEXT:
            message = f"{array.values.size} numbers are too many for a YAML file"
            raise UsageError(f"{address}: {message}; graph.save(FILE) writes them beside it")
    return dump_yaml(plain)


def save(plain: dict[str, Any], path: Path) -> None:
    """Write the text and, if Python gave arrays, their archive; UsageError if that fails."""
    archive = path.with_suffix(".npz")
    plain, archives = arrays_beside(plain, archive.name, path.resolve().parent)
    files: dict[Path, Content] = {}
    for arrays in archives.values():
        files[archive] = partial(save_arrays, arrays=arrays)
    with system_errors(f"write '{path}'"):
        write_files({**files, path: dump_yaml(plain)})
