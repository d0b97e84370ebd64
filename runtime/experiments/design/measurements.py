"""Measurements that a graph is fitted to: columns of a file, each beside a signal of the graph.

In: an entry of ``data`` in an experiment file, or ``--to``. Out: :class:`Measurement`::

    push: {file: push.csv, signals: {angle: arm.angle}, set: {arm.load: 0.5}}
    --to push.csv:angle=arm.angle,rate=arm.rate
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from blocks.core import FloatArray, misspelt
from runtime.document import Node
from runtime.errors import Problems, UsageError
from runtime.experiments.design.variants import GraphVariant
from runtime.graph import Graph

KEYS = ("file", "signals", "weights")
EXAMPLE = "as in {angle: arm.angle}"


@dataclass(frozen=True)
class Measurement:
    """What was measured in one run, and the graph that shall reproduce it.

    Parameters
    ----------
    variant : the graph, with what was different in this run.
    file : csv or npz, as the block FromFile reads it.
    signals : addresses of signals by the column that each is compared with.
    weights : of columns; how much the difference counts, 1 by default.
    arrays : times (s) and values by column, in place of a file.
    """

    variant: GraphVariant
    file: Path
    signals: Mapping[str, str]
    weights: Mapping[str, float] = field(default_factory=dict)
    arrays: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)


def parse_measurement(text: str, graph: Graph) -> Measurement:
    """The measurement that ``push.csv:angle=arm.angle,rate=arm.rate`` names.

    Raises
    ------
    UsageError : it has another form.
    """
    # From the right, since a path may have a colon.
    file, colon, pairs = text.rpartition(":")
    signals: dict[str, str] = {}
    for pair in pairs.split(","):
        column, equals, address = (part.strip() for part in pair.partition("="))
        if not (colon and file and equals and column and address):
            raise UsageError(f"--to {text}: expected FILE:COLUMN=SIGNAL, as push.csv:angle=arm.out")
        if column in signals:
            raise UsageError(f"--to {text}: column '{column}' is there twice; keep one")
        signals[column] = address
    return Measurement(GraphVariant(Path(file).stem, graph), Path(file), signals)


def read_measurements(
    section: Node, variants: list[GraphVariant], folder: Path, problems: Problems
) -> Iterator[Measurement]:
    """The measurements of a section whose changes of the graph have been read already."""
    by_name = {variant.name: variant for variant in variants}
    for name, node in section.items() if section.is_map else ():
        if name not in by_name:
            continue
        place = f"data.{name}"
        file, signals, weights = (node.get(key) for key in KEYS)
        if file is None or not isinstance(file.value, str):
            where, got = (node.where, "nothing") if file is None else (file.where, file.describe())
            problems.add(where, f"{place}.file", f"expected a .csv or .npz file, got {got}")
            continue
        addresses, numbers = dict[str, str](), dict[str, float]()
        for column, item in _columns(signals, node, f"{place}.signals", problems):
            if isinstance(item.value, str):
                addresses[column] = item.value
            else:
                text = f"expected the address of a signal, got {item.describe()}"
                problems.add(item.where, f"{place}.signals.{column}", text)
        for column, item in (
            _columns(weights, node, f"{place}.weights", problems) if weights else ()
        ):
            if column not in addresses:
                text = "there is no such column in signals"
                message: str = misspelt("unknown-name", text, column, addresses)
            elif type(item.value) not in (int, float) or not 0.0 < item.value < math.inf:
                message = f"expected a number above 0, got {item.describe()}"
            else:
                numbers[column] = float(item.value)
                continue
            problems.add(item.where, f"{place}.weights.{column}", message)
        yield Measurement(by_name[name], folder / file.value, addresses, numbers)


def _columns(
    node: Node | None, parent: Node, place: str, problems: Problems
) -> Iterable[tuple[str, Node]]:
    """The entries of a mapping that has some."""
    if node is not None and node.is_map and node.value:
        return node.items()
    where, got = (parent.where, "nothing") if node is None else (node.where, node.describe())
    problems.add(where, place, f"expected an entry for each column, {EXAMPLE}, got {got}")
    return ()
