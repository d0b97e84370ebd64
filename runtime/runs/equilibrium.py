"""An equilibrium of a graph: states that do not move, and inputs and outputs with wanted values.

In: a network, and which states, inputs and outputs are fixed or bounded. Out: the values, and an
overlay that begins a run with them. Of a pendulum with ``fixed={"p.angle": 0.5}`` and the input
``p.torque``: theta = 0.5, theta' = 0, torque = m g l sin(0.5).

Found by nonlinear least squares (``scipy.optimize.least_squares``) on the rates of change of
continuous states, the changes of sampled ones, and what outputs miss of their wanted values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray, hint
from runtime.engine import Watched
from runtime.errors import UsageError
from runtime.network import Endpoint, Network
from runtime.plan import Port
from runtime.runs.operating_point import OperatingPoint

ENOUGH = 1e-7  # what may be left, relative to a value or to 1 if it is smaller
Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Trim:
    """An equilibrium, or the nearest to one that was found.

    states, inputs, outputs : values by address. left : what still moves, or misses its value, the
    largest first: 0 at an equilibrium.
    overlay : a graph's sections that begin a run there.
    """

    states: Mapping[str, float]
    inputs: Mapping[str, float]
    outputs: Mapping[str, float]
    left: tuple[tuple[str, float], ...]
    overlay: Mapping[str, Any]

    @property
    def is_equilibrium(self) -> bool:
        return not self.left


def trim(
    network: Network,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    *,
    fixed: Mapping[str, float] | None = None,
    bounds: Bounds | None = None,
    at: float = 0.0,
    states: Mapping[str, Any] | None = None,
) -> Trim:
    """Find an equilibrium.

    Parameters
    ----------
    inputs : what may change, besides the states: outputs of Constant blocks, and inputs of blocks
        without a wire.
    outputs : what is reported.
    fixed : values of states, inputs and outputs that shall hold. bounds : ranges of them.
    at : the time; states : values to begin the search at.

    Raises
    ------
    UsageError : a name is wrong, or an overlay cannot set an input.
    """
    search = _Search(network, inputs, outputs, fixed or {}, bounds or {}, at, states or {})
    return search.result()


class _Search:
    """The unknowns are the free states and inputs, in the order of their addresses."""

    def __init__(
        self,
        network: Network,
        inputs: Sequence[str],
        outputs: Sequence[str],
        fixed: Mapping[str, float],
        bounds: Bounds,
        at: float,
        states: Mapping[str, Any],
    ) -> None:
        self.network, self.wanted = network, {**bounds, **{k: (v, v) for k, v in fixed.items()}}
        plain = OperatingPoint(network, inputs, outputs, at, states)
        n, z, _ = plain.point.sizes
        self.states = plain.point.columns[: n + z]
        others = [a for a in self.wanted if a not in (*self.states, *plain.inputs, *plain.outputs)]
        # A fixed output need not be listed.
        self.there = OperatingPoint(network, inputs, [*outputs, *others], at, states)
        self.point, self.n = self.there.point, n
        self.base, self.targets = self._inputs_now()
        names = (*self.states, *self.there.inputs)
        start = np.concatenate([self.there.columns[: n + z], self.base])
        self.names, self.low, self.high = (
            names,
            np.full(len(names), -np.inf),
            np.full(len(names), np.inf),
        )
        for i, name in enumerate(names):
            if name in self.wanted:
                self.low[i], self.high[i] = self.wanted[name]
            elif i >= n + z and name not in self.there.driven:
                self.low[i] = self.high[i] = start[i]
        self.whole = np.clip(start, self.low, self.high)
        self.free = np.flatnonzero(self.low < self.high)
        for name in self.wanted:
            if name not in (*names, *self.there.outputs):
                raise UsageError(f"no state, input or output '{name}'{hint(name, names)}")

    def _inputs_now(self) -> tuple[FloatArray, list[tuple[Port, bool]]]:
        """The values of the inputs as the graph has them, and where an overlay writes each."""
        values, targets = list[float](), list[tuple[Port, bool]]()
        for port in self.there.point.offsets.first:
            entry = self.network.entries[port[0]]
            kind = self.network.types[port]
            is_open = port[1] in entry.cls.spec.inputs
            if is_open and any((w.block, w.port) == port for w in self.network.driving):
                raise UsageError(f"'{'.'.join(port)}' is wired; name a Constant that drives it")
            if not is_open and entry.cls.__name__ != "Constant":
                raise UsageError(
                    f"'{'.'.join(port)}' is the output of a {entry.cls.__name__}, which an overlay "
                    "cannot hold at a value; name a Constant, or an input without a wire"
                )
            if is_open:
                default = entry.cls.spec.inputs[port[1]].default or 0.0
                values += [default] * int(np.prod(kind.shape))
            else:
                values += self.there.value_of(Watched(Endpoint(*port))).tolist()
            targets.append((port, is_open))
        return np.array(values), targets

    def _evaluate(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """All values, what moves, and the outputs."""
        whole = self.whole.copy()
        whole[self.free] = unknowns
        count = len(self.states)
        columns, u = self.there.columns.copy(), whole[count:] - self.base
        columns[:count] = whole[:count]
        after, y = self.point.tick(0, columns, u)
        columns[count:] = after[count:]
        rates, _ = self.point.flow(columns, u)
        return whole, np.concatenate([rates, after[self.n : count] - whole[self.n : count]]), y

    def _residuals(self, unknowns: FloatArray) -> FloatArray:
        _, moving, y = self._evaluate(unknowns)
        return np.concatenate([moving, self._distances(y)])

    def _distances(self, y: FloatArray) -> FloatArray:
        """How far each output with a wanted value is from its range."""
        ranges = [self.wanted.get(name, (-np.inf, np.inf)) for name in self.there.outputs]
        return np.array(
            [
                min(v - low, 0.0) + max(v - high, 0.0)
                for v, (low, high) in zip(y, ranges, strict=True)
            ]
        )

    def result(self) -> Trim:
        from scipy.optimize import least_squares

        x0 = self.whole[self.free]
        low, high = self.low[self.free], self.high[self.free]
        if len(x0):
            # Inside of its bounds, as the method wants it.
            found = least_squares(
                self._residuals,
                np.clip(x0, np.nextafter(low, high), np.nextafter(high, low)),
                bounds=(low, high),
                x_scale="jac",
                xtol=1e-15,
                ftol=1e-15,
                gtol=1e-15,
                max_nfev=1000,
            )
            x0 = found.x
        whole, _, y = self._evaluate(x0)
        left, count = self._residuals(x0), len(self.states)
        names = [f"{name}'" for name in self.states] + list(self.there.outputs)
        sizes = np.maximum(1.0, np.abs(np.concatenate([whole[:count], y])))
        order = np.argsort(-np.abs(left) / sizes)
        return Trim(
            states=dict(zip(self.states, whole[:count].tolist(), strict=True)),
            inputs=dict(zip(self.there.inputs, whole[count:].tolist(), strict=True)),
            outputs=dict(zip(self.there.outputs, y.tolist(), strict=True)),
            left=tuple(
                (names[i], float(left[i])) for i in order if abs(left[i]) > ENOUGH * sizes[i]
            ),
            overlay=self._overlay(whole),
        )

    def _overlay(self, whole: FloatArray) -> dict[str, Any]:
        """The sections that begin a run at values."""
        overlay: dict[str, Any] = {"blocks": {}, "wires": {}, "initial": {}}
        at = 0
        for address, shape in self.point.shapes:
            size = int(np.prod(shape))
            overlay["initial"][address] = whole[at : at + size].reshape(shape).tolist()
            at += size
        for port, is_open in self.targets:
            shape = self.network.types[port].shape
            size = int(np.prod(shape))
            value = whole[at : at + size].reshape(shape).tolist()
            at += size
            if is_open:
                name = "_".join(("trim", *port)).replace(".", "_")
                kind = str(self.network.types[port])
                overlay["blocks"][name] = {"type": "Constant", "value": value, "signal": kind}
                overlay["wires"][port[0]] = {port[1]: f"{name}.value"}
            else:
                overlay["blocks"][port[0]] = {"value": value}
        return {key: section for key, section in overlay.items() if section}
