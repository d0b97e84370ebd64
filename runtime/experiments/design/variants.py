"""Variants of a graph: with changes of one's own, or each block taken out alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from runtime.errors import GraphError, UsageError
from runtime.graph import Graph

BASELINE = "baseline"
# A change of these kinds begins a variant of its own, unless it follows a named one.
STARTS = ("without", "bypass", "replace")
Change = tuple[str, str]


@dataclass(frozen=True)
class Variant:
    """A graph with a name; ``changes`` says in words how it differs from the baseline."""

    name: str
    graph: Graph
    changes: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, graph: Graph, baseline: Graph) -> Variant:
        known = len(baseline.overrides)
        return cls(name, graph, tuple(map(str, graph.overrides[known:])))


def grouped(changes: Iterable[Change]) -> tuple[list[Change], list[tuple[str, list[Change]]]]:
    """Changes in the order written, as those of the baseline and those of each variant.

    ``variant NAME`` begins a variant that all changes up to the next one are part of. Without it,
    each ``without``, ``bypass`` and ``replace`` begins one, named after what it does; what else
    follows belongs to it.
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


def check_variants(variants: Sequence[Variant]) -> None:
    """Check that the names differ and that all graphs can run.

    Raises
    ------
    UsageError, GraphError : naming the variant.
    """
    seen: set[str] = {BASELINE}
    for variant in variants:
        name = variant.name
        if not name.strip() or not name.isprintable():
            raise UsageError(f"'{name}' is no name for a variant")
        if name in seen:
            raise UsageError(f"there are two variants '{name}'; give one another name")
        seen.add(name)
        try:
            variant.graph.check()
        except GraphError as error:
            raise UsageError(f"variant '{name}' cannot run:\n{error}") from None


def each_alone(graph: Graph) -> tuple[list[Variant], dict[str, str]]:
    """Every block and part of a graph taken out alone.

    A block with a through-pair is bypassed; others are left out where all that reads them can
    live without.

    Returns
    -------
    The variants, and for each block that the graph needs the input that would stay open.
    """
    removed = graph.network.removed
    variants: list[Variant] = []
    essential: dict[str, str] = {}
    for name in graph.network.scope.all_names():
        if any(gone == name or gone.startswith(f"{name}.") for gone in removed):
            continue
        reason = ""
        for kind in ("bypass", "without"):
            changed: Graph = getattr(graph, kind)(name)
            try:
                changed.check()
            except GraphError as error:
                reason = error.problems[0].text.partition(";")[0]
                continue
            variants.append(Variant.of(f"{kind} {name}", changed, graph))
            break
        else:
            essential[name] = reason
    return variants, essential


def slugs(names: Sequence[str]) -> dict[str, str]:
    """A file name for each variant, no two of them equal."""
    found: dict[str, str] = {}
    for name in names:
        base = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:60] or "variant"
        slug, n = base, 2
        # Some file systems take upper and lower case for the same.
        while slug.lower() in {other.lower() for other in found.values()}:
            slug, n = f"{base}_{n}", n + 1
        found[name] = slug
    return found
