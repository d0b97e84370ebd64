"""Registries of kinds: those of the library, and those of installed packages by their names."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar, overload

from blocks.core import BrokenPackageError, Installed

K = TypeVar("K")
D = TypeVar("D")


class Kinds(dict[str, K]):
    """Kinds by name: iterated are those of the library, found are those of packages as well.

    A package offers one under an entry point, as blocks are offered; it is imported when a graph
    names it, and one that is broken is an error at that name only::

        [project.entry-points."spikeblocks.metrics"]
        percentile = "my_package:PERCENTILE"

    Parameters
    ----------
    own : those of the library. group : the entry points. kind : the class of an entry.
    """

    def __init__(self, own: Mapping[str, K], group: str, kind: type[K]) -> None:
        super().__init__(own)
        wanted = f"a {kind.__name__}"
        self.installed: Installed[K] = Installed(group, _is_a(kind), wanted, taken=own)

    def __missing__(self, name: str) -> K:
        found = self.installed.find(name)
        if found is None:
            raise KeyError(name)
        return found

    @overload
    def get(self, name: str, default: None = None, /) -> K | None: ...

    @overload
    def get(self, name: str, default: K, /) -> K: ...

    @overload
    def get(self, name: str, default: D, /) -> K | D: ...

    def get(self, name: str, default: object = None, /) -> object:
        """The kind of a name; the default if there is none, or if its package is broken."""
        try:
            return self[name]
        except (KeyError, BrokenPackageError):
            return default

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.get(name) is not None

    def broken(self, name: str) -> str:
        """Why a package's kind cannot be used; '' if it can, or if there is none."""
        try:
            self.installed.find(name)
        except BrokenPackageError as error:
            return str(error)
        return ""

    def known(self, own: Iterable[str] | None = None) -> tuple[str, ...]:
        """Names of the library's kinds, or of some of them, and of those of packages."""
        return (*(self if own is None else own), *self.installed.names())


def _is_a(kind: type) -> Callable[[object], bool]:
    return lambda value: isinstance(value, kind)
