"""How a graph runs: load it, check it, run it at a fixed step, record it and draw it.

    import runtime

    graph = runtime.load("line_actuator_failure")
    result = graph.without("adaptive").run(seed=1)
    result["plant.pose"], result.metrics

Names are imported when they are first used, so that ``import runtime`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.errors import (
        GraphError,
        MissingExtraError,
        SimulationError,
        SpikeblocksError,
        UsageError,
    )
    from runtime.graph import Graph, load
    from runtime.runs import Result
    from runtime.runs import open_run as open

_HOMES = {
    "Graph": ("runtime.graph", "Graph"),
    "load": ("runtime.graph", "load"),
    "open": ("runtime.runs.result", "open_run"),
    "Result": ("runtime.runs.result", "Result"),
    **{
        name: ("runtime.errors", name)
        for name in (
            "GraphError",
            "MissingExtraError",
            "SpikeblocksError",
            "SimulationError",
            "UsageError",
        )
    },
}

__all__ = [
    "Graph",
    "GraphError",
    "MissingExtraError",
    "Result",
    "SimulationError",
    "SpikeblocksError",
    "UsageError",
    "load",
    "open",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'runtime' has no attribute '{name}'")
    return getattr(importlib.import_module(home[0]), home[1])


def __dir__() -> list[str]:
    return sorted(__all__)
