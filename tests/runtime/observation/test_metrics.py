"""Metrics against closed forms, and the errors in their options and signals."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.core.params import param
from blocks.core.signals import FloatArray
from runtime.document.node import parse_yaml
from runtime.errors import GraphError
from runtime.observation.metric_kinds import MetricKind, MetricOptions
from runtime.observation.metrics import METRIC_KINDS, Metric, ProbeInfo, Series
from tests.runtime.broken import SOUND, changed

T = np.linspace(0.0, 10.0, 1001)


def value(kind: str, values: Any, t: FloatArray = T, **options: Any) -> float | None:
    """A metric of one signal."""
    series = Series(t, np.asarray(values, dtype=float))
    return Metric("m", kind, {"of": "p"}, options).value({"p": series})


# -- closed forms


def test_settling_time_of_a_decay() -> None:
    # |3 exp(-t)| <= 0.1 from t = ln 30 = 3.401...: the next sample is 3.41.
    assert value("settling_time", 3.0 * np.exp(-T), band=0.1) == pytest.approx(3.41)
    assert value("settling_time", -3.0 * np.exp(-T), band=0.1) == pytest.approx(3.41)


def test_a_value_at_a_time_is_interpolated_and_null_where_the_run_ended_before() -> None:
    assert value("value_at", T**2, at=2.345) == pytest.approx((2.34**2 + 2.35**2) / 2)
    assert value("value_at", T**2, at=10.0) == 100.0
    assert value("value_at", T[:500], T[:500], at=6.0) is None
    assert value("rms", T[:500], T[:500], after=3.0, until=6.0) is None
    assert value("rms", T[:500], T[:500], after=3.0, until=5.0) is not None


def test_angles_are_wrapped_and_averaged_on_the_circle() -> None:
    near = math.pi + 0.1 * np.cos(T)  # about half a turn, on both sides of the jump
    jumps = np.remainder(near + math.pi, math.tau) - math.pi
    assert abs(value("circular_mean", jumps) or 0.0) == pytest.approx(math.pi, abs=0.01)
    assert value("circular_deviation", jumps) == pytest.approx(np.std(near), rel=0.01)
    assert value("circular_mean", [0.0, math.pi], np.arange(2.0)) is None
    error = value("steady_state_error", jumps, target=-math.pi, window=10.0, wrap=True)
    assert error == pytest.approx(abs(near.mean() - math.pi), abs=1e-9)
    assert value("max_abs", 7.0 * np.ones(3), np.arange(3.0), wrap=True) == pytest.approx(
        7.0 - math.tau
    )


def test_a_metric_of_an_expression_of_columns() -> None:
    columns = np.column_stack((np.cos(T), np.sin(T)))
    expression = "u[0]**2 + u[1]**2 + t"
    assert value("max", columns, expression=expression) == pytest.approx(11.0)
    assert value("final", columns, expression="norm(u)") == pytest.approx(1.0)
    assert value("rms", columns, length=True) == pytest.approx(1.0)  # added, not averaged
    graph = {
        "graph": "g",
        "run": {"dt": 0.01, "until": 1.0},
        "blocks": {"s": {"type": "Function", "expression": "[t, 2*t]"}},
        "metrics": {"m": {"kind": "max", "of": "s.out", "expression": "u[0] + u[2]"}},
    }
    with pytest.raises(GraphError, match=r"metrics.m.expression: column 10: .u. has 2 components"):
        runtime.load(graph).check()
    graph["metrics"] = {
        "m": {"kind": "value_at", "of": "s.out", "expression": "u[1] - u[0]", "at": 0.5}
    }
    assert runtime.load(graph).run().metrics["m"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("expression", "above", "expected"),
    [("t", 0.5, (1.0, 0.0)), ("t", 5.0, (0.0, 0.0)), ("log(0.5 - t)", 5.0, (1.0, 1.0))],
)
def test_a_crash_is_a_metric(expression: str, above: float, expected: tuple[float, float]) -> None:
    graph = {
        "graph": "g",
        "run": {"dt": 0.01, "until": 1.0, "stop": {"when": "s.out", "above": above}},
        "blocks": {"s": {"type": "Function", "expression": expression}},
        "metrics": {"crashed": {"kind": "crashed"}, "broken": {"kind": "crashed", "stop": False}},
    }
    (trial,) = runtime.sweep(graph, {"run.until": [1.0]}, jobs=1).trials
    assert trial.status == ("failed" if expected[1] else "ok")
    assert (trial.metrics["crashed"], trial.metrics["broken"]) == expected


def test_settling_time_is_the_last_entry_into_the_band() -> None:
    assert value("settling_time", [0, 5, 0, 5, 1, 1], np.arange(6.0), band=1) == 4.0
    assert value("settling_time", [5, 5, 1], np.arange(3.0), band=1.0, hold=0.0) == 2.0
    assert value("settling_time", [0, 0, 0], np.arange(3.0), band=0) == 0.0
    assert value("settling_time", [0, 0, 5], np.arange(3.0), band=1) is None


def test_a_band_that_is_reached_at_the_very_end_is_not_settled() -> None:
    """A sine of 1 rad/s passes the band of 0.1 about each zero for 0.2 s: it never settles."""
    sine = np.sin(T)
    for end in range(2, len(T)):
        assert value("settling_time", sine[50:end], T[50:end], band=0.1) is None
    # A hold of 0.1 s is enough if it is set, and rounding of the times does not matter.
    ends = slice(0, int(np.searchsorted(T, math.pi)))
    entered = T[np.searchsorted(T, math.pi - math.asin(0.1))]
    asked = {"band": 0.1, "hold": T[ends][-1] - entered}
    assert value("settling_time", sine[ends], T[ends], **asked) == pytest.approx(entered)
    assert value("settling_time", sine[ends], T[ends], band=0.1, hold=0.12) is None


@pytest.mark.parametrize("hold", [-1.0, math.inf, "long", [1.0]])
def test_a_hold_is_a_time(hold: Any) -> None:
    [(key, message)] = complaints("settling_time", {"band": 0.1, "hold": hold}, of=TWIST)
    assert key == "hold" and message.startswith("expected a number at least 0 s, got ")


def test_nan_is_outside_of_the_band() -> None:
    assert value("settling_time", [0, 0, 0, math.nan], np.arange(4.0), band=1) is None
    assert value("settling_time", [0, math.nan, 0, 0], np.arange(4.0), band=1) == 2.0


def test_settling_time_of_columns_waits_for_the_slowest() -> None:
    both = np.column_stack((3.0 * np.exp(-T), 30.0 * np.exp(-T)))
    # The second column is in its band from ln 300 = 5.703... on; a band of 10 from ln 3 = 1.098...
    assert value("settling_time", both, band=0.1) == pytest.approx(5.71)
    assert value("settling_time", both, band=[0.1, 10.0]) == pytest.approx(3.41)


def test_settling_time_counts_from_after() -> None:
    assert value("settling_time", [0, 0, 5, 0], np.arange(4.0), band=1, after=3.0, hold=0.0) == 3.0


def test_share_above_a_level_of_a_sine() -> None:
    sine = np.sin(2.0 * np.pi * T)[:-1]
    # sin is above 1/2 for a third of its period, and above 0.9 for 1/2 - asin(0.9) / pi.
    assert value("share_above", sine, T[:-1]) == pytest.approx(1.0 / 3.0, abs=0.02)
    high = 0.5 - math.asin(0.9) / math.pi
    assert value("share_above", sine, T[:-1], level=0.9) == pytest.approx(high, abs=0.02)
    assert value("share_above", [0.5, 0.6, 0.5, 0.4], np.arange(4.0)) == 0.25


def test_mean_rms_and_max_of_a_sine() -> None:
    sine = np.sin(2.0 * np.pi * T)[:-1]
    # Ten whole periods: mean |sin| = 2 / pi, mean sin^2 = 1/2; sampled 100 times a period.
    assert value("mean_abs", sine, T[:-1]) == pytest.approx(2.0 / math.pi, rel=1e-3)
    assert value("rms", sine, T[:-1]) == pytest.approx(math.sqrt(0.5), rel=1e-12)
    assert value("max_abs", -3.0 * sine, T[:-1]) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("mean_abs", 2.0), ("rms", math.sqrt(14 / 3)), ("max_abs", 3.0), ("min", -2.0)],
)
def test_numbers_by_hand(kind: str, expected: float) -> None:
    assert value(kind, [1, -2, 3], np.arange(3.0)) == pytest.approx(expected, rel=1e-15)
    assert value(kind, [[1], [-2], [3]], np.arange(3.0)) == pytest.approx(expected, rel=1e-15)


def test_final_and_displacement() -> None:
    assert value("final", [1, -2, 3], np.arange(3.0)) == 3.0
    assert value("displacement", [1, -2, 3], np.arange(3.0)) == 2.0
    assert value("displacement", [[1], [-2], [3]], np.arange(3.0)) == 2.0
    assert value("displacement", [[1, 1, 9], [7, 7, 7], [4, 5, 0]], np.arange(3.0)) == 5.0


def test_path_length_of_a_polygon_and_of_a_circle() -> None:
    corners = [[0, 0, 1], [3, 4, 2], [3, 0, 3]]
    assert value("path_length", corners, np.arange(3.0)) == 9.0
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    circle = 2.0 * np.column_stack((np.cos(angle), np.sin(angle)))
    # The chords of 1000 equal arcs: 1000 * 2 r sin(pi / 1000).
    assert value("path_length", circle) == pytest.approx(4000.0 * math.sin(math.pi / 1000))


def test_lqr_cost_is_the_papers_sum() -> None:
    x = np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0], [1.0, 1.0, 1.0]])
    u = np.array([[1.0, 2.0], [3.0, 0.0], [5.0, 5.0]])
    t = np.arange(3.0)
    series = {"s": Series(t, x), "c": Series(t, u)}
    inputs = {"state": "s", "command": "c"}

    def cost(**options: Any) -> float | None:
        return Metric("m", "lqr_cost", inputs, options).value(series)

    # Twice J: (1 + 3*4) + 2*9 of x, (1 + 2*4) + 9 of u; the last row counts with q_final alone.
    assert cost(q=[1, 2, 3], r=[1, 2]) == 0.5 * (13 + 18 + 9 + 9)
    assert cost(q=[1, 2, 3], r=[1, 2], q_final=[10, 20, 30]) == 0.5 * (49 + 60)
    q = np.diag([1.0, 2.0, 3.0])
    q[0, 2] = q[2, 0] = 0.5  # adds 2 * 0.5 * x_0 * x_2 = 2 in the first row
    assert cost(q=q.tolist(), r=[[1, 0], [0, 2]]) == 0.5 * (13 + 2 + 18 + 9 + 9)


def test_lqr_cost_of_single_columns() -> None:
    t = np.arange(3.0)
    series = {"s": Series(t, np.array([1.0, 2.0, 3.0])), "c": Series(t, np.array([[1.0]] * 3))}
    for q, r in ((2, 4), ([2], [4]), ([[2]], [[4]])):
        metric = Metric("m", "lqr_cost", {"state": "s", "command": "c"}, {"q": q, "r": r})
        assert metric.value(series) == 0.5 * (2 * (1 + 4) + 4 * 2)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20), st.floats(0.0, 1e3))
def test_settling_time_by_its_definition(values: list[float], band: float) -> None:
    t = np.arange(len(values), dtype=float)
    inside = [i for i in range(len(values)) if all(abs(v) <= band for v in values[i:])]
    first = inside[0] if inside else None
    assert value("settling_time", values, t, band=band, hold=0.0) == first
    kept = None if first is None or len(values) - 1 - first < 3 else first
    assert value("settling_time", values, t, band=band, hold=3.0) == kept


def test_after_cuts_all_signals() -> None:
    assert value("mean_abs", [9, 9, 1, 3], np.arange(4.0), after=2.0) == 2.0
    assert value("displacement", [9, 9, 1, 3], np.arange(4.0), after=2) == 2.0
    assert value("final", [1.0], np.zeros(1), after=0.5) is None


def test_no_value_without_numbers() -> None:
    assert value("final", [1, math.nan], np.arange(2.0)) is None
    assert Metric("m", "final", {"of": None}).value({}) is None
    assert Metric("m", "final", {"of": "p"}).value({}) is None


# -- expectations


@pytest.mark.parametrize(
    ("options", "number", "message"),
    [
        ({"below": 1}, 0.5, ""),
        ({"below": 1}, 1.0, "metric 'm': expected below 1, got 1"),
        ({"above": 1}, 1.5, ""),
        ({"above": 1}, 0.25, "metric 'm': expected above 1, got 0.25"),
        ({"above": 0, "below": 1}, 2.0, "metric 'm': expected below 1, got 2"),
        ({"below": 1}, None, "metric 'm': expected below 1, got none"),
        ({}, None, ""),
    ],
)
def test_expectations(options: dict[str, float], number: float | None, message: str) -> None:
    assert Metric("m", "final", {"of": "p"}, options).expectation(number) == message


# -- errors

SCALAR = ProbeInfo((), ("m",))
POSE = ProbeInfo((3,), ("m", "m", "rad"))
TWIST = ProbeInfo((2,), ("m/s", "rad/s"))
TABLE = ProbeInfo((5, 2), ("m", "m"))


def complaints(kind: str, options: dict[str, Any], **signals: ProbeInfo) -> list[tuple[str, str]]:
    return list(METRIC_KINDS[kind].check(options, signals))


@pytest.mark.parametrize("kind", ["mean_abs", "rms", "max_abs", "min", "final"])
def test_one_column_metrics(kind: str) -> None:
    assert complaints(kind, {}, of=SCALAR) == []
    assert complaints(kind, {}, of=ProbeInfo((1,), ("",))) == []
    message = "expected one column, got 3; name one, as in plant.pose.theta"
    assert complaints(kind, {}, of=POSE) == [("of", message)]
    table = "expected a scalar, a record or a vector, got a table"
    assert complaints(kind, {}, of=TABLE) == [("of", table)]


def test_path_length_needs_a_position() -> None:
    assert complaints("path_length", {}, of=POSE) == []
    for wrong in (TWIST, SCALAR):
        message = "expected x and y in m, as in plant.pose"
        assert complaints("path_length", {}, of=wrong) == [("of", message)]
    assert complaints("displacement", {}, of=POSE) == []
    assert complaints("displacement", {}, of=SCALAR) == []
    message = "expected one column, got 2; name one, as in plant.pose.theta"
    assert complaints("displacement", {}, of=TWIST) == [("of", message)]


BANDS = [-1, "x", None, True, math.nan, math.inf, [], [[1]], [1, -1], {"a": 1}]


@pytest.mark.parametrize("band", BANDS, ids=str)
def test_bands(band: Any) -> None:
    [(key, message)] = complaints("settling_time", {"band": band}, of=TWIST)
    wanted = "expected a number or an array of 2 numbers at least 0, got "
    assert (key, message[: len(wanted)]) == ("band", wanted)


def test_a_band_has_one_number_per_column() -> None:
    assert complaints("settling_time", {"band": [1, 2, 3]}, of=POSE) == []
    assert complaints("settling_time", {"band": [1, 2]}, of=POSE) == [
        ("band", "expected a number or an array of 3 numbers at least 0, got [1, 2]")
    ]
    assert complaints("settling_time", {}, of=POSE) == [
        (
            "band",
            "missing; expected a number or an array of 3 numbers at least 0: "
            "largest size that is settled, or per column",
        )
    ]


@pytest.mark.parametrize("key", ["after", "below", "above"])
@pytest.mark.parametrize("bad", ["x", None, True, math.nan, math.inf, [1]], ids=str)
def test_numbers_of_every_metric(key: str, bad: Any) -> None:
    [(found, message)] = complaints("final", {key: bad}, of=SCALAR)
    wanted = f"expected a number{' at least 0 s' if key == 'after' else ''}, got"
    assert (found, message[: len(wanted)]) == (key, wanted)


def test_after_is_not_negative() -> None:
    assert complaints("final", {"after": -1}, of=SCALAR) == [
        ("after", "expected a number at least 0 s, got -1")
    ]


WEIGHTS = [
    ([1, 1], "expected a number or an array of 3 or 3x3 numbers, got [1, 1]"),
    (1, "expected an array of 3 or 3x3 numbers, got 1"),
    ([1, 1, "x"], "expected a number or an array of 3 or 3x3 numbers, got [1, 1, 'x']"),
    ([[1, 0], [0, 1]], "expected a number or an array of 3 or 3x3 numbers, got [[1, 0], [0, 1]]"),
    ([1, 1, [1]], "expected a number or an array of 3 or 3x3 numbers, got [1, 1, [1]]"),
    ([1, 1, math.inf], "expected a number or an array of 3 or 3x3 numbers, got [1, 1, inf]"),
]


@pytest.mark.parametrize(("weight", "message"), WEIGHTS, ids=str)
def test_weights(weight: Any, message: str) -> None:
    assert complaints("lqr_cost", {"q": weight, "r": [1, 1]}, state=POSE, command=TWIST) == [
        ("q", message)
    ]


def test_state_and_command_need_the_same_rate() -> None:
    slow = ProbeInfo((2,), ("m/s", "rad/s"), every=10)
    once = ProbeInfo((2,), ("m/s", "rad/s"), every=0)
    weights = {"q": [1, 1, 1], "r": [1, 1]}
    for command, when in ((slow, "every 10 ticks"), (once, "once")):
        message = (
            "the two are recorded at different times, state every 1 ticks and command "
            f"{when}; probe both alike"
        )
        assert complaints("lqr_cost", weights, state=POSE, command=command) == [
            ("command", message)
        ]


class Percentile(MetricOptions):
    """The options of a kind of metric that is not built in."""

    percentile: float = param(unit="%", at_least=0.0, at_most=100.0, doc="share of rows below")


@pytest.mark.parametrize("written", ["ninety", 101, -1, None, [50], True])
def test_options_of_a_new_kind_are_checked_against_their_declaration(
    written: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the kind's own declaration is needed: check, value, defaults and message follow."""

    def percentile(series: Any, options: Any) -> float:
        return float(np.percentile(series["of"].values, options["percentile"]))

    kind = MetricKind(percentile, "a percentile", Percentile)
    monkeypatch.setitem(METRIC_KINDS, "percentile", kind)
    plain = parse_yaml(SOUND, "g").plain()
    entry = {"kind": "percentile", "of": "plant.pose.x", "percentile": written}
    graph = runtime.load({**plain, "metrics": {"p": entry}})
    with pytest.raises(GraphError) as caught:
        graph.check()
    message = "metrics.p.percentile: expected a number at least 0 and at most 100 %, got "
    assert str(caught.value).startswith(message)
    result = graph.set("metrics.p.percentile", 50).probe("x", "plant.pose.x").run()
    assert result.metrics["p"] == np.median(result["x"])


# -- in a graph


def measured(metrics: str) -> runtime.Result:
    text = changed(SOUND, f"metrics:\n{metrics}")
    return runtime.load(parse_yaml(text, "g").plain()).run()


def test_metrics_of_a_run_are_those_of_its_arrays() -> None:
    result = measured(
        "  way: {kind: path_length, of: pose}\n"
        "  far: {kind: displacement, of: plant.pose}\n"
        "  turned: {kind: final, of: plant.pose.theta}\n"
        "  cost: {kind: lqr_cost, state: error.state, command: lqr.command, q: [1, 1, 1],"
        " r: [2, 2]}\n"
    )
    pose = result["pose"]
    steps = [math.dist(a[:2], b[:2]) for a, b in pairwise(pose)]
    assert result.metrics["way"] == pytest.approx(sum(steps), rel=1e-12)
    assert result.metrics["far"] == pytest.approx(math.dist(pose[0, :2], pose[-1, :2]), rel=1e-12)
    assert result.metrics["turned"] == pose[-1, 2]
    x, u = result["error.state"], result["lqr.command"]
    by_hand = 0.5 * sum((x[:-1] ** 2).sum(axis=1) + 2.0 * (u[:-1] ** 2).sum(axis=1))
    assert result.metrics["cost"] == pytest.approx(by_hand, rel=1e-12)
    assert result.metrics["way"] > 0.0


def test_a_metric_of_times_after_the_end_has_a_note() -> None:
    result = measured("  m: {kind: final, of: plant.pose.x, after: 5}\n")
    assert result.metrics == {"m": None}
    assert result.notes == ["metric 'm' has no value: it looks at times after 5 s"]


def test_a_metric_of_times_until_after_the_end_has_a_note() -> None:
    until = measured("  m: {kind: final, of: plant.pose.x, until: 5}\n")
    assert until.metrics == {"m": None}
    message = "metric 'm' has no value: it looks at times until {:g} s, and the run ends at {:g} s"
    assert until.notes == [message.format(5, until.manifest["until"])]
    half = until.manifest["until"] / 2
    inside = measured(f"  m: {{kind: final, of: plant.pose.x, until: {half}}}\n")
    assert inside.metrics["m"] is not None and not inside.notes


def test_a_run_that_stops_before_the_end_of_a_metric_has_a_note() -> None:
    document = {
        "run": {"dt": 0.01, "until": 2.0, "stop": {"when": "clock.time", "above": 1.2}},
        "blocks": {"clock": {"type": "Clock"}, "one": {"type": "Constant", "value": 1.0}},
        "metrics": {
            "late": {"kind": "final", "of": "clock.time", "until": 1.5},
            "early": {"kind": "final", "of": "clock.time", "until": 1.0},
            "constant": {"kind": "final", "of": "one.value", "until": 5.0},
        },
    }
    result = runtime.load(document).run()
    assert result.metrics["late"] is None and result.metrics["constant"] == 1.0
    (note,) = result.notes
    assert note.startswith("metric 'late' has no value: it looks at times until 1.5 s, and the run")


def test_a_metric_has_the_unit_of_its_kind_or_of_its_signal(tmp_path: Path) -> None:
    graph = runtime.load("starters/adaptive").set("run.until", 0.05)
    graph = graph.metric("bent", "final", "match.curvature").metric("on", "share_above", "turn_on")
    result = (
        graph.probe("turn_on", "limit.saturated").metric("far", "displacement", "plant.pose").run()
    )
    units = {"settled_at": "s", "mean_error": "m", "bent": "1/m", "far": "m"}
    assert result.units == units
    assert runtime.open(result.save(tmp_path / "run")).units == units
