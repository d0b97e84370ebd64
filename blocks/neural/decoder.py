"""Decoders: from the spikes of an ensemble to a function of what it represents."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import final

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Spikes,
    State,
    Vector,
    kernel_of,
    param,
)
from blocks.neural.distributions import Distribution
from blocks.neural.solvers import SingularError, Solver, rmse
from blocks.neural.synapses import Synapse
from blocks.neural.tuning import Tuning

LEAST_POINTS, MOST_POINTS, POINTS_PER_DIMENSION = 750, 2500, 500


@final
class Decoder(Block):
    """Decode a function of what an ensemble represents from its spikes.

        spikes ─▶ [ Decoder ] ─▶ value

    Decoding  value = h * (W spikes), h the synapse
    Weights   W from the solver: decoders of the tuning curves, A D = f(points), times transform

    The weights follow from the tuning of the ensemble whose spikes are wired here, on points drawn
    evenly within its radius, unless ``weights`` are given. The synapse is discretised exactly for
    an input that holds: with a lowpass, s += (1 - exp(-dt / tau)) (W spikes - s). Spikes between
    t_k-1 and t_k are in the value at t_k.
    """

    spikes = Input(Spikes("n"), doc="spikes, or rates, of an ensemble")
    out = Output(Vector("k"), name="value", doc="the decoded value")

    weights_given: FloatArray | None = param(
        None, name="weights", shape=(None, None), doc="weights, in place of solved ones"
    )
    transform: FloatArray | None = param(
        None, shape=[(), (None, None)], doc="a factor, or a matrix, that the value is multiplied by"
    )
    eval_points: Distribution | None = param(
        None, doc="points to solve on, per radius, a row each; default drawn within the radius"
    )
    points: int | None = param(None, at_least=1, doc="number of points; default by size")
    solver: Solver = param("l2", doc="solver of the weights")
    synapse: Synapse = param(0.005, unit="s", doc="filter of the value")

    weights = State("rows", "n", doc="decoding weights W, per group")
    filtered = State("order", "k", doc="the filter's states")

    def sizes(self) -> dict[str, int]:
        found = {"order": self.synapse.order}
        if self.weights_given is not None:
            rows, found["n"] = self.weights_given.shape
            found |= {"rows": rows, "k": rows}
        return found

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        if "d" not in lengths or "groups" not in lengths:
            return {}
        rows = self._components(max(1, lengths["d"] // lengths["groups"]))
        if self.transform is not None and self.transform.ndim == 2:
            rows = self.transform.shape[0]
        return {"rows": rows, "k": rows * lengths["groups"]}

    def _components(self, d: int) -> int:
        """The length of the function's value at a point of d dimensions."""
        return d

    def validate_in(self, context: BlockContext) -> None:
        if self.weights_given is not None:
            return
        if "spikes" not in context.published:
            message = (
                "these spikes come from no ensemble, so there is no tuning to solve weights for; "
                "wire the spikes of an Ensemble directly, or give 'weights'"
            )
            raise ParameterError([("weights", message)])
        groups, d = context.lengths["groups"], context.lengths["d"]
        problems = []
        wired, own = context.types["value"].shape[0], context.lengths["rows"] * groups
        if wired != own:
            message = f"the decoded value has {own} numbers, but {wired} are expected where it goes"
            problems.append(("transform" if self.transform is not None else "weights", message))
        inside = self._components(d // groups)
        if self.transform is not None and self.transform.ndim == 2:
            if groups > 1:
                message = "with groups, expected a number; a matrix would mix the groups"
                problems.append(("transform", message))
            elif self.transform.shape[1] != inside:
                message = f"expected a matrix with {inside} columns, got {self.transform.shape}"
                problems.append(("transform", message))
        if self.eval_points is not None:
            try:
                self._points(np.random.default_rng(0), 10, d // groups, 1.0)
            except ValueError as error:
                problems.append(("eval_points", str(error)))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        a, b = self.synapse.matrices(state.dt)
        state.a, state.b, state.order = a, b, self.synapse.order
        state.share = float(b[0]) if self.synapse.order == 1 else 0.0
        state.groups, state.error = 1, math.nan
        if self.weights_given is not None:
            state.weights[...] = self.weights_given
        else:
            tuning: Tuning = state.published["spikes"]
            state.groups = tuning.groups
            self._solve(state, tuning)

    def _points(self, rng: np.random.Generator, n: int, d: int, radius: float) -> FloatArray:
        """Evaluation points (m, d)."""
        given = self.eval_points
        if given is None:
            given = Distribution("ball")
        elif given.fixed is not None and given.fixed.size > 1:
            rows = given.fixed if given.fixed.ndim == 2 else given.fixed[:, None]
            if rows.shape[1] != d:
                raise ValueError(f"expected rows of {d} numbers, got {rows.shape[1]}")
            return rows * radius
        count = min(max(POINTS_PER_DIMENSION * d, LEAST_POINTS), MOST_POINTS)
        count = max(count, 2 * n) if self.points is None else self.points
        return given.draw(rng, count, d) * radius

    def _solve(self, state: BlockState, tuning: Tuning) -> None:
        """Solve the weights of each group, and note the error on the points."""
        n, errors = tuning.neurons, []
        points = self._points(state.rng, n, tuning.dimensions, tuning.radius)
        targets = points
        for group in range(tuning.groups):
            rates = tuning.rates(points, group)
            try:
                decoders = self.solver.solve(rates, targets, state.rng)
            except SingularError as error:
                raise ParameterError([("solver", str(error))], "Decoder") from None
            errors.append(rmse(rates, targets, decoders))
            weights = decoders.T
            if self.transform is not None:
                weights = (
                    weights * self.transform
                    if self.transform.ndim == 0
                    else ((self.transform[:, :, None] * weights[None]).sum(axis=1))
                )
            state.weights[:, group * n : (group + 1) * n] = weights
        state.error = math.sqrt(sum(e * e for e in errors) / len(errors))

    def output(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        decoded = decode(state.weights, spikes, state.groups)
        if self.synapse.order == 0:
            return decoded
        if self.synapse.order == 1:
            return np.asarray(state.filtered[0] + state.share * (decoded - state.filtered[0]))
        first, second = state.filtered
        return np.asarray(
            state.a.item(2) * first + state.a.item(3) * second + state.b.item(1) * decoded
        )

    @kernel_of(output)
    def _output_kernel(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        value = decode(state.weights, spikes, state.groups)
        memory = state.filtered
        if state.order == 1:
            for i in range(len(value)):
                value[i] = memory[0, i] + state.share * (value[i] - memory[0, i])
        if state.order == 2:
            a, b = state.a, state.b
            for i in range(len(value)):
                value[i] = a[1, 0] * memory[0, i] + a[1, 1] * memory[1, i] + b[1] * value[i]
        return value

    def update(self, state: BlockState, t: float, spikes: FloatArray, value: FloatArray) -> None:
        if self.synapse.order == 1:
            state.filtered[0] = value
        elif self.synapse.order == 2:
            first, second = state.filtered
            decoded = decode(state.weights, spikes, state.groups)
            first[:] = (
                state.a.item(0) * first + state.a.item(1) * second + state.b.item(0) * decoded
            )
            second[:] = value

    @kernel_of(update)
    def _update_kernel(
        self, state: BlockState, t: float, spikes: FloatArray, value: FloatArray
    ) -> None:
        memory = state.filtered
        if state.order == 1:
            for i in range(len(value)):
                memory[0, i] = value[i]
        if state.order == 2:
            a, b = state.a, state.b
            decoded = decode(state.weights, spikes, state.groups)
            for i in range(len(value)):
                memory[0, i] = a[0, 0] * memory[0, i] + a[0, 1] * memory[1, i] + b[0] * decoded[i]
                memory[1, i] = value[i]


def decode(weights: FloatArray, spikes: FloatArray, groups: int) -> FloatArray:
    """The sums of weights (rows, n) times spikes (n,), group by group, (groups * rows,).

    Most neurons are silent in a step: only the others are added up.
    """
    firing = spikes.nonzero()[0]
    amounts = weights.take(firing, 1) * spikes[firing]
    if groups == 1:
        return np.asarray(np.add.reduce(amounts, 1))
    group_of = firing // (weights.shape[1] // groups)
    value = np.empty((groups, len(weights)))
    for row in range(len(weights)):
        value[:, row] = np.bincount(group_of, amounts[row], groups)
    return value.reshape(-1)


@kernel_of(decode)
def _decode_kernel(weights: FloatArray, spikes: FloatArray, groups: int) -> FloatArray:
    rows, n = weights.shape
    each = n // groups
    value = np.zeros(groups * rows)
    for group in range(groups):
        for i in range(group * each, (group + 1) * each):
            if spikes[i] != 0.0:
                for row in range(rows):
                    value[group * rows + row] += weights[row, i] * spikes[i]
    return value
