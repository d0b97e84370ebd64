"""Registries: what the library has of each kind, and what installed packages offer, by name.

In: the name of a registry, the class of its entries and the library's own. Out: entries by name,
of which those of packages are imported one by one, when they are asked for::

    METRIC_KINDS = Registry("metrics", MetricKind, "a MetricKind", own={"mean": MEAN})
    METRIC_KINDS["percentile"]

    [project.entry-points."spikeblocks.metrics"]    # in a package's pyproject.toml
    percentile = "my_package.metrics:PERCENTILE"
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, TypeVar, overload

from blocks.foreign import raised_text

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

T = TypeVar("T")
D = TypeVar("D")
OURS = "spikeblocks"  # the package whose offers are the library's own: its bridges
PREFIX = f"{OURS}."


class BrokenPackageError(ImportError):
    """What an installed package offers cannot be used; the message names both, and the cause."""


@dataclass(frozen=True)
class Offer:
    """One entry point: what a package, or the library itself, offers under a name.

    Parameters
    ----------
    package : its name and version, as in "my_blocks 0.1.0".
    point : the entry point. Its value is ``module`` or ``module:attribute``.
    unused : why the name is not this package's; '' if it is.
    """

    package: str
    point: EntryPoint
    unused: str = ""

    def __str__(self) -> str:
        return f"'{self.point.name}' of package {self.package}"

    @property
    def is_ours(self) -> bool:
        """Whether the library offers it itself, as its bridges do."""
        return self.package.partition(" ")[0] == OURS


class Registry(dict[str, T]):
    """The entries of one kind by name.

    Iterated are the library's, so that its documents and schema do not depend on what is
    installed; looked up are those of packages as well, which are imported then. A package that
    cannot be imported, or that offers something else, is an error at its own name only.

    Parameters
    ----------
    name : packages offer entries as entry points of the group ``spikeblocks.<name>``; '' for none.
    kind : the class that an entry is an instance of, or with ``classes`` a subclass of.
    wanted : that in words, as in "a subclass of Block".
    own : the library's. lazy : more of the library's, as ``module`` or ``module:attribute``,
        imported as those of packages are.
    """

    def __init__(
        self,
        name: str,
        kind: type,
        wanted: str,
        own: Mapping[str, T] | None = None,
        lazy: Mapping[str, str] | None = None,
        classes: bool = False,
    ) -> None:
        super().__init__(own or {})
        self.name, self.kind, self.wanted, self.classes = name, kind, wanted, classes
        self.lazy = dict(lazy or {})
        self._loaded: dict[str, T | BrokenPackageError] = {}
        self._read: _Installed | None = None
        # All that was ever imported, which graphs in memory may use after sys.path has changed.
        self._named: list[tuple[str, T]] = []

    def accepts(self, value: object) -> bool:
        """Whether an object is of the kind."""
        if self.classes:
            return isinstance(value, type) and issubclass(value, self.kind)
        return isinstance(value, self.kind)

    def find(self, name: str) -> T | None:
        """The entry of a name; None if there is none.

        Raises
        ------
        BrokenPackageError : the package cannot be imported, or offers something of another kind.
        """
        if dict.__contains__(self, name):
            return dict.__getitem__(self, name)
        if name not in self.lazy and self._read is not _installed():
            self._loaded, self._read = {}, _installed()
        if name not in self._loaded:
            if value := self.lazy.get(name):
                # Not as an entry point: importlib.metadata takes longer than most of our modules.
                own = partial(_object, value)
                self._loaded[name] = self._load(f"'{name}' of package {OURS}: {value}", own)
            elif offer := self.offers().get(name):
                loaded = self._load(f"{offer}: {offer.point.value}", offer.point.load)
                self._loaded[name] = loaded
                if not isinstance(loaded, BrokenPackageError):
                    self._named.append((name, loaded))
            else:
                return None
        found = self._loaded[name]
        if isinstance(found, BrokenPackageError):
            raise found
        return found

    def __missing__(self, name: str) -> T:
        found = self.find(name)
        if found is None:
            raise KeyError(name)
        return found

    @overload
    def get(self, name: str, default: None = None, /) -> T | None: ...

    @overload
    def get(self, name: str, default: T, /) -> T: ...

    @overload
    def get(self, name: str, default: D, /) -> T | D: ...

    def get(self, name: str, default: object = None, /) -> object:
        """The entry of a name; the default if there is none, or if its package is broken."""
        try:
            return self[name]
        except (KeyError, BrokenPackageError):
            return default

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self.get(name) is not None

    def why_broken(self, name: str) -> str:
        """Why the entry of a package cannot be used; '' if it can, or if there is none."""
        try:
            self.find(name)
        except BrokenPackageError as error:
            return str(error)
        return ""

    def library(self) -> tuple[str, ...]:
        """The names of the library's own entries, and of those of its bridges that can be used."""
        ours = [name for name, offer in self.offers().items() if offer.is_ours]
        return (*self, *(name for name in ours if name in self.lazy or not self.why_broken(name)))

    def is_library(self, name: str) -> bool:
        """Whether the entry of a name is the library's own."""
        known = dict.__contains__(self, name) or name in self.lazy
        return known or ((offer := self.offers().get(name)) is not None and offer.is_ours)

    def names(self, own: Iterable[str] | None = None) -> tuple[str, ...]:
        """All names, of the library's perhaps only some; nothing is imported."""
        return (*(self if own is None else own), *self.offers())

    def name_of(self, value: T) -> str:
        """The name under which a package's entry was found; '' if it is no package's."""
        return next((name for name, found in self._named if found is value), "")

    def usable(self) -> dict[str, T]:
        """All entries that can be used; the packages are imported."""
        found = {name: self.get(name) for name in self.names()}
        return {name: entry for name, entry in found.items() if entry is not None}

    def broken(self) -> list[str]:
        """One line for each offer that cannot be used; the packages are imported."""
        unused = [f"{offer} is not used: {offer.unused}" for offer in self._every() if offer.unused]
        reasons = (self.why_broken(name) for name in self.offers())
        return [*_installed().unreadable, *unused, *filter(None, reasons)]

    def offers(self) -> dict[str, Offer]:
        """What is not imported yet: the library's, then the packages', of two names the first."""
        return {offer.point.name: offer for offer in self._every() if not offer.unused}

    def _lazy(self, name: str) -> Offer:
        from importlib.metadata import EntryPoint

        return Offer(OURS, EntryPoint(name, self.lazy[name], PREFIX + self.name))

    def _every(self) -> Iterator[Offer]:
        """All offers, those included that another one or the library hides."""
        yield from map(self._lazy, self.lazy)
        if not self.name:
            return
        first: dict[str, str] = {}
        for package, point in _installed().points.get(PREFIX + self.name, ()):
            reason = ""
            owner = first.setdefault(point.name, package)
            is_taken = dict.__contains__(self, point.name) or point.name in self.lazy
            if is_taken or (owner != package and Offer(owner, point).is_ours):
                reason = "the library has that name itself"
            elif owner != package:
                reason = f"{owner} has that name, too"
            yield Offer(package, point, reason)

    def _load(self, what: str, load: Callable[[], Any]) -> T | BrokenPackageError:
        try:
            found: Any = load()
        except BaseException as error:  # noqa: BLE001 -- a package may raise anything
            reason = f"cannot be imported: {raised_text(error, with_place=False)}"
        else:
            if self.accepts(found):
                entry: T = found
                return entry
            reason = f"is not {self.wanted}"
        return BrokenPackageError(f"{what} {reason}")


def _object(value: str) -> Any:
    """What ``module`` or ``module:attribute`` names."""
    module, _, attribute = value.partition(":")
    found = importlib.import_module(module)
    return getattr(found, attribute) if attribute else found


@dataclass(frozen=True)
class _Installed:
    """The entry points of all packages by group, each with its package; and what is unreadable."""

    points: Mapping[str, list[tuple[str, EntryPoint]]]
    unreadable: list[str]


def _installed() -> _Installed:
    return _offered_on(tuple(sys.path))


@lru_cache(maxsize=1)
def _offered_on(path: tuple[str, ...]) -> _Installed:
    """Our entry points of all packages, the library's first; of equally named ones the first.

    ``importlib.metadata.entry_points`` would fail with the first package whose text is damaged.
    """
    from importlib.metadata import distributions

    points: dict[str, list[tuple[str, EntryPoint]]] = {}
    unreadable, seen = [], set()
    for distribution in distributions(path=list(path)):
        try:
            ours = [p for p in distribution.entry_points if p.group.startswith(PREFIX)]
            name = distribution.metadata["Name"] if ours else ""
        except Exception as error:  # noqa: BLE001 -- importlib.metadata checks no text
            reason = f"its entry points cannot be read: {type(error).__name__}: {error}"
            unreadable.append(f"package {_named(distribution)}: {reason}")
            continue
        if ours and name not in seen:
            seen.add(name)
            for point in ours:
                points.setdefault(point.group, []).append((_named(distribution), point))
    for offers in points.values():
        offers.sort(key=lambda offer: offer[0].partition(" ")[0] != OURS)
    return _Installed(points, unreadable)


def groups() -> tuple[str, ...]:
    """The groups under which packages offer something, ours or misspelt."""
    return tuple(_installed().points)


def _named(distribution: Distribution) -> str:
    """A package's name and version, or where it is if that cannot be read."""
    try:
        return f"{distribution.metadata['Name']} {distribution.version}"
    except Exception:  # noqa: BLE001 -- importlib.metadata checks no text
        return f"in {distribution.locate_file('')}"
