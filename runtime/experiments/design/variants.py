"""Variants of a graph: with given changes, or with one block removed.

In: a graph, and changes as a command line has them. Out: graphs with names::

    --set a=1 --without x --set b=2 --bypass y
    ->  baseline with a=1; "without x" with b=2; "bypass y"
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from blocks.core import hint
from runtime.errors import GraphError, UsageError
from runtime.files import slug
from runtime.graph import Graph

BASELINE = "baseline"
# A change of these kinds begins a new variant, unless it follows a named one.
STARTS = ("without", "bypass", "replace")
Change = tuple[str, str]


@dataclass(frozen=True)
class GraphVariant:
    """A graph with a name; ``changes`` describes how it differs from the baseline."""

    name: str
    graph: Graph
    changes: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, graph: Graph, baseline: Graph) -> GraphVariant:
        known = len(baseline.overrides)
        return cls(name, graph, tuple(map(str, graph.overrides[known:])))


def group_changes(changes: Iterable[Change]) -> tuple[list[Change], list[tuple[str, list[Change]]]]:
    """Split changes, in the order written, into those of the baseline and of each variant.

    ``variant NAME`` begins a variant, which has all changes up to the next ``variant``. Without it,
    each ``without``, ``bypass`` and ``replace`` begins a variant named after the change; other
    changes belong to the variant that they follow.
    """
    common: list[Change] = []
    variants: list[tuple[str, list[Change]]] = []
    is_named = False
    for kind, text in changes:
        if kind == "variant":
            variants.append((text, []))
            is_named = True
        elif kind in STARTS and not is_named:
            variants.append((f"{kind} {text}", [(kind, text)]))
        else:
            (variants[-1][1] if variants else common).append((kind, text))
    return common, variants


def check_variants(variants: Sequence[GraphVariant]) -> None:
    """Check that the names are unique and that all graphs can run.

    Raises
    ------
    UsageError : a name is invalid or a graph cannot run; the message names the variant.
    """
    seen: set[str] = {BASELINE}
    for variant in variants:
        name = variant.name
        if not name.strip() or not name.isprintable():
            raise UsageError(f"'{name}' is not a valid name for a variant")
        if name in seen:
            raise UsageError(f"duplicate variant '{name}'; rename one of them")
        seen.add(name)
        try:
            variant.graph.check()
        except GraphError as error:
            raise UsageError(f"variant '{name}' cannot run:\n{error}") from None


def check_contrasts(contrasts: Iterable[tuple[str, str]], variants: Sequence[GraphVariant]) -> None:
    """Check that the variants that are compared with each other exist.

    Raises
    ------
    UsageError : one does not.
    """
    names = [BASELINE, *(variant.name for variant in variants)]
    for name in (name for pair in contrasts for name in pair):
        if name not in names:
            known = hint(name, names) or f"; there are {', '.join(names)}"
            raise UsageError(f"contrasts: there is no variant '{name}'{known}")


def removals(graph: Graph) -> tuple[list[GraphVariant], dict[str, str]]:
    """Variants that each remove one block or part of a graph.

    A block with a pass-through is bypassed. Another block is removed if every input wired to it is
    optional.

    Returns
    -------
    The variants, and for each essential block the error that its removal causes.
    """
    removed = graph.network.removed_entries.values()
    variants: list[GraphVariant] = []
    essential: dict[str, str] = {}
    for name in graph.network.scope.all_names():
        if any(other.is_named(name) for other in removed):
            continue
        reason = ""
        # Bypassed if that is possible: a loop stays closed, and the block's own effect is measured,
        # not that of an open loop.
        for kind in ("bypass", "without"):
            changed: Graph = getattr(graph, kind)(name)
            try:
                changed.check()
            except GraphError as error:
                reason = error.problems[0].text.partition(";")[0]
                continue
            variants.append(GraphVariant.of(f"{kind} {name}", changed, graph))
            break
        else:
            essential[name] = reason
    return variants, essential


def slugs(names: Sequence[str]) -> dict[str, str]:
    """A unique file name for each variant."""
    unique_names: dict[str, str] = {}
    for name in names:
        base = slug(name.replace(".", " "), "variant")[:60]
        unique, n = base, 2
        # Some file systems do not distinguish upper and lower case.
        while unique.lower() in {other.lower() for other in unique_names.values()}:
            unique, n = f"{base}_{n}", n + 1
        unique_names[name] = unique
    return unique_names
