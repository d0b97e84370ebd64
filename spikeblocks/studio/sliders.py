"""The numbers of a graph that sliders change while it runs.

In: a checked graph. Out: one entry for each number of its inputs, of ``params``, and of parameters
that may change during a run, with bounds that make sense: from nothing to twice the value, as far
as the declaration allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from blocks.core import plain
from runtime.document import Node
from runtime.language import place_of
from runtime.network import Network, NetworkEntry

MOST = 400
COMPONENTS = 4  # of an array that has sliders


def sliders_of(network: Network, document: Node) -> list[dict[str, Any]]:
    """All sliders of a graph, the first ``MOST``."""
    found = [*_inputs(network), *_params(document)]
    for name, entry in network.entries.items():
        if len(found) >= MOST:
            break
        found += _parameters(name, entry, document)
    return found[:MOST]


def path_of(name: str, key: str) -> str:
    """The path of a parameter of a block, which may be inside parts."""
    return f"blocks.{'.blocks.'.join(name.split('.'))}.{key}"


def is_number(value: Any) -> bool:
    """Whether a value is one finite number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _inputs(network: Network) -> Iterator[dict[str, Any]]:
    for port in network.inputs.values():
        given = [float(x) for x in _flat(0.0 if port.default is None else port.default)]
        lows, highs = _flat(port.low), _flat(port.high)
        for i, number in enumerate(given):
            low, high = float(lows[i % len(lows)]), float(highs[i % len(highs)])
            reach = 2.0 * abs(number) or 1.0
            low = low if math.isfinite(low) else min(-reach, high - reach)
            high = high if math.isfinite(high) else max(reach, low + reach)
            made = _slider("inputs", port.name, f"inputs.{port.name}", given, i, (low, high))
            yield made | {"port": port.name, "doc": port.doc}


def _params(document: Node) -> Iterator[dict[str, Any]]:
    params = document.get("params")
    for name, node in params.items() if params is not None else ():
        if is_number(node.value):
            value = float(node.value)
            yield _slider("params", name, f"params.{name}", [value], 0, _range(value))


def _parameters(name: str, entry: NetworkEntry, document: Node) -> Iterator[dict[str, Any]]:
    """The tunable numbers of a block whose value is not one of ``params``."""
    block = entry.block_or_none
    for key, declared in entry.cls.spec.params.items() if block is not None else ():
        path = path_of(name, key)
        if block is None or not block.is_tunable(key) or place_of(document, path) != path:
            continue
        value = plain(block.value(key))
        numbers = value if isinstance(value, list) else [value]
        if not 0 < len(numbers) <= COMPONENTS or not all(map(is_number, numbers)):
            continue
        for i, number in enumerate(numbers):
            low, high = _range(float(number))
            low = max([low, *_given(declared.above, declared.at_least)])
            high = min([high, *_given(declared.below, declared.at_most)])
            made = _slider(name, key, path, [float(x) for x in numbers], i, (low, high))
            units = declared.units
            made |= {"unit": units[i % len(units)], "doc": declared.doc}
            yield made | {"list": isinstance(value, list)}


def _given(*bounds: float | None) -> list[float]:
    return [bound for bound in bounds if bound is not None]


def _slider(
    group: str, label: str, path: str, given: list[float], index: int, ends: tuple[float, float]
) -> dict[str, Any]:
    name = label if len(given) == 1 else f"{label}[{index}]"
    made: dict[str, Any] = {"group": group, "label": name, "path": path, "value": given[index]}
    made |= {"low": ends[0], "high": ends[1], "all": given, "index": index, "port": ""}
    return made | {"list": len(given) > 1, "unit": "", "doc": ""}


def _range(value: float) -> tuple[float, float]:
    """From nothing to twice a value, or to the other side of a negative one."""
    if value == 0.0:
        return -1.0, 1.0
    return (0.0, 2.0 * value) if value > 0 else (2.0 * value, 0.0)


def _flat(value: Any) -> list[Any]:
    found = plain(value)
    return found if isinstance(found, list) else [found]
