"""Programs of the fuzzer that once gave other numbers in C than in Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from tests.compilers import needs_compiler

MODULE = '''
import numpy as np
import blocks


class Found(blocks.Block):
    """Each line is one program."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Vector(8))
    r = blocks.State(8)

    def output(self, state, t):
        return state.r.copy()

    def update(self, state, t, x):
        r = state.r
        r[0] = np.copysign(1.0, np.sum(-np.zeros(2)))
        r[1] = np.copysign(1.0, np.sum(np.full(9, -0.0)))
        r[2] = 1103515245 * (bool(x) + 1)
        r[3:7] = np.sign(np.arange(4) - 2)
        n = int(4.0 * x)
        r[7] = {where}
'''
GRAPH = """
graph: found
run: {{dt: 0.01, until: 0.1}}
blocks:
  wave: {{type: Sine, frequency: 3.0}}
  found: {{type: Found, module: {file}}}
wires:
  found: {{x: wave.out}}
probes:
  out: found.out
"""


def graph(folder: Path, where: str) -> runtime.Graph:
    (folder / "own.py").write_text(MODULE.replace("{where}", where))
    (folder / "g.yaml").write_text(GRAPH.format(file=folder / "own.py"))
    return runtime.load(folder / "g.yaml")


@needs_compiler
def test_results_are_pythons(tmp_path: Path) -> None:
    own = graph(tmp_path, "np.where(x > 0.5, x, 2 % (n + 9))")
    python, compiled = (own.run(engine=engine) for engine in ("python", "compiled"))
    assert compiled.notes == []
    assert np.array_equal(python["out"], compiled["out"])
    assert python["out"][-1, 2] == 2 * 1103515245
    assert python["out"][-1, :2].tolist() == [1.0, 1.0]


@needs_compiler
def test_np_where_computes_what_it_does_not_take(tmp_path: Path) -> None:
    # n is 0 on tick 1, where x is not positive: Python divides by zero all the same.
    own = graph(tmp_path, "np.where(n < 1, x, 2 % n)")
    messages = []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            own.run(engine=engine)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]
    assert "ZeroDivisionError" in messages[0]
