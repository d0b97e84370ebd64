"""Kinds of metrics and plots: those of the library, of installed packages, of a graph's file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar, overload

from blocks.core import BrokenPackageError, Installed, hint
from blocks.registry import Modules
from runtime.document import Node, check_keys, misspelt_keys
from runtime.errors import Problems
from runtime.network import own_object
from runtime.observation.other_names import OTHER_NAMES


class Declared(Protocol):
    """What a kind declares for the checks of its entries: the keys that they take."""

    @property
    def keys(self) -> tuple[str, ...]: ...


K = TypeVar("K", bound=Declared)
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
        self.kind = kind
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


@dataclass(frozen=True)
class Chosen(Generic[K]):
    """The kind that an entry of ``plots`` or ``metrics`` names.

    Parameters
    ----------
    name : as written; '' if there is no such kind, which is reported.
    declared : the kind; None for none.
    keys : what the entry may have.
    files : those that were run for the kind, by resolved path.
    """

    name: str
    declared: K | None
    keys: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def own(self) -> K | None:
        """The kind, if a file of the graph defines it."""
        return self.declared if self.files else None


def choose(
    kinds: Kinds[K],
    node: Node,
    address: str,
    known: Callable[[str], tuple[str, ...]],
    problems: Problems,
    modules: Modules,
) -> Chosen[K] | None:
    """The kind of an entry, whose keys are checked; None if nothing more can be said about it.

    ``known`` are the kinds that a message should list, given the one that is written.
    """
    written, files = node.get("kind"), dict[str, bytes]()
    asked = "" if written is None else str(written.plain())
    if node.get("module") is not None:
        wanted = kinds.installed.wanted
        found = own_object(node, kinds.kind, wanted, address, problems, modules)
        if found is None:
            return None
        declared: K | None
        declared, files = found
    else:
        declared = kinds.get(asked)
        broken = "" if declared is not None else kinds.broken(asked)
        if written is not None and broken:
            problems.add(written.where, f"{address}.kind", broken)
            return None
    candidates = kinds.values() if declared is None else [declared]
    every = ("kind", *(key for each in candidates for key in each.keys), "module")
    keys = tuple(dict.fromkeys(every))
    check_keys(node, keys, address, problems, "key")
    if declared is None:
        _report_kind(node, known(asked), keys, f"{address}.kind", problems)
    return Chosen("" if declared is None else asked, declared, keys, files)


def _report_kind(
    node: Node, known: tuple[str, ...], keys: tuple[str, ...], address: str, problems: Problems
) -> None:
    item = node.get("kind")
    if item is None:
        if "kind" not in misspelt_keys(node, keys):
            message = f"missing; expected one of {', '.join(known)}"
            problems.add(node.key, address, message)
        return
    near = hint(item.plain(), known, OTHER_NAMES)
    message = f"expected one of {', '.join(known)}, got {item.describe()}{near}"
    if near and isinstance(item.value, str):  # a long list would hide it
        message = f"there is no kind '{item.value[:40]}'{near}"
    problems.add(item.where, address, message)


def _is_a(kind: type) -> Callable[[object], bool]:
    return lambda value: isinstance(value, kind)
