"""Whole graphs in C: solvers, random numbers, parts that are off, events, loops; equal to a run."""

from __future__ import annotations

from pathlib import Path

import pytest

import runtime
from runtime.export import export
from tests.runtime.export import table
from tests.runtime.export.table import shipped
from tests.runtime.export.test_every_block import COMPILERS, SANITIZE, run

QUICK = {
    "gallery/dc_motor": "states of several blocks in one row",
    "gallery/brusselator": "a solver that chooses its steps",
    "gallery/published/flame": "an implicit solver, with a local array",
    "gallery/bouncing_ball": "events between ticks",
    "gallery/thermostat": "a switch between ticks",
    "gallery/noise_filter": "random numbers",
    "starters/own_block": "blocks of one's own",
}


def test_the_table_is_of_shipped_graphs() -> None:
    names = table.rows()
    assert names and set(names) <= set(shipped())
    assert all(len(cells) == len(table.COLUMNS) for cells in names.values())


@pytest.mark.slow
@pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
def test_a_row_of_the_table_is_what_its_command_finds() -> None:
    name = "gallery/pid_loop"
    assert table.row(name).split(" | ")[:3] == table.rows()[name][:3]


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


# Parameters, inputs and saved bytes of every kind while it runs; a failure is reset.
HOSTILE = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "controller.h"
static struct controller c;
static unsigned char saved[CONTROLLER_SAVED];
static const double worst[] = {
    0.0, -0.0, 1.0, -1.0, 0.5, 5e-324, 1e-300, 1e15, -1e15, 9.3e18, 1e155, -1e300,
    1.7976931348623157e308, (double)NAN, (double)INFINITY, -(double)INFINITY};
static unsigned seed = 1;
static double any(void)
{
    seed = seed * 1664525u + 1013904223u;
    return worst[(seed >> 16) %% (unsigned)(sizeof worst / sizeof worst[0])];
}
int main(void)
{
    static const char *const names[] = {%(names)s""};
    struct controller_inputs in;
    struct controller_outputs out;
    double given[sizeof in / sizeof(double) + 1];
    const int numbers = (int)(sizeof in / sizeof(double));
    int failures = 0, refused = 0;
    controller_init(&c);
    controller_save(&c, saved);
    for (int k = 0; k < %(steps)d; k++) {
        for (int i = 0; i < numbers; i++) given[i] = k %% 3 ? 0.25 : any();
        memcpy(&in, given, sizeof in);
        if (k %% 5 == 4) {
            const int which = (int)(seed >> 8) %% (int)(sizeof names / sizeof names[0]);
            refused += controller_set(&c, names[which], (int)(seed >> 4) %% 4, any()) != 0;
        }
        if (k %% 41 == 40) {
            saved[seed %% CONTROLLER_SAVED] ^= 1;
            if (!controller_load(&c, saved)) return printf("damaged bytes at step %%d", k), 1;
            saved[seed %% CONTROLLER_SAVED] ^= 1;
            if (controller_load(&c, saved)) return printf("refused at step %%d", k), 1;
        }
        const int failure = controller_step(&c, &in, &out);
        if (!failure) continue;
        failures++;
        if (strcmp(controller_message(failure), "unknown failure") == 0) return 1;
        if (k %% 2) controller_reset(&c);
        else controller_init(&c);
    }
    printf("%%d failures, %%d refused\\n", failures, refused);
    return 0;
}
"""
LONG = ("gallery/pid_loop", "gallery/noise_filter", "gallery/balanced_pole", "starters/own_block")


@pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in LONG[:1] else pytest.mark.slow) for n in shipped()],
)
def test_hostile_numbers_end_in_failures(name: str, tmp_path: Path) -> None:
    graph = runtime.load(name)
    export(graph, tmp_path, ticks=20)
    header = (tmp_path / "controller.h").read_text()
    section = header.split("_parameters {", 1)[1].split("};", 1)[0]
    names = [
        line.split("/* ", 1)[1].split(": ")[0] for line in section.splitlines() if "/*" in line
    ]
    steps = 100_000 if name in LONG[1:] else 1000
    text = HOSTILE % {"names": "".join(f'"{each}", ' for each in names), "steps": steps}
    (tmp_path / "hostile.c").write_text(text)
    assert "failures" in run(tmp_path, COMPILERS[0], *SANITIZE, "controller.c", "hostile.c")
