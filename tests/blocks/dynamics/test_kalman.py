"""The Kalman filter against the textbook's matrices and the steady solution of scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import linalg

from tests.blocks.responses import problems, respond

A, B, C = [[1.0, 0.1], [0.0, 1.0]], [0.005, 0.1], [1.0, 0.0]
Q, R = [[1e-4, 0.0], [0.0, 1e-3]], 0.04
ENTRY: dict[str, Any] = {"type": "KalmanFilter", "A": A, "B": B, "C": C, "Q": Q, "R": R}


def textbook(measurements: Any, controls: Any, entry: dict[str, Any]) -> Any:
    a, q = np.array(entry["A"]), np.array(entry["Q"])
    n = len(a)
    b, c = np.reshape(entry["B"], (n, -1)), np.reshape(entry["C"], (-1, n))
    r = np.reshape(entry["R"], (len(c), len(c)))
    x, p, rows = np.array(entry.get("x0", np.zeros(n))), np.eye(n), []
    for y, u in zip(measurements, controls, strict=True):
        gain = p @ c.T @ np.linalg.inv(c @ p @ c.T + r)
        x = x + gain @ (np.atleast_1d(y) - c @ x)
        p = (np.eye(n) - gain @ c) @ p
        rows.append(x)
        x, p = a @ x + b @ np.atleast_1d(u), a @ p @ a.T + q
    return np.array(rows)


def test_one_measurement_and_one_control() -> None:
    draw = np.random.default_rng(2)
    y, u = draw.standard_normal((2, 150))
    found = respond({**ENTRY, "x0": [1.0, -1.0]}, {"measurement": y, "control": u}, of="estimate")
    np.testing.assert_allclose(found, textbook(y, u, {**ENTRY, "x0": [1.0, -1.0]}), atol=1e-12)


def test_two_measurements_that_depend_on_each_other() -> None:
    entry = {**ENTRY, "C": [[1.0, 0.0], [0.5, 1.0]], "R": [[0.04, 0.01], [0.01, 0.09]]}
    y = np.random.default_rng(3).standard_normal((100, 2))
    found = respond(entry, {"measurement": y}, of="estimate")
    np.testing.assert_allclose(found, textbook(y, np.zeros(100), entry), atol=1e-12)


def test_the_covariance_settles_at_the_riccati_solution() -> None:
    expected = linalg.solve_discrete_are(np.transpose(A), np.reshape(C, (2, 1)), Q, R)
    p = respond(ENTRY, {"measurement": np.zeros(2000)}, of="P")[-1]
    np.testing.assert_allclose(p.reshape(2, 2), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"A": [[1, 2]]}, "expected 1 x 1 numbers"),
        ({"Q": [[1]]}, "expected 2 x 2 numbers"),
        ({"C": [1]}, "expected 2 columns"),
        ({"R": [[1, 0], [0, 1]]}, "expected 1 x 1 numbers"),
        ({"B": [1]}, "expected 2 rows"),
        ({"x0": [1]}, "expected 2 numbers"),
    ],
)
def test_wrong_matrices_are_refused(change: dict[str, Any], part: str) -> None:
    assert part in problems({**ENTRY, **change}, ["Scalar"], "measurement")
