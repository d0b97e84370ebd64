"""Parameters that are more than a number: read from a text or a mapping, held as an object."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

__all__ = ["Setting", "SettingError", "Variant"]


class SettingError(ValueError):
    """What is wrong with a setting: (name within it, text); '' is the whole of it."""

    def __init__(self, problems: list[tuple[str, str]]) -> None:
        self.problems = problems
        super().__init__("; ".join(f"{name}: {text}" if name else text for name, text in problems))


class Setting(ABC):
    """A value with a text of its own, such as ``uniform(200, 400)`` or ``{type: LIF, ...}``.

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


class Variant(Setting):
    """A setting of one of several classes: ``LIF``, or ``{type: LIF, tau_rc: 0.02}``.

    A family of such classes has one root, with the ``key`` that names a class. A class declares
    its own parameters with :func:`blocks.core.param`, as a block does.
    """

    key: ClassVar[str] = "type"
    noun: ClassVar[str] = "setting"
    members: ClassVar[dict[str, type[Variant]]] = {}
    label: ClassVar[str] = ""

    def __init_subclass__(cls, root: bool = False, abstract: bool = False, label: str = "") -> None:
        super().__init_subclass__()
        from blocks.core.reading import read_params

        cls.declared = read_params(cls)
        if root:
            cls.members = {}
            return
        cls.label = label or cls.__name__
        if not abstract and cls.__module__.startswith("blocks."):
            cls.members[cls.label] = cls

    declared: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, **values: Any) -> None:
        from blocks.core.params import hint

        problems = [
            (name, f"unknown{hint(name, self.declared) or _listed(self.declared)}")
            for name in sorted(values.keys() - self.declared.keys())
        ]
        for name, declared in self.declared.items():
            if name not in values and declared.required:
                problems.append((name, f"missing; expected {declared.describe()}: {declared.doc}"))
                continue
            try:
                self.__dict__[name] = declared.convert(values.get(name, declared.default))
            except ValueError as error:
                problems.append((name, str(error)))
        problems = problems or self.wrong()
        if problems:
            raise SettingError(problems)

    def wrong(self) -> list[tuple[str, str]]:
        """What is wrong with several parameters together."""
        return []

    @classmethod
    def read(cls, written: Any) -> Self:
        from blocks.core.params import hint, show

        if isinstance(written, cls):
            return written
        values = dict(written) if isinstance(written, dict) else {cls.key: written}
        name = values.pop(cls.key, None)
        if isinstance(name, type) and issubclass(name, cls):
            return name(**values)
        if isinstance(name, str) and name in cls.members:
            made: Any = cls.members[name](**values)
            return made  # type: ignore[no-any-return]
        known = ", ".join(cls.members)
        where = cls.key if isinstance(written, dict) else ""
        got = "nothing" if name is None else show(name)
        text = f"expected {cls.expected} ({known}), got {got}{hint(name, cls.members)}"
        raise SettingError([(where, text)])

    def written(self) -> Any:
        from blocks.core.params import plain

        values = {}
        for name, declared in self.declared.items():
            value = plain(self.__dict__[name])
            if declared.required or value != plain(declared.convert(declared.default)):
                values[name] = value
        return {self.key: self.label, **values} if values else self.label

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} cannot change after construction")


def _listed(names: Mapping[str, Any]) -> str:
    return f"; it has {', '.join(names)}" if names else "; it has none"
