"""Parameters that are more than a number: read from a string or a mapping, held as an object."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self


class SettingError(ValueError):
    """What is wrong with a setting: (name within it, text); '' is the whole of it."""

    def __init__(self, problems: list[tuple[str, str]]) -> None:
        self.problems = problems
        super().__init__("; ".join(f"{name}: {text}" if name else text for name, text in problems))


class Setting(ABC):
    """A value in a form of its own, such as ``uniform(200, 400)`` or ``{type: LIF, ...}``.

    A parameter that is annotated with a subclass takes what its ``read`` accepts. Two settings
    are equal if they are written alike.
    """

    expected: ClassVar[str] = "a setting"

    @classmethod
    @abstractmethod
    def read(cls, written: Any) -> Self:
        """The setting that a graph writes.

        Raises
        ------
        SettingError : with what is wrong and where in it.
        ValueError : ``written`` is no such setting at all.
        """

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        """The forms that can be listed, ``uniform(low, high)``, each with a line about it."""
        return {}

    @abstractmethod
    def written(self) -> Any:
        """The setting as graphs write it, in plain Python values."""

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.written() == other.written()

    def __hash__(self) -> int:
        return hash((type(self), repr(self.written())))

    def __repr__(self) -> str:
        written = self.written()
        return written if isinstance(written, str) else repr(written)
