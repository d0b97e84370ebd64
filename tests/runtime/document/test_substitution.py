"""Params inside texts, and params that are computed from others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime


def graph(params: dict[str, Any], **blocks: Any) -> dict[str, Any]:
    return {"run": {"dt": 0.1, "until": 0.2}, "params": params, "blocks": blocks}


def last(loaded: runtime.Graph, of: str) -> Any:
    return loaded.run(engine="python").probes[of].values[-1]


def constant(value: Any) -> dict[str, Any]:
    return {"type": "Constant", "value": value}


def function(expression: Any, **more: Any) -> dict[str, Any]:
    return {"type": "Function", "expression": expression, **more}


@pytest.mark.parametrize(
    ("params", "expression", "expected"),
    [
        ({"tau": 0.5}, "2*$tau", 1.0),
        ({"k": -3}, "$k**2 - $k", 12.0),
        ({"k": 1.0e-7}, "$k*1e7", 1.0),
        ({"n": 3}, "sum(j for j in range($n))", 3.0),
        ({"a": [[0, 1], [-1, 0]]}, "$a @ [2, 3]", [3.0, -2.0]),
        ({"d": 0.3, "wheel": "$d * 0.5", "turn": "2*$wheel"}, "$turn + $d", 0.6),
        ({"n": 2, "m": "$n + 1"}, "ones($m)", [1.0, 1.0, 1.0]),
        ({"f": "1 + 2"}, "2*$f", 6.0),
        ({"a": 2, "b": "$a", "c": ["$b", "$a*3"]}, "$c", [2.0, 6.0]),
    ],
)
def test_params_in_expressions(params: dict[str, Any], expression: str, expected: Any) -> None:
    signal = {"signal": f"Vector({len(expected)})"} if isinstance(expected, list) else {}
    loaded = runtime.load(
        {**graph(params, f=function(expression, **signal)), "probes": {"f": "f.out"}}
    )
    np.testing.assert_allclose(last(loaded, "f"), expected, rtol=1e-15)


def test_sizes_are_params() -> None:
    text = graph({"d": 3}, f=function("full($d, 2)", signal="Vector($d)"))
    loaded = runtime.load({**text, "probes": {"f": "f.out"}})
    np.testing.assert_array_equal(last(loaded, "f"), [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(last(loaded.set("params.d", 5), "f"), [2.0] * 5)


def test_what_is_computed_follows_a_change() -> None:
    text = graph({"d": 0.4, "wheel": "$d * 0.5"}, f=function("$wheel"))
    loaded = runtime.load({**text, "probes": {"f": "f.out"}})
    assert last(loaded, "f") == 0.2
    assert last(loaded.set("params.d", 0.8), "f") == 0.4
    assert last(loaded.set("params.wheel", 3.0), "f") == 3.0


PART = """
params: {d: 0.4, wheel: $d * 0.5}
outputs: {out: f.out}
blocks: {f: {type: Function, expression: "$wheel + 10*$d"}}
"""


@pytest.mark.parametrize(
    ("given", "expected"),
    [("{}", 4.2), ("{d: 1}", 10.5), ("{d: $d}", 21.0), ("{wheel: 7 + $d}", 13.0)],
)
def test_a_part_computes_its_own_params(tmp_path: Path, given: str, expected: float) -> None:
    (tmp_path / "part.yaml").write_text(PART)
    (tmp_path / "top.yaml").write_text(
        "run: {dt: 0.1, until: 0.2}\nparams: {d: 2}\nprobes: {out: p.out}\n"
        f"blocks:\n  p: {{graph: part.yaml, params: {given}}}\n"
        "  used: {type: Constant, value: $d}\n"
    )
    assert last(runtime.load(tmp_path / "top.yaml"), "out") == pytest.approx(expected)


def test_dollars_elsewhere_are_text() -> None:
    text = {
        **graph({}, f=function("t")),
        "probes": {"f": "f.out"},
        "plots": {"f": {"kind": "timeseries", "of": "f", "title": "$x$ over $t$"}},
    }
    runtime.load(text).check()


@pytest.mark.parametrize(
    ("params", "part"),
    [
        ({"a": "$a + 1"}, "params.a: the param is computed from itself: $a -> $a"),
        ({"a": "$b", "b": "$a"}, "computed from itself: $a -> $b -> $a"),
        ({"a": "$b + 1"}, "params.a: there is no param 'b'"),
        ({"a": "1/$b", "b": 0}, "cannot compute '1/$b'"),
        ({"a": "$b * 2", "b": "text"}, "expected arithmetic with numbers"),
        ({"a": "zeros($b)", "b": 2}, "expected one number, got a vector"),
        ({"a": "9**9**9**$b", "b": 2}, "the number is too large"),
    ],
)
def test_wrong_params_are_refused_once(params: dict[str, Any], part: str) -> None:
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load(graph(params, f=function("$a"))).check()
    assert part in str(caught.value)
    assert len(caught.value.problems) == 1


def test_params_are_in_the_names_of_states_with_units() -> None:
    states = {"p($n)": "m", "v": "m/s"}
    system = {"type": "DynamicSystem", "states": states, "derivative": ["-p", "-v"]}
    text = graph({"n": 3}, f={**system, "initial": "ones($n + 1)"})
    loaded = runtime.load({**text, "probes": {"v": "f.out.v"}})
    np.testing.assert_allclose(last(loaded, "v"), np.exp(-0.1), rtol=1e-4)
    names = ("p0", "p1", "p2", "p3", "v")
    larger = loaded.set("params.n", 4)
    assert larger.network.types["f", "out"].rows == tuple(
        (name, "m/s" if name == "v" else "m") for name in names
    )
    with pytest.raises(runtime.GraphError, match="there is no param 'm'") as error:
        runtime.load(graph({}, f={**system, "states": {"p($m)": "m"}, "initial": 1.0})).check()
    assert len(error.value.problems) == 1


# Uses three params of the graph around it, of which none is passed.
UNPASSED = {
    "params": {"b": "$k"},
    "inputs": {"x": "Vector($n)"},
    "outputs": {"y": "f.out"},
    "blocks": {"f": function("$g*x[0] + $k + $g + $b", names=["x($n)"])},
    "wires": {"f": {"u": "inputs.x"}},
}


@pytest.mark.parametrize("repeated", [{}, {"repeat": 2, "share": ["x"]}])
def test_what_a_part_lacks_is_one_error(repeated: dict[str, Any]) -> None:
    text = graph(
        {"k": 1.0, "g": 2.0, "n": 2}, part={**UNPASSED, **repeated}, c=constant([1.0, 2.0])
    )
    wired = {**text, "wires": {"part": {"x": "c.value"}}, "probes": {"y": "part.y"}}
    with pytest.raises(runtime.GraphError) as error:
        runtime.load(wired).check()
    (problem,) = error.value.problems
    assert problem.address == "blocks.part.params"
    assert "'n', 'g', 'k'" in problem.text
    assert "{n: $n, g: $g, k: $k}" in problem.text
    wired["blocks"]["part"] = {**wired["blocks"]["part"], "params": {"b": "$k"}}
    given = wired["blocks"]["part"]["params"]
    given |= {"n": "$n", "g": "$g", "k": "$k"}
    assert np.all(last(runtime.load(wired), "y") == 6.0)


def test_a_param_that_nobody_declares_is_reported_once() -> None:
    text = graph({}, a=function("$gain"), b=function("2*$gain"), c=function("$gain + $bias"))
    with pytest.raises(runtime.GraphError) as error:
        runtime.load(text).check()
    assert [p.address for p in error.value.problems] == [
        "blocks.a.expression",
        "blocks.c.expression",
    ]
