"""A graph's continuous part as a linear system, at an operating point.

In: a network, addresses of inputs and outputs, a time. Out: A, B, C, D of x' = A x + B u and
y = C x + D u. For a pendulum, theta'' = -g/l sin(theta), at rest: A = [[0, 1], [-g/l, 0]].

Derivatives are central differences of the plan that the engine runs, whatever its blocks compute:
automatic differentiation would need each block written for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from blocks.core import FloatArray, hint
from runtime.document import SECOND
from runtime.engine import Engine, Program, Watched, flow_at
from runtime.errors import UsageError
from runtime.network import AddressError, Endpoint, Network, check_output, find, state_shape
from runtime.observation import Observation

if TYPE_CHECKING:
    from scipy.signal import StateSpace

# The step of a central difference, relative to the number: the cube root of the rounding error.
STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)


@dataclass(frozen=True)
class Linearization:
    """x' = A x + B u, y = C x + D u, for small deviations from an operating point.

    states, inputs, outputs : the addresses of the components of x, u and y.
    point : the states at the operating point. t : its time, in ``time_unit``.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    point: FloatArray
    t: float
    time_unit: str = SECOND

    @property
    def poles(self) -> FloatArray:
        """The eigenvalues of A (1/s), the slowest first."""
        values = np.linalg.eigvals(self.a)
        order = np.lexsort((values.imag, -values.real))
        return np.asarray(values[order])

    def system(self) -> StateSpace:
        """The system for scipy.signal: step responses, Bode plots, transfer functions."""
        from scipy import signal

        return signal.StateSpace(self.a, self.b, self.c, self.d)

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "schema_version": 1,
            "t": self.t,
            **{name: list(getattr(self, name)) for name in ("states", "inputs", "outputs")},
            "point": self.point.tolist(),
            **{name.upper(): getattr(self, name).tolist() for name in "abcd"},
            "poles": [[float(p.real), float(p.imag)] for p in self.poles],
        }


def linearize(
    network: Network,
    inputs: Sequence[str],
    outputs: Sequence[str],
    at: float = 0.0,
    states: Mapping[str, Any] | None = None,
) -> Linearization:
    """Linearize a graph by central differences; sampled blocks hold their outputs.

    Parameters
    ----------
    network : whose run ends at ``at``, at least.
    inputs : input ports, or outputs that drive the system (a source's).
    outputs : addresses of outputs or states.
    at : the time (s) of the operating point; the graph is run up to there.
    states : values of continuous states at the operating point, by address.

    Raises
    ------
    UsageError : an address is wrong, or there are no continuous states.
    SimulationError : the run up to the operating point failed.
    """
    engine, tick = _operating_point(network, at)
    row = engine.plan.row
    if not row.size:
        raise UsageError("the graph has no continuous states, so there is nothing to linearize")
    names = [slot.address(i) for slot in row.slots for i in range(slot.start, slot.stop)]
    _set_states(engine, states or {})
    offsets, labels = _offsets(network, inputs)
    watches = [_watch(network, text) for text in outputs]
    flow = flow_at(engine, tick, offsets, watches)
    x0 = engine.state.continuous.copy()
    by_state, by_input = _jacobians(engine.state.continuous, flow, len(labels))
    n = row.size
    rows = [
        each for text, w in zip(outputs, watches, strict=True) for each in _rows(network, text, w)
    ]
    return Linearization(
        a=by_state[:n],
        b=by_input[:n],
        c=by_state[n:],
        d=by_input[n:],
        states=tuple(names),
        inputs=tuple(labels),
        outputs=tuple(rows),
        point=x0,
        t=tick * network.dt,
        time_unit=network.time_unit,
    )


def _jacobians(
    x: FloatArray, flow: Callable[[list[float]], tuple[list[float], list[float]]], inputs: int
) -> tuple[FloatArray, FloatArray]:
    """A above C, and B above D: the Jacobians of one function of (x, u) that gives x' above y."""

    def at_point(state: FloatArray, offset: FloatArray) -> FloatArray:
        x[:] = state
        slopes, y = flow(offset.tolist())
        return np.array([*slopes, *y])

    x0, u0 = x.copy(), np.zeros(inputs)
    by_state = _differences(lambda v: at_point(v, u0), x0)
    by_input = _differences(lambda v: at_point(x0, v), u0)
    x[:] = x0
    return by_state, by_input


def _operating_point(network: Network, at: float) -> tuple[Engine, int]:
    """An engine that has run up to a time, and its tick."""
    engine = Engine(Program(network, Observation()), network.seed)
    if round(at / network.dt) == 0:
        engine.prepare()
        return engine, 0
    outcome = engine.run()
    if outcome.error is not None:
        raise outcome.error
    return engine, outcome.ticks


def _differences(function: Any, point: FloatArray) -> FloatArray:
    """The Jacobian of a function by central differences, one column per component."""
    columns = []
    for i, value in enumerate(point.tolist()):
        step = STEP * max(1.0, abs(value))
        low, high = point.copy(), point.copy()
        low[i], high[i] = value - step, value + step
        # Divided by the difference that the rounded numbers have, not by 2 * step: a step that is
        # not a power of two is rounded when it is added.
        columns.append((function(high) - function(low)) / (high[i] - low[i]))
    rows = len(function(point))
    return np.array(columns).T if columns else np.zeros((rows, 0))


def _set_states(engine: Engine, states: Mapping[str, Any]) -> None:
    slots = {str(slot): slot for slot in engine.plan.row.slots}
    for address, value in states.items():
        if address not in slots:
            near = hint(address, slots) or f"; the states are {', '.join(slots)}"
            raise UsageError(f"no continuous state '{address}'{near}")
        slot = slots[address]
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in ((), slot.shape):
            raise UsageError(f"'{address}' has shape {slot.shape}, got {array.shape}")
        row = engine.state.continuous[slot.start : slot.stop]
        # A number stands for all components of a state, as in graphs.
        row[...] = np.broadcast_to(array, slot.shape).reshape(-1)


def _offsets(
    network: Network, inputs: Sequence[str]
) -> tuple[dict[tuple[str, str], int], list[str]]:
    """The first offset of each input, and the labels of all."""
    offsets: dict[tuple[str, str], int] = {}
    labels: list[str] = []
    for text in inputs:
        port = _input_at(network, text)
        offsets[port] = len(labels)
        labels += _labels(text, network.types[port])
    return offsets, labels


def _input_at(network: Network, text: str) -> tuple[str, str]:
    """The input or output of a block to which an offset is added."""
    block, _, port = text.rpartition(".")
    entry = network.entries.get(block)
    if entry is not None and port in entry.cls.spec.inputs:
        if entry.cls.spec.inputs[port].variadic:
            raise UsageError(f"'{text}' takes many wires; name the output that drives it")
        if entry.sampled or (entry.cls.spec.update and not entry.cls.spec.continuous):
            raise UsageError(f"'{text}' is read by a sampled block, which holds its outputs")
        return block, port
    end = _output_at(network, text)
    if end.component or end.port in network.entries[end.block].cls.spec.states:
        raise UsageError(f"'{text}': expected a whole input or output of a block")
    return end.block, end.port


def _watch(network: Network, text: str) -> Watched:
    end = _output_at(network, text)
    return Watched(end, end.port in network.entries[end.block].cls.spec.states)


def _output_at(network: Network, text: str) -> Endpoint:
    try:
        end = find(network.scope, text).end
    except AddressError as error:
        raise UsageError(str(error)) from None
    message = check_output(network, end, states=True)
    if message or end.block not in network.entries:
        raise UsageError(message or f"'{end.block}' is removed")
    return end


def _labels(text: str, kind: Any) -> list[str]:
    if kind.form == "scalar":
        return [text]
    parts = kind.components if kind.form == "record" else range(math.prod(kind.shape))
    return [f"{text}.{part}" for part in parts]


def _rows(network: Network, text: str, watch: Watched) -> list[str]:
    end = watch.end
    if end.component:
        return [text]
    if not watch.is_state:
        return _labels(text, network.types[end.block, end.port])
    entry = network.entries[end.block]
    spec = entry.cls.spec
    shape = state_shape(entry.block, spec.states[end.port], network.context(end.block), spec)
    return [f"{text}.{i}" for i in range(math.prod(shape))] if shape else [text]
