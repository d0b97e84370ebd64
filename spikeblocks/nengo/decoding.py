"""What a decoder computes: its function and its transform, or its weights.

In: connections of a Nengo network, and what its simulator solved. Out: entries of a Decoder::

    {type: Decoder, weights: <array>}  # of x[0]*x[1]
    {type: Decoder, function: "x[0]*x[1]", transform: 2.0}       # with neurons drawn anew
"""

from __future__ import annotations

import re
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from spikeblocks.nengo import nodes
from spikeblocks.nengo.expressions import Text
from spikeblocks.nengo.flow import Decoded, is_full
from spikeblocks.nengo.populations import solver_entry


def decoder_entry(
    source: Decoded,
    weights: FloatArray,
    matrix: FloatArray | None,
    simulator: Any,
    redraw: bool,
    live: bool = False,
) -> tuple[dict[str, Any], str]:
    """The entry of a Decoder, and what it decodes as a comment."""
    connection = source.connection
    given: dict[str, Any] = {"type": "Decoder", "weights": weights}
    if source.population.groups > 1:
        given["groups"] = source.population.groups
    if live or isinstance(connection.pre_obj, nengo.ensemble.Neurons) or is_full(connection):
        return given, ""
    text = function_text(connection)
    if not redraw:
        shown = text if isinstance(text, str) else ", ".join(text or [])
        return given, shown and f"of {shown}"
    entry: dict[str, Any] = {"type": "Decoder"}
    if text is None:
        entry["function"] = function_table(connection, simulator)
    elif text:
        entry["function"] = text
    transform = _transform(connection)
    if source.population.groups > 1:
        if not np.array_equal(transform, transform[0, 0] * np.eye(len(transform))):
            raise UsageError(f"{connection}: a matrix in an array is not drawn anew")
        factor = transform[0, 0] * (1.0 if matrix is None else matrix[0, 0])
        if factor != 1.0:
            entry["transform"] = float(factor)
        return entry, ""
    whole = transform if matrix is None else matrix @ transform
    if whole.shape[0] != whole.shape[1] or not np.array_equal(whole, np.eye(len(whole))):
        is_number = whole.shape == (1, 1)
        entry["transform"] = float(whole[0, 0]) if is_number else whole
    solver = solver_entry(connection.solver)
    return entry if solver is None else {**entry, "solver": solver}, ""


def weights_of(source: Decoded, matrix: FloatArray | None) -> FloatArray:
    """The weights of all members side by side, multiplied by a matrix or by a number."""
    n = source.population.first.n_neurons
    rows = [np.zeros((source.rows, n)) if w is None else w for w in source.weights]
    whole = np.concatenate(rows, axis=1)
    if matrix is None:
        return whole
    factor = matrix[0, 0] if source.population.groups > 1 else None
    return np.asarray(matrix @ whole if factor is None else factor * whole)


def function_table(connection: Any, simulator: Any) -> dict[str, FloatArray]:
    """A function that is no expression, as its values at the points that Nengo solves on."""
    points = np.asarray(simulator.data[connection].eval_points, dtype=float)
    values: Any = connection.function
    if callable(values):
        values = [np.atleast_1d(values(x)) for x in points[:, connection.pre_slice]]
    return {"points": points, "targets": np.array(values, dtype=float)}


def function_text(connection: Any) -> Text | None:
    """What a connection computes of x, the represented vector; '' is x itself."""
    ensemble, chosen = connection.pre_obj, list(range(connection.pre_obj.size_out))
    chosen = np.arange(len(chosen))[connection.pre_slice].tolist()
    if connection.function is None:
        return "" if len(chosen) == ensemble.dimensions else [f"x[{i}]" for i in chosen]
    function = connection.function
    if not callable(function):
        return None
    text = nodes.of_values(
        lambda x: function(x[chosen]), ensemble.dimensions, "x", ensemble.radius
    ) if len(chosen) < ensemble.dimensions else None  # fmt: skip
    if text is None:
        text = nodes.of_values(function, len(chosen), "x", ensemble.radius)
        if len(chosen) < ensemble.dimensions and text is not None:
            text = _renumbered(text, chosen)
    return text


class Probed:
    """What a probe of an ensemble decodes, as if it were a connection."""

    function = None
    pre_slice = slice(None)
    learning_rule_type = None
    transform = nengo.transforms.NoTransform(1)
    solver = nengo.solvers.LstsqL2()
    post_obj = None

    def __init__(self, ensemble: Any, synapse: Any) -> None:
        self.pre_obj, self.synapse = ensemble, synapse
        self.size_mid = self.size_out = ensemble.dimensions


def between_neurons(connection: Any) -> bool:
    """Whether a connection has a weight for each pair of neurons."""
    return is_full(connection) or (
        isinstance(connection.pre_obj, nengo.ensemble.Neurons)
        and isinstance(connection.post_obj, nengo.ensemble.Neurons)
    )


def _transform(connection: Any) -> FloatArray:
    transform = connection.transform
    if isinstance(transform, nengo.transforms.NoTransform):
        return np.eye(connection.size_mid)
    value = transform.sample()
    value = value.toarray() if hasattr(value, "toarray") else np.asarray(value, dtype=float)
    if value.ndim < 2:
        return value * np.eye(connection.size_mid)
    return np.asarray(value)


def _renumbered(text: Text, chosen: list[int]) -> Text | None:
    """A text of some components in terms of all of them."""
    if isinstance(text, list):
        parts = [_renumbered(each, chosen) for each in text]
        return None if any(p is None for p in parts) else [str(p) for p in parts]
    if len(chosen) == 1:
        text = re.sub(r"(?<![\w.])x(?:\[0\])?(?![\w(\[])", f"x[{chosen[0]}]", text)
        return text
    if re.search(r"(?<![\w.])x(?!\[\d+\]|\w)", text):
        return None
    return re.sub(r"(?<![\w.])x\[(\d+)\]", lambda m: f"x[{chosen[int(m[1])]}]", text)


def sliced_spikes(connection: Any, spikes: str, weights: FloatArray) -> tuple[str, FloatArray]:
    """The spikes of the neurons that a connection comes from, and the weights of these."""
    chosen = np.arange(weights.shape[1])[connection.pre_slice]
    if len(chosen) == weights.shape[1]:
        return spikes, weights
    if not np.array_equal(chosen, chosen[0] + np.arange(len(chosen))):
        raise UsageError(f"{connection}: only ranges of neurons learn")
    return f"{spikes}[{chosen[0]}:{chosen[-1] + 1}]", weights[:, chosen]
