"""Diagrams of loops through continuous blocks."""

from __future__ import annotations

import runtime
from runtime.diagrams.picture import picture_of
from tests.runtime.engine.test_continuous import OSCILLATOR, graph_of


def test_a_continuous_block_says_so() -> None:
    boxes = picture_of(graph_of(OSCILLATOR).network).boxes
    assert boxes["speed"].about.startswith("speed: Integrator, continuous, rk4")
    assert boxes["spring"].about.startswith("spring: Gain, 10 Hz")


def test_a_linear_system_without_direct_feedthrough_needs_no_input_in_the_same_tick() -> None:
    system = {"type": "StateSpace", "A": [[-1]], "B": [1], "C": [1]}
    back = {"type": "Gain", "gain": -1.0}
    wires = {"s": {"input": "back.out"}, "back": {"input": "s.out"}}
    graph = runtime.load({"blocks": {"s": system, "back": back}, "wires": wires})
    needs = {net.source[0]: net.needs for net in picture_of(graph.network).nets}
    assert needs == {"s": (), "back": ("input",)}
