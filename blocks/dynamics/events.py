"""Events of a system of equations: when they happen, and what the states are then.

In goes a list of a graph, ``[{when: x < 0, then: [0, -0.8*v]}]``; out come conditions, directions,
and the texts of functions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from blocks.core import Setting, SettingError

DIRECTIONS = ("rising", "falling", "either")
KEYS = ("when", "then", "direction")


@dataclass(frozen=True)
class Happening:
    """An event: its condition, the states after it, and whether it is met as it becomes true."""

    when: str
    then: tuple[str, ...]
    direction: str = DIRECTIONS[0]


class Happenings(Setting):
    """Several events, as a list of ``{when, then, direction}``."""

    expected = "a list of events, as in [{when: x < 0, then: [0, -v], direction: rising}]"

    def __init__(self, items: Sequence[Happening]) -> None:
        self.items = tuple(items)

    @classmethod
    def read(cls, written: Any) -> Self:
        if isinstance(written, cls):
            return written
        if not isinstance(written, Sequence) or isinstance(written, str):
            raise ValueError(f"expected {cls.expected}, got {written!r}")
        problems: list[tuple[str, str]] = []
        items = [_read(str(i), each, problems) for i, each in enumerate(written)]
        if problems:
            raise SettingError(problems)
        return cls([each for each in items if each is not None])

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {"[{when: x < 0, then: [0]}]": "events with the states after each"}

    def written(self) -> Any:
        return [vars(each) | {"then": list(each.then)} for each in self.items]


def _read(place: str, written: Any, problems: list[tuple[str, str]]) -> Happening | None:
    if not isinstance(written, Mapping) or not {"when", "then"} <= set(written) <= set(KEYS):
        problems.append((place, f"expected when, then and maybe direction, got {written!r}"))
        return None
    then, direction = written["then"], written.get("direction", DIRECTIONS[0])
    texts = [then] if isinstance(then, (str, int, float)) else then
    if not isinstance(written["when"], str) or not isinstance(texts, Sequence):
        problems.append((place, "expected expressions as 'when' and 'then'"))
        return None
    if direction not in DIRECTIONS:
        expected = ", ".join(DIRECTIONS)
        problems.append((f"{place}.direction", f"expected {expected}, got {direction!r}"))
        return None
    return Happening(written["when"], tuple(map(str, texts)), direction)
