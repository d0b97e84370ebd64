"""Arrays beside a document: a text ``file.npz#name`` becomes the array, one value of the tree.

In: a tree, and files as :func:`numpy.savez` writes them. Out: the tree with a
:class:`~blocks.core.StoredArray` for each such text; or, the other way, a document that names
arrays of an archive beside it::

    weights: my.npz#w        ->   weights: <array 1000x1000 float64 5f70bf18a0860070>
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from blocks.core import FloatArray, StoredArray, misspelt
from blocks.files import DAMAGED, UnfitError, archive, opened, read_array, resolved
from blocks.limits import size
from blocks.messages import Message, message_of
from runtime.document.limits import MAX_ARRAY_BYTES, Work
from runtime.document.node import Node
from runtime.errors import Problems

REFERENCE = re.compile(r"([^#$][^#\n]*\.npz)#(.+)")
# Sections of a graph or part in which a value may be an array.
PLACES = ("params", "defaults", "blocks", "initial")
UNNAMED = "arrays.npz"  # the archive of arrays that Python gave
# Arrays that a graph still has, by file, its time and size, and name: an editor reads a text again
# with every key that is pressed.
_READ: WeakValueDictionary[tuple[str, int, int, str], StoredArray] = WeakValueDictionary()


def with_arrays(document: Node, problems: Problems, work: Work) -> Node:
    """A graph's or a part's document with the arrays that its values name.

    Raises
    ------
    GraphError : all arrays together take more than :data:`MAX_ARRAY_BYTES`.
    """
    for name in PLACES:
        node = document.get(name)
        if node is not None:
            read = array_values(node, name, problems, work)
            document = document if read is node else document.with_item(name, read)
    return document


def array_values(node: Node, address: str, problems: Problems, work: Work) -> Node:
    """A value with the arrays that it, or what it contains, names; the same node if it does not."""
    if node.is_map:
        items = {
            key: array_values(item, f"{address}.{key}", problems, work)
            for key, item in node.items()
        }
        changed = any(items[key] is not item for key, item in node.items())
        return Node(items, node.where, node.key) if changed else node
    match = REFERENCE.fullmatch(node.value) if isinstance(node.value, str) else None
    if match is None:
        return node
    folder = Path(node.where.file).parent if node.where.line else Path()
    try:
        array = _read(resolved(folder / match[1]), match[2], match[1], work)
    except ValueError as error:
        problems.add(node.where, address, message_of(error))
        problems.silence(node.where, address)
        return node
    work.array(array, node.where, address)
    return Node(array, node.where, node.key)


def _read(path: Path, name: str, written: str, work: Work) -> StoredArray:
    """One array of a file.

    Raises
    ------
    ValueError : with what is wrong, for a message.
    """
    try:
        status = path.stat()
        key = (str(path), status.st_mtime_ns, status.st_size, name)
        array = _READ.get(key)
        if array is None:
            with opened(path) as file, archive(file, MAX_ARRAY_BYTES) as members:
                names = [each.removesuffix(".npy") for each in members.namelist()]
                if name not in names:
                    text, other = f"'{written}' has no array '{name}'", ", ".join(names[:20])
                    other = f"; it has {other or 'none'}"
                    raise _MissingError(misspelt("unknown-name", text, name, names, other))
                values = read_array(members, f"{name}.npy", work.room)
            array = _READ[key] = StoredArray(values, f"{path}#{name}")
    except FileNotFoundError:
        message = "paths are relative to the file that names them"
        text = f"there is no file '{written}'; {message}"
        raise ValueError(Message(text, "missing-file")) from None
    except _MissingError as error:
        raise ValueError(message_of(error)) from None
    except UnfitError as unfit:
        reason = str(unfit)
        if "limit" in reason and work.room < MAX_ARRAY_BYTES:
            reason = f"the arrays of this graph take more than {size(MAX_ARRAY_BYTES)}"
        raise ValueError(f"'{written}#{name}': {reason}") from None
    except MemoryError:
        raise ValueError(f"'{written}#{name}' does not fit into memory") from None
    except DAMAGED as error:
        message = f"'{written}' is no archive as numpy.savez writes it"
        raise ValueError(f"{message}: {getattr(error, 'strerror', None) or error}") from None
    return array


class _MissingError(Exception):
    """An archive does not hold the array."""


def arrays_in(plain: Any, address: str = "") -> Iterator[tuple[str, StoredArray]]:
    """The arrays of a plain document, each with its address."""
    if isinstance(plain, StoredArray):
        yield address, plain
    elif isinstance(plain, dict):
        for key, value in plain.items():
            yield from arrays_in(value, f"{address}.{key}".lstrip("."))


def replace_arrays(plain: Any, named: Callable[[str, StoredArray], Any], address: str = "") -> Any:
    """A plain document with another value for each array, given its address and the array."""
    if isinstance(plain, StoredArray):
        return named(address, plain)
    if isinstance(plain, dict):
        return {
            key: replace_arrays(value, named, f"{address}.{key}".lstrip("."))
            for key, value in plain.items()
        }
    return plain


def arrays_beside(
    plain: dict[str, Any], unnamed: str = UNNAMED, folder: Path | None = None
) -> tuple[dict[str, Any], dict[str, dict[str, FloatArray]]]:
    """A document that names its arrays, and the archives with them to be written beside it.

    An array that was read from ``/home/me/my.npz#w`` is ``my.npz#w`` again, one that Python gave
    is ``arrays.npz#a.encoders``, by its address. For a document that is written to ``folder``,
    only the archive ``unnamed`` there is written; arrays of others stay where they are.
    """
    archives: dict[str, dict[str, StoredArray]] = {}

    def named(address: str, array: StoredArray) -> str:
        path, _, name = array.origin.rpartition("#")
        if path and folder is not None and Path(path) != folder / unnamed:
            return array.origin
        file = Path(path).name if path else unnamed
        name = name or address.removeprefix("blocks.").replace(".blocks.", ".")
        archive = archives.setdefault(file, {})
        while archive.setdefault(name, array) != array:
            name = f"{name}_"  # two files of one name, from different folders
        return f"{file}#{name}"

    plain = replace_arrays(plain, named)
    return plain, {
        file: {name: array.values for name, array in arrays.items()}
        for file, arrays in archives.items()
    }


def with_folder(plain: Any, folder: Path, own: Mapping[str, Any]) -> Any:
    """A document whose arrays are named with the folder of their archives, which are ``own``."""
    if isinstance(plain, dict):
        return {key: with_folder(value, folder, own) for key, value in plain.items()}
    match = REFERENCE.fullmatch(plain) if isinstance(plain, str) else None
    return plain if match is None or match[1] not in own else f"{folder / match[1]}#{match[2]}"
