"""What other packages offer under an entry point group: each is imported only when it is needed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

T = TypeVar("T")


class BrokenPackageError(ImportError):
    """What an installed package offers cannot be used; the message names both, and the cause."""


class Installed(Generic[T]):
    """The entry points of one group, by name.

    A package that cannot be imported, or that offers something else, does not keep the others from
    being used: it is an error where its own name is asked for, and one line of :meth:`broken`.

    Parameters
    ----------
    group : the name of the group, as in ``[project.entry-points."spikeblocks.blocks"]``.
    accepted : whether an object is of the kind that the group is for.
    wanted : that kind in words, as in "a subclass of Block".
    taken : names of the library itself, which a package cannot offer.
    """

    def __init__(
        self,
        group: str,
        accepted: Callable[[object], bool],
        wanted: str,
        taken: Collection[str] = (),
    ) -> None:
        self.group, self.accepted, self.wanted, self.taken = group, accepted, wanted, taken
        self._points: dict[str, tuple[str, EntryPoint]] | None = None
        self._found: dict[str, T | BrokenPackageError] = {}
        self._unusable: list[str] = []

    def names(self) -> list[str]:
        """All names that are offered; nothing is imported."""
        return list(self._offers())

    def find(self, name: str) -> T | None:
        """What is offered under a name; None if there is no such name.

        Raises
        ------
        BrokenPackageError : the package cannot be imported, or offers something of another kind.
        """
        if name not in self._offers():
            return None
        if name not in self._found:
            self._found[name] = self._loaded(name)
        found = self._found[name]
        if isinstance(found, BrokenPackageError):
            raise found
        return found

    def name_of(self, value: T) -> str:
        """The name of an object that was found; '' if it is no package's, or not found yet."""
        return next((name for name, found in self._found.items() if found is value), "")

    def usable(self) -> dict[str, T]:
        """All that can be used, by name; the packages are imported."""
        found: dict[str, T] = {}
        for name in self.names():
            try:
                offered = self.find(name)
            except BrokenPackageError:
                continue
            if offered is not None:
                found[name] = offered
        return found

    def broken(self) -> list[str]:
        """One line for each offer that cannot be used; the packages are imported."""
        self.usable()
        failed = [str(e) for e in self._found.values() if isinstance(e, BrokenPackageError)]
        return [*self._unusable, *failed]

    def _loaded(self, name: str) -> T | BrokenPackageError:
        package, point = self._offers()[name]
        try:
            offered = point.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 -- a package may raise anything
            reason = f"cannot be imported: {type(error).__name__}: {error}"
        else:
            if self.accepted(offered):
                found: T = offered
                return found
            reason = f"is not {self.wanted}"
        return BrokenPackageError(f"'{name}' of package {package}: {point.value} {reason}")

    def _offers(self) -> dict[str, tuple[str, EntryPoint]]:
        """The entry points by name, each with its package; of two of one name, the first."""
        if self._points is not None:
            return self._points
        points: dict[str, tuple[str, EntryPoint]] = {}
        for package, point in self._read():
            other, _ = points.get(point.name, (package, point))
            if point.name in self.taken:
                reason = "the library has that name itself"
            elif other != package:
                reason = f"{other} has that name, too"
            else:
                points[point.name] = package, point
                continue
            self._unusable.append(f"'{point.name}' of package {package} is not used: {reason}")
        self._points = points
        return points

    def _read(self) -> Iterator[tuple[str, EntryPoint]]:
        """Each entry point of the group with its package; the first of equally named packages.

        ``importlib.metadata.entry_points`` would fail with the first package whose text is damaged.
        """
        from importlib.metadata import distributions

        seen = set()
        for distribution in distributions():
            try:
                offers = distribution.entry_points.select(group=self.group)
                name = distribution.metadata["Name"] if offers else ""
            except Exception as error:  # noqa: BLE001 -- importlib.metadata checks no text
                reason = f"its entry points cannot be read: {type(error).__name__}: {error}"
                self._unusable.append(f"package {_named(distribution)}: {reason}")
                continue
            if offers and name not in seen:
                seen.add(name)
                yield from ((_named(distribution), point) for point in offers)


def _named(distribution: Distribution) -> str:
    """A package's name and version, or where it is if that cannot be read."""
    try:
        return f"{distribution.metadata['Name']} {distribution.version}"
    except Exception:  # noqa: BLE001 -- importlib.metadata checks no text
        return f"in {distribution.locate_file('')}"
