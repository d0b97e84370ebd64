"""The plan as data: what a tick does, in which order, with which gates; what passes make of it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime import plan as plans  # pytest would collect Test
from runtime.engine import python_text
from runtime.errors import SimulationError
from runtime.graph import Graph
from runtime.plan import (
    Call,
    Gate,
    Integrate,
    Load,
    Operation,
    Plan,
    Port,
    Record,
    Restore,
    Stop,
    Store,
    Zero,
    exchanged,
    signals_of,
)
from tests.examples import examples

ROOT = Path(__file__).parents[3]
SMALL: dict[str, Any] = {
    "run": {"dt": 0.1, "until": 1.0, "solver": "rk4"},
    "blocks": {
        "wave": {"type": "Pulse", "period": 1.0},
        "target": {"type": "Gain", "gain": 2.0, "dt": 0.2},
        "error": {"type": "Sum", "signs": [1, -1]},
        "plant": {"type": "Integrator"},
    },
    "wires": {
        "target": {"input": "wave.out"},
        "error": {"terms": ["target.out", "plant.out"]},
        "plant": {"input": "error.out"},
    },
    "probes": {"y": "plant.out"},
}
PART: dict[str, Any] = {
    "inputs": {"signal": "Scalar", "enable": "Scalar"},
    "blocks": {
        "enable": {"type": "Enable", "while_off": "reset"},
        "twice": {"type": "Gain", "gain": 2.0},
        "slow": {"type": "Gain", "gain": 2.0, "dt": 0.2},
        "delay": {"type": "UnitDelay"},
        "total": {"type": "Integrator"},
    },
    "wires": {
        "enable": {"input": "inputs.enable"},
        "twice": {"input": "inputs.signal"},
        "slow": {"input": "twice.out"},
        "delay": {"input": "twice.out"},
        "total": {"input": "delay.out"},
    },
}
GRAPHS = ("line_actuator_failure", "wall_following", "gallery/night_setback", "gallery/cascade")


def switched(**changes: Any) -> Graph:
    """A part with continuous, sampled and slow blocks that is reset while it is off."""
    wires = {"part": {"signal": "wave.out", "enable": "wave.out"}}
    blocks = {"wave": SMALL["blocks"]["wave"], "part": PART}
    run = {**SMALL["run"], **changes}
    probes = {"seen": ["part.slow.out", "part.total.out"]}
    return runtime.load({"run": run, "blocks": blocks, "wires": wires, "probes": probes})


def plan_of(graph: Graph) -> Plan:
    return graph.program().plan


def lines(operations: Iterable[Operation]) -> list[str]:
    return [str(each) for each in operations]


def check_order(operations: Iterable[Operation], known: set[Port]) -> None:
    """Every signal is written before it is read, and tested right after its call."""
    calls: list[Call] = []
    for each in operations:
        read = {switch.key for switch in each.gate.switches}
        if isinstance(each, Call):
            own = {(argument.block, argument.port) for argument in each.arguments}
            read |= {signal.key for signal in each.reads} - own
            calls.append(each)
        elif isinstance(each, plans.Test):
            assert (each.outputs, each.gate) == (calls[-1].outputs, calls[-1].gate)
        elif isinstance(each, (Record, Stop)):
            read |= signals_of([each])
        elif isinstance(each, Integrate):
            check_order(each.stage, set(known))
        assert read <= known, f"{each} reads {read - known} too early"
        known |= {signal.key for signal in each.outputs} if isinstance(each, Call) else set()


def test_the_text_of_a_small_plan_is_that_of_the_documentation() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```text\n(call .*?)\n```", page, re.DOTALL)
    assert str(plan_of(runtime.load(SMALL))) == shown


@pytest.mark.parametrize("name", GRAPHS)
def test_signals_are_written_before_they_are_read(name: str) -> None:
    plan = plan_of(runtime.load(ROOT / "graphs" / f"{name}.yaml"))
    check_order(plan.operations, set())
    assert len({(each.block, each.method) for each in plan.evaluations}) == len(plan.evaluations)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=12), st.integers(1, 3))
@examples(30)
def test_any_network_without_loops_is_ordered(wires: list[tuple[int, int]], every: int) -> None:
    """Sums wired at random, always from a name that is later in the alphabet to an earlier one."""
    terms: dict[int, list[str]] = {i: [] for i in range(10)}
    for a, b in wires:
        if a != b:
            terms[min(a, b)].append(f"s{max(a, b)}.out")
    blocks = {f"s{i}": {"type": "Sum", "signal": "Scalar"} for i in terms}
    blocks["s5"]["dt"] = 0.1 * every
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 1.0},
            "blocks": blocks,
            "wires": {f"s{i}": {"terms": sources} for i, sources in terms.items() if sources},
            "probes": {},
        }
    )
    plan = plan_of(graph)
    check_order(plan.operations, set())
    assert [str(s) for s in plan.held] == (["s5.out"] if every > 1 else [])
    place = {call.block: i for i, call in enumerate(plan.evaluations)}
    assert len(place) == 10
    assert all(place[s.partition(".")[0]] < place[f"s{i}"] for i in terms for s in terms[i])


def test_two_plans_of_one_graph_are_equal_and_a_changed_wire_changes_one_call() -> None:
    graph, other = (runtime.load(SMALL).set("blocks.plant.signal", "Scalar") for _ in range(2))
    plan, again = plan_of(graph), plan_of(other)
    assert plan.operations == again.operations
    rewired = plan_of(graph.wire("target.input", "plant.out"))
    changed = set(lines(rewired.operations)) - set(lines(plan.operations))
    assert changed == {"call      target.out: Scalar = target.output(t, plant.out)  [every 2]"}


def test_a_part_that_is_off_is_a_gate() -> None:
    plan = plan_of(switched())
    shown = lines(plan.operations)
    assert (
        "call      part.slow.out: Scalar = part.slow.output(t, part.twice.out)"
        "  [every 2, while part.enable.on]"
    ) in shown
    assert "zero      part.slow.out  [every 2, unless part.enable.on]" in shown
    (restore,) = (each for each in plan.operations if isinstance(each, Restore))
    assert restore.gate.is_off
    assert {str(state) for state in restore.states} >= {"part.delay.memory", "part.total.integral"}
    assert plan.restored == {"part.delay", "part.total"}
    assert plan.integration is not None
    assert "zero      part.total.integral  [unless part.enable.on]" in lines(plan.integration.stage)


def test_what_is_computed_between_ticks_for_a_stop() -> None:
    stop = {"when": "part.total.out", "above": 0.5}
    plan = plan_of(switched(stop=stop))
    part = plan.integration
    assert part is not None and isinstance(part.crossings[0].guards, Stop)
    assert [each.block for each in part.watch if isinstance(each, Call)] == ["part.total"]
    sampled = plan_of(switched(stop={"when": "part.delay.out", "above": 0.5}))
    assert sampled.can_stop and sampled.integration is not None
    assert not sampled.integration.crossings


def test_what_python_exchanges_with_compiled_code() -> None:
    plan = plan_of(switched())
    group = [each for each in plan.operations if each.block == "part.slow"][:3]
    load, call, test, zero, store = exchanged(group)
    assert isinstance(load, Load) and isinstance(store, Store)
    assert [call, test, zero] == group and isinstance(zero, Zero)
    # As it may be left out, it stores what was there.
    assert list(map(str, load.signals)) == ["part.twice.out", "part.enable.on", "part.slow.out"]
    assert list(map(str, store.signals)) == ["part.slow.out"]
    assert load.gate == store.gate == Gate(2)


@pytest.mark.parametrize("stop", [None, {"when": "wave.out", "above": 0.5}])
def test_the_first_tick_in_pieces(monkeypatch: pytest.MonkeyPatch, stop: Any) -> None:
    """Each operation is a text of its own, under the gate that it would be under among others."""
    graph = switched(engine="python", **({} if stop is None else {"stop": stop}))
    whole = graph.run()
    monkeypatch.setattr(python_text, "PIECE", 1)
    pieces = graph.set("run.until", 1.0).run()
    assert pieces.status == whole.status
    assert pieces.manifest["ticks"] == whole.manifest["ticks"]
    np.testing.assert_array_equal(pieces["seen"], whole["seen"])


def test_a_failure_of_the_first_tick_names_its_block_in_any_piece(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = runtime.load(SMALL).set("run.engine", "python")
    bad = {"type": "Function", "expression": "1 / u[0]"}  # the plant begins at zero
    graph = graph.overlay({"blocks": {"bad": bad}, "wires": {"bad": {"u": "plant.out"}}})
    for size in (1, 3, 1000):
        monkeypatch.setattr(python_text, "PIECE", size)
        with pytest.raises(SimulationError, match="bad.*ZeroDivisionError"):
            graph.set("run.until", 1.0).run()
