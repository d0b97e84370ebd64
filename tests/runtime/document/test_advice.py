"""Messages name what to write instead, and blame the line of the user's own code."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import blocks
import runtime
from blocks.core import ParameterError, covariance_fault, extras, pip_line
from runtime.errors import GraphError, SimulationError, raised_at
from tests.conftest import Run

SINE = {"s": {"type": "Sine"}}


def problems(extra: dict[str, Any], wires: dict[str, Any] | None = None, **more: Any) -> str:
    document = {"run": {"dt": 0.1, "until": 1.0}, "blocks": {**SINE, **extra}, **more}
    with pytest.raises(GraphError) as caught:
        runtime.load({**document, "wires": wires or {}}).check()
    return str(caught.value)


FILTER: dict[str, Any] = {
    "type": "KalmanFilter",
    "A": [[1.0, 0.1], [0.0, 1.0]],
    "C": [[1.0, 0.0]],
    "Q": [[1e-3, 0.0], [0.0, 1e-3]],
    "R": 1e-6,
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"Q": [[-1, 0], [0, 1]]},
            "k.Q: a covariance has no negative eigenvalue",
        ),
        ({"Q": [[1, 0.5], [0, 1]]}, "k.Q: a covariance is symmetric, but [0][1] is 0.5"),
        ({"P0": [[1, 2], [2, 1]]}, "k.P0: a covariance has no negative eigenvalue"),
        ({"R": 0.0}, "k.R: a covariance has only positive eigenvalues"),
        ({"C": [[1, 0], [0, 1]]}, "k.R: expected 2 x 2 numbers, got a number"),
    ],
)
def test_covariances_are_checked(change: dict[str, Any], message: str) -> None:
    assert message in problems({"k": {**FILTER, **change}}, {"k": {"measurement": "s.out"}})
    extended = {"type": "ExtendedKalmanFilter", "x0": [0, 0], "Q": FILTER["Q"], "R": 1e-6}
    extended |= {"transition": ["x[0]", "x[1]"], "observation": ["x[0]"]}
    if "C" not in change:
        assert message in problems({"k": {**extended, **change}}, {"k": {"measurement": "s.out"}})


@given(arrays.arrays(float, (3, 3), elements=st.floats(-3, 3, width=16)))
def test_a_matrix_times_its_transpose_is_a_covariance_and_its_negative_is_not(root: Any) -> None:
    square = root @ root.T
    assert covariance_fault(square) == ""
    if np.abs(square).max() > 1e-3:
        assert "eigenvalue" in covariance_fault(-square)
    skewed = square + np.triu(np.ones((3, 3)), 1) * (1.0 + np.abs(square).max())
    assert "symmetric" in covariance_fault(skewed)


def test_a_row_is_suggested_where_a_list_is_no_matrix() -> None:
    system = {"type": "StateSpace", "A": [-1], "B": [1], "C": [1]}
    assert "got [-1.0]; one row is written [[-1.0]]" in problems({"k": system})
    gain = {"type": "Gain", "gain": [1, 2, 3, 4]}
    state = {"c": {"type": "Constant", "value": [1, 2, 3, 4]}, "p": {"type": "Pendulum"}}
    wires = {"k": {"input": "c.value"}, "p": {"torque": "k.out"}}
    assert "[[1.0, 2.0, 3.0, 4.0]]" in problems({"k": gain, **state}, wires)
    right = {**gain, "gain": [[1, 2, 3, 4]]}
    runtime.load({"blocks": {"k": right, **state}, "wires": wires}).check()


@given(st.lists(st.integers(-9, 9), min_size=2, max_size=4), st.floats(-1e3, 1e3))
def test_a_column_is_suggested_where_one_number_goes_to_many(gains: list[int], u: float) -> None:
    """What the message says to write is the product of the number with each gain."""
    written = {"u": {"type": "Constant", "value": u}, "k": {"type": "Gain", "gain": gains}}
    graph = runtime.load({"run": {"dt": 0.1, "until": 0.1}, "blocks": written})
    graph = graph.connect("u.value", "k.input").probe("k.out")
    with pytest.raises(GraphError) as caught:
        graph.check()
    _, _, column = str(caught.value).splitlines()[0].rpartition("is a column, gain: ")
    found = graph.set("k.gain", ast.literal_eval(column)).run(engine="python")["k.out"]
    np.testing.assert_array_equal(found[0], np.array(gains) * u)


def test_a_typo_in_a_type_is_reported_alone() -> None:
    joined = {"k": {"type": "Concatenate"}, "f": {"type": "Function", "expression": "u[0]"}}
    wires = {"k": {"inputs": ["p.out", "s.out"]}, "f": {"u": ["p.out", "s.out"]}}
    text = problems({"p": {"type": "Sien"}, **joined}, wires)
    assert text == "blocks.p.type: no block type 'Sien', did you mean 'Sine'?"
    removed = problems({"p": {"type": "Sine"}, **joined}, wires, without=["p"])
    assert "the block that was wired to u[0] is removed" in removed


def test_nothing_is_printed_that_follows_from_another_error(tmp_path: Path) -> None:
    """A name that is taken, a file that cannot be read, a block that is removed as well."""
    (tmp_path / "mine.py").write_text("nothing at all", encoding="utf-8")
    blocks = {
        "c": {"type": "Constant", "value": [1.0, 2.0]},
        "g": {"type": "Function", "expression": ["u[0]", "u[1]"], "constants": {"e": 1.0}},
        "f": {"type": "Function", "expression": "a + k", "names": ["a", "b", "d", "k"]},
    }
    wires: dict[str, Any] = {"g": {"u": "c.value"}, "f": {"u": ["g.out", "c.value"]}}
    text = problems(blocks, wires)
    taken = "'e' is the number 2.718 in every expression; choose another name"
    assert text == f"blocks.g.constants: {taken}"
    blocks["g"] = {"type": "Mine", "module": str(tmp_path / "mine.py")}
    blocks["h"] = {"type": "Constant"}
    wires = {"f": {"u": ["g.out", "c.value", "h.value"]}}
    broken = problems(blocks, wires, without=["h"])
    assert "invalid syntax" in broken
    assert "removed" not in broken


def test_a_wrong_input_is_one_error() -> None:
    """It names no other block where the type has an everyday name, and the input is not open."""
    wrong = problems({"f": {"type": "Gain", "gain": 2.0}}, {"f": {"u": "s.out"}})
    assert wrong == "wires.f.u: 'f' has no input 'u'; its inputs: input"


def test_advice_about_a_bypass_can_be_followed() -> None:
    blocks = {"p": {"type": "Sine"}, "g": {"type": "Gain", "gain": 2.0}}
    message = problems(blocks, {"g": {"input": "p.out"}}, bypass=["p"])
    assert "wire another signal to g.input, then write 'without: [p]'" in message
    assert "'without: [p]' removes it" in problems({"p": {"type": "Sine"}}, bypass=["p"])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("pi", "'pi' is the number 3.142 in every expression; choose another name"),
        ("sin", "'sin' is a function in every expression; choose another name"),
        ("u", "'u' is the inputs in every expression; choose another name"),
        ("t", "'t' is the time in every expression; choose another name"),
        ("a b", "'a b' is not a valid name; use letters, digits and _"),
        ("if", "'if' is not a valid name; use letters, digits and _"),
        ("x", "the name 'x' is given twice"),
    ],
)
def test_each_reason_against_a_name_has_its_message(name: str, message: str) -> None:
    system = {"type": "DynamicSystem", "initial": 0.0, "derivative": "-x", "states": "x"}
    text = problems({"d": {**system, "constants": {name: 1.0}}})
    assert text == f"blocks.d.constants: {message}"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"run": {"duration": 3}}, "run.duration: unknown key, did you mean 'until'?"),
        ({"run": {"timestep": 3}}, "run.timestep: unknown key, did you mean 'dt'?"),
        ({"plots": {"p": {"kind": "scope", "of": "s"}}}, "did you mean 'timeseries'?"),
        ({"plots": {"p": {"kind": "timeserie", "of": "s"}}}, "did you mean 'timeseries'?"),
        ({"metrics": {"m": {"kind": "mae", "of": "s"}}}, "did you mean 'mean_abs'?"),
        ({"metrics": {"m": {"kind": "setling_time", "of": "s"}}}, "did you mean 'settling_time'?"),
    ],
)
def test_words_of_other_tools(more: dict[str, Any], message: str) -> None:
    assert message in problems({}, probes={"s": "s.out"}, **more)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["run", "starters/adaptive", "--style", "papr"], "did you mean 'paper'?"),
        (["rn", "x"], "did you mean 'run'?"),
        (["my.yaml"], "did you mean 'runtime run my.yaml'?"),
        (
            ["run", "starters/adaptive", "--vs", "without", "adaptive"],
            "write --vs without=adaptive",
        ),
        (["run", "starters/adaptive", "--set", "lqr.q", "5"], "write --set lqr.q=5"),
    ],
)
def test_the_command_line_suggests(cli: Run, line: list[str], message: str) -> None:
    done = cli(*line)
    assert done.returncode == 2
    assert message in done.stderr


OWN = """
from blocks import Block, Gain, Input, Output, Scalar, param


class Mine(Block):
    x = Input(Scalar)
    out = Output(Scalar)
    gain: float = param(1.0, doc="a factor")
{body}
"""
OUTPUT = "    def output(self, state, t, x):\n"


@pytest.mark.parametrize(
    ("body", "marked"),
    [
        (OUTPUT + "        self.count = 3  # here\n        return x", "cannot change"),
        (OUTPUT + "        return [1.0][3] + x  # here", "IndexError"),
        (OUTPUT + "        return Gain(gain='a')  # here", "expected a number"),
        (
            "    def validate(self):\n        1 / 0  # here\n\n" + OUTPUT + "        return x",
            "Zero",
        ),
        (OUTPUT + "        return x\n\n\nG = Gain([[1.0]])  # here", "given by name"),
    ],
)
def test_own_code_is_blamed_at_its_own_line(tmp_path: Path, body: str, marked: str) -> None:
    text = OWN.format(body=body)
    (tmp_path / "own.py").write_text(text)
    line = next(i for i, each in enumerate(text.split("\n"), 1) if "# here" in each)
    document = {"m": {"type": "Mine", "module": str(tmp_path / "own.py")}}
    graph = runtime.load({"blocks": {**SINE, **document}, "wires": {"m": {"x": "s.out"}}})
    with pytest.raises((GraphError, SimulationError), match=marked) as caught:
        graph.run()
    assert f"own.py:{line}" in str(caught.value)
    assert "block.py" not in str(caught.value)


def test_a_declaration_is_blamed_at_its_class(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        OWN.format(body=OUTPUT.replace(", x", ", y") + "        return y")
    )
    text = problems({"m": {"type": "Mine", "module": str(tmp_path / "own.py")}})
    assert "own.py:5: Mine.output: 'y' is not a port" in text


def test_what_no_file_raised_has_no_place() -> None:
    assert raised_at(ValueError("never raised")) == ""


@pytest.mark.parametrize("given", [([[1.0, 2.0]],), ([[1.0]], 3.0)])
def test_parameters_are_given_by_name(given: tuple[Any, ...]) -> None:
    with pytest.raises(ParameterError, match=r"by name, as in Gain\(gain=\[\["):
        blocks.Gain(*given)


def test_the_pip_line_installs_this_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(extras.ROOT)
    assert pip_line("tune") == "pip install -e '.[tune]'"
    monkeypatch.chdir(tmp_path)
    assert pip_line("tune") == f"pip install -e '{extras.ROOT}[tune]'"
    monkeypatch.setattr(extras, "ROOT", tmp_path)
    came_from = {None: "spikeblocks", '{"url": "file:///a%20b/one.whl"}': "/a b/one.whl"}
    for written, origin in came_from.items():
        installed = SimpleNamespace(read_text=lambda name, text=written: text)
        monkeypatch.setattr("importlib.metadata.distribution", lambda name, i=installed: i)
        assert pip_line("tune") == f"pip install '{origin}[tune]'"
