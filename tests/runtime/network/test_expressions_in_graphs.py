"""Where a mistake in an expression is shown; names and definitions in all blocks; sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime

TEXT = """run: {dt: 0.1, until: 1}
blocks:
  c: {type: Constant, value: [1.0, 2.0, 3.0]}
  f:
    type: Function
    let:
      a: 2*u[0]
      b: a + 1
    expression:
      - u[0]
      - a
      - b
      - u[1] + b
wires: {f: {u: c.value}}
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("- u[1] + b", "- 1 + u[7]", "g.yaml:13:9: blocks.f.expression[3]: column 7 of '1 + u[7]'"),
        ("- a", "- aa", "g.yaml:11:9: blocks.f.expression[1]: column 1 of 'aa'"),
        ("b: a + 1", "b: a + sni(1)", "g.yaml:8:10: blocks.f.let.b: column 5 of 'a + sni(1)'"),
        ("b: a + 1", "sin: a + 1", "blocks.f.let: 'sin' is a function in every expression"),
        ("a: 2*u[0]", "a: 2*b", "g.yaml:7:10: blocks.f.let.a: column 3 of '2*b': unknown name"),
    ],
)
def test_a_mistake_is_shown_at_its_item(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "g.yaml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load(path).check()
    text = str(caught.value).replace(f"{tmp_path}/", "")
    assert message in text
    assert len(caught.value.problems) == 1


def last(graph: dict[str, Any], **values: Any) -> Any:
    loaded = runtime.load({"run": {"dt": 0.1, "until": 1.0}, **graph})
    for path, value in values.items():
        loaded = loaded.set(path.replace("__", "."), value)
    return loaded.run(engine="python").probes["out"].values


def test_a_filter_has_names_and_definitions() -> None:
    blocks = {
        "y": {"type": "Sine"},
        "w": {"type": "Constant", "value": [0.1, 0.2]},
    }
    entry = {"type": "ExtendedKalmanFilter", "Q": "diag(0.1, 0.2)", "R": 0.5, "x0": [0, 1]}
    plain = {**entry, "transition": ["x[0] + 0.1*x[1] + u[1]", "x[1] - 0.1*sin(x[0])"]}
    named = {
        **entry,
        "states": {"a": "rad", "b": "rad/s"},
        "names": ["w(2)"],
        "let": {"s": "sin(a)", "rate": ["b", "-s"]},
        "transition": "[a, b] + 0.1*rate + [w[1], 0]",
    }
    wires = {"it": {"measurement": "y.out", "u": "w.value"}}
    found = [
        last(
            {
                "blocks": {**blocks, "it": {**one, "observation": "x[0]**2"}},
                "wires": wires,
                "probes": {"out": "it.estimate"},
            }
        )
        for one in (plain, named)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)


def test_a_constraint_has_names_and_definitions() -> None:
    graph = {
        "blocks": {
            "c": {"type": "Constant", "value": 3.0},
            "it": {
                "type": "AlgebraicConstraint",
                "names": ["target"],
                "let": {"cube": "z**3"},
                "expression": "cube + z - target",
                "low": 0,
                "high": 3,
            },
        },
        "wires": {"it": {"u": "c.value"}},
        "probes": {"out": "it.out"},
    }
    z = float(last(graph)[-1])
    assert z**3 + z == pytest.approx(3.0, rel=1e-14)


def test_a_singular_matrix_is_an_error_with_its_block_and_time() -> None:
    graph = {
        "blocks": {"it": {"type": "Function", "expression": "det(inv([[t - 0.3, 0], [0, 1]]))"}},
        "probes": {"out": "it.out"},
        "run": {"dt": 0.25, "until": 1.0},
    }
    assert len(last(graph)) == 4
    graph["run"] = {"dt": 0.3, "until": 1.0}
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError, match="'it' at tick 1 .*singular"):
            runtime.load(graph).run(engine=engine)


PART = {
    "params": {"index": 0, "gain": "1 + 2*$index"},
    "inputs": {"x": "Scalar"},
    "outputs": {"y": "f.out"},
    "blocks": {"f": {"type": "Gain", "gain": "$gain"}},
    "wires": {"f": {"input": "inputs.x"}},
}


def test_the_number_of_copies_is_a_param() -> None:
    graph = {
        "params": {"n": 3},
        "blocks": {
            "x": {"type": "Function", "expression": "[1 + j for j in range($n)]"},
            "items": {**PART, "repeat": "$n"},
            "total": {"type": "Function", "expression": "sum(u)"},
        },
        "wires": {"items": {"x": "x.out"}, "total": {"u": "items.y"}},
        "probes": {"out": "total.out"},
    }
    for n in (1, 3, 6):
        expected = sum((1 + j) * (1 + 2 * j) for j in range(n))
        assert last(graph, params__n=n)[-1] == expected


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_events_of_vectors_are_reflections(engine: str) -> None:
    ball = {
        "type": "DynamicSystem",
        "states": {"p(2)": "m", "v(2)": "m/s"},
        "let": {"n": "p/norm(p)"},
        "derivative": ["v", "zeros(2)"],
        "initial": [0.2, 0.1, 1, 0.3],
        "events": [{"when": "norm(p) > 1", "then": ["p", "v - 2*(v @ n)*n"]}],
    }
    graph = {
        "run": {"dt": 0.01, "until": 6.0},
        "blocks": {"ball": ball},
        "probes": {"out": "ball.out"},
    }
    out = runtime.load(graph).run(engine=engine).probes["out"].values
    at, speed = out[:, :2], out[:, 2:]
    np.testing.assert_allclose(np.linalg.norm(speed, axis=1), np.hypot(1, 0.3), rtol=1e-13)
    assert np.linalg.norm(at, axis=1).max() < 1 + 1e-9
    # Reflections inside of a circle keep the angular momentum.
    turning = at[:, 0] * speed[:, 1] - at[:, 1] * speed[:, 0]
    np.testing.assert_allclose(turning, turning[0], atol=1e-9)
    assert np.abs(np.diff(speed, axis=0)).max(axis=1).astype(bool).sum() >= 3
