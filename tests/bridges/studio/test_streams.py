"""Streams: a page gets each row once, no peak is lost, and what is drawn again is sent again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import runtime
from spikeblocks.studio.streams import ROWS, Streams, pack
from tests.bridges.studio.frames import unpack
from tests.runtime.sessions.test_session import SERVO

PROBES = runtime.load(SERVO).program().observation.probes
MODES = {"x": "curves", "out": "rows", "spikes": "events", "push": "curves"}


def streamed(until: int, stops: list[int]) -> tuple[Streams, dict[str, Any], Any]:
    session = runtime.load(SERVO).session()
    streams = Streams(PROBES, MODES, until, 0.001)
    kept: dict[str, Any] = {name: [] for name in MODES}
    for ticks in stops:
        session.step(ticks)
        _, parts = unpack(pack({}, streams.take(session.rows(streams.since))))
        for name, (first, numbers) in parts.items():
            width = streams.streams[name].describe(0.001)["width"]
            rows = numbers.reshape(-1, width)
            if name != "spikes":
                assert first == sum(map(len, kept[name]))
            kept[name].append(rows)
    joined = {n: np.vstack(p) if p else np.empty((0, 1)) for n, p in kept.items()}
    return streams, joined, session.result()


@settings(max_examples=10)
@given(st.lists(st.integers(1, 300), min_size=1, max_size=5))
def test_each_row_comes_once(stops: list[int]) -> None:
    _, kept, result = streamed(100, stops)
    assert np.array_equal(kept["x"][:, 0], result["x"].astype("<f4"))
    assert np.array_equal(kept["out"], result["out"].astype("<f4"))
    at, neuron = np.nonzero(result["spikes"])
    assert np.array_equal(kept["spikes"], np.column_stack([at, neuron]))


def test_no_peak_is_lost_where_rows_are_dropped() -> None:
    streams, kept, result = streamed(40 * ROWS, [700, 1, 1999, 300])
    assert streams.streams["x"].stride == 80
    full = result["x"][: 3000 // 80 * 80].reshape(-1, 80)
    assert np.array_equal(kept["x"][0::2, 0], full.min(axis=1).astype("<f4"))
    assert np.array_equal(kept["x"][1::2, 0], full.max(axis=1).astype("<f4"))
    assert np.array_equal(kept["out"], result["out"][::14].astype("<f4")[: len(kept["out"])])


def test_rows_from_a_tick_on_are_sent_again() -> None:
    session = runtime.load(SERVO).session().step(90)
    streams = Streams(PROBES, MODES, 100, 0.001)
    list(streams.take(session.rows(streams.since)))
    assert not list(streams.take(session.rows(streams.since)))
    streams.go_back(30)
    again = {name: (first, rows) for name, first, rows in streams.take(session.rows(30))}
    assert again["x"][0] == 30 and len(again["x"][1]) == 60
    assert again["out"][0] == 10
    streams.begin_again()
    assert {first for _, first, _ in streams.take(session.rows(0))} == {0}


def test_nothing_constant_is_sent_twice() -> None:
    probes = runtime.load("line_actuator_failure").program().observation.probes
    constant = [name for name, probe in probes.items() if probe.constant]
    session = runtime.load("line_actuator_failure").session().step(10)
    streams = Streams(probes, dict.fromkeys(constant, "rows"), 1000, 0.001)
    assert len(list(streams.take(session.rows(streams.since)))) == len(constant) > 0
    session.step(10)
    assert not list(streams.take(session.rows(streams.since)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_legal(value: float) -> None:
    _, parts = unpack(pack({"t": 1.0}, [("a", 3, np.array([[value, 1.0]]))]))
    assert parts["a"][0] == 3
    assert np.array_equal(parts["a"][1], np.array([value, 1.0], "<f4"), equal_nan=True)
