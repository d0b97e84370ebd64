"""The response of one block in a graph to given inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import runtime

Array = npt.NDArray[np.float64]


def respond(
    entry: Mapping[str, Any],
    inputs: Mapping[str, Any] | None = None,
    ticks: int = 0,
    dt: float = 0.01,
    of: str = "out",
    **run: Any,
) -> Array:
    """What a block's output is in each tick.

    Parameters
    ----------
    entry : the block as a graph writes it. inputs : by port, one row per tick; for an input that
        takes many wires a list of such arrays.
    """
    blocks: dict[str, Any] = {"it": dict(entry)}
    wires: dict[str, Any] = {}
    for port, rows in (inputs or {}).items():
        several = isinstance(rows, list)
        names = []
        for number, row in enumerate(rows if several else [rows]):
            values = np.asarray(row, float)
            ticks = len(values)
            names.append(f"{port}_{number}.out")
            times = dt * np.arange(ticks)
            blocks[f"{port}_{number}"] = {
                "type": "Piecewise",
                "times": times.tolist(),
                "values": values.tolist(),
            }
        wires[port] = names if several else names[0]
    graph = {
        "run": {"dt": dt, "until": ticks * dt, "engine": "python", **run},
        "blocks": blocks,
        "probes": {"y": f"it.{of}"},
    }
    if wires:
        graph["wires"] = {"it": wires}
    return np.asarray(runtime.load(graph).run()["y"])


def problems(entry: Mapping[str, Any], wires: Sequence[str] = (), port: str = "input") -> str:
    """The message of a graph with one block that is wrong; one wire of each given type."""
    blocks: dict[str, Any] = {"it": dict(entry)}
    for i, kind in enumerate(wires):
        blocks[f"c{i}"] = {"type": "Constant", **SOURCES[kind]}
    sources = [f"c{i}.value" for i in range(len(wires))]
    graph: dict[str, Any] = {"run": {"dt": 0.01, "until": 0.1}, "blocks": blocks}
    if sources:
        graph["wires"] = {"it": {port: sources if len(sources) > 1 else sources[0]}}
    try:
        runtime.load(graph).check()
    except runtime.GraphError as error:
        return str(error)
    return ""


SOURCES = {
    "Scalar": {"value": 1.0},
    "Twist": {"value": [1.0, 2.0], "signal": "Twist"},
    "Vector": {"value": [1.0, 2.0, 3.0], "signal": "Vector"},
}
