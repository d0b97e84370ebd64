"""Repeated parts: equal to parts written out by hand, with their ports divided and joined."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError
from runtime.runs import open_run
from tests.conftest import Run

PART = """
    inputs: {{x: {kind}, k: {{type: Scalar, optional: true}}}}
    outputs: {{y: slow.out}}
    blocks:
      of_x: {{type: Function, expression: "{expression}"}}
      sum: {{type: Sum}}
      slow: {{type: Lowpass, tau: 0.1}}
    wires:
      of_x: {{u: inputs.x}}
      sum: {{terms: [of_x.out, inputs.k]}}
      slow: {{input: sum.out}}
"""


def written(tmp_path: Path, kind: str = "Scalar", more: str = "", **wires: str) -> runtime.Graph:
    """A part that filters x (the sum of its components) plus k, repeated."""
    expression = "u[0] + u[1]" if kind == "Vector(2)" else "u[0]"
    params = "params: {count: 3}" if "$count" in more else ""
    wired = ", ".join(f"{port}: '{source}'" for port, source in wires.items())
    text = f"""
graph: repeated
run: {{dt: 0.01, until: 0.5, seed: 3}}
{params}
blocks:
  x: {{type: Function, expression: ["sin(3*t)", "cos(3*t)", "t", "0.5", "1 - t", "2"]}}
  bank:{PART.format(kind=kind, expression=expression)}{more}
wires:
  bank: {{{wired}}}
probes: {{x: x.out, y: bank.y}}
"""
    path = tmp_path / "repeated.yaml"
    path.write_text(text)
    return runtime.load(path)


def filtered(u: np.ndarray) -> np.ndarray:
    """The lowpass of tau = 0.1 s, tick by tick."""
    y, found = np.zeros(u.shape[1]), []
    for row in u:
        y = y + (1.0 - np.exp(-0.01 / 0.1)) * (row - y)
        found.append(y)
    return np.array(found)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_numbers_are_divided_and_a_shared_input_is_not(tmp_path: Path, engine: str) -> None:
    more = "    repeat: $count\n    share: [k]\n"
    run = written(tmp_path, "Scalar", more, x="x.out[1:4]", k="x.out.5").run(engine=engine)
    expected = filtered(run["x"][:, 1:4] + run["x"][:, 5, None])
    found = run["y"]
    # The filter's output lags its input by a tick.
    np.testing.assert_allclose(found[1:], expected[:-1], rtol=1e-12)


def test_vectors_are_divided_into_vectors(tmp_path: Path) -> None:
    run = written(tmp_path, "Vector(2)", "    repeat: 2\n", x="x.out[0:4]", k="x.out[2:4]").run()
    x = run["x"]
    u = np.column_stack([x[:, 0] + x[:, 1] + x[:, 2], x[:, 2] + x[:, 3] + x[:, 3]])
    np.testing.assert_allclose(run["y"][1:], filtered(u)[:-1], rtol=1e-12)


def test_an_open_input_stays_open_in_all_copies(tmp_path: Path) -> None:
    run = written(tmp_path, "Scalar", "    repeat: 6\n", x="x.out").run()
    np.testing.assert_allclose(run["y"][1:], filtered(run["x"])[:-1], rtol=1e-12)


def test_once_is_the_part_itself(tmp_path: Path) -> None:
    one = written(tmp_path, "Scalar", "    repeat: 1\n", x="x.out.0", k="x.out.1").run()
    plain = written(tmp_path, "Scalar", "", x="x.out.0", k="x.out.1").run()
    assert np.array_equal(one["y"].reshape(-1), plain["y"])


def test_copies_have_numbers_and_neurons_of_their_own() -> None:
    inner = {
        "params": {"index": 0},
        "outputs": {"which": "number.value"},
        "blocks": {
            "number": {"type": "Constant", "value": "$index"},
            "snn": {"type": "Ensemble", "neurons": 5, "dimensions": 1},
        },
    }
    plain: dict[str, Any] = {
        "run": {"dt": 0.001, "until": 0.01},
        "blocks": {"many": {**inner, "repeat": 4}},
        "probes": {"which": "many.which"},
    }
    run = runtime.load(plain).run()
    assert run["which"][0].tolist() == [0.0, 1.0, 2.0, 3.0]
    biases = {tuple(run.states[f"many.copy_{i}.snn.bias"]) for i in range(4)}
    assert len(biases) == 4


def test_a_run_of_repeated_parts_runs_again_from_its_folder(cli: Run, tmp_path: Path) -> None:
    written(tmp_path, "Scalar", "    repeat: 6\n    share: [k]\n", x="x.out", k="x.out.0")
    assert cli("run", "repeated.yaml", "--no-plots").returncode == 0
    folder = tmp_path / "runs" / "repeated" / "latest"
    again = runtime.load(folder / "graph.resolved.yaml").run()
    assert np.array_equal(again["y"], open_run(folder)["y"])
    assert cli("draw", "repeated.yaml").returncode == 0
    without = cli("run", "repeated.yaml", "--no-plots", "--set", "bank.slow.tau=0.3")
    assert without.returncode == 0, without.stderr


@pytest.mark.parametrize(
    ("kind", "more", "wires", "message"),
    [
        ("Scalar", "    repeat: 0\n", {}, "blocks.bank.repeat: expected how often the part is"),
        ("Scalar", "    repeat: many\n", {}, "1 to 20000, got the string 'many'"),
        ("Scalar", "    repeat: 30000\n", {}, "1 to 20000, got 30000"),
        ("Scalar", "    share: [k]\n", {}, "only a part with 'repeat' shares inputs"),
        ("Scalar", "    repeat: 6\n    share: [j]\n", {}, "the part has no input 'j'"),
        ("Pose", "    repeat: 6\n", {}, "'x' is a Pose: declare its type, or give all copies"),
        ("Vector", "    repeat: 6\n", {}, "'x' is a Vector: declare its type"),
        ("Scalar", "    repeat: 4\n", {}, r"expected Vector\(4\), got Vector\(6\) from 'x.out'"),
        ("Vector(2)", "    repeat: 2\n", {}, r"expected Vector\(4\), got Vector\(6\)"),
    ],
)
def test_errors(tmp_path: Path, kind: str, more: str, wires: dict[str, str], message: str) -> None:
    with pytest.raises(GraphError, match=message):
        written(tmp_path, kind, more, **{"x": "x.out", "k": "x.out[0:6]", **wires}).check()


def test_an_error_inside_is_reported_once(tmp_path: Path) -> None:
    written(tmp_path, "Scalar", "    repeat: 6\n", x="x.out")
    text = (tmp_path / "repeated.yaml").read_text().replace("tau: 0.1", "tau: -1")
    (tmp_path / "repeated.yaml").write_text(text)
    with pytest.raises(GraphError) as caught:
        runtime.load(tmp_path / "repeated.yaml").check()
    assert [problem.address for problem in caught.value.problems] == ["blocks.bank.blocks.slow.tau"]


def test_a_block_cannot_be_repeated() -> None:
    plain = {"blocks": {"a": {"type": "Ensemble", "dimensions": 1, "repeat": 3}}}
    with pytest.raises(GraphError, match="only parts are repeated: put the block into one, or use"):
        runtime.load(plain).check()


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("n", [2, 5])
def test_params_wires_and_expressions_follow_the_number_of_copies(n: int, engine: str) -> None:
    """Copy i gets cos(2 pi i / n) of its own, and its neighbour's number of a shared input."""
    plain: dict[str, Any] = {
        "run": {"dt": 0.001, "until": 0.002},
        "params": {"n": n},
        "blocks": {
            "numbers": {"type": "Function", "expression": "[10.0*i for i in range($n)]"},
            "cells": {
                "repeat": "$n",
                "share": "all",
                "params": {"n": "$n", "angle": "2*pi*$index/$n", "next": "($index + 1) % $n"},
                "inputs": {"x": "Scalar", "all": "Vector($n)"},
                "outputs": {"y": "f.out"},
                "blocks": {
                    "f": {"type": "Function", "expression": "u[0]*cos($angle) + u[1]*($index + 1)"}
                },
                "wires": {"f": {"u": ["inputs.x", "inputs.all[$next]"]}},
            },
        },
        "wires": {"cells": {"x": "numbers.out", "all": "numbers.out"}},
        "probes": {"y": "cells.y"},
    }
    i = np.arange(n)
    expected = 10.0 * i * np.cos(2.0 * np.pi * i / n) + 10.0 * ((i + 1) % n) * (i + 1)
    found = runtime.load(plain).run(engine=engine)["y"][0]
    np.testing.assert_allclose(np.atleast_1d(found), expected, rtol=1e-12)


def test_an_index_of_the_graph_around_is_not_that_of_the_copies() -> None:
    part = {"outputs": {"y": "c.value"}, "blocks": {"c": {"type": "Constant", "value": "$k"}}}
    plain = {
        "params": {"index": 7},
        "blocks": {"many": {**part, "repeat": 2, "params": {"k": "$index"}}},
        "probes": {"y": "many.y"},
        "run": {"dt": 0.1, "until": 0.1},
    }
    assert runtime.load(plain).run()["y"][0].tolist() == [7.0, 7.0]
    with pytest.raises(GraphError, match="there is no param 'index'"):
        inner = {key: value for key, value in plain["blocks"]["many"].items() if key != "repeat"}
        runtime.load({**plain, "params": {}, "blocks": {"many": inner}}).check()


def test_checking_is_linear_in_the_copies(tmp_path: Path) -> None:
    def calls(copies: int) -> int:
        """The calls of functions that checking takes, C ones included."""
        path = tmp_path / f"{copies}.yaml"
        path.write_text(
            f"""
graph: g
run: {{dt: 0.01, until: 1.0}}
blocks:
  u: {{type: Constant, value: 1.0}}
  parts:
    repeat: {copies}
    share: [x]
    inputs: {{x: Scalar}}
    outputs: {{y: b.out}}
    blocks: {{a: {{type: Gain, gain: 0.9}}, b: {{type: Gain, gain: 0.9}}}}
    wires: {{a: {{input: inputs.x}}, b: {{input: a.out}}}}
wires: {{parts: {{x: u.value}}}}
probes: {{y: parts.y}}
"""
        )
        graph, count = runtime.load(path), 0

        def counted(frame: FrameType, event: str, _: object) -> None:
            nonlocal count
            count += event in ("call", "c_call")

        sys.setprofile(counted)
        try:
            graph.check()
        finally:
            sys.setprofile(None)
        return count

    calls(5)  # imports, and what is computed once
    few, many = calls(50), calls(200)
    assert many < 4.4 * few


INNER = """
graph: inner
run: {{dt: 0.01, until: 0.3, seed: 1}}
blocks:
  in: {{type: Function, expression: ["2*t + 1", "-t", "9*t"]}}
  after: {{type: {after}}}
  p:
    {repeat}
    inputs: {{x: Scalar}}
    outputs: {{y: {output}}}
    blocks:
      g: {{type: Gain, gain: 2.0}}
      lim: {{type: Clip, low: -1, high: 1}}
      slow: {{type: Lowpass, tau: 0.1}}
      sum: {{type: Sum}}
    wires:
      g: {{input: inputs.x}}
      lim: {{input: g.out}}
      slow: {{input: lim.out}}
      sum: {{terms: [inputs.x, slow.out]}}
wires: {{p: {{x: {x}}}, after: {{{into}}}}}
probes: {{y: after.out}}
metrics: {{last: {{kind: max_abs, of: y, length: true}}}}
"""


def inner(
    tmp_path: Path, copies: int = 3, output: str = "sum.out", required: bool = False
) -> runtime.Graph:
    """A part of which one block can be left out, repeated; after it a Sum, or a Gain."""
    path = tmp_path / f"inner{copies}.yaml"
    after, into = ("Gain, gain: 1.0", "input: p.y") if required else ("Sum", "terms: [p.y, in.out]")
    repeat, x = (f"repeat: {copies}", "in.out") if copies > 1 else ("", "in.out.0")
    into = into if copies > 1 else into.replace("in.out", "in.out.0")
    path.write_text(
        INNER.format(**{"after": after, "into": into, "repeat": repeat}, x=x, output=output)
    )
    return runtime.load(path)


def change(graph: runtime.Graph, how: str, name: str) -> runtime.Graph:
    changed: runtime.Graph = getattr(graph, how)(name)
    return changed


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("how", ["without", "bypass"])
@pytest.mark.parametrize("name", ["slow", "lim"])
def test_a_name_inside_stands_for_all_copies(
    tmp_path: Path, how: str, name: str, engine: str
) -> None:
    graph = inner(tmp_path)
    if (how, name) == ("without", "lim"):
        graph = graph.without("p.slow")
    of_all = change(graph, how, f"p.{name}")
    assert [n for n in of_all.network.removed if n.endswith(name)] == [
        f"p.copy_{i}.{name}" for i in range(3)
    ]
    one_by_one = graph
    for i in range(3):
        one_by_one = change(one_by_one, how, f"p.copy_{i}.{name}")
    found, expected = (each.run(engine=engine)["y"] for each in (of_all, one_by_one))
    np.testing.assert_array_equal(found, expected)
    # The first copy is what the part is without being repeated.
    alone = inner(tmp_path, copies=1)
    alone = alone.without("p.slow") if (how, name) == ("without", "lim") else alone
    plain = change(alone, how, f"p.{name}").run(engine=engine)["y"]
    np.testing.assert_array_equal(found[:, 0], plain.ravel())
    assert not np.array_equal(found, inner(tmp_path).run(engine=engine)["y"])


def test_an_output_that_all_copies_lose_is_that_of_a_removed_block(tmp_path: Path) -> None:
    graph = inner(tmp_path, output="slow.out")
    found = graph.without("p.slow").run()
    np.testing.assert_allclose(found["y"][-1], [1.58, -0.29, 2.61])
    with pytest.raises(GraphError) as error:
        inner(tmp_path, output="slow.out", required=True).without("p.slow").check()
    (problem,) = error.value.problems
    assert problem.address == "wires.after.input"
    assert "'after.input' is not connected without 'p.slow'; 'bypass: [p.slow]'" in problem.text


@pytest.mark.parametrize(
    ("how", "name", "part"),
    [
        ("without", "p.copy_1.slow", "'p.y' lacks the values of 1 of its 3 copies"),
        ("without", "p.g", "input 'p.lim.input' (Scalar) is not connected without 'p.g'"),
        (
            "without",
            "p.copy_2.g",
            "'p.copy_2.lim.input' (Scalar) is not connected without 'p.copy_2.g'",
        ),
        ("without", "p.slwo", "there is no block 'p.slwo', did you mean 'p.slow'?"),
        ("bypass", "p.sum", "'p.sum' (Sum) has no pass-through"),
        ("bypass", "p", "'p' is a part"),
    ],
)
def test_what_copies_cannot_lose_is_one_error(
    tmp_path: Path, how: str, name: str, part: str
) -> None:
    with pytest.raises(GraphError) as error:
        change(inner(tmp_path, output="slow.out"), how, name).check()
    (problem,) = error.value.problems
    assert part in problem.text


def test_a_block_of_nested_copies(tmp_path: Path) -> None:
    path = tmp_path / "nested.yaml"
    path.write_text("""
graph: nested
run: {dt: 0.1, until: 0.1}
blocks:
  in: {type: Constant, value: [1, 2, 3, 4]}
  outer:
    repeat: 2
    inputs: {x: Vector(2)}
    outputs: {y: inner.y}
    blocks:
      inner:
        repeat: 2
        inputs: {x: Scalar}
        outputs: {y: twice.out}
        blocks: {twice: {type: Gain, gain: 2}}
        wires: {twice: {input: inputs.x}}
    wires: {inner: {x: inputs.x}}
  all: {type: Sum}
wires: {outer: {x: in.value}, all: {terms: [outer.y, in.value]}}
probes: {y: all.out}
""")
    graph = runtime.load(path)
    for changed, expected in (
        (graph, [3, 6, 9, 12]),
        (graph.bypass("outer.inner.twice"), [2, 4, 6, 8]),
        (graph.bypass("outer.copy_1.inner.copy_0.twice"), [3, 6, 6, 12]),
        (graph.without("outer.inner.twice"), [1, 2, 3, 4]),
        (graph.without("outer.inner"), [1, 2, 3, 4]),
    ):
        np.testing.assert_array_equal(changed.run()["y"][-1], expected)


def test_an_ablation_and_a_session_take_the_copies_together(tmp_path: Path, cli: Run) -> None:
    graph = inner(tmp_path)
    done = cli("ablate", "inner3.yaml", "--seeds", "0", "-q", "-j", "1", "--no-plots")
    rows = [line.split() for line in done.stdout.splitlines()]
    names = [" ".join(row[:2]) for row in rows]
    assert "bypass p.lim" in names and not any("copy_" in name for name in names)
    session = graph.session()
    session.run(0.1)
    session.without("p.slow")
    session.run(0.1)
    np.testing.assert_allclose(session.read("p.y"), session.read("in.out"))
