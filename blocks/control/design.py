"""Linear models of plants, and the gains that Riccati equations give for them.

In: matrices A, B, C, or the name of a block with a derivative and an operating point. Out: the
model for small deviations, and the gains of a regulator or an observer. For x'' = u with Q = I and
R = 1: K = [1, sqrt(3)].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    ParameterError,
    jacobian,
    misspelt,
    size_of,
    started,
)

Given = Mapping[str, object]  # values of inputs by name
AT_REST = 1e-3  # a rate of change, relative to a state or to 1: numbers are written by hand
DIGITS = 12


@dataclass(frozen=True)
class Model:
    """x' = A x + B u, y = C x, or x(t_k+1) = A x + B u, for deviations from x0, u0 and y0."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    x0: FloatArray
    u0: FloatArray
    y0: FloatArray

    def sampled(self, dt: float) -> Model:
        """The same at the ticks of a step, while u holds: the matrix exponential."""
        from scipy.linalg import expm  # scipy stays off the start-up path

        n, m = self.b.shape
        square = np.zeros((n + m, n + m))
        square[:n, :n], square[:n, n:] = self.a * dt, self.b * dt
        moved = expm(square)
        return Model(moved[:n, :n], moved[:n, n:], self.c, self.x0, self.u0, self.y0)


def model_of(
    context: BlockContext,
    name: str,
    port: str,
    measured: Sequence[str],
    x0: FloatArray | None,
    u0: FloatArray | None,
) -> Model:
    """The linear model of a block of the same graph at an operating point.

    Parameters
    ----------
    name : the block; it has continuous states. port : its input; '' for the only one.
    measured : its outputs that are y, in order.
    x0, u0 : the operating point, which is an equilibrium; default 0.

    Raises
    ------
    ParameterError : there is no such block, input or output, or the point is no equilibrium.
    """
    found = context.neighbour(name)
    if found is None or found[0].spec.derivative is None:
        what = "no block" if found is None else "no continuous states in the block"
        raise ParameterError([("plant", f"there is {what} '{name}' in this part of the graph")])
    block, around = found
    port = _input_of(block, port)
    kind = around.types[port]
    state = started(block, around)
    rows = [getattr(state, each) for each in block.spec.continuous]
    n, m = sum(row.size for row in rows), max(1, int(np.prod(kind.shape)))
    at = np.concatenate([_sized(x0, n, "x0"), _sized(u0, m, "u0")])

    def responded(v: FloatArray) -> FloatArray:
        start = 0
        for row in rows:
            row[...] = v[start : start + row.size].reshape(row.shape)
            start += row.size
        given = {port: kind.pack(v[n:].reshape(kind.shape))}
        return np.concatenate(
            [_rates(block, state, given), _outputs(block, state, given, measured)]
        )

    matrix, unsettled = jacobian(responded, at)
    here = responded(at)
    _check(name, [each.row for each in unsettled], here[:n], at[:n])
    a, b, c = matrix[:n, :n], matrix[:n, n:], matrix[n:, :n]
    return Model(a, b, c, at[:n], at[n:], here[n:])


def _input_of(block: Block, port: str) -> str:
    inputs = [name for name, each in block.spec.inputs.items() if not each.variadic]
    if port and port not in inputs:
        text = f"the plant has no input '{port}'"
        raise ParameterError([("input", misspelt("unknown-input", text, port, inputs))])
    if not port and len(inputs) != 1:
        listed = ", ".join(inputs) or "none"
        raise ParameterError([("input", f"missing; the inputs of the plant are {listed}")])
    return port or inputs[0]


def _sized(value: FloatArray | None, size: int, name: str) -> FloatArray:
    array = np.zeros(size) if value is None else np.atleast_1d(value).astype(np.float64)
    if array.shape != (size,):
        message = f"expected {size} numbers, as the plant has, got {size_of(array)}"
        raise ParameterError([(name, message)])
    return array


def _given(block: Block, state: BlockState, needs: Sequence[str], given: Given) -> list[object]:
    """Arguments of a method: what is given, and defaults of all other inputs."""
    found: list[object] = []
    for name in needs:
        if name in given:
            found.append(given[name])
        elif name in block.spec.outputs:
            found.append(_output(block, state, name, given))
        else:
            declared = block.spec.inputs[name]
            kind = state.context.types[name]
            found.append(() if declared.variadic else kind.filled(declared.default or 0.0))
    return found


def _rates(block: Block, state: BlockState, given: Given) -> FloatArray:
    call = block.spec.derivative
    needs = () if call is None else call.needs
    rates = block.derivative(state, 0.0, *_given(block, state, needs, given))  # type: ignore[attr-defined]
    parts = rates if len(block.spec.continuous) > 1 else (rates,)
    return np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in parts])


def _output(block: Block, state: BlockState, port: str, given: Given) -> object:
    (call,) = (each for each in block.evaluations if port in each.outputs)
    value = getattr(block, call.method)(state, 0.0, *_given(block, state, call.needs, given))
    return value if len(call.outputs) == 1 else value[call.outputs.index(port)]


def _outputs(block: Block, state: BlockState, given: Given, ports: Sequence[str]) -> FloatArray:
    for port in ports:
        if port not in block.spec.outputs:
            text = f"the plant has no output '{port}'"
            message = misspelt("unknown-output", text, port, block.spec.outputs)
            raise ParameterError([("measured", message)])
    values = [np.ravel(np.asarray(_output(block, state, p, given), float)) for p in ports]
    return np.concatenate([np.zeros(0), *values])


def _check(name: str, loose: Sequence[int], rates: FloatArray, x: FloatArray) -> None:
    """Check that the plant rests at the point, and has a derivative there."""
    moving = np.abs(rates) > AT_REST * np.maximum(1.0, np.abs(x))
    if moving.any():
        i = int(np.argmax(np.abs(rates)))
        raise ParameterError(
            [
                (
                    "x0",
                    f"'{name}' does not rest there: number {i} of its states changes by "
                    f"{rates[i]:.4g} per unit of time; runtime linearize --trim finds a point",
                )
            ]
        )
    if loose:
        message = f"'{name}' has no derivative there: a limit or a kink is at this point"
        raise ParameterError([("x0", message)])


def regulator_gain(model: Model, q: FloatArray, r: FloatArray, is_sampled: bool) -> FloatArray:
    """K (m, n) of u = -K x, which minimises the integral, or the sum, of x'Qx + u'Ru.

    Raises
    ------
    ParameterError : no gain makes the loop stable.
    """
    from scipy import linalg

    a, b = model.a, model.b
    try:
        if is_sampled:
            p = linalg.solve_discrete_are(a, b, q, r)
            gain = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
        else:
            p = linalg.solve_continuous_are(a, b, q, r)
            gain = np.linalg.solve(r, b.T @ p)
    except np.linalg.LinAlgError:
        raise ParameterError([_why(a, b, q, is_sampled)]) from None
    if not _is_stable(a - b @ gain, is_sampled):
        raise ParameterError([_why(a, b, q, is_sampled)])
    return rounded(gain)


def observer_gain(model: Model, q: FloatArray, r: FloatArray, is_sampled: bool) -> FloatArray:
    """L (n, p): of x' = A x + B u + L (y - C x), or of the correction x + L (y - C x) at a tick.

    The dual of a regulator: that of A', C' is L' (Kalman and Bucy, 1961); sampled, A L is.

    Raises
    ------
    ParameterError : the measurements do not determine the states.
    """
    from scipy import linalg

    a, c = model.a, model.c
    try:
        if is_sampled:
            p = linalg.solve_discrete_are(a.T, c.T, q, r)
            gain = np.linalg.solve(c @ p @ c.T + r, c @ p).T
        else:
            p = linalg.solve_continuous_are(a.T, c.T, q, r)
            gain = np.linalg.solve(r, c @ p).T
    except np.linalg.LinAlgError:
        raise ParameterError([_why(a.T, c.T, q, is_sampled, observed=True)]) from None
    closed = a - a @ gain @ c if is_sampled else a - gain @ c
    if not _is_stable(closed, is_sampled):
        raise ParameterError([_why(a.T, c.T, q, is_sampled, observed=True)])
    return rounded(gain)


def rounded(values: FloatArray) -> FloatArray:
    """Numbers to twelve digits: LAPACK's last ones depend on the processor."""
    sizes = np.where(values == 0.0, 1.0, np.abs(values))
    scale = 10.0 ** (DIGITS - 1 - np.floor(np.log10(sizes)))
    return np.asarray(np.round(values * scale) / scale, dtype=np.float64)


def _is_stable(a: FloatArray, is_sampled: bool) -> bool:
    poles = np.linalg.eigvals(a)
    return bool((np.abs(poles) < 1.0).all() if is_sampled else (poles.real < 0.0).all())


def _why(
    a: FloatArray, b: FloatArray, q: FloatArray, is_sampled: bool, observed: bool = False
) -> tuple[str, str]:
    """Why a Riccati equation has no stabilising solution (Hautus, 1969), by parameter."""
    n = len(a)
    for pole in np.linalg.eigvals(a):
        outside = abs(pole) >= 1.0 - 1e-9 if is_sampled else pole.real >= -1e-9
        shifted = a - pole * np.eye(n)
        at = f"{pole.real:.4g}{pole.imag:+.4g}j" if abs(pole.imag) > 1e-12 else f"{pole.real:.4g}"
        if outside and np.linalg.matrix_rank(np.column_stack([shifted, b]), tol=1e-8) < n:
            if observed:
                return (
                    "R",
                    f"no measurement shows the mode of the pole {at}, which does not decay",
                )
            return "R", f"no input moves the mode of the pole {at}, which does not decay"
        if outside and np.linalg.matrix_rank(np.column_stack([shifted.T, q]), tol=1e-8) < n:
            what = "noise of Q reaches" if observed else "weight of Q sees"
            return "Q", f"no {what} the mode of the pole {at}, which does not decay"
    return "Q", "the Riccati equation has no stabilising solution: its numbers differ too much"


def square(value: FloatArray, size: int) -> FloatArray:
    """A weight or a covariance (size, size), of which the diagonal may be given."""
    matrix = np.asarray(value, dtype=np.float64)
    if matrix.ndim == 0:
        matrix = np.full(size, float(matrix))
    return np.diag(matrix) if matrix.ndim == 1 else matrix
