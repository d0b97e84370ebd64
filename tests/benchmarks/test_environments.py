"""The environment that is written by hand goes the way of the graph's, to rounding."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium")
from benchmarks.environments import STEPS, ByHand, balancing, episode, of_graph


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_the_environment_by_hand_is_the_graphs(engine: str) -> None:
    ours = episode(of_graph(engine, "gusts"), balancing, 1)
    theirs = episode(ByHand(density=0.0), balancing, 1)
    assert len(ours) == len(theirs) == STEPS
    for one, other in zip(ours, theirs, strict=True):
        assert np.allclose(one[0], other[0], rtol=0.0, atol=1e-12)
        assert one[1] == pytest.approx(other[1], abs=1e-12)
        assert one[2:4] == other[2:4]
    # And where the pole falls.
    ours, theirs = (
        episode(env, lambda _: [10.0], 1) for env in (of_graph(engine, "gusts"), ByHand(0.0))
    )
    assert 1 < len(ours) == len(theirs) < STEPS
    assert ours[-1][2] and theirs[-1][2]
