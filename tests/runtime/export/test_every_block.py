"""Every block type that can be exported is: the same outputs as the graph, no warning, and under
hostile inputs nothing but finite outputs and failures.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from blocks.core import PartEnable
from runtime.export import export
from tests.runtime.export.every_block import first_cases, graph_of

COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
STRICT = ("-std=c99", "-pedantic", *WARNINGS, "-ffp-contract=off")
SANITIZE = (
    *("-O1", "-g", "-fsanitize=address,undefined,float-cast-overflow"),
    "-fno-sanitize-recover=all",
)
CASES = first_cases()
# Steps with inputs of every size and kind; a failure is reset. Random ones, the same each time.
HOSTILE = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "controller.h"
static struct controller c;
static const double worst[] = {
    0.0, -0.0, 1.0, -1.0, 0.5, 3.0, -7.25, 1e-300, 5e-324, 1e15, -1e15, 9.3e18, -9.3e18, 1e155,
    1e300, -1e300, 1.7976931348623157e308, -1.7976931348623157e308, %(wrong)s};
int main(void)
{
    struct controller_inputs in;
    struct controller_outputs out;
    double given[sizeof in / sizeof(double) + 1], made[sizeof out / sizeof(double) + 1];
    const int numbers = (int)(sizeof in / sizeof(double));
    const int count = (int)(sizeof worst / sizeof worst[0]);
    unsigned seed = 1;
    int failures = 0;
    controller_init(&c);
    for (int k = 0; k < %(steps)d; k++) {
        const int kept = k %% 4;
        for (int i = 0; i < numbers; i++) {
            seed = seed * 1664525u + 1013904223u;
            const double one = worst[(seed >> 16) %% (unsigned)count];
            if (k == 0 || kept == 0 || (seed >> 8) %% 5 == 0) given[i] = kept == 1 ? 0.25 : one;
        }
        memcpy(&in, given, sizeof in);
        memset(&out, 0, sizeof out);
        const int failure = controller_step(&c, &in, &out);
        memcpy(made, &out, sizeof out);
        for (int i = 0; i < (int)(sizeof out / sizeof(double)); i++)
            if (isnan(made[i])) return printf("NaN is no failure at step %%d", k), 1;
        if (!failure) continue;
        failures++;
        if (strcmp(controller_message(failure), "unknown failure") == 0) return 1;
        if (k %% 2) controller_reset(&c);
        else controller_init(&c);
    }
    printf("%%d failures\\n", failures);
    return 0;
}
"""


def exportable(name: str) -> bool:
    """Whether a block type can be exported by itself; continuous ones are with what they read."""
    cls = type(CASES[name].block)
    return not (cls.spec.continuous or issubclass(cls, PartEnable))


def run(folder: Path, compiler: str, *words: str) -> str:
    """Compile and run a program in a folder; what it prints."""
    program = folder / "program"
    made = subprocess.run(
        [compiler, *STRICT, *words, "-lm", "-o", str(program)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if "sanitize" in " ".join(words) and "cannot find" in made.stderr:
        return "no sanitizers"
    assert made.returncode == 0 and not made.stderr, made.stderr
    done = subprocess.run([program], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0 and not done.stderr, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.skipif(not COMPILERS, reason="needs gcc or clang")
@pytest.mark.parametrize("name", sorted(filter(exportable, CASES)))
def test_every_type_is_exported(name: str, tmp_path: Path) -> None:
    export(graph_of(CASES[name]), tmp_path, blocks=["block"])
    for compiler in COMPILERS:
        for level in range(4):
            said = run(tmp_path, compiler, f"-O{level}", "controller.c", "controller_test.c")
            assert "fine" in said
        assert run(tmp_path, compiler, *SANITIZE, "controller.c", "controller_test.c")
    # Infinite and NaN inputs, too: they are a failure, or a miss where signals have misses.
    steps = 200 if name in ("WallFitter", "MatchingPoint") else 2000
    text = HOSTILE % {"wrong": "(double)NAN, (double)INFINITY, -(double)INFINITY", "steps": steps}
    (tmp_path / "hostile.c").write_text(text)
    assert "failures" in run(tmp_path, COMPILERS[0], *SANITIZE, "controller.c", "hostile.c")
    finite = HOSTILE % {"wrong": "2.0", "steps": steps}
    (tmp_path / "hostile.c").write_text(finite)
    assert "failures" in run(tmp_path, COMPILERS[-1], *SANITIZE, "controller.c", "hostile.c")
