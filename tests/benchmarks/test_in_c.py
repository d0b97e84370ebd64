"""The loops by hand in C compute what the compiled engine computes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("numba", reason="the numbers of the loops are those of numba's (extra 'bench')")

from benchmarks import case_a, chains, in_c, tracking
from tests.compilers import needs_compiler

pytestmark = needs_compiler
EXACT = 1e-12  # m, rad: sums are in another order, and expm1 and log1p may be other ones
TICKS = 600


@pytest.mark.parametrize("neurons", [100, 1003])
@pytest.mark.parametrize("vector", [False, True])
def test_case_a_in_c_is_the_compiled_engine(neurons: int, vector: bool) -> None:
    ours = case_a.Ours(neurons, TICKS, "compiled")().poses
    theirs = in_c.case_a(case_a.numbers(neurons), TICKS, vector).poses[:: case_a.EVERY]
    assert np.ptp(ours, axis=0).max() > 0.01
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=EXACT)


def test_tracking_in_c_is_the_compiled_engine() -> None:
    ours = tracking.Ours(TICKS, 0.001, "compiled")().poses
    np.testing.assert_allclose(in_c.tracking(TICKS, 0.001).poses, ours, rtol=0.0, atol=EXACT)


def test_gains_in_c_is_the_compiled_engine() -> None:
    graph = chains.chain(5).set("run.until", TICKS * 0.01).set("run.engine", "compiled")
    for i in range(1, 6):
        graph = graph.set(f"b{i}.gain", 1.0 + 0.1 * i)
    factors = 1.0 + 0.1 * np.arange(1, 6)
    assert in_c.gains(factors, TICKS).poses[:, 0].tolist() == graph.run()["last"].ravel().tolist()
