"""The comparison of runs as data: graphs, circumstances, metrics, probes.

In: two or more runs. Out: :class:`Comparison` of each of the others with the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.compare.documents import KeyDifference, differences
from runtime.compare.probes import FirstDifference, Pair, pair
from runtime.compare.runs import Run
from runtime.errors import UsageError
from runtime.network import STATES
from runtime.runs import DIAGRAM, METRICS, PROBES, RESOLVED, WRITTEN

CIRCUMSTANCES = ("status", "error", "ticks", "engine", "git", "versions")
# The files of every run folder; further ones are modules of user-defined blocks.
COMMON_FILES = (WRITTEN, RESOLVED, DIAGRAM, METRICS, PROBES, STATES)


@dataclass(frozen=True)
class RunComparison:
    """One run compared with the first: the probes of both, and those that only one has.

    ``missing`` maps a probe to the label of the run that did not record it.
    """

    run: Run
    pairs: list[Pair]
    missing: dict[str, str]

    @property
    def is_same(self) -> bool:
        """Whether both recorded the same probes at the same times with the same bits."""
        is_whole = not self.missing and all(pair.is_whole for pair in self.pairs)
        return is_whole and not self.first_differences

    @property
    def first_differences(self) -> list[tuple[Pair, FirstDifference]]:
        """Each probe's first difference, the earliest first."""
        first = [(pair, at) for pair in self.pairs if (at := pair.first_difference) is not None]
        return sorted(first, key=lambda item: item[1].tick)


@dataclass(frozen=True)
class Comparison:
    """A comparison of runs; ``others`` compares each of the others with the first.

    graph : differences of the resolved graphs. circumstances : of status, length, commit, versions
    and modules of user-defined blocks. metrics : each metric's value in each run, or None.
    """

    runs: list[Run]
    graph: list[KeyDifference]
    circumstances: list[KeyDifference]
    metrics: dict[str, list[float | None]]
    others: list[RunComparison]

    @property
    def labels(self) -> list[str]:
        return [run.label for run in self.runs]


def compare(
    runs: Sequence[Run], probes: Sequence[str] = (), *, causes_first: bool = False
) -> Comparison:
    """Compare runs with the first one.

    Parameters
    ----------
    runs : two or more.
    probes : names of those to compare; all by default.
    causes_first : list probes in the order in which a tick computes their signals, instead of the
        graph's.

    Raises
    ------
    UsageError : a probe was not recorded by any run, or two runs share no probe and no metric.
    """
    first, *rest = runs
    names = _probes(runs, probes)
    for run in rest:
        _check_shared(first, run)
    if causes_first:
        order = _order(first)
        names = sorted(names, key=lambda name: order.get(name, len(order)))
    metrics = dict.fromkeys(name for run in runs for name in run.result.metrics)
    return Comparison(
        runs=list(runs),
        graph=differences([run.document for run in runs]),
        circumstances=differences([_circumstances(run) for run in runs]),
        metrics={name: [run.result.metrics.get(name) for run in runs] for name in metrics},
        others=[_compare_with_first(first, run, names) for run in rest],
    )


def _circumstances(run: Run) -> dict[str, Any]:
    """What a run's numbers may depend on besides its graph, and its status."""
    manifest = run.result.manifest
    hashes = manifest.get("hashes")
    files = hashes.items() if isinstance(hashes, dict) else ()
    modules = {name: str(digest)[:12] for name, digest in files if name not in COMMON_FILES}
    known = {key: manifest[key] for key in CIRCUMSTANCES if key in manifest}
    return known | ({"modules": modules} if modules else {})


def _probes(runs: Sequence[Run], selection: Sequence[str]) -> list[str]:
    known = list(dict.fromkeys(name for run in runs for name in run.result.probes))
    for name in selection:
        if name not in known:
            from blocks.core import hint

            suggestion = hint(name, known) or f"; there are {', '.join(known) or 'none'}"
            raise UsageError(f"no run has a probe '{name}'{suggestion}")
    return list(dict.fromkeys(selection)) or known


def _check_shared(a: Run, b: Run) -> None:
    """Check that two runs share a probe or a metric."""
    if set(a.result.probes) & set(b.result.probes) or set(a.result.metrics) & set(b.result.metrics):
        return
    titles = " and ".join(f"'{run.folder}' (graph {run.result.title})" for run in (a, b))
    raise UsageError(f"nothing to compare: {titles} share no probe and no metric")


def _compare_with_first(first: Run, run: Run, names: Iterable[str]) -> RunComparison:
    dt = float(first.result.manifest["dt"])
    here, there = first.result.probes, run.result.probes
    pairs = [pair(here[n], there[n], dt) for n in names if n in here and n in there]
    missing = {
        name: (run if name in here else first).label
        for name in names
        if (name in here) != (name in there)
    }
    return RunComparison(run, pairs, missing)


def _order(run: Run) -> dict[str, int]:
    """The index of each probe in the order in which a tick computes their signals.

    Empty for a run folder of an earlier version, which does not have it.
    """
    order = run.result.manifest.get("order")
    names = order if isinstance(order, list) else []
    return {name: i for i, name in enumerate(names) if isinstance(name, str)}
