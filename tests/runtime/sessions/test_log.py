"""The log of a session: what goes in comes out, also of copies and files, in little memory."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.limits import LINE
from runtime.graph import open_session
from runtime.sessions import changes_of
from runtime.sessions.log import TOGETHER, Change, Log
from tests.examples import examples
from tests.runtime.sessions.test_session import same, servo

NUMBERS = st.floats(allow_nan=False)
ROWS = st.lists(NUMBERS, min_size=3, max_size=3)
ADDED = st.one_of(
    st.tuples(st.just("push"), NUMBERS),
    st.tuples(st.just("pull"), ROWS),
    st.tuples(st.just("table"), st.lists(ROWS, min_size=2, max_size=2)),
    st.tuples(st.just(""), st.just(0.0)),  # a change that is no write
)


@given(added=st.lists(ADDED, max_size=12), copied=st.integers(0, 12), often=st.integers(1, 200))
@examples(40)
def test_what_goes_in_comes_out(added: list[tuple[str, Any]], copied: int, often: int) -> None:
    log, expected, copy = Log(), [], Log()
    for tick, (port, value) in enumerate(added * often):
        if tick == copied:
            copy = log.copy()
        if port:
            log.write(tick, port, value if isinstance(value, float) else np.array(value))
            expected.append(Change(tick, "write", (port, value)))
        else:
            log.note(Change(tick, "set", ("gain.gain", [1, "a"])))
            expected.append(Change(tick, "set", ("gain.gain", [1, "a"])))
    assert list(log) == expected and len(log) == len(expected)
    if copied < len(expected):
        assert list(copy) == expected[:copied]
        copy.write(9, "push", 4.0)
        assert list(log) == expected
    lines = [json.dumps(entry) for entry in log.entries()]
    assert [c for line in lines for c in changes_of(json.loads(line))] == expected


def test_a_write_a_tick_takes_eighteen_bytes() -> None:
    log, count = Log(), 100 * TOGETHER
    tracemalloc.start()
    try:
        for tick in range(count):
            log.write(tick, "push", 0.5 * tick)
        assert tracemalloc.get_traced_memory()[0] < 25 * count  # an hour of 1 kHz: 90 MB at most
    finally:
        tracemalloc.stop()


def test_a_session_that_is_written_to_at_each_tick_replays(tmp_path: Path) -> None:
    session = servo(run={"dt": 0.001, "until": 3.0, "seed": 4})
    for tick in range(2 * TOGETHER + 100):
        session.write("push", float(np.sin(0.01 * tick)))
        session.step()
    folder = session.save(tmp_path / "a")
    again = open_session(folder)
    assert again.log == session.log
    assert same(session.result(), again.result()) == []
    lines = (folder / "log.jsonl").read_text().splitlines(keepends=True)
    assert len(lines) == 3
    for damaged, message in (
        ("".join(lines[:2]), "has not the 2148 changes"),
        ("".join(lines)[:-9], "line 3: "),
        ("[]\n", "line 1: "),
        ("[" * 100_000, "line 1: it is nested too deep"),
        (" " * (LINE + 1), "is damaged: line 1 has more than"),
    ):
        (folder / "log.jsonl").write_text(damaged)
        with pytest.raises(runtime.UsageError, match=message):
            open_session(folder)


@pytest.mark.parametrize("value", [True, np.True_, [True]])
def test_a_truth_value_is_no_number(value: Any) -> None:
    session = servo()
    with pytest.raises(runtime.UsageError, match=r"'push': expected a number for a Scalar, got"):
        session.write("push", value)
    assert session.log == ()
