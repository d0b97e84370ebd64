"""Sliders of a page: a value of a graph, and the numbers of the exported step that follow from it.

In go texts such as ``fault.gain[1]=0..1``, out come positions and, for each, the numbers that the
step then has. Most values are such a number themselves; where others follow from it (a time
constant, and the share of a filter's step), the graph is prepared once for each position, so that
the page computes what a run of the changed graph would::

    gain.gain=0..4      gain.gain itself
    filter.tau=0.1..1   101 positions, with filter.share at each
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import Setting, hint
from runtime.errors import SpikeblocksError, UsageError
from runtime.export import Layout, Units
from runtime.graph import Graph
from runtime.network import PortDeclaration

STEPS, TABLE_STEPS = 200, 40
USUAL = 6  # sliders of a page for which none is named
TEXT = re.compile(r"([^=]+)=(.+?)\.\.(.+)")
INDEX = re.compile(r"(.+?)\[(\d+)\]")
INDEXED = re.compile(r"^inputs\.|\[\d+\]$")
Key = tuple[str, str, int]  # a block, a word of its struct, and the index in an array
Prepare = Callable[[Graph], Units]


@dataclass(frozen=True)
class Slider:
    """A slider.

    label, doc, unit : as its parameter is declared. value : what the graph has.
    numbers : of its positions. places : of the numbers that follow, in the struct of parameters.
    tables : of each of these, the number at each position; None if it is the value itself.
    is_input : whether the places are in the struct of inputs.
    """

    label: str
    doc: str
    unit: str
    value: float
    numbers: tuple[float, ...]
    places: tuple[int, ...]
    tables: tuple[tuple[float, ...], ...] | None = None
    is_input: bool = False

    def as_dict(self) -> dict[str, Any]:
        """What the page gets."""
        nearest = min(range(len(self.numbers)), key=lambda i: abs(self.numbers[i] - self.value))
        numbers = list(self.numbers)
        tables = None if self.tables is None else [list(each) for each in self.tables]
        if tables is None:
            numbers[nearest] = self.value  # back at its position, it is what the graph has
        return {
            **{"label": self.label, "doc": self.doc, "unit": self.unit, "exact": self.value},
            **{"numbers": numbers, "steps": len(numbers) - 1, "first": nearest},
            **{"places": list(self.places), "tables": tables, "input": self.is_input},
        }


def given(layout: Layout) -> list[float]:
    """What the inputs of a page begin with: the defaults of the graph's ports."""
    ports = {(p.end.block, p.end.port): p for p in layout.selection.network.inputs.values()}
    values = [ports[port].default for port in layout.selection.inputs]
    return [x for value in values for x in np.ravel(0.0 if value is None else value).tolist()]


def usual(graph: Graph, layout: Layout) -> list[str]:
    """Sliders for a graph for which none is named: its inputs with bounds, and parameters that a
    step uses as they are."""
    found = []
    for port in graph.network.inputs.values():
        for at in np.ndindex(port.low.shape):
            if np.isfinite([port.low[at], port.high[at]]).all():
                index = "".join(f"[{i}]" for i in at)
                low, high = float(port.low[at]), float(port.high[at])
                found.append(f"{port.name}{index}={low!r}..{high!r}")
    written = graph.to_dict().get("params")
    for name, value in (written if isinstance(written, Mapping) else {}).items():
        if isinstance(value, (int, float)) and not isinstance(value, bool) and value:
            low, high = sorted((0.2 * value, 2.0 * value))
            found.append(f"{name}={low!r}..{high!r}")
    for block in dict.fromkeys(block for block, _ in layout.parameters):
        entry = graph.network.entries[block]
        for name, declared in entry.cls.spec.params.items():
            value = entry.block.value(name)
            numbers = {f"{block}.{name}": value}
            numbers |= {f"{block}.{name}.{key}": each for key, each in _written(value).items()}
            found += [
                f"{address}={low!r}..{high!r}"
                for address, number in numbers.items()
                if isinstance(number, float) and number and math.isfinite(number) and name != "dt"
                for low, high in [_range(number, declared)]
            ]
    return found


def _written(value: Any) -> Mapping[str, Any]:
    """The names with their values of a parameter that has such; otherwise none."""
    written = value.written() if isinstance(value, Setting) else value
    return written if isinstance(written, Mapping) else {}


def _range(value: float, declared: Any) -> tuple[float, float]:
    """From nearly nothing to twice a value, as far as its declaration allows."""
    low, high = sorted((0.1 * value, 2.0 * value))
    for bound in (declared.below, declared.at_most):
        high = high if bound is None else min(high, bound - 1e-6 * (bound == declared.below))
    return low, high


def sliders(
    graph: Graph, layout: Layout, prepare: Prepare, texts: Sequence[str], strict: bool
) -> list[Slider]:
    """The sliders of these texts.

    Parameters
    ----------
    prepare : the C text of a graph's blocks, with the numbers that they start with.
    strict : whether one that is not possible is an error; otherwise it is left out.

    Raises
    ------
    UsageError : a text is wrong, or its value changes more than numbers of the step.
    """
    found = []
    for text in texts:
        try:
            found.append(_slider(graph, layout, prepare, text))
        except SpikeblocksError:
            if strict:
                raise
        if not strict and len(found) == USUAL:
            break
    return found


def _slider(graph: Graph, layout: Layout, prepare: Prepare, text: str) -> Slider:
    what = TEXT.fullmatch(text.strip())
    try:
        low, high = (float(each) for each in what.groups()[1:]) if what else (0.0, 0.0)
    except ValueError:
        low = high = math.nan
    if what is None or not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise UsageError(f"--slider: expected NAME=LOW..HIGH such as gain.gain=0..2, got '{text}'")
    name = what[1].strip()
    if (port := INDEXED.sub("", name)) in graph.network.inputs:
        return _of_input(layout, graph.network.inputs[port], name, low, high)
    address, value, declared = _found(graph, name)

    def with_value(number: float) -> Mapping[Key, float]:
        return _numbers(layout, prepare(graph.set(address, _placed(graph, name, number))), name)

    before = _numbers(layout, layout.units, name)
    ends = {number: with_value(number) for number in (low, 0.5 * (low + high), high)}
    keys = [key for key in before if any(each[key] != before[key] for each in ends.values())]
    if not keys:
        raise UsageError(f"--slider: nothing that a step computes depends on '{name}'")
    every = [(*key, i) for key, each in layout.parameters.items() for i in range(each.size)]
    order = {key: place for place, key in enumerate(every)}
    doc, unit = (declared.doc, declared.unit) if declared is not None else ("", "")
    places = tuple(order[key] for key in keys)
    if all(each[key] == number for number, each in ends.items() for key in keys):
        numbers = np.linspace(low, high, STEPS + 1).tolist()
        return Slider(name, doc, unit, value, tuple(numbers), places)
    # The graph's own value is a position, so that the page begins with the graph.
    numbers = sorted({*np.linspace(low, high, TABLE_STEPS + 1).tolist(), value})
    rows = [before if number == value else with_value(number) for number in numbers]
    tables = tuple(tuple(row[key] for row in rows) for key in keys)
    return Slider(name, doc, unit, value, tuple(numbers), places, tables)


def _of_input(layout: Layout, port: PortDeclaration, name: str, low: float, high: float) -> Slider:
    """The slider of one number of an input of the graph."""
    first = 0
    for end in layout.selection.inputs:
        if end == (port.end.block, port.end.port):
            break
        first += layout.count(end)
    else:
        raise UsageError(f"--slider: nothing reads the input '{name}'")
    count, indexed = math.prod(port.type.shape), INDEX.fullmatch(name)
    index = int(indexed[2]) if indexed else 0
    if (indexed is None) != (port.type.form == "scalar") or index >= count:
        message = f"--slider: '{name}' is no number of the input; expected "
        names = port.name if port.type.form == "scalar" else f"{port.name}[0..{count - 1}]"
        raise UsageError(message + names)
    try:
        for end_value in (low, high):
            port.value(end_value)
    except ValueError as error:
        raise UsageError(f"--slider: {error}") from None
    units = port.unit.split(", ")
    value = 0.0 if port.default is None else float(np.ravel(port.default)[index])
    numbers = tuple(np.linspace(low, high, STEPS + 1).tolist())
    unit = units[index] if len(units) == count else port.unit
    return Slider(name, port.doc, unit, value, numbers, (first + index,), None, True)


def _found(graph: Graph, name: str) -> tuple[str, float, Any]:
    """The address of a value, what it is, and its declaration if it is a block's parameter."""
    indexed = INDEX.fullmatch(name)
    plain, index = (indexed[1], int(indexed[2])) if indexed else (name, None)
    entries = graph.network.entries
    address, declared = f"blocks.{plain}", None
    for block in sorted(entries, key=len, reverse=True):
        parameter, _, key = plain.removeprefix(f"{block}.").partition(".")
        if plain.startswith(f"{block}.") and parameter in entries[block].cls.spec.params:
            value = entries[block].block.value(parameter)
            value = _written(value).get(key) if key else value
            declared = entries[block].cls.spec.params[parameter]
            break
    else:
        written = graph.to_dict().get("params")
        params = written if isinstance(written, Mapping) else {}
        if plain not in params:
            known = [f"{each}.{p}" for each, e in entries.items() for p in e.cls.spec.params]
            known += graph.network.inputs
            found = hint(name, (*known, *params))
            raise UsageError(f"--slider: '{graph.network.title}' has no value '{name}'{found}")
        value, address = params[plain], f"params.{plain}"
    try:
        number = float(value if index is None else np.asarray(value)[index])
    except (TypeError, ValueError, IndexError):
        message = f"--slider: '{name}' is not a number"
        if np.ndim(value) == 1 and index is None:
            message += f" but {len(value)}; name one, such as {name}[0]"
        raise UsageError(message) from None
    return address, number, declared


def _placed(graph: Graph, name: str, number: float) -> Any:
    """The value of a parameter with one number in it."""
    indexed = INDEX.fullmatch(name)
    if indexed is None:
        return number
    block, _, parameter = indexed[1].rpartition(".")
    made = graph.network.entries[block].block
    values: list[float] = np.asarray(made.value(parameter), dtype=float).tolist()
    values[int(indexed[2])] = number
    return values


def _numbers(layout: Layout, units: Units, name: str) -> dict[Key, float]:
    """The numbers of the parameters' struct in another graph.

    Raises
    ------
    UsageError : something else is different, too.
    """
    found: dict[Key, float] = {}
    for block, text in layout.units.blocks.items():
        other = units.blocks.get(block)
        if other is None or (other.prefix, other.words) != (text.prefix, text.words):
            raise UsageError(
                f"--slider: '{name}' changes how '{block}' computes, not only a number"
            )
        for (word, _), mine, its in zip(text.words, text.values, other.values, strict=True):
            if (block, word) in layout.parameters and np.shape(mine) == np.shape(its):
                numbers = np.ravel(its).tolist()
                found |= {(block, word, i): float(each) for i, each in enumerate(numbers)}
            elif not np.array_equal(mine, its, equal_nan=np.asarray(mine).dtype.kind == "f"):
                what = word.partition("_")[2]
                raise UsageError(
                    f"--slider: '{name}' changes '{block}.{what}', which a step does not take from "
                    "its parameters"
                )
    return found
