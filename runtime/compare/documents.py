"""Differences of plain documents, by key.

In: trees of dicts and lists. Out: the paths at which they differ, with the values of each::

    {a: {b: 1}}, {a: {b: 2, c: 3}}  ->  a.b (1, 2) changed; a.c (absent, 3) added
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from runtime.document import flow_yaml

LONG = 60  # characters: longer lists of the same length are compared item by item


class Absent(Enum):
    """The type of :data:`ABSENT`, for a key that a document does not have; null is a value."""

    ABSENT = "absent"


ABSENT: Final = Absent.ABSENT


@dataclass(frozen=True)
class KeyDifference:
    """A path at which documents differ.

    ``values`` has one item per document, :data:`ABSENT` where it has no such key.
    """

    path: str
    values: tuple[Any, ...]

    @property
    def change(self) -> str:
        """The change from the first document: added, removed or changed."""
        if self.values[0] is ABSENT:
            return "added"
        others = [value for value in self.values[1:] if not same(value, self.values[0])]
        return "removed" if all(value is ABSENT for value in others) else "changed"


def differences(documents: Sequence[Any]) -> list[KeyDifference]:
    """The differences of documents, in the order of the first one's keys.

    Mappings are compared key by key; an entry that only some documents have is one difference.
    Short lists are values; long ones of the same length are compared item by item.

    Parameters
    ----------
    documents : two or more trees of dicts, lists and scalars.
    """
    return list(_differences("", tuple(documents)))


def _differences(path: str, values: tuple[Any, ...]) -> Iterator[KeyDifference]:
    if all(same(value, values[0]) for value in values[1:]):
        return
    # A section that only some have is compared by its entries.
    is_section = "." not in path
    inside = [{} if value is ABSENT and is_section else value for value in values]
    if all(isinstance(value, dict) for value in inside):
        for key in dict.fromkeys(key for value in inside for key in value):
            at = f"{path}.{key}".lstrip(".")
            yield from _differences(at, tuple(value.get(key, ABSENT) for value in inside))
    elif _itemwise(values):
        for i, items in enumerate(zip(*values, strict=True)):
            yield from _differences(f"{path}[{i}]", items)
    else:
        yield KeyDifference(path, values)


def _itemwise(values: Sequence[Any]) -> bool:
    """Whether all are lists of the same length, and at least one is long."""
    if not all(isinstance(value, list) for value in values):
        return False
    if len({len(value) for value in values}) > 1:
        return False
    return any(len(str(value)) > LONG for value in values)


def same(a: Any, b: Any) -> bool:
    """Whether two values are the same to a graph: 1 is 1.0, true is not 1, nan is nan."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, bool) or isinstance(b, bool):
        return a is b
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return a == b or (math.isnan(a) and math.isnan(b))
    return type(a) is type(b) and bool(a == b)


def text_of(value: Any, most: int = 0) -> str:
    """A value in one line of YAML, cut to ``most`` characters if given."""
    text = "" if value is ABSENT else flow_yaml(value)
    return f"{text[: most - 1]}…" if most and len(text) > most else text
