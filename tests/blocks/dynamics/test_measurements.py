"""Filters of several measurements that come when they come, against one that has all in order.

The oracle begins anew at each tick, with what has arrived by then at the time of its measurement.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from tests.blocks.responses import problems, respond

DT = 0.1
A, B = np.array([[1.0, DT], [0.0, 1.0]]), np.array([0.005, 0.1])
Q = np.diag([1e-4, 1e-3])
MODELS = {
    "position": ([[1.0, 0.0]], [[0.04]]),
    "both": ([[1.0, 1.0], [0.0, 1.0]], [[1, 0.2], [0.2, 0.5]]),
}
KALMAN: dict[str, Any] = {
    "type": "KalmanFilter",
    **{"A": A.tolist(), "B": B.tolist(), "Q": Q.tolist(), "x0": [0.3, -0.1]},
}
EXTENDED: dict[str, Any] = {
    "type": "ExtendedKalmanFilter",
    "transition": ["p + 0.1*v + 0.005*u", "v + 0.1*u"],
    **{"states": ["p", "v"], "Q": Q.tolist(), "x0": [0.3, -0.1]},
}


def kalman(**more: Any) -> dict[str, Any]:
    """Entries of a KalmanFilter with both measurements."""
    kinds = {name: {"C": c, "R": r, **more.pop(name, {})} for name, (c, r) in MODELS.items()}
    return {**KALMAN, "measurements": kinds, **more}


def extended(**more: Any) -> dict[str, Any]:
    texts = {"position": "p", "both": ["p + v", "v"]}
    kinds = {
        name: {"observation": texts[name], "R": r, **more.pop(name, {})}
        for name, (_, r) in MODELS.items()
    }
    return {**EXTENDED, "measurements": kinds, **more}


def oracle(arrivals: list[tuple[int, int, str, Any]], u: Any) -> Any:
    """Estimates; ``arrivals`` are (tick of arrival, of measurement, which, its numbers)."""
    rows = []
    for now in range(len(u)):
        x, p = np.array(KALMAN["x0"]), np.eye(2)
        for tick in range(now + 1):
            known = {name: y for came, at, name, y in arrivals if came <= now and at == tick}
            if known:
                c = np.vstack([MODELS[name][0] for name in MODELS if name in known])
                y = np.concatenate([np.atleast_1d(known[name]) for name in MODELS if name in known])
                r = np.zeros((len(y), len(y)))
                if "position" in known:
                    r[0, 0] = 0.04
                if "both" in known:
                    r[-2:, -2:] = MODELS["both"][1]
                gain = p @ c.T @ np.linalg.inv(c @ p @ c.T + r)
                x, p = x + gain @ (y - c @ x), (np.eye(2) - gain @ c) @ p
            if tick < now:
                x, p = A @ x + B * u[tick], A @ p @ A.T + Q
        rows.append(x)
    return np.array(rows)


@pytest.mark.parametrize("entries", [kalman, extended])
def test_a_slow_measurement_with_a_delay_counts_where_it_was_measured(entries: Any) -> None:
    ticks = 60
    y, both, u = np.random.default_rng(4).standard_normal((4, ticks))[:3]
    both = np.column_stack([both, y[::-1]])
    entry = entries(both={"dt": 0.5, "offset": 0.3, "delay": 0.3})
    driven = {"measurement": [y, both], ("control" if entries is kalman else "u"): [u]}
    found = respond(entry, driven, dt=DT, of="estimate")
    arrivals = [(k, k, "position", y[k]) for k in range(ticks)]
    # The first arrives at 0.3 s, and was measured at 0.
    arrivals += [(k, k - 3, "both", both[k]) for k in range(3, ticks, 5)]
    np.testing.assert_allclose(found, oracle(arrivals, u), atol=1e-8)


@given(st.data())
def test_stamps_in_any_order_with_repetitions(data: Any) -> None:
    ticks, lag = 25, 6
    draw = np.random.default_rng(data.draw(st.integers(0, 1000)))
    u, y, both = draw.standard_normal(ticks), np.zeros(ticks), np.zeros((ticks, 2))
    stamps, arrivals = {}, []
    for name, rows in (("position", y), ("both", both)):
        stamp, row, done = -1.0, np.zeros(rows[0].shape), set()
        column = []
        for k in range(ticks):
            at = k - data.draw(st.integers(0, lag + 3))
            if data.draw(st.booleans()) and at >= 0 and at not in done:
                done.add(at)
                stamp, row = at * DT, draw.standard_normal(rows[0].shape)
                if k - at <= lag:
                    arrivals.append((k, at, name, row))
            rows[k] = row
            column.append(stamp)
        stamps[name] = np.array(column)
    driven = {"measurement": [y, both], "stamp": [*stamps.values()], "control": [u]}
    found = respond(kalman(lag=lag * DT), driven, dt=DT, of="estimate")
    np.testing.assert_allclose(found, oracle(arrivals, u), atol=1e-9)


def graph(entry: dict[str, Any], **more: Any) -> Any:
    """A position that is sampled every 0.5 s, held and measured at 0.1 s, or as stamped."""
    entries = {
        "motion": {"type": "Sine"},
        "gps": {"type": "Hold", "dt": 0.5},
        "scaled": {"type": "Gain", "gain": 2.0},
        "filter": entry,
    }
    wires = {
        "gps": {"input": "motion.out"},
        "scaled": {"input": "gps.out"},
        "filter": {"measurement": "scaled.out", **more},
    }
    run = {"dt": DT, "until": 2.0}
    return runtime.load({"run": run, "blocks": entries, "wires": wires})


ONE = {**KALMAN, "B": None, "C": [1, 0], "R": 0.04}


def test_a_held_signal_in_a_filter_is_a_note_with_both_rates() -> None:
    (note,) = graph(ONE).network.notes
    assert note.startswith(
        "block 'filter': measurement 'measurement' is new every 0.5 s, and is used every 0.1 s: "
        "what is held counts as 5 measurements; write measurements:"
    )
    own = {"gps": {"C": [1, 0], "R": 0.04, "dt": 0.5}}
    right = {**KALMAN, "B": None, "measurements": own}
    assert graph(right).network.notes == ()
    own["gps"]["dt"] = 0.2
    (note,) = graph({**right, "measurements": own}).network.notes
    assert "measurement 'gps' is new every 0.5 s, and is used every 0.2 s" in note
    assert "write dt: 0.5 into measurements.gps" in note


def test_so_it_is_for_a_filter_with_a_gain_that_does_not_change() -> None:
    entry = {**ONE, "type": "DiscreteSteadyStateKalman", "R": [0.04]}
    entry = {name: value for name, value in entry.items() if name != "x0"}
    (note,) = graph(entry).network.notes
    assert "measurement[0] is new every 0.5 s, and is used every 0.1 s" in note


def test_what_comes_too_late_is_a_note() -> None:
    y = np.arange(10.0)
    stamps = np.where(y < 5, y * DT, y * DT - 0.3)
    late = graph({**ONE, "lag": 0.2})
    for name, values in (("y", y), ("s", stamps)):
        given = {"times": (DT * y).tolist(), "values": values.tolist()}
        late = late.add(name, blocks.Piecewise(**given))
    result = late.wire("filter.measurement", "y.out").wire("filter.stamp", ["s.out"]).run(until=1.0)
    assert any(
        "5 of measurement 'measurement' came later than lag = 0.2 s" in n for n in result.notes
    )


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"R": 1.0}, "R: given with measurements"),
        ({"C": [1, 0]}, "C: given with measurements"),
        ({"measurements": {}}, "measurements: expected measurements by name"),
        ({"measurements": {"gps": 3}}, "measurements.gps: expected a mapping with a model and R"),
        ({"measurements": {"gps": {"C": [1, 0]}}}, "measurements.gps.R: missing"),
        ({"measurements": {"gps": {"R": 1}}}, "measurements.gps.C: missing"),
        (
            {"measurements": {"gps": {"C": [1, 0], "R": 1, "rate": 5}}},
            "measurements.gps.rate: unknown",
        ),
        ({"measurements": {"gps": {"C": [1], "R": 1}}}, "measurements.gps.C: expected 2 columns"),
        (
            {"measurements": {"gps": {"C": [1, 0], "R": -1}}},
            "measurements.gps.R: a covariance",
        ),
        (
            {"measurements": {"gps": {"C": [1, 0], "R": 1, "dt": "x"}}},
            "measurements.gps.dt: expected",
        ),
        (
            {"measurements": {"gps": {"C": [1, 0], "R": 1, "dt": 1e-3}}},
            "gps.dt: expected at least the",
        ),
        ({"measurements": {"gps": {"C": [1, 0], "R": 1, "offset": 1}}}, "gps.offset: without dt"),
        (
            {"measurements": {"a": {"C": [1, 0], "R": 1, "delay": 1}}, "lag": 0.5},
            "lag: expected at",
        ),
        (
            {"measurements": {"a": {"C": np.eye(2).tolist(), "R": np.eye(2).tolist()}}},
            "(a: 2), got 1",
        ),
    ],
)
def test_mistakes_are_refused(change: dict[str, Any], part: str) -> None:
    one = {"measurements": {"gps": {"C": [1, 0], "R": 1.0}}}
    assert part in problems({**KALMAN, **one, **change}, ["Scalar"], "measurement")


def test_an_error_in_an_observation_points_at_its_item() -> None:
    kinds = {"gps": {"observation": ["p", "velocity"], "R": [[1, 0], [0, 1]]}}
    text = problems(
        {**EXTENDED, "transition": ["p", "v"], "measurements": kinds}, ["Twist"], "measurement"
    )
    assert "measurements.gps.observation[1]: column 1 of 'velocity': unknown name" in text
    kinds["gps"]["observation"] = ["p"]
    text = problems(
        {**EXTENDED, "transition": ["p", "v"], "measurements": kinds}, ["Twist"], "measurement"
    )
    assert "measurements.gps.observation: expected 2 expression(s), one per measurement (R)" in text
