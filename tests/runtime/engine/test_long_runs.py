"""The smallest step of a solver is that of the time it has come to, not of the end of the run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import runtime

ROBERTSON: dict[str, Any] = {
    "type": "DynamicSystem",
    "states": ["a", "b", "c"],
    "initial": [1, 0, 0],
    "derivative": ["-0.04*a + 1e4*b*c", "0.04*a - 1e4*b*c - 3e7*b**2", "3e7*b**2"],
}


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_values_at_equal_times_do_not_depend_on_the_end(engine: str) -> None:
    run = {"dt": 1e9, "until": 1.01e11, "solver": "rodas4", "rtol": 1e-8, "atol": 1e-14}
    document = {"run": run, "blocks": {"s": ROBERTSON}, "probes": {"x": "s.out"}}
    x = np.asarray(runtime.load(document).run(engine=engine)["x"])
    short = np.asarray(runtime.load(document).set("run.until", 5e9).run(engine=engine)["x"])
    np.testing.assert_array_equal(x[: len(short)], short)
    # For long times a is 1 / (4.8e-4 t), from b = 0.04 a / (1e4 c) and a' = -3e7 b^2.
    assert x[100, 0] == pytest.approx(1.0 / (4.8e-4 * 1e11), rel=1e-3)
    np.testing.assert_allclose(x.sum(axis=1), 1.0, atol=1e-9)
