"""Checks of the values that blocks return, and their error messages.

In: what a block returned, and the type of its port. Out: the value in the form that the next block
gets, or an error that names block, port and time::

    sealed(state.x)         a copy that nobody can write into
    checks.floats("own", "out", np.int64(2))     2.0
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NoReturn

import numpy as np

from blocks.core import FloatArray, SignalType, state_shape
from runtime.engine.events import (
    ACTED,
    FOLLOWED,
    MAX_EVENTS,
    ROSE,
    SIDE,
    decided,
    noted,
    opened,
    proposed,
)
from runtime.engine.steps import ATOL, COUNT, CRAWLED, MAX_CRAWLED, RTOL, STEP
from runtime.errors import SimulationError
from runtime.network import Network
from runtime.plan import Call, Integrate
from runtime.solvers import ADAPTIVE, SOLVERS, listed

# What counts as a number where a float is expected; no array, and no text.
NUMBERS = (float, int, np.floating, np.integer, np.bool_)


class FormError(TypeError):
    """A block returned what is not of its output's type."""


class NotFiniteError(ArithmeticError):
    """A block produced NaN or infinity; ``block`` names it where the plan's line does not."""

    def __init__(self, message: str, block: str = "") -> None:
        super().__init__(message)
        self.block = block


def sealed(value: Any) -> Any:
    """An array that a block returned, as other blocks may have it: not shared and read-only.

    What a :class:`blocks.core.block.BlockState` keeps are views, so an array without a base is
    not one of them.

    Raises
    ------
    TypeError : the value is not an array.
    """
    try:
        if value.base is not None:
            value = value.copy()
        value.setflags(False)  # by position: by keyword it takes twice as long
    except AttributeError:
        raise TypeError(f"expected a float64 array as output, got {brief(value)}") from None
    return value


class Zeros(dict[int, FloatArray]):
    """Read-only arrays of zeros, by their length."""

    def __missing__(self, length: int) -> FloatArray:
        self[length] = sealed(np.zeros(length))
        return self[length]


@dataclass(frozen=True)
class OutputChecks:
    """Checks what the blocks of a network return against the types of their outputs."""

    network: Network
    _shapes: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)

    def form(self, block: str, port: str, value: Any) -> None:
        """Check one output's form.

        Raises
        ------
        SimulationError : the value is not held as the output's type says.
        """
        kind = self.network.types[block, port]
        if not kind.holds(value, exact=False):
            raise SimulationError(block, 0, 0.0, wrong_form(port, kind, value))

    def floats(self, block: str, port: str, value: Any) -> Any:
        """What an own block returned, at any tick, in the form of a signal.

        A block may return an int, a bool or NumPy's number at one tick. The next block would
        compute with it by other rules, as ``True + True``, which is 2 in Python and True in NumPy.

        Raises
        ------
        FormError : it has another form, as an array of another shape.
        """
        kind = self.network.types[block, port]
        if kind.form == "scalar":
            if isinstance(value, NUMBERS):
                return float(value)
        elif kind.form == "record":
            fits = isinstance(value, tuple) and len(value) == len(kind.components)
            if fits and all(isinstance(each, NUMBERS) for each in value):
                return tuple(map(float, value))
        elif isinstance(value, np.ndarray) and value.shape == kind.shape:
            if value.dtype == np.float64:
                return value
            if value.dtype.kind in "fiub":
                return value.astype(np.float64)
        raise FormError(wrong_form(port, kind, value))

    def several(self, ports: tuple[str, ...], value: Any) -> Any:
        """A tuple of outputs, as the plan takes it apart."""
        if not isinstance(value, tuple) or len(value) != len(ports):
            listed = ", ".join(ports)
            raise FormError(f"expected a tuple of its outputs ({listed}), got {brief(value)}")
        return value

    def forms(self, block: str, ports: tuple[str, ...], value: Any) -> Any:
        """Check what a block returned on its first tick; returns the value."""
        if len(ports) > 1:
            self.several(ports, value)
        for port, item in zip(ports, (value,) if len(ports) == 1 else value, strict=True):
            self.form(block, port, item)
        return value

    def not_finite(self, block: str, method: str, *values: Any) -> None:
        """Raise the error of a method whose outputs are not finite; called by the plan.

        Returns if all are valid, and only their sum or a square is not.
        """
        evaluations = self.network.entries[block].cls.spec.evaluations
        (outputs,) = (each.outputs for each in evaluations if each.method == method)
        for port, value in zip(outputs, values, strict=True):
            if _is_bad(self.network.types[block, port], value):
                why = self.network.entries[block].block.why_not_finite()
                why = f"; {why}" if why else ""
                raise NotFiniteError(f"output '{port}' is not finite: {brief(value)}{why}")

    def rates(self, block: str, value: Any) -> Any:
        """Check what a block's derivative returned on its first tick; returns the value.

        Raises
        ------
        TypeError : it is not one value per continuous state, each of the state's shape.
        """
        entry = self.network.entries[block]
        spec = entry.cls.spec
        names = spec.continuous
        if len(names) > 1 and (not isinstance(value, tuple) or len(value) != len(names)):
            listed = ", ".join(names)
            message = f"derivative must return a tuple, one value per state ({listed})"
            raise TypeError(f"{message}, got {brief(value)}")
        if block not in self._shapes:  # an implicit solver asks thousands of times on one tick
            states = (spec.states[name] for name in names)
            context = self.network.context(block)
            self._shapes[block] = [state_shape(entry.block, s, context) for s in states]
        given = (value,) if len(names) == 1 else value
        for name, rate, shape in zip(names, given, self._shapes[block], strict=True):
            if np.shape(rate) != shape or np.asarray(rate).dtype.kind not in "fiu":
                expected = f"numbers of shape {shape}" if shape else "a float"
                message = f"derivative of state '{name}' must be {expected}"
                raise TypeError(f"{message}, got {brief(rate)}")
        return value


def bad_slope(part: Integrate, slopes: FloatArray, stage: int, t: float) -> None:
    """Raise the error of a rate of change that is not finite; called by the plan.

    Returns if only the square of a large number is infinite.
    """
    for column, value in enumerate(slopes[stage].tolist()):
        if not math.isfinite(value):
            slot = part.row.at(column)
            message = f"the derivative of state '{slot.component(column)}' is not finite: {value}"
            raise NotFiniteError(
                f"{message} (stage {stage + 1} of the solver, t = {t:g} {part.time_unit})",
                slot.block,
            )


IMPLICIT = listed((name for name in ADAPTIVE if SOLVERS[name].is_implicit), "or")
EXPLICIT = listed((name for name in ADAPTIVE if not SOLVERS[name].is_implicit), "or")
STIFF = f", or changes much faster than the others (a stiff system, for which there is {IMPLICIT})"
JUMPS = "; a derivative that jumps, as sign(x) does, needs a Relay in its place, or a fixed step"


def unreached(part: Integrate, solver: str, control: FloatArray, done: float, t: float) -> NoReturn:
    """Raise the error of a solver that cannot meet its tolerances; called by the plan."""
    column = round(-1.0 - done)
    slot = part.row.at(column)
    if control[CRAWLED] > MAX_CRAWLED:
        raise NotFiniteError(
            f"{solver} crawls at t = {t:g} {part.time_unit}: {control[CRAWLED]:.0f} of "
            f"{control[COUNT]:.0f} steps since the tick, the last of {control[STEP]:.3g} "
            f"{part.time_unit}, move no state by much more than their errors; the derivative of "
            f"state '{slot.component(column)}' jumps to and fro (a sliding mode): use {EXPLICIT} "
            "or a fixed step, or smooth the jump, as tanh(x/0.001) does for sign(x)",
            slot.block,
        )
    tolerance = f"rtol = {control[RTOL]:g} and atol = {control[ATOL]:g}"
    raise NotFiniteError(
        f"{solver} cannot integrate state '{slot.component(column)}' with {tolerance}: "
        f"step {control[COUNT]:.0f} since the tick is {control[STEP]:.3g} {part.time_unit} "
        f"at t = {t:g} {part.time_unit}; the "
        f"state jumps or runs away{'' if SOLVERS[solver].is_implicit else STIFF}{JUMPS}",
        slot.block,
    )


def event_names(part: Integrate, arrays: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """What the text of a graph refers to whose steps end at events or edges."""
    if not part.ends_steps:
        return {}
    fired = np.zeros(len(part.directions))
    return {
        **{key: arrays[f"run/{key}"] for key in ("search", "sides", "guards", "count")},
        "directions": np.where(part.directions > 1.0, 0.0, part.directions),
        "fired": fired,
        "edges": part.edges,
        "log": np.empty((max(1, part.log), 2)),  # its memory is used where something is written
        **{each.__name__: each for each in (opened, proposed, decided, noted)},
        "restless": partial(restless, part, arrays["run/search"], fired),
    }


def restless(part: Integrate, search: FloatArray, fired: FloatArray, t: float) -> NoReturn:
    """Raise the error of events without end in one tick; called by the plan."""
    first = int(np.flatnonzero(fired)[0])
    block = next(each.block for each in part.crossings if each.stop > first)
    count = search[ACTED]
    many = f"more than {MAX_EVENTS}" if count > MAX_EVENTS else f"{count:.0f}"
    raise NotFiniteError(
        f"{many} events since the tick, the last at t = {t:g} {part.time_unit}: "
        "they follow each other ever faster. A switch that undoes itself needs a hysteresis (of a "
        "Relay, switch_on above switch_off), an event should leave its condition; with "
        "run: {events: ticks}, each acts at most once a tick",
        block,
    )


def unmet(part: Integrate, network: Network, sides: FloatArray) -> list[str]:
    """Notes of conditions that held to the end of a run, after their last event or from the start.

    An event acts where its condition becomes true: not again, where it has not been false.
    """
    notes = []
    for crossing in part.crossings:
        block = crossing.guards.block if isinstance(crossing.guards, Call) else ""
        if not block or not network.entries[block].cls.notes_conditions:
            continue
        for i, direction in enumerate(crossing.directions):
            side, at = sides[SIDE, crossing.start + i], sides[ROSE, crossing.start + i]
            if direction == 1.0 and side in (1.0, FOLLOWED):
                since = "the start" if math.isnan(at) else f"t = {at:g} {part.time_unit}"
                acted = "and never acted" if math.isnan(at) else "when it acted last"
                notes.append(
                    f"block '{block}': the condition of event {i} held to the end since {since}, "
                    f"{acted}; an event acts as its condition becomes true, so it has to be false "
                    "in between"
                )
    return notes


def _is_bad(kind: SignalType, value: Any) -> bool:
    numbers = np.asarray(value)
    return bool(np.isnan(numbers).any() or (kind.finite and np.isinf(numbers).any()))


def wrong_initial(name: str, begun: FloatArray, array: FloatArray) -> str:
    """What is wrong with a state that an earlier run ended with; '' if nothing is.

    A state that is NaN after ``start`` says so that there is no value yet, and may be NaN again;
    infinite numbers may come from the misses of a scan.
    """
    wrong = int(np.isnan(array).sum())
    if wrong and not np.isnan(begun).any():
        message = (
            f"{wrong} of {array.size} numbers of the state '{name}' are NaN in the earlier run"
        )
        return f"{message}; begin from another run, or without this state"
    return ""


def wrong_form(port: str, kind: SignalType, value: Any) -> str:
    """The error of an output that has not the form of its type."""
    return f"output '{port}' must be {kind.held_as}, got {brief(value)}"


def brief(value: Any) -> str:
    """A value in at most 80 characters, for messages."""
    is_array = isinstance(value, np.ndarray)
    text = f"an array of shape {value.shape}, {value.dtype}" if is_array else repr(value)
    return text if len(text) < 80 else text[:77] + "..."
