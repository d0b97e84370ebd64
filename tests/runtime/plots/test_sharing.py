"""Work shared with a fork: all of it is done, whatever becomes of the fork."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import runtime
from runtime.plots import save_plots

if sys.platform == "win32":
    pytest.skip("Windows cannot fork", allow_module_level=True)

from runtime.plots import sharing

COUNT = 6


def meeting(folder: Path, then: Callable[[bool], None]) -> Callable[[int], str]:
    """Work of which each process does some: each waits in its first until the other has begun."""
    parent = os.getpid()

    def work(index: int) -> str:
        in_fork = os.getpid() != parent
        own, other = ("fork", "parent") if in_fork else ("parent", "fork")
        if not (folder / own).exists():
            (folder / own).touch()
            while not (folder / other).exists():
                os.sched_yield()
            then(in_fork)
        return f"{index} by {own}"

    return work


def test_two_processes_share_the_work(tmp_path: Path) -> None:
    begun: list[int] = []
    work = meeting(tmp_path, lambda in_fork: None)
    answers = sharing.share_work(work, COUNT, lambda i, n: begun.append(i))
    assert [answer.split()[0] for answer in answers] == [str(i) for i in range(COUNT)]
    assert {answer.split()[2] for answer in answers} == {"parent", "fork"}
    assert begun == [i for i, answer in enumerate(answers) if "parent" in answer]


def test_a_killed_fork_costs_nothing_but_time(tmp_path: Path) -> None:
    def then(in_fork: bool) -> None:
        if in_fork:
            os.kill(os.getpid(), signal.SIGKILL)

    answers = sharing.share_work(meeting(tmp_path, then), COUNT)
    assert answers == [f"{i} by parent" for i in range(COUNT)]


def test_a_fork_that_is_refused_is_done_without(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> int:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(os, "fork", refuse)
    assert sharing.share_work(str, 3) == ["0", "1", "2"]


def test_more_than_the_pipe_holds_is_done_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "MOST", 2)
    assert sharing.share_work(str, 5) == ["0", "1", "2", "3", "4"]


def test_an_interrupt_unwinds_the_fork_too(tmp_path: Path) -> None:
    def then(in_fork: bool) -> None:
        if not in_fork:
            while not (tmp_path / "trying").exists():
                os.sched_yield()
            raise KeyboardInterrupt
        try:
            (tmp_path / "trying").touch()
            signal.pause()
        finally:
            (tmp_path / "unwound").write_text(str(os.getpid()), encoding="utf-8")

    with pytest.raises(KeyboardInterrupt):
        sharing.share_work(meeting(tmp_path, then), COUNT)
    with pytest.raises(ChildProcessError):  # it was waited for
        os.waitpid(int((tmp_path / "unwound").read_text(encoding="utf-8")), os.WNOHANG)


def test_shared_figures_are_the_same_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "can_share", lambda: True)
    result = runtime.load("starters/tracking").set("run.until", 0.2).run()
    notes: list[str] = []
    alone = save_plots(result, tmp_path / "alone", notes.append)
    both = save_plots(result, tmp_path / "both", notes.append, share=True)
    assert [path.name for path in both] == [path.name for path in alone]
    assert len(alone) > 1
    assert [path.read_bytes() for path in both] == [path.read_bytes() for path in alone]
    assert notes == []


def test_reasons_are_told_in_the_order_of_the_plots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sharing, "can_share", lambda: True)
    result = runtime.load("starters/tracking").set("run.until", 0.2).run()

    def draw(plot: object) -> Figure:
        raise ValueError(f"no {result.plots.index(plot)}")

    notes: list[str] = []
    assert save_plots(result, tmp_path, notes.append, draw_plot=draw, share=True) == []
    assert [note.split("no ")[1] for note in notes] == [str(i) for i in range(len(result.plots))]
