"""Python objects of a Nengo network that run within a graph: functions, processes.

In: a callable of the time and the input. Out: the text of a block's class that calls it, for a
graph that lives no longer than the process::

    live_block("node", lambda t, u: np.sin(t), size_in=0, size=1)

Nothing of it is written for a user: an import of a model writes the function's source instead.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray

Call = Callable[..., Any]
# By number, since a graph is text. Those of a simulator are removed when it is closed.
CALLS: dict[int, Call] = {}
_numbers = itertools.count()


def registered(call: Call) -> int:
    """A number under which generated text finds a callable."""
    number = next(_numbers)
    CALLS[number] = call
    return number


def checked(function: Call, size: int) -> Call:
    """A function whose values are arrays (size,), as Nengo takes them.

    Raises
    ------
    nengo.exceptions.SimulationError : when it is called, for a value of another kind or size.
    """

    def call(*arguments: Any) -> FloatArray:
        value = function(*arguments)
        if size == 0:
            return np.zeros(1)
        if value is None:
            raise nengo.exceptions.SimulationError(f"{_named(function)} returned None")
        try:
            array = np.asarray(value, dtype=float).reshape(-1)
        except (TypeError, ValueError):
            message = f"{_named(function)} returned {value!r} of invalid type {type(value)}"
            raise nengo.exceptions.SimulationError(message) from None
        if array.size != size:
            message = f"{_named(function)} returned {array.size} numbers, expected {size}"
            raise nengo.exceptions.SimulationError(message)
        if not np.isfinite(array).all():
            raise nengo.exceptions.SimulationError(f"{_named(function)} is not finite: {value!r}")
        return array

    return call


def stepped(process: Any, size_in: int, size: int, dt: float, seed: int) -> Call:
    """A process as a function of the time and the input, with Nengo's random numbers."""
    # Nengo gives every process without a seed the generator of the simulator's own seed.
    rng = process.get_rng(np.random.RandomState(seed))
    state = process.make_state((size_in,), (size,), dt)
    step = process.make_step((size_in,), (size,), dt, rng, state)

    def call(t: float, *inputs: FloatArray) -> Any:
        return np.array(step(t, *inputs), dtype=float)

    return call


def _named(function: Call) -> str:
    return f"Function '{getattr(function, '__name__', type(function).__name__)}'"
