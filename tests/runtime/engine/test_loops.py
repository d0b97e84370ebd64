"""Algebraic loops that a run solves, beside closed forms, scipy and a conserved length."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import blocks as library
import runtime
from blocks.core import Block, BlockState, Input, Output, Scalar
from runtime.cli.explain import explain_text

ENGINES = ["python", "compiled"]


def load(
    blocks: dict[str, Any], wires: dict[str, Any], *probes: str, classes: Any = (), **run: Any
) -> runtime.Graph:
    settings = {"dt": 0.05, "until": 2.0, "loops": "solve", **run}
    return runtime.load(
        {
            "graph": "loop",
            "run": settings,
            "blocks": blocks,
            "wires": wires,
            "probes": {each.replace(".", "_"): each for each in probes},
        }
    )


def feedback(gain: Any, reference: dict[str, Any]) -> runtime.Graph:
    made = {
        "r": reference,
        "s": {"type": "Sum", "signs": [1, -1]},
        "g": {"type": "Gain", "gain": gain},
    }
    return load(
        made, {"s": {"terms": ["r.out", "g.out"]}, "g": {"input": "s.out"}}, "s.out", "r.out"
    )


@pytest.mark.parametrize("engine", ENGINES)
@given(gain=st.floats(-1e6, 1e6).filter(lambda g: abs(1 + g) > 1e-3), size=st.floats(1e-9, 1e9))
def test_a_linear_loop_is_its_closed_form(engine: str, gain: float, size: float) -> None:
    result = feedback(gain, {"type": "Sine", "frequency": 0.7, "amplitude": size}).run(
        engine=engine
    )
    expected = result["r_out"] / (1.0 + gain)
    np.testing.assert_allclose(result["s_out"], expected, rtol=1e-9, atol=1e-12 * size)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_loop_of_vectors_is_a_system_of_equations(engine: str) -> None:
    gain = np.array([[0.5, 2.0, 0.0], [-1.0, 0.3, 4.0], [0.2, 0.0, -3.0]])
    reference = {"type": "Function", "expression": ["sin(t)", "t", "1"]}
    result = feedback(gain.tolist(), reference).run(engine=engine)
    expected = np.linalg.solve(np.eye(3) + gain, result["r_out"].T).T
    np.testing.assert_allclose(result["s_out"], expected, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("engine", ENGINES)
def test_two_constraints_that_need_each_other(engine: str) -> None:
    made = {
        "t": {"type": "Function", "expression": "1 + 0.5 * sin(3 * t)"},
        "a": {"type": "AlgebraicConstraint", "expression": "z**3 + z - u[0] - u[1]"},
        "b": {"type": "AlgebraicConstraint", "expression": "z + exp(z) - 0.5 * u[0]"},
    }
    for name in ("a", "b"):
        made[name] |= {"low": -20.0, "high": 20.0}
    wires = {"a": {"u": ["t.out", "b.out"]}, "b": {"u": ["a.out"]}}
    result = load(made, wires, "a.out", "b.out", "t.out").run(engine=engine)

    def rest(z: Any, u: float) -> list[float]:
        return [z[0] ** 3 + z[0] - u - z[1], z[1] + np.exp(z[1]) - 0.5 * z[0]]

    found = np.column_stack((result["a_out"], result["b_out"]))
    for row, u in zip(found[::8], result["t_out"].ravel()[::8], strict=True):
        np.testing.assert_allclose(row, fsolve(rest, row, args=(u,), xtol=1e-13), atol=1e-10)
        np.testing.assert_allclose(rest(row, u), 0.0, atol=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("solver", "order"), [("rk4", 4.0), ("heun", 2.0)])
def test_a_loop_is_solved_at_the_stages_of_a_solver(solver: str, order: float, engine: str) -> None:
    """x' = -z with z = x - z**3, which has one solution."""
    made = {
        "x": {"type": "DynamicSystem", "derivative": ["-u[0]"], "initial": [2.0]},
        "z": {"type": "Function", "expression": "u[0] - u[1]**3"},
    }
    wires = {"x": {"u": ["z.out"]}, "z": {"u": ["x.out", "z.out"]}}

    def root(x: float) -> float:
        return float(brentq(lambda z: z + z**3 - x, -10, 10, xtol=1e-15, rtol=1e-14))

    errors = []
    for dt in (0.1, 0.05):
        run = load(made, wires, "x.out", solver=solver, dt=dt).run(engine=engine).probes["x_out"]
        exact = solve_ivp(
            lambda t, x: [-root(x[0])], (0, 2), [2.0], "DOP853", run.t, rtol=1e-11, atol=1e-13
        )
        errors.append(np.abs(run.values.ravel() - exact.y[0]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pendulum_with_a_multiplier_keeps_its_length(engine: str) -> None:
    """Index 1: x'' = -q x, y'' = -q y - g, with q from 0 = x x'' + y y'' + x'^2 + y'^2."""
    made = {
        "p": {
            "type": "DynamicSystem",
            "states": ["x", "y", "v", "w"],
            "derivative": ["v", "w", "u[0]", "u[1]"],
            "initial": [1.0, 0.0, 0.0, 0.0],
        },
        "a": {"type": "Function", "expression": ["-u[0] * u[1]", "-u[0] * u[2] - 9.81"]},
        "q": {
            "type": "Function",
            "expression": "u[0] + u[3] * u[1] + u[4] * u[2] + u[5]**2 + u[6]**2",
        },
    }
    wires = {
        "p": {"u": ["a.out"]},
        "a": {"u": ["q.out", "p.out[0]", "p.out[1]"]},
        "q": {"u": ["q.out", "a.out", "p.out"]},
    }
    options = {"solver": "rodas4", "rtol": 1e-8, "atol": 1e-10}
    run = load(made, wires, "p.out", "q.out", **options).run(engine=engine)
    x, y, v, w = run["p_out"].T
    np.testing.assert_allclose(np.hypot(x, y), 1.0, atol=1e-6)
    np.testing.assert_allclose(0.5 * (v * v + w * w) + 9.81 * y, 0.0, atol=1e-5)
    angle = solve_ivp(
        lambda t, s: [s[1], -9.81 * np.sin(s[0])],
        *((0, 2), [np.pi / 2, 0.0], "DOP853", run.probes["p_out"].t),
        rtol=1e-11,
    ).y[0]
    np.testing.assert_allclose(x, np.sin(angle), atol=1e-5)
    np.testing.assert_allclose(run["q_out"].ravel(), v * v + w * w - 9.81 * y, atol=1e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_robertson_with_its_third_equation_algebraic(engine: str) -> None:
    made = {
        "y": {
            "type": "DynamicSystem",
            "derivative": [
                "-0.04 * x[0] + 1e4 * x[1] * u[0]",
                "0.04 * x[0] - 1e4 * x[1] * u[0] - 3e7 * x[1]**2",
            ],
            "initial": [1.0, 0.0],
        },
        "c": {"type": "Function", "expression": "u[0] + 2 * (1 - u[1] - u[2] - u[0])"},
    }
    wires = {"y": {"u": ["c.out"]}, "c": {"u": ["c.out", "y.out"]}}
    options = {"dt": 4.0, "until": 40.0, "solver": "rodas4", "rtol": 1e-6, "atol": 1e-10}
    run = load(made, wires, "y.out", "c.out", **options).run(engine=engine)

    def rates(t: float, y: Any) -> list[float]:
        fast = 1e4 * y[1] * y[2]
        return [-0.04 * y[0] + fast, 0.04 * y[0] - fast - 3e7 * y[1] ** 2, 3e7 * y[1] ** 2]

    t = run.probes["y_out"].t
    exact = solve_ivp(rates, (0, 40), [1.0, 0, 0], "Radau", t, rtol=1e-10, atol=1e-13).y
    np.testing.assert_allclose(run["y_out"], exact[:2].T, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(run["c_out"].ravel(), exact[2], rtol=1e-4, atol=1e-9)


class Half(Block):
    """Half of a number, in a form that is not compiled."""

    signal = Input(Scalar, name="input")
    out = Output(Scalar)

    def output(self, state: BlockState, t: float, input: float) -> float:
        return float({"half": 0.5 * input}["half"])


class Halved(Block):
    """The same in a form that is compiled, and compared with this one."""

    signal = Input(Scalar, name="input")
    out = Output(Scalar)

    def output(self, state: BlockState, t: float, input: float) -> float:
        return 0.5 * input


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("solver", ["rk4", "rodas4"])
@pytest.mark.parametrize("half", [Half, Halved])
def test_a_loop_may_have_own_blocks(half: type[Block], engine: str, solver: str) -> None:
    graph = runtime.Graph("loop", dt=0.05, until=1.0)
    graph = graph.set("run.loops", "solve").set("run.solver", solver)
    graph = graph.add("half", half()).add("sum", library.Sum(signs=[1, -1]))
    graph = graph.add("x", library.Integrator(initial=1.0, signal=Scalar)).add(
        "minus", library.Gain(gain=-1.0)
    )
    for source, target in (
        *(("x.out", "sum.terms"), ("half.out", "sum.terms"), ("sum.out", "half.input")),
        *(("sum.out", "minus.input"), ("minus.out", "x.input")),
    ):
        graph = graph.connect(source, target)
    result = graph.probe("x.out").run(engine=engine)
    # sum = x - sum / 2, so that x' = -2 x / 3.
    np.testing.assert_allclose(
        result["x_out"].ravel(), np.exp(-2 / 3 * result.probes["x_out"].t), rtol=1e-5
    )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("u[0] + 1", "do not determine"),
        ("2 * u[0] + u[0]**2 + 2 + t", "residual is"),
    ],
)
def test_a_loop_without_a_solution_is_named(engine: str, expression: str, words: str) -> None:
    made = {"z": {"type": "Function", "expression": expression, "signal": "Scalar"}}
    with pytest.raises(runtime.SimulationError, match=words) as caught:
        load(made, {"z": {"u": ["z.out"]}}, "z.out").run(engine=engine)
    assert "the algebraic loop of z.out (z.out ▸ z.u" in str(caught.value)
    assert "t = 0 s" in str(caught.value)


def test_blocks_of_different_steps_are_no_loop_that_can_be_solved() -> None:
    made = {
        "s": {"type": "Sum", "signs": [1, -1], "dt": 0.1},
        "g": {"type": "Gain", "gain": 0.5},
        "r": {"type": "Function", "expression": "1"},
    }
    graph = load(made, {"s": {"terms": ["r.out", "g.out"]}, "g": {"input": "s.out"}})
    with pytest.raises(runtime.GraphError, match="not all computed on the same ticks; a UnitDelay"):
        graph.check()


def test_the_plan_shows_the_loop_and_a_linearization_solves_it() -> None:
    made = {
        "x": {"type": "Integrator", "initial": 1.0, "signal": "Scalar"},
        "s": {"type": "Sum", "signs": [1, -1]},
        "g": {"type": "Gain", "gain": 0.5},
        "minus": {"type": "Gain", "gain": -1.0},
    }
    wires = {
        "x": {"input": "minus.out"},
        "s": {"terms": ["x.out", "g.out"]},
        "g": {"input": "s.out"},
        "minus": {"input": "s.out"},
    }
    graph = load(made, wires, "x.out")
    assert "solve     for " in str(graph.program().plan)
    assert "\nSolved for s.out: g.out ▸ s.terms[1] ▸ s.out ▸ g.input\n" in explain_text(graph)
    system = graph.linearize([], ["x.out"])
    np.testing.assert_allclose(system.a, [[-2 / 3]], rtol=1e-6)
