"""Weights that are solved from the tuning of the ensemble whose spikes a block reads.

In: the published tuning of the neurons, a function and the points to solve on. Out: decoding
weights (rows, n) with W rates(x) close to f(x), before the first tick::

    W = solver(rates at the points (m, n), f of the points (m, k)) times transform
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Container, Mapping

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    Constants,
    Definitions,
    FloatArray,
    Input,
    Output,
    ParameterError,
    SettingError,
    Spikes,
    State,
    Vector,
    kernel_of,
    misnamed,
    param,
)
from blocks.neural.decoded_function import DecodedFunction, OwnNames, PointError
from blocks.neural.decoder_solvers import DecoderSolver, SingularError, rmse
from blocks.neural.distributions import Distribution
from blocks.neural.ensemble import Ensemble
from blocks.neural.published_tuning import Tuning

# Between these bounds the number of points follows the dimensions, as in Nengo; twice the neurons
# keep the system overdetermined, up to a number at which solving would take seconds.
LEAST_POINTS, MOST_POINTS, POINTS_PER_DIMENSION, MANY_POINTS = 750, 2500, 500, 4000
# Up to this many decoders, a loop over them takes less time than the indices of a common sum.
FEW = 3


class Solved(Block, ABC):
    """The part of a Decoder that finds its weights."""

    spikes = Input(Spikes("n"), doc="spikes, or rates, of an ensemble")
    out = Output(Vector("k"), name="value", doc="the decoded value")

    function: DecodedFunction | None = param(
        None, doc="of x, the represented vector: expressions, or a table; default x itself"
    )
    constants: Constants | None = param(
        None, doc="names that the function uses, with their values: {k: 2.5}"
    )
    let: Definitions | None = param(
        None, doc="names with expressions that the function uses: {r: norm(x)}"
    )
    transform: FloatArray | None = param(
        None,
        shape=[(), (None, None)],
        doc="a factor or matrix that multiplies the value: of each group, or of all together",
    )
    weights_given: FloatArray | None = param(
        None, name="weights", shape=(None, None), doc="weights, in place of solved ones"
    )
    groups_given: int = param(
        1, at_least=1, name="groups", doc="groups of neurons, each with columns of ``weights``"
    )
    eval_points: Distribution | None = param(
        None, doc="points to solve on, per radius, a row each; default drawn within the radius"
    )
    points: int | None = param(None, at_least=1, doc="number of points; default by size")
    solver: DecoderSolver = param("l2", doc="solver of the weights")

    weights = State("rows", "n", doc="decoding weights W, per group")

    @abstractmethod
    def output(self, state: BlockState, t: float, spikes: FloatArray) -> FloatArray:
        """The decoded value (k,)."""

    def sizes(self) -> dict[str, int]:
        if self.weights_given is None:
            return {}
        rows, n = self.weights_given.shape
        return {"rows": rows, "k": rows * self.groups_given, "n": n}

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        if self.weights_given is not None or "d" not in lengths or "groups" not in lengths:
            return {}
        rows = self._components(max(1, lengths["d"] // lengths["groups"]))
        if self.transform is not None and self.transform.ndim == 2:
            rows = self.transform.shape[0]
        return {"rows": rows, "k": rows * self.groups_out(lengths)}

    def groups_out(self, lengths: Mapping[str, int]) -> int:
        """The groups that values are decoded for: one where a matrix mixes those of the neurons."""
        if self.weights_given is not None:
            return self.groups_given
        groups = lengths.get("groups", 1)
        matrix = self.transform
        if groups == 1 or matrix is None or matrix.ndim != 2:
            return groups
        inside = self._components(max(1, lengths["d"] // groups))
        return 1 if matrix.shape[1] == groups * inside else groups

    def _components(self, d: int) -> int:
        """The length of the function's value at a point of d dimensions."""
        return d if self.function is None else self.function.components(d, self._own_names)

    def validate(self) -> None:
        fixed = self.weights_given is not None
        both = [
            name
            for name in ("function", "transform", "eval_points")
            if self.value(name) is not None
        ]
        variables = {"x": "the represented vector"}
        problems = [
            (name, text)
            for name, names in (("constants", self.constants), ("let", self.let))
            for _, text in misnamed(names or (), variables)
        ]
        if not fixed and self.groups_given > 1:
            message = "belongs to 'weights'; without them the groups are those of the ensemble"
            problems.append(("groups", message))
        if self.weights_given is not None and self.weights_given.shape[1] % self.groups_given:
            columns = f"{self.weights_given.shape[1]} columns of 'weights'"
            problems.append(("groups", f"{columns} cannot be divided among {self.groups_given}"))
        if problems:
            raise ParameterError(problems)
        if self.function is not None and self.eval_points is not None:
            parts = (self.function, *self.function.each)
            if any(part.table is not None for part in parts):
                message = "a table has points of its own; remove one of the two"
                raise ParameterError([("eval_points", message)])
        if fixed and both:
            message = "weights that are given are used as they are; remove one of the two"
            raise ParameterError([(name, message) for name in both])

    def validate_in(self, context: BlockContext) -> None:
        if self.weights_given is not None:
            return
        message = self.why_open(context.published)
        if message:
            raise ParameterError([("spikes", message)])
        groups, d = context.lengths["groups"], context.lengths["d"]
        problems = []
        out = self.groups_out(context.lengths)
        wired, own = context.types["value"].shape[0], context.lengths["rows"] * out
        if wired != own:
            message = f"the decoded value has {own} numbers, but {wired} are expected where it goes"
            problems.append(("function" if self.transform is None else "transform", message))
        inside = self._components(d // groups)
        matrix = self.transform
        own_groups = matrix is not None and matrix.ndim == 2 and out == groups
        if matrix is not None and own_groups and matrix.shape[1] != inside:
            message = f"expected a matrix with {inside} columns, got {matrix.shape}"
            message += f"; {groups * inside} columns mix the groups" if groups > 1 else ""
            problems.append(("transform", message))
        if self.function is not None:
            wrong = self.function.wrong_for(groups, d // groups, self._own_names)
            if wrong:
                raise ParameterError([("function", wrong)])
        for group in range(groups if self.function is not None and self.function.each else 1):
            problems += self._unusable(d // groups, context.published.get("spikes"), group)
        if problems:
            raise ParameterError(problems)

    def why_open(self, published: Container[str]) -> str:
        if self.weights_given is not None or "spikes" in published:
            return ""
        return (
            "the spikes come from no ensemble, so there is no tuning to solve weights for; "
            "wire the spikes of an Ensemble directly, or give 'weights'"
        )

    def _unusable(self, d: int, source: Block | None, group: int) -> list[tuple[str, str]]:
        """What is wrong with the points, or with the function at some of them.

        Points that are drawn are others than those of a run, of the same distribution.
        """
        neurons, radius = 10, 1.0
        if isinstance(source, Ensemble):
            neurons, radius = source.neurons, source.radius
        try:
            points = self._points(np.random.default_rng(0), neurons, d, radius, group)
        except ValueError as error:
            return [("eval_points", str(error))]
        try:
            self._targets(points, group)
        except SettingError as error:
            return [("function", error.problems[0][1])]
        except PointError as error:
            return [("function", str(error))]
        return []

    def _targets(self, points: FloatArray, group: int) -> FloatArray:
        if self.function is None:
            return points
        return self.function.of_group(group).of_points(points, self._own_names)

    @property
    def _own_names(self) -> OwnNames:
        return self.constants, self.let

    def _points(
        self, rng: np.random.Generator, n: int, d: int, radius: float, group: int
    ) -> FloatArray:
        """Evaluation points (m, d)."""
        table = None if self.function is None else self.function.of_group(group).table
        if table is not None:
            return table[0]
        distribution = self.eval_points
        if distribution is None:
            distribution = Distribution("ball")
        elif distribution.fixed is not None and distribution.fixed.size > 1:
            rows = (
                distribution.fixed if distribution.fixed.ndim == 2 else distribution.fixed[:, None]
            )
            if rows.shape[1] != d:
                raise ValueError(f"expected rows of {d} numbers, got {rows.shape[1]}")
            return rows * radius
        count = min(max(POINTS_PER_DIMENSION * d, LEAST_POINTS), MOST_POINTS)
        count = max(count, min(2 * n, MANY_POINTS)) if self.points is None else self.points
        return distribution.draw(rng, count, d) * radius

    def solve(self, rng: np.random.Generator, tuning: Tuning) -> tuple[FloatArray, float]:
        """The weights (rows, groups * n), solved for each group, and the error on the points."""
        n, solved, errors = tuning.neurons, [], []
        for group in range(tuning.groups):
            # Each group has points of its own, as each ensemble of Nengo's has: with shared ones
            # the errors of the groups would be alike.
            points = self._points(rng, n, tuning.dimensions, tuning.radius, group)
            try:
                targets = self._targets(points, group)
            except PointError as error:
                raise ParameterError([("function", str(error))], type(self).__name__) from None
            decoders, wrong = np.zeros((n, targets.shape[1])), 0.0
            if targets.any():  # else there is nothing to solve: the weights are zero
                rates = tuning.rates(points, group)
                try:
                    decoders = self.solver.solve(rates, targets, rng)
                except SingularError as error:
                    raise ParameterError([("solver", str(error))], type(self).__name__) from None
                wrong = rmse(rates, targets, decoders)
            errors.append(wrong)
            solved.append(self._transformed(decoders.T, group))
        return np.hstack(solved), math.sqrt(sum(e * e for e in errors) / len(errors))

    def _transformed(self, weights: FloatArray, group: int) -> FloatArray:
        if self.transform is None:
            return weights
        if self.transform.ndim == 0:
            return weights * self.transform
        inside, matrix = len(weights), self.transform
        if matrix.shape[1] > inside:  # it mixes the groups
            matrix = matrix[:, group * inside : (group + 1) * inside]
        return np.asarray((matrix[:, :, None] * weights[None]).sum(axis=1))


def decode(weights: FloatArray, spikes: FloatArray, groups: int) -> FloatArray:
    """The sums of weights (rows, n) times spikes (n,), group by group, (groups * rows,).

    Most neurons are silent in a step: only the others are added up.
    """
    firing = spikes.astype(bool).nonzero()[0]  # quicker than spikes.nonzero()
    amounts = weights.take(firing, 1) * spikes[firing]
    if groups == 1:
        return np.asarray(np.add.reduce(amounts, 1))
    # bincount adds in the order of the neurons, as the kernel does.
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
    # Those that fire are marked, then listed, both without a branch; the sums are in NumPy's order.
    firing, amounts = np.empty(n, dtype=np.int64), np.empty(n)
    for i in range(n):
        firing[i] = spikes[i] != 0.0
    for group in range(groups):
        start, count = group * each, 0
        for i in range(start, start + each):
            marked = firing[i]
            firing[count] = i
            count += marked
        for row in range(rows):
            # All of them, as for rates and filtered spikes: without the list, this is vectorised.
            if count == each:
                for k in range(each):
                    amounts[k] = weights[row, start + k] * spikes[start + k]
            else:
                for k in range(count):
                    amounts[k] = weights[row, firing[k]] * spikes[firing[k]]
            total = 0.0
            if groups == 1:
                total = np.sum(amounts[:count])
            else:
                for k in range(count):
                    total += amounts[k]
            value[group * rows + row] = total
    return value


def decode_each(weights: FloatArray, spikes: FloatArray, groups: int) -> FloatArray:
    """For each member what :func:`decode` makes of weights (m, rows, n), spikes (m, n)."""
    members, rows, n = weights.shape
    if members <= FEW:
        return np.array([decode(w, s, groups) for w, s in zip(weights, spikes, strict=True)])
    flat = spikes.reshape(-1)
    firing = flat.astype(bool).nonzero()[0]
    member, fired = firing // n, flat[firing]
    # Where the weights of the first row are: those of member i begin at i rows n.
    first = firing + member * ((rows - 1) * n) if rows > 1 else firing
    if groups > 1:
        each = n // groups
        counted = [
            np.bincount(firing // each, weights.take(first + row * n) * fired, members * groups)
            for row in range(rows)
        ]
        return np.array(counted, dtype=float).T.reshape(members, groups * rows)
    # A sum over a part begins with its first number, one over a row with 0: so a 0 before each.
    padded = np.zeros((rows, len(firing) + members))
    at = np.arange(1, len(firing) + 1) + member
    for row in range(rows):
        padded[row, at] = weights.take(first + row * n) * fired
    starts = np.arange(members) + firing.searchsorted(np.arange(0, members * n, n))
    return np.ascontiguousarray(np.add.reduceat(padded, starts, 1).T)
