"""A graph as a linear system at an operating point: in continuous time, or sampled.

In: a network, addresses of inputs and outputs, a time. Out: A, B, C, D. For a pendulum,
theta'' = -g/l sin(theta), at rest: A = [[0, 1], [-g/l, 0]]. With a controller at 100 Hz around it,
the exact discrete closed loop at that rate.

Derivatives are differences of the plan that the engine runs, whatever its blocks compute:
automatic differentiation would need each block written for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from blocks.core import FloatArray, MissingPackageError, eigenvalues, require
from runtime.document import SECOND
from runtime.errors import MissingExtraError, UsageError
from runtime.network import Network
from runtime.runs.operating_point import OperatingPoint
from runtime.runs.sampling import Linear, Loose, Matrices, minimal

if TYPE_CHECKING:
    from scipy.signal import StateSpace

    from runtime.engine import Point

AT_REST = 1e-6  # a rate of change, relative to a state or to 1 if it is smaller


@dataclass(frozen=True)
class Linearization:
    """x' = A x + B u, y = C x + D u, for small deviations from an operating point.

    With sampled blocks in the loop x(t + period) = A x(t) + B u(t), exact for a u that holds over
    the period; the outputs are those at its beginning.

    states, inputs, outputs : the addresses of the components of x, u and y.
    point : the states at the operating point. t : its time, in ``time_unit``.
    drift : the rate of change of each state there, or its change in a period: 0 at an equilibrium.
    period : of the sampled blocks (s); 0 in continuous time.
    sampled : the blocks that are part of it as sampled ones.
    held : blocks that vary with time, or switch, and are held constant.
    without : sampled states that have no effect there. loose : entries that differ by side or step.
    opened : the signal at which the loop is cut. If it is input and output as well, the system is
    L of 1 + L = 0, the loop transfer function with negative feedback.
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
    drift: FloatArray
    time_unit: str = SECOND
    period: float = 0.0
    sampled: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    loose: tuple[Loose, ...] = ()
    opened: str = ""

    @cached_property
    def poles(self) -> npt.NDArray[np.complex128]:
        """The eigenvalues of A, the slowest first: in the s plane (1/s), or in the z plane."""
        return sorted_poles(self.a, bool(self.period))

    @property
    def equivalent(self) -> npt.NDArray[np.complex128]:
        """The poles as s (1/s): of a sampled loop log(z) / period, -inf for z = 0."""
        if not self.period:
            return self.poles
        with np.errstate(divide="ignore"):
            found = np.log(self.poles.astype(complex))
        # Part by part: a complex quotient makes NaN of the imaginary part beside -inf.
        return np.asarray(found.real / self.period + 1j * (found.imag / self.period))

    @property
    def is_stable(self) -> bool:
        """Whether all poles are in the left half plane, or inside of the unit circle."""
        return is_inside(self.poles, bool(self.period))

    @property
    def moving(self) -> tuple[tuple[str, float], ...]:
        """The states that move at the operating point, with their drift, the fastest first."""
        relative = np.abs(self.drift) / np.maximum(1.0, np.abs(self.point))
        order = np.argsort(-relative)
        return tuple((self.states[i], float(self.drift[i])) for i in order if relative[i] > AT_REST)

    def system(self) -> StateSpace:
        """The system for scipy.signal: step responses, Bode plots, transfer functions."""
        from scipy import signal

        if self.period:
            return signal.StateSpace(self.a, self.b, self.c, self.d, dt=self.period)
        return signal.StateSpace(self.a, self.b, self.c, self.d)

    # Any: python-control has no types.
    def to_control(self) -> Any:
        """The system as a ``control.StateSpace`` with the names of states, inputs and outputs.

        Raises
        ------
        MissingExtraError : python-control, the extra ``control``, is not installed.
        """
        names = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        # Its names must not have dots, which select the signals of a subsystem.
        plain = {key: [each.replace(".", "_") for each in names[key]] for key in names}
        plain = {key: each for key, each in plain.items() if each}
        return control().StateSpace(self.a, self.b, self.c, self.d, self.period, **plain)

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        names = ("states", "inputs", "outputs", "sampled", "held", "without")
        return {
            "schema_version": 2,
            "t": self.t,
            "period": self.period,
            "opened": self.opened,
            **{name: list(getattr(self, name)) for name in names},
            "point": self.point.tolist(),
            "drift": self.drift.tolist(),
            **{name.upper(): getattr(self, name).tolist() for name in "abcd"},
            "poles": [[float(p.real), float(p.imag)] for p in self.poles],
            "unsettled": [vars(each) for each in self.loose],
        }


def is_inside(poles: npt.NDArray[Any], is_sampled: bool) -> bool:
    """Whether all poles are in the left half plane, or inside of the unit circle."""
    return bool((np.abs(poles) < 1.0).all() if is_sampled else (poles.real < 0.0).all())


def sorted_poles(a: FloatArray, is_sampled: bool) -> npt.NDArray[np.complex128]:
    """The eigenvalues of A, the slowest first."""
    values = eigenvalues(a)
    order = np.lexsort((values.imag, -(np.abs(values) if is_sampled else values.real)))
    return np.asarray(values[order])


def control() -> Any:
    """python-control.

    Raises
    ------
    MissingExtraError : it is not installed.
    """
    try:
        return require("control", "linear analysis with python-control", "control")
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None


def linearize(
    network: Network,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    *,
    at: float = 0.0,
    states: Mapping[str, Any] | None = None,
    opened: str = "",
) -> Linearization:
    """Linearize a graph by differences, with the sampled blocks of its loop.

    Parameters
    ----------
    inputs : input ports, or outputs that drive the system (a source's).
    outputs : addresses of outputs or states.
    at : the time (s) of the operating point; the graph is run up to there, and with sampled blocks
        to the next time at which all of them act.
    states : values of states at the operating point, by address.
    opened : a signal at which the loop is cut; without inputs and outputs, the result is the loop
        transfer function there.

    Raises
    ------
    UsageError : an address is wrong, there are no states, a block draws random numbers, or the
        sampled blocks have no common period that is short enough.
    SimulationError : the run up to the operating point failed.
    """
    there = OperatingPoint(network, inputs, outputs, at, states or {}, opened)
    point, structure = there.point, there.structure
    linear = Linear(point, there.columns, there.u, there.inputs, there.outputs)
    n = point.sizes[0]
    if structure.period:
        found = linear.sampled(structure.steps, structure.period)
        kept, without = minimal(found, n)
    else:
        found, kept, without = linear.continuous(), list(range(n)), []
    if not kept:
        raise UsageError("the graph has no states, so there is nothing to linearize")
    columns = [i for i, name in enumerate(there.inputs) if name in there.driven]
    sign = -1.0 if opened and not (inputs or outputs) else 1.0
    names = point.columns
    return Linearization(
        a=found.a[np.ix_(kept, kept)],
        b=found.b[np.ix_(kept, columns)],
        c=sign * found.c[:, kept],
        d=sign * found.d[:, columns],
        states=tuple(names[i] for i in kept),
        inputs=tuple(there.inputs[i] for i in columns),
        outputs=there.outputs,
        point=there.columns[kept],
        t=point.t,
        drift=found.drift[kept],
        time_unit=network.time_unit,
        period=structure.period * network.dt,
        sampled=structure.sampled,
        held=structure.held,
        without=tuple(names[i] for i in without if i < sum(point.sizes[:2])),
        loose=_relevant(found, point, kept),
        opened=opened,
    )


def _relevant(found: Matrices, point: Point, kept: Sequence[int]) -> tuple[Loose, ...]:
    """The entries that do not settle, between what is not left out."""
    left_out = {point.columns[i] for i in range(sum(point.sizes[:2]))} - {
        point.columns[i] for i in kept
    }
    return tuple(
        each
        for each in found.loose
        if each.of.rstrip("'") not in left_out and each.by not in left_out
    )
