"""Functions of decoders: tables, one for each group, and matrices over groups."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest

import blocks
import runtime
from tests.blocks.neural.models import Wave, drawn, ensemble, graph, simulated

ENGINES = ("python", "compiled")
POINTS = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2))
TARGETS = np.stack([POINTS[:, 0] * POINTS[:, 1], np.sin(3.0 * POINTS[:, 0]), POINTS[:, 1]], axis=1)


def test_a_table_of_points_and_targets_is_nengos() -> None:
    fixed = drawn(80, 2, 4)
    with nengo.Network(seed=1) as model:
        theirs = ensemble(80, 2, fixed)
        link = nengo.Connection(
            theirs,
            nengo.Node(size_in=3),
            function=TARGETS,
            eval_points=POINTS,
            scale_eval_points=False,
            solver=nengo.solvers.LstsqL2(reg=0.05),
        )
    expected = simulated(model, 0.001).data[link].weights
    table = {"points": POINTS.tolist(), "targets": TARGETS.tolist()}
    made = graph(0.05).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=80, **fixed))
    made = made.add("out", blocks.Decoder(function=table, solver={"type": "l2", "reg": 0.05}))
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")
    for engine in ENGINES:
        found = made.probe("out.weights").run(engine=engine)["out.weights"][0]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


def groups(**decoder: Any) -> runtime.Graph:
    """Three groups of one dimension each."""
    made = graph(0.2).add("x", Wave(size=3)).add("a", blocks.Ensemble(neurons=30, groups=3))
    made = made.add("out", blocks.Decoder(**decoder)).connect("x.out", "a.input")
    return made.connect("a.spikes", "out.spikes").probe("out.value")


LINE = {"eval_points": np.linspace(-1.0, 1.0, 40).reshape(-1, 1)}


@pytest.mark.parametrize("engine", ENGINES)
def test_a_matrix_multiplies_what_the_groups_decode(engine: str) -> None:
    """Over all groups or of each: as a Gain behind a Decoder without it."""
    mixed = np.random.default_rng(1).standard_normal((2, 3))
    plain = groups(**LINE).run(engine=engine)["out.value"]
    found = groups(transform=mixed, **LINE).run(engine=engine)["out.value"]
    np.testing.assert_allclose(found, plain @ mixed.T, atol=1e-12)
    each = groups(transform=[[2.0], [-1.0]], **LINE).run(engine=engine)["out.value"]
    np.testing.assert_allclose(each.reshape(-1, 3, 2), plain[:, :, None] * [2.0, -1.0], atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_each_group_has_a_function_of_its_own(engine: str) -> None:
    functions = ["x**2", "sin(k*x)", "-x"]
    constants = {"k": 2.0}
    found = groups(function={"each": functions}, constants=constants, **LINE)
    value = found.run(engine=engine)["out.value"]
    for i, function in enumerate(functions):
        alone = groups(function=function, constants=constants if "k" in function else None, **LINE)
        np.testing.assert_array_equal(value[:, i], alone.run(engine=engine)["out.value"][:, i])


@pytest.mark.parametrize(
    ("decoder", "message"),
    [
        ({"function": {"each": ["x", "x"]}}, "expected a function for each of 3 groups, got 2"),
        ({"function": {"each": ["x", ["x", "x"], "x"]}}, "as many components each"),
        ({"function": {"points": [[1, 2]], "targets": [1]}}, "expected points of 1 numbers"),
        ({"function": {"each": ["x", "y", "x"]}}, "out.function: .*y"),
        ({"transform": [[1, 2]]}, "expected a matrix with 1 columns, .* 3 columns mix the groups"),
    ],
)
def test_errors_in_groups(decoder: Any, message: str) -> None:
    with pytest.raises(runtime.GraphError, match=message):
        groups(**decoder).check()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        ({"points": [1, 2], "targets": [1]}, "function.targets: expected a target for each of 2"),
        ({"points": [1, "a"], "targets": [1, 2]}, "function.points: expected finite numbers"),
        ({"point": [1], "targets": [1]}, "expected an expression"),
        ({"each": []}, "expected an expression"),
    ],
)
def test_wrong_functions(function: Any, message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        blocks.Decoder(function=function)


def test_a_table_has_points_of_its_own() -> None:
    with pytest.raises(blocks.ParameterError, match="eval_points: a table has points of its own"):
        blocks.Decoder(function={"points": [1, 2], "targets": [1, 2]}, **LINE)
