"""The process from which workers are forked: started early, it imports while we check the graph."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections.abc import Iterator
from multiprocessing.context import BaseContext

THREADS = tuple(
    f"{library}_NUM_THREADS"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")
)
# The second is first needed by the first run.
PRELOADED = ["runtime.experiments.worker", "networkx"]


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes that start meanwhile get one thread each for linear algebra.

    The workers are as many as are to run side by side; each with as many threads again would
    only stand in each other's way.
    """
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def worker_context() -> BaseContext:
    """How workers are started: forked from a process that has imported what they need.

    The process is started, unless it is there; where there are none such, workers start afresh.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with single_threaded():
        forkserver.ensure_running()
    return context
