"""Diagrams of loops through continuous blocks."""

from __future__ import annotations

import runtime
from runtime.diagrams.picture import picture_of
from tests.runtime.engine.test_continuous import OSCILLATOR, graph_of


def test_a_continuous_block_says_so() -> None:
    boxes = picture_of(graph_of(OSCILLATOR).network).boxes
    assert boxes["speed"].about.startswith("speed: Integrator, continuous, rk4")
    assert boxes["spring"].about.startswith("spring: Gain, continuous")
    assert {box.rate for box in boxes.values()} == {"continuous"}


def test_only_what_a_solver_evaluates_between_ticks_is_continuous() -> None:
    sampled = {"sampled": {"type": "UnitDelay", "dt": 0.5}, "held": {"type": "Gain", "gain": 2.0}}
    wires = {"sampled": {"input": "wave.out"}, "held": {"input": "sampled.out"}}
    blocks = {"wave": {"type": "Sine"}, "x": {"type": "Integrator"}, **sampled}
    document = {
        "run": {"dt": 0.1},
        "blocks": blocks,
        "wires": {**wires, "x": {"input": "wave.out"}},
    }
    boxes = picture_of(runtime.load(document).network).boxes
    rates = {name: box.rate for name, box in boxes.items()}
    want = {"wave": "continuous", "x": "continuous", "sampled": "2 Hz", "held": "10 Hz"}
    assert rates == want
    del blocks["x"], document["wires"]["x"]
    boxes = picture_of(runtime.load(document).network).boxes
    assert boxes["wave"].rate == "10 Hz"  # nothing evaluates it between ticks


def test_a_linear_system_without_direct_feedthrough_needs_no_input_in_the_same_tick() -> None:
    system = {"type": "StateSpace", "A": [[-1]], "B": [1], "C": [1]}
    back = {"type": "Gain", "gain": -1.0}
    wires = {"s": {"input": "back.out"}, "back": {"input": "s.out"}}
    graph = runtime.load({"blocks": {"s": system, "back": back}, "wires": wires})
    needs = {net.source[0]: net.needs for net in picture_of(graph.network).nets}
    assert needs == {"s": (), "back": ("input",)}
