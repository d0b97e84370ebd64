"""Every metric and every plot through YAML: with the options that it requires, and one more."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import runtime
from blocks.core.params import Param
from runtime.document import dump_yaml
from runtime.observation import METRIC_KINDS, OF_RUN, PLOT_KINDS
from tests.runtime.plots.test_every_kind import CASES
from tests.runtime.plots.test_map import graph

# What a value must be beyond its own declaration.
SPECIAL: dict[str, Any] = {
    "below": 1e9,  # expectations of a value that need not exist here
    "above": -1e9,
    "compare": "set=go.value=[0.1, 0.1]",
    "events": None,  # names a probe of events
    "expression": "u[0]",
    "scale": 2.0,
    "low": 0.2,
    "high": 0.8,
    "until": 0.3,
    "turning_radius": 0.1,
    "size": [6.0, 4.0],
    "angles": [-1.0, 1.0],
}
SIGNALS = {"position": "plant.pose", "columns": "go.value", "number": "wave.out"}


def written(declared: Param) -> Any:
    """A value that fits a declaration; None where only a special one would."""
    if declared.name in SPECIAL:
        return SPECIAL[declared.name]
    if declared.choices:
        return declared.choices[-1]
    number = 0.2 if declared.at_most is None else declared.at_most
    if declared.kind == "array":
        if () in declared.shapes or not declared.shapes:
            return number
        return [number + i for i in range(int(declared.shapes[0][0] or 2))]
    values = {"float": number, "int": 3, "bool": not declared.default, "str": "a"}
    return values[declared.kind]


def metric(kind: str) -> dict[str, Any]:
    """An entry of a metric with its required options alone."""
    declared = METRIC_KINDS[kind]
    entry: dict[str, Any] = {"kind": kind}
    signal = SIGNALS[declared.forms[-1]]
    if kind in ("firing_rate", "synaptic_operations"):
        signal = "e.spikes"
    entry |= dict.fromkeys(declared.inputs, signal)
    options = declared.options.declared.items()
    entry |= {name: written(each) for name, each in options if each.required}
    if kind == "lqr_cost":
        entry |= {"q": [1.0, 1.0], "r": [1.0, 1.0]}
    return entry


def plot(kind: str) -> dict[str, Any]:
    """The same of a plot."""
    declared = PLOT_KINDS[kind].options.declared.items()
    required = {name: written(each) for name, each in declared if each.required}
    return {"kind": kind, "of": CASES[kind][0]["of"], **required}


def with_one_more(entry: dict[str, Any], declared: Any) -> Iterator[dict[str, Any]]:
    yield entry
    for name, each in declared.items():
        value = written(each) if name not in entry else None
        if entry["kind"] == "lqr_cost" and name == "q_final":
            value = [1.0, 1.0]
        if value is not None:
            yield {**entry, name: value}


def loaded(folder: Path, section: str, entries: dict[str, Any]) -> runtime.Graph:
    """A graph that was written as YAML, with entries in one of its sections."""
    plain = graph(run={"dt": 0.001, "until": 0.4, "seed": 0}, plots={}, metrics={})
    plain["blocks"] |= {
        "wave": {"type": "Function", "expression": "sin(4 * t)"},
        "e": {"type": "Ensemble", "neurons": 5},
        "d": {"type": "Decoder"},
    }
    plain["wires"] |= {"e": {"input": "wave.out"}, "d": {"spikes": "e.spikes"}}
    path = folder / "graph.yaml"
    path.write_text(dump_yaml({**plain, section: entries}), encoding="utf-8")
    return runtime.load(path)


def entries(section: str, kind: str) -> dict[str, Any]:
    """Entries of a kind, each with another set of options."""
    first, kinds = (metric, METRIC_KINDS) if section == "metrics" else (plot, PLOT_KINDS)
    declared = kinds[kind].options.declared
    several = with_one_more(first(kind), declared)
    return {f"{kind}_{i}": entry for i, entry in enumerate(several)}


@pytest.mark.parametrize(
    ("section", "kind"),
    [*(("metrics", kind) for kind in METRIC_KINDS), *(("plots", kind) for kind in PLOT_KINDS)],
)
def test_a_kind_is_checked_with_what_it_requires_and_one_more(
    section: str, kind: str, tmp_path: Path
) -> None:
    loaded(tmp_path, section, entries(section, kind)).check()


def test_every_metric_is_measured_with_what_it_requires(tmp_path: Path) -> None:
    kinds = [kind for kind in METRIC_KINDS if kind not in OF_RUN]
    result = loaded(tmp_path, "metrics", {kind: metric(kind) for kind in kinds}).run()
    assert result.metrics.keys() == set(kinds)


@pytest.mark.slow
def test_every_metric_and_plot_runs_with_one_more_option(tmp_path: Path) -> None:
    every = {name: each for kind in METRIC_KINDS for name, each in entries("metrics", kind).items()}
    assert loaded(tmp_path, "metrics", every).run().metrics.keys() == every.keys()
    plots = {name: each for kind in PLOT_KINDS for name, each in entries("plots", kind).items()}
    assert loaded(tmp_path, "plots", plots).run().plot().keys() == plots.keys()
