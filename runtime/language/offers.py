"""What completion offers: one insertion each, plain or a snippet.

In: a declaration. Out: an :class:`Offer`. A snippet has places to fill in, in the language server
protocol's notation: "dt: ${1:number}", or "kind: ${1|map,raster|}" where one of several values is
chosen.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

Icon = Literal["section", "type", "key", "value", "output", "name", "file", "param", "snippet"]


@dataclass(frozen=True)
class Offer:
    """One text that may be written.

    label : as listed; insert : what is written, a snippet with ``$1``, ``${2:text}`` if
    ``is_snippet``. detail : one line beside the label. doc : Markdown. rank : the lowest is first.
    """

    label: str
    icon: Icon
    detail: str = ""
    doc: str = ""
    insert: str = ""
    is_snippet: bool = False
    rank: int = 1

    @property
    def text(self) -> str:
        return self.insert or self.label


def matches(prefix: str, label: str) -> bool:
    """Whether all letters of a prefix occur in a label in that order."""
    # Editors filter in the same way while typing goes on: "ter" matches "TrackingError" without a
    # request.
    position, label = -1, label.lower()
    for letter in prefix.lower():
        position = label.find(letter, position + 1)
        if position < 0:
            return False
    return True


def escape_snippet(text: str) -> str:
    """A string as it stands inside a snippet."""
    return re.sub(r"([$}\\])", r"\\\1", text)


def choice(number: int, values: Iterable[str], otherwise: str) -> str:
    """A place of a snippet where one of some values is chosen."""
    choices = [re.sub(r"([$}\\,|])", r"\\\1", value) for value in values]
    if len(choices) > 1:
        return f"${{{number}|{','.join(choices)}|}}"
    return f"${{{number}:{escape_snippet(choices[0] if choices else otherwise)}}}"


def offers_of(names: Iterable[str], icon: Icon, detail: str = "", rank: int = 1) -> Iterator[Offer]:
    """Names as offers that differ in nothing else."""
    return (Offer(name, icon, detail, rank=rank) for name in names)
