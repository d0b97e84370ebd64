"""Arithmetic that is the same on every processor: right, and the same."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

import runtime
from blocks.core import portable

seeds = st.integers(0, 2**32 - 1)

# Kernels of OpenBLAS, numbers of its threads, and NumPy without its AVX-512 code. Features that
# a processor does not have cannot be disabled, which NumPy tells by a warning.
MACHINES = {
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"},
    "Prescott": {"OPENBLAS_CORETYPE": "Prescott", "OPENBLAS_NUM_THREADS": "2"},
    "Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "no AVX-512": {
        "OPENBLAS_NUM_THREADS": "1",
        "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL"
        " AVX512_ICL AVX512_SPR",
    },
}


def fingerprints() -> dict[str, str]:
    """A hash of everything that runs record, and of their metrics."""
    wide = runtime.load("line_actuator_failure").set("adaptive.snn_omega.neurons", 12_000)
    spline = {"type": "WaypointPath", "points": [[0, 0], [3, 1], [5, -1], [9, 0], [12, 2]]}
    winding = runtime.load("sine_estimation_error").set("blocks.track", spline)
    turned = runtime.load("sine_estimation_error").set("lqr.q", [0.1, 0.3, 0.2])
    least_squares = runtime.load("wall_following").set("fitter.fit", "least_squares")
    runs = {
        "line": (runtime.load("line_actuator_failure"), 3.0),
        "sine": (runtime.load("sine_estimation_error"), 3.0),
        "walls": (runtime.load("wall_following_robust").set("explore.explore_time", 0.5), 9.0),
        "least squares": (least_squares.set("explore.explore_time", 0.5), 3.0),
        "wide": (wide, 0.1),
        "waypoints": (winding, 0.5),
        "riccati": (turned, 0.5),
    }
    found = {}
    for name, (graph, until) in runs.items():
        result = graph.run(until=until, seed=3, engine="python")
        for probe in result.probes:
            found[f"{name}: {probe}"] = hashed(result[probe])
        found[f"{name}: metrics"] = hashed(np.array(list(result.metrics.values()), dtype=float))
    return found


def hashed(values: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def on_a_machine(**environment: str) -> dict[str, Any]:
    found = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.blocks.core.test_portable"],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    result: dict[str, Any] = json.loads(found.stdout)
    return result


@pytest.fixture(scope="module")
def here() -> dict[str, Any]:
    return fingerprints()


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES)
def test_bits_do_not_depend_on_the_processor_or_on_threads(
    machine: str, here: dict[str, Any]
) -> None:
    there = on_a_machine(**MACHINES[machine])
    assert [name for name, found in here.items() if there[name] != found] == []


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "expm1", "log1p"])
def test_functions_are_numpys_to_rounding(name: str) -> None:
    x = np.linspace(-0.99, 3.0, 1001).reshape(7, 143)
    expected = getattr(np, name)(x)
    np.testing.assert_allclose(getattr(portable, name)(x), expected, rtol=1e-15, atol=1e-15)


def test_angles_are_numpys_to_rounding() -> None:
    x, y = np.random.default_rng(0).standard_normal((2, 500))
    np.testing.assert_allclose(portable.arctan2(y, x), np.arctan2(y, x), rtol=1e-15)


if __name__ == "__main__":
    print(json.dumps(fingerprints()))


def test_scipys_functions_are_those_of_the_whole_package() -> None:
    from scipy import special

    rng = np.random.default_rng(0)
    x = rng.normal(size=500_000) * 10.0 ** rng.integers(-30, 3, 500_000)
    ends = [0.0, -0.0, 5e-324, -1e-300, 700.0, 710.0, -40.0, np.inf, np.nan]
    x = np.concatenate([x, ends])
    for ours, theirs, values in (
        (portable.expm1, special.expm1, np.minimum(x, 709.0)),
        (portable.log1p, special.log1p, np.maximum(x, -0.999)),
    ):
        assert np.array_equal(ours(values).view(np.uint64), theirs(values).view(np.uint64))


@pytest.mark.parametrize("place", ["find_spec", "module_from_spec"])
def test_where_scipy_is_another_one_its_public_functions_are_taken(
    place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import importlib.util

    from scipy import special

    def fails(*arguments: object) -> None:
        raise ImportError("not there")

    monkeypatch.setattr(importlib.util, place, fails)
    assert portable._scipy_functions() is special
