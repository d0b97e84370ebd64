"""The switch passes on what it says, of any type."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Path, Scan, SignalType, Twist
from blocks.core import BlockState
from blocks.generic.arithmetic import Switch
from runtime import check_block
from tests.blocks.worlds import started


@pytest.fixture
def state() -> BlockState:
    return started(Switch())


@pytest.mark.parametrize("select", [0.0, 0.5, -3.0])
def test_off(state: BlockState, select: float) -> None:
    assert Switch().output(state, 0.0, select, (1.0, 2.0), (3.0, 4.0)) == (1.0, 2.0)


@pytest.mark.parametrize("select", [0.51, 1.0, 7.0])
def test_on(state: BlockState, select: float) -> None:
    scan = np.array([1.0, np.inf])
    assert Switch().output(state, 0.0, select, -scan, scan) is scan


@pytest.mark.parametrize("kind", [None, Twist, Scan(4), Path(5)])
def test_it_keeps_the_rules_of_blocks(kind: SignalType | None) -> None:
    check_block(Switch(), {} if kind is None else {"off": kind})


def test_it_takes_its_type_from_the_wires() -> None:
    graph = runtime.Graph(dt=0.1, until=1.0)
    graph = graph.add("select", blocks.Constant(value=1.0))
    graph = graph.add("a", blocks.Constant(value=[1.0, 2.0], signal="Twist"))
    graph = graph.add("b", blocks.Constant(value=[3.0, 4.0], signal="Twist"))
    graph = graph.add("switch", Switch()).connect("select.value", "switch.select")
    graph = graph.connect("a.value", "switch.off").connect("b.value", "switch.on")
    result: Any = graph.probe("switch.out").run()
    assert np.array_equal(result["switch.out"], np.tile([3.0, 4.0], (10, 1)))
