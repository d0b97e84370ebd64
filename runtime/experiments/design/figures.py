"""Figures that an experiment asks for by name, as a paper prints them.

In: an entry of ``figures``. Out: :class:`FigureSpec`::

    error: {metric: miss, over: wind.speed, log: y}         one curve with intervals per variant
    heading: {signal: plant.pose.theta, at: {wind.speed: 2}}    mean over seeds, over time
    plane: {metric: miss, over: [wind.speed, plant.mass], contours: 6}      a map per variant
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from blocks.core import misspelt
from runtime.document import Node, check_keys, flow_yaml
from runtime.errors import GraphError, Problems
from runtime.experiments.design.checks import check_metric
from runtime.experiments.design.factors import Factor
from runtime.graph import Graph

STYLES = ("paper", "paper2", "screen")
LOGS = ("x", "y", "xy")
EXAMPLE = "as in {metric: error, over: params.speed} or {signal: plant.pose.x}"


@dataclass(frozen=True)
class FigureSpec:
    """One figure.

    Parameters
    ----------
    metric, signal : what is shown; one of them is ''.
    over : the factors along its axes; of a signal, the factor with a curve for each value.
    at : the values of other factors, as YAML; without it, a metric is the mean over them.
    log : axes that are logarithmic.
    contours : how many levels of a map are drawn as lines, too.
    variants : those that are shown; all if empty.
    labels : what variants, values and factors are called.
    x, y : labels of the axes; '' for the factor's path, and for the metric or signal.
    style : of the figure.
    """

    name: str
    metric: str = ""
    signal: str = ""
    over: tuple[str, ...] = ()
    at: Mapping[str, str] = field(default_factory=dict)
    log: str = ""
    contours: int = 0
    variants: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    x: str = ""
    y: str = ""
    style: Literal["paper", "paper2", "screen"] = "paper"

    def label(self, name: str) -> str:
        """What a variant, a value or a factor is called."""
        return self.labels.get(name, name)

    def to_dict(self) -> dict[str, Any]:
        """The entry as it is written."""
        entry = {key: getattr(self, key) for key in FIGURE_KEYS}
        plain = {
            key: list(value)
            if isinstance(value, tuple)
            else dict(value)
            if isinstance(value, Mapping)
            else value
            for key, value in entry.items()
        }
        return {key: value for key, value in plain.items() if value}


FIGURE_KEYS = tuple(each.name for each in fields(FigureSpec) if each.name != "name")


def read_figure(
    name: str, node: Node, graph: Graph, factors: Sequence[Factor], problems: Problems
) -> FigureSpec | None:
    """One entry of ``figures``; None, and problems, if it is wrong."""
    before, address = len(problems.items), f"figures.{name}"
    if not node.is_map:
        problems.add(node.where, address, f"expected a figure, {EXAMPLE}, got {node.describe()}")
        return None
    check_keys(node, FIGURE_KEYS, address, problems, "key")
    plain: dict[str, Any] = {key: item.plain() for key, item in node.items()}
    metric, signal = plain.get("metric"), plain.get("signal")
    if (metric is None) == (signal is None):
        problems.add(node.key, address, f"expected a metric or a signal, {EXAMPLE}")
    elif metric is not None:
        check_metric(graph, str(metric), node.value["metric"].where, address, problems)
    else:
        _check_signal(graph, str(signal), node.value["signal"], f"{address}.signal", problems)
    over = plain.get("over", [])
    paths = [over] if isinstance(over, str) else [str(path) for path in over]
    known = [factor.path for factor in factors]
    for key, used in (("over", paths), ("at", list(plain.get("at", {})))):
        for path in (path for path in used if path not in known):
            text, other = (
                f"there is no factor '{path}'",
                f"; there are {', '.join(known) or 'none'}",
            )
            message = misspelt("unknown-name", text, path, known, other)
            problems.add(node.value[key].where, address, message)
    for key, choices in (("log", LOGS), ("style", STYLES)):
        if key in plain and plain[key] not in choices:
            expected = ", ".join(choices)
            got = node.value[key].describe()
            problems.add(node.value[key].where, address, f"{key}: expected {expected}, got {got}")
    if metric is not None and len(paths) not in (1, 2):
        problems.add(node.key, address, "over: expected one factor, or two for a map")
    if len(problems.items) > before:
        return None
    fields = plain | {"over": tuple(paths), "variants": tuple(plain.get("variants", ()))}
    fields["at"] = {path: flow_yaml(value) for path, value in plain.get("at", {}).items()}
    fields["labels"] = {str(k): str(v) for k, v in plain.get("labels", {}).items()}
    return FigureSpec(name, **fields)


def _check_signal(graph: Graph, signal: str, node: Node, address: str, problems: Problems) -> None:
    try:
        probe = with_signal(graph, signal).observation.probes[shown_probe(signal)]
    except GraphError as error:
        text = error.problems[0].text
        problems.add(node.where, address, text)
        return
    if probe.shape not in ((), (1,)):
        message = "expected one number, as plant.pose.x, got several columns"
        problems.add(node.where, address, message)


def shown_probe(signal: str) -> str:
    """The probe that a trial records for a figure."""
    return "shown_" + "".join(c if c.isalnum() else "_" for c in signal)


def with_signal(graph: Graph, signal: str) -> Graph:
    """A graph that records a signal for a figure; unchanged if its variant removes the block."""
    return graph.probe(shown_probe(signal), signal)
