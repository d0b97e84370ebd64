"""How a graph runs: load it, check it, run it at a fixed step, record it and draw it.

    import runtime

    graph = runtime.load("line_actuator_failure")
    result = graph.without("adaptive").run(seed=1)
    result["plant.pose"], result.metrics

A step through a first-order lag with a time constant of 0.1 s:

>>> import blocks, runtime
>>> graph = runtime.Graph("lag", dt=0.01, until=0.5)
>>> graph = graph.add("one", blocks.Constant(value=1.0)).add("lag", blocks.Lowpass(tau=0.1))
>>> graph = graph.connect("one.value", "lag.input").probe("lag.out")
>>> result = graph.run()
>>> result.status, round(float(result["lag.out"][-1]), 3)
('complete', 0.993)

A variant, and what is wrong with another one:

>>> graph.set("lag.tau", 0.2).run()["lag.out"].shape
(50,)
>>> graph.without("lagg")
Traceback (most recent call last):
runtime.errors.GraphError: without: without[0]: there is no block 'lagg', did you mean 'lag'?

Names are imported when they are first used, so that ``import runtime`` costs next to nothing.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

PACKAGE = str(Path(__file__).parents[1])


def _check_blocks() -> None:
    """Report a folder or file of the user's own that Python finds instead of our ``blocks``."""
    found = importlib.util.find_spec("blocks")
    # A folder without __init__.py has no origin.
    places = [] if found is None else [found.origin, *(found.submodule_search_locations or ())]
    own = next(filter(None, places), "")
    ours = Path(PACKAGE, "blocks", "__init__.py")
    if ours.is_file() and not (own and Path(own).exists() and ours.samefile(own)):
        raise ImportError(
            f"your own '{own or 'blocks'}' hides the package 'blocks' of spikeblocks; rename it, "
            "or start Python in another folder"
        )


# Before the first import of ours that another package 'blocks' does not have.
_check_blocks()
from blocks.library.lazy import door  # noqa: E402

if TYPE_CHECKING:
    from runtime.checking import CheckError, NotCompiledWarning, check_block
    from runtime.errors import (
        GraphError,
        MissingExtraError,
        SimulationError,
        SpikeblocksError,
        UsageError,
    )
    from runtime.experiments import AblationTable, SweepTable, TuningTable, ablate, sweep, tune
    from runtime.fitting import Fit, fit
    from runtime.graph import Graph, load
    from runtime.runs import Result
    from runtime.runs import open_run as open
    from runtime.sessions import Session
else:
    __getattr__ = door(__name__)

__all__ = [
    "AblationTable",
    "CheckError",
    "Fit",
    "Graph",
    "GraphError",
    "MissingExtraError",
    "NotCompiledWarning",
    "Result",
    "Session",
    "SimulationError",
    "SpikeblocksError",
    "SweepTable",
    "TuningTable",
    "UsageError",
    "ablate",
    "check_block",
    "fit",
    "load",
    "open",
    "sweep",
    "tune",
]


def __dir__() -> list[str]:
    return sorted(__all__)
