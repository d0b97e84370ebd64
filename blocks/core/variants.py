"""Settings of one of several classes, each with parameters of its own."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from blocks.core.hints import alternatives, misspelt
from blocks.core.params import plain, show
from blocks.core.reading import read_params
from blocks.core.settings import Setting, SettingError
from blocks.library.extensions import BrokenPackageError, Registry
from blocks.messages import message_of

# How a graph names a class that is not the library's.
OWN = "; your own needs its file, as in {type: Mine, module: mine.py}"


class Variant(Setting):
    """A setting of one of several classes: ``LIF``, or ``{type: LIF, tau_rc: 0.02}``.

    A family of such classes has one root, with the ``key`` that names a class. A class declares
    its own parameters with :func:`blocks.core.param`, as a block does. ``registry`` is
    the name of the family's :class:`Registry`, as in "neurons"; without it packages offer none.
    """

    key: ClassVar[str] = "type"
    members: ClassVar[Registry[type[Variant]]]
    label: ClassVar[str] = ""

    def __init_subclass__(
        cls, root: bool = False, abstract: bool = False, label: str = "", registry: str = ""
    ) -> None:
        super().__init_subclass__()
        cls.declared = read_params(cls)
        if root:
            wanted = f"a subclass of {cls.__name__}"
            cls.members = Registry(registry, cls, wanted, classes=True)
            return
        cls.label = label or cls.__name__
        # The library's alone: a class of a graph's own file is looked up in that file, so that two
        # graphs may use one name for different classes.
        if not abstract and cls.__module__.startswith("blocks."):
            cls.members[cls.label] = cls

    declared: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, **values: Any) -> None:
        other = alternatives(self.declared)
        problems: list[tuple[str, str]] = [
            (name, misspelt("unknown-parameter", "unknown", name, self.declared, other))
            for name in sorted(values.keys() - self.declared.keys())
        ]
        for name, declared in self.declared.items():
            if name not in values and declared.required:
                problems.append((name, declared.missing()))
                continue
            try:
                self.__dict__[name] = declared.convert(values.get(name, declared.default))
            except ValueError as error:
                problems.append((name, message_of(error)))
        problems = problems or self.wrong()
        if problems:
            raise SettingError(problems)

    def wrong(self) -> list[tuple[str, str]]:
        """What is wrong with several parameters together."""
        return []

    @classmethod
    def read(cls, written: Any) -> Self:
        if isinstance(written, cls):
            return written
        values = dict(written) if isinstance(written, dict) else {cls.key: written}
        name = values.pop(cls.key, None)
        if isinstance(name, type) and issubclass(name, cls):
            return name(**values)
        where = cls.key if isinstance(written, dict) else ""
        try:
            member: Any = cls.members.find(name) if isinstance(name, str) else None
        except BrokenPackageError as error:
            raise SettingError([(where, str(error))]) from None
        if member is not None:
            return member(**values)  # type: ignore[no-any-return]
        known = cls.members.names()
        got = "nothing" if name is None else show(name)
        text = f"expected {cls.expected} ({', '.join(known)}), got {got}"
        other = OWN if cls.members.name else ""
        raise SettingError([(where, misspelt("unknown-type", text, name, known, other))])

    @classmethod
    def forms(cls) -> Mapping[str, str]:
        return {name: member.summary() for name, member in cls.members.items()}

    @classmethod
    def summary(cls) -> str:
        """The first line of the documentation."""
        return (cls.__doc__ or "").strip().partition("\n")[0]

    def written(self) -> Any:
        values = {}
        for name, declared in self.declared.items():
            value = plain(self.__dict__[name])
            if declared.required or value != plain(declared.convert(declared.default)):
                values[name] = value
        offered = self.members.name_of(type(self))
        own = {} if offered else _own_file(type(self))
        name = offered or self.label
        return {self.key: name, **own, **values} if values or own else name

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} cannot change after construction")


def _own_file(cls: type[Variant]) -> dict[str, str]:
    """The file of a class that is not the library's, as a graph names it."""
    if cls.__module__.startswith("blocks."):
        return {}
    try:
        return {"module": str(Path(inspect.getfile(cls)).resolve())}
    except (OSError, TypeError):
        return {}
