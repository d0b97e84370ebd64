"""Whole graphs in C: solvers, random numbers, parts that are off, events, loops; equal to a run."""

from __future__ import annotations

from pathlib import Path

import pytest

import runtime
from runtime.export import export
from tests.runtime.export.test_every_block import COMPILERS, SANITIZE, run

GRAPHS = Path(__file__).parents[3] / "graphs"
QUICK = {
    "gallery/dc_motor": "states of several blocks in one row",
    "gallery/brusselator": "a solver that chooses its steps",
    "gallery/published/flame": "an implicit solver, with a local array",
    "gallery/bouncing_ball": "events between ticks",
    "gallery/thermostat": "a switch between ticks",
    "gallery/noise_filter": "random numbers",
    "starters/own_block": "blocks of one's own",
}


def shipped() -> list[str]:
    """All shipped graphs that are no part of another one, and need no extra."""
    found = []
    for path in sorted(GRAPHS.rglob("*.yaml")):
        name = str(path.relative_to(GRAPHS).with_suffix(""))
        text = path.read_text()
        if "\nrun:" in text and "mujoco" not in name:
            found.append(name)
    return found


@pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
@pytest.mark.parametrize("name", QUICK)
def test_a_whole_graph_does_what_its_run_does(name: str, tmp_path: Path) -> None:
    made = export(runtime.load(name), tmp_path, ticks=200)
    assert made.inputs == ()
    said = run(tmp_path, COMPILERS[0], *SANITIZE, "controller.c", "controller_test.c")
    assert "fine" in said and "WRONG" not in said


@pytest.mark.slow
@pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
@pytest.mark.parametrize("name", shipped())
def test_every_shipped_graph_is_exported(name: str, tmp_path: Path) -> None:
    export(runtime.load(name), tmp_path, ticks=200)
    for compiler in COMPILERS:
        said = run(tmp_path, compiler, "-O2", "controller.c", "controller_test.c")
        assert "WRONG" not in said
