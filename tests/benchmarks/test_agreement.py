"""Implementations of one diagram agree, and a benchmark of some that do not is refused."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("numba", reason="loops written by hand need numba (extra 'bench')")

import benchmarks.__main__ as command
from benchmarks import by_hand, case_a, contests, peers, tracking
from benchmarks.agreement import TOLERANCE, DisagreementError, Run, largest_difference
from benchmarks.case_a import EVERY
from benchmarks.tables import Goal, faster, figure, within
from benchmarks.timing import Timing, take_turns

TICKS = 300


@pytest.fixture(scope="module")
def numbers() -> by_hand.CaseA:
    return case_a.numbers(40)


def rows(run: Run, first: int = 0) -> Run:
    return Run(run.seconds, run.poses[first::EVERY])


@pytest.mark.slow
def test_case_a_by_hand_equals_the_python_engine(numbers: by_hand.CaseA) -> None:
    runs = {
        "ours": case_a.Ours(40, TICKS, "python")(),
        "numpy": rows(by_hand.numpy_case_a(numbers, TICKS)),
        "numba": rows(by_hand.numba_case_a(numbers, TICKS)),
    }
    assert largest_difference("case A", runs) <= TOLERANCE


def test_case_a_in_nengo_is_the_numpy_loop_in_nengos_order(numbers: by_hand.CaseA) -> None:
    theirs = case_a.nengo_run(numbers, TICKS)
    in_order = rows(by_hand.numpy_case_a(numbers, TICKS, filtered="decoded"), EVERY - 1)
    assert largest_difference("nengo", {"numpy": in_order, "nengo": theirs}) <= TOLERANCE
    # The order of synapse and decoders is no rounding error, or there would be nothing to test.
    other = rows(by_hand.numpy_case_a(numbers, TICKS), EVERY - 1)
    assert np.abs(other.poses - theirs.poses).max() > 100.0 * TOLERANCE


@pytest.mark.parametrize("dt", [0.01, 0.001])
def test_tracking_by_hand_equals_the_python_engine(dt: float) -> None:
    runs = {
        "ours": tracking.Ours(TICKS, dt, "python")(),
        "numba": by_hand.numba_tracking(TICKS, dt),
    }
    assert largest_difference("tracking", runs) <= TOLERANCE
    # Euler steps of the unicycle: what the first row leads to is the second.
    (x, y, theta), second = runs["ours"].poses[0], runs["ours"].poses[1]
    assert (x, y, theta) == tracking.X0
    assert np.hypot(*(second[:2] - (x, y))) > 0.0


@pytest.mark.parametrize("title", [peer.title for peer in peers.PEERS])
def test_peers_that_are_installed_agree(title: str) -> None:
    peer = next(peer for peer in peers.PEERS if peer.title == title)
    pytest.importorskip(peer.package if peer.package != "drake" else "pydrake")
    found, missing = peers.installed([peer])
    assert title not in missing
    runs = {"numba": by_hand.numba_tracking(50, 0.01), title: found[title].poses(50, 0.01)}
    assert largest_difference("tracking", runs) <= TOLERANCE


def test_a_peer_that_is_not_there_is_named() -> None:
    nobody = peers.Peer("nobody", "no-such-package", "in_nobody")
    assert peers.installed([nobody]) == ({}, {"nobody": "is not installed"})


def straight(step: float) -> Run:
    return Run(1.0, np.arange(30.0).reshape(10, 3) * step)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (Run(1.0, straight(1.0).poses + 2e-9), "B and A part at row 0 by 2e-09"),
        (Run(1.0, straight(1.0).poses * np.nan), "B and A part at row 0"),
        (Run(1.0, straight(1.0).poses[1:]), r"B gave \(9, 3\) poses against \(10, 3\) of A"),
    ],
)
def test_disagreement_is_refused(other: Run, message: str) -> None:
    with pytest.raises(DisagreementError, match=message):
        largest_difference("subject", {"A": straight(1.0), "B": other})


def test_agreeing_on_standing_still_is_refused() -> None:
    with pytest.raises(DisagreementError, match="A stands still"):
        largest_difference("subject", {"A": straight(0.0), "B": straight(0.0)})


def off(poses: float, steps: int, dt: float) -> Run:
    run = by_hand.numba_tracking(steps, dt)
    return Run(run.seconds, run.poses + poses)


def test_nothing_is_written_where_implementations_part(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def timed(*_: object) -> None:
        raise AssertionError("timed before all agreed")

    monkeypatch.setattr(contests, "ENGINES", {contests.PYTHON: "python"})
    bent = SimpleNamespace(poses=partial(off, 1e-8))
    monkeypatch.setattr(peers, "installed", lambda _: ({"bent": bent}, {}))
    monkeypatch.setattr(contests, "take_turns", timed)
    monkeypatch.setattr(command, "PAGE", tmp_path / "performance.md")
    monkeypatch.setattr("sys.argv", ["benchmarks", "1"])
    assert command.main() == 1
    assert "no table: tracking at 10 ms: bent and" in capsys.readouterr().err
    assert not (tmp_path / "performance.md").exists()


def test_goals_say_whether_they_are_met() -> None:
    timings = {"ours": Timing([2.0, 1.0, 3.0]), "theirs": Timing([30.0, 20.0, 10.0])}
    assert faster("fast", timings, "ours", "theirs", 10.0).line() == "* fast: 10x, met.\n"
    assert faster("fast", timings, "ours", "theirs", 11.0).line() == "* fast: 10x, **missed**.\n"
    assert within("near", timings, "theirs", "ours", 9.0).line() == "* near: 10x, **missed**.\n"
    assert within("near", timings, "ours", "nobody", 9.0).line() == "* near: not measured.\n"
    assert not Goal("nan", float("nan"), most=1.0).met
    assert figure(timings["ours"], 1.0, "s") == "2.0 s (1.0 to 3.0)"


def test_contestants_take_turns() -> None:
    order: list[str] = []

    def contestant(name: str) -> float:
        order.append(name)
        return float(len(order))

    timings = take_turns({name: partial(contestant, name) for name in "ab"}, 2)
    assert order == ["a", "b"] * 3
    assert timings["a"].seconds == [3.0, 5.0]  # the first round does not count
