"""Compiled code follows globals, helpers, methods and defaults that change between runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import runtime
from blocks import Block, Sine
from runtime.engine import Engine
from runtime.engine.compiled import make_kernels
from tests.compilers import needs_compiler
from tests.runtime.engine import changing
from tests.runtime.engine.changing import Defaults, Mutable, Rarely, Tables, Uses

pytestmark = [needs_compiler, pytest.mark.filterwarnings("ignore")]


def graph(block: Block) -> runtime.Graph:
    made = runtime.Graph("changed", dt=0.01, until=0.2).add("s", Sine()).add("b", block)
    return made.connect("s.out", "b.x").probe("b.out")


def refused(made: runtime.Graph) -> dict[str, str]:
    engine = Engine(made.program(), 1)
    engine.prepare()
    return make_kernels(made.network, engine.state.blocks).refused


def other_alarm() -> float:
    return changing.LEVEL + 1000.0


CHANGES: dict[str, Callable[[pytest.MonkeyPatch], Any]] = {
    "a number": lambda patch: patch.setattr(changing, "LEVEL", 200.0),
    "its type": lambda patch: patch.setattr(changing, "LEVEL", 200),
    "a text": lambda patch: patch.setattr(changing, "NAME", "slow"),
    "a function": lambda patch: patch.setattr(changing, "alarm", other_alarm),
    "code": lambda patch: patch.setattr(changing.alarm, "__code__", other_alarm.__code__),
    "a default": lambda patch: patch.setattr(changing.scaled, "__defaults__", (5.0,)),
    "a method": lambda patch: patch.setattr(Uses, "bonus", lambda self: 9.0),
    "an attribute of the class": lambda patch: patch.setattr(Uses, "gain", 4.0),
    "a builtin": lambda patch: patch.setattr(changing, "abs", lambda x: 50.0, raising=False),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_changes_between_two_runs_of_a_graph_acts(
    change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = graph(Uses())
    assert refused(made) == {}
    first = made.run(engine="compiled")["b.out"]
    session = made.session(engine="compiled").step(5)
    if change == "code":
        monkeypatch.setitem(vars(changing), "changing", changing)
    CHANGES[change](monkeypatch)
    expected = made.run(engine="python")["b.out"]
    assert not np.array_equal(first, expected) or change == "its type"
    result = made.run(engine="compiled")
    np.testing.assert_array_equal(result["b.out"], expected)
    assert not [text for text in result.notes if "compiled and" in text]
    rows = session.step(10).result()["b.out"]
    np.testing.assert_array_equal(rows[:5], first[:5])
    np.testing.assert_array_equal(rows[5:], expected[5:15])


def test_what_is_used_rarely_is_not_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    made = graph(Rarely())
    for level in (100.0, 200.0, 300.0, -0.0, 0.0, float("inf")):
        monkeypatch.setattr(changing, "LEVEL", level)
        if level < float("inf"):
            assert repr(float(made.run(engine="compiled")["b.out"][-1])) == repr(level)
    with pytest.raises(runtime.SimulationError, match="not finite: inf"):
        made.run(engine="compiled")


def test_tables_that_are_changed_in_place_act(monkeypatch: pytest.MonkeyPatch) -> None:
    made = graph(Tables())
    made.run(engine="compiled")
    monkeypatch.setattr(changing, "TABLE", np.full(2, 5.0))
    monkeypatch.setattr(changing.CONFIG, "gain", 70.0, raising=False)
    changing.LIST[0] = 11.0
    assert made.run(engine="compiled")["b.out"][-1] == 5.0 + 11.0 + 1.0 + 70.0
    changing.TABLE[0] = 6.0
    assert made.run(engine="compiled")["b.out"][-1] == 6.0 + 11.0 + 1.0 + 70.0
    changing.LIST[0] = 1.0


def test_defaults_are_those_of_the_definition(monkeypatch: pytest.MonkeyPatch) -> None:
    made = graph(Defaults())
    assert refused(made) == {}
    monkeypatch.setattr(changing, "LEVEL", 7.0)
    monkeypatch.setattr(changing, "START", 8.0)
    python, compiled = made.run(engine="python"), made.run(engine="compiled")
    x = np.sin(2 * np.pi * 0.01 * np.arange(20))
    np.testing.assert_allclose(python["b.out"], 102.0 * x + 7.0, atol=1e-12)
    np.testing.assert_array_equal(compiled["b.out"], python["b.out"])


def test_a_default_that_calls_share_is_called_from_python() -> None:
    for engine in ("python", "compiled"):
        changing.total.__defaults__[0][0] = 0.0  # type: ignore[index]
        made = graph(Mutable())
        np.testing.assert_array_equal(made.run(engine=engine)["b.out"], np.arange(20.0))
    (reason,) = refused(graph(Mutable())).values()
    assert "has a default of 'kept' that is no number or text, a list" in reason
    assert "changing.py:" in reason
