"""An exported controller that fails says so: the same number under each compiler and level."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Block, Input, Output, Scalar, State
from runtime import toolchain
from runtime.export import export

COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
STRICT = ("-std=c99", "-pedantic", *WARNINGS, "-ffp-contract=off")
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")
BUILDS = [
    *([(name, f"-O{level}") for name in COMPILERS for level in range(4)]),
    *([(name, "-O1", *SANITIZE) for name in COMPILERS]),
]
QUICK = [(name, level) for name in COMPILERS for level in ("-O0", "-O2")]
needs_compiler = pytest.mark.skipif(
    not toolchain.available(), reason=f"no C compiler: {toolchain.install_command()}"
)


def positive(x: float) -> float:
    if x < 0.0:
        raise ValueError("a negative number")
    return x


def halves(x: float) -> tuple[float, float]:
    return positive(x) / 2.0, positive(x) / 2.0


class Faulty(Block):
    """kind, x ─▶ [ Faulty ] ─▶ out: fails in a way for each kind, for some x."""

    kind = Input(Scalar, doc="which statement runs")
    x = Input(Scalar, doc="x")
    out = Output(Scalar, doc="something that depends on x")
    weights = State(3, doc="untouched by a step that fails before it writes")

    def output(self, state: Any, t: float, kind: float, x: float) -> float:
        n = int(x)
        if kind == 1.0:
            raise RuntimeError("asked to fail")
        if kind == 2.0:
            return positive(x) + 1.0
        if kind == 3.0:
            a, b = halves(x)
            state.weights[0] = a
            return a + b
        if kind == 4.0:
            return float(state.weights[n])
        if kind == 5.0:
            state.weights[n] = 7.0
        if kind == 6.0:
            part = state.weights[3:]
            part[n] = 7.0
        if kind == 7.0:
            return 1.0 / x
        if kind == 8.0:
            return float(5 // n)
        if kind == 9.0:
            return 5.0 % x
        if kind == 10.0:
            return float(int(1e300 * x))
        if kind == 11.0:
            return float(np.zeros(n)[0])
        if kind == 12.0:
            return float(np.zeros(n)[3])
        if kind == 13.0:
            while positive(x) < 10.0:
                x += 1.0
            return x
        if kind == 14.0:
            return 1.0 if x != 0.5 and 5 % n == 0 else 0.0
        if kind == 15.0:
            made = np.zeros(n)
            made[:] = state.weights[:2]
            return float(made[0])
        if kind == 16.0:
            return float(np.max(state.weights[:n]))
        if kind == 17.0:
            total = 0.0
            for i in range(5 // n, 3):
                total += state.weights[i]
            return total
        if kind == 18.0:
            rows = np.zeros((n, 3))
            rows[n, 2] = 1.0
        if kind == 19.0:
            return x * 1e308
        return 0.0


# Kind, x that is fine, x that fails, and what is said.
CASES: list[tuple[int, float | None, float, str]] = [
    (1, None, 0.0, "asked to fail"),
    (2, 1.0, -1.0, "a negative number"),
    (3, 1.0, -1.0, "a negative number"),
    (4, 2.0, 3.0, "out of bounds"),
    (5, 2.0, -4.0, "out of bounds"),
    (6, None, 0.0, "out of bounds"),
    (7, 1.0, 0.0, "float division by zero"),
    (8, 1.0, 0.0, "integer division or modulo by zero"),
    (9, 1.0, 0.0, "float modulo"),
    (10, 0.0, 1.0, "to integer"),
    (11, 1.0, 0.0, "out of bounds"),
    (12, 4.0, 1e7, "more memory"),
    (13, 1.0, -1.0, "a negative number"),
    (14, 0.5, 0.0, "integer division or modulo by zero"),
    (15, 2.0, 3.0, "broadcast"),
    (16, 1.0, 0.0, "zero-size array"),
    (17, 2.0, 0.0, "integer division or modulo by zero"),
    (18, None, 0.0, "out of bounds"),
    (19, 1.0, 10.0, "output block.out is not finite"),
]
MAIN = """
#include <stdio.h>
#include "controller.h"
static struct controller c;
int main(void)
{
    const double cases[][3] = {%s};
    for (int i = 0; i < %d; i++) {
        struct controller_inputs in = {cases[i][0], cases[i][1]};
        struct controller_outputs out = {-1.0};
        controller_init(&c);
        const int fine = cases[i][1] != cases[i][2] ? controller_step(&c, &in, &out) : 0;
        struct controller_outputs kept = out;
        in.x_out = cases[i][2];
        const int failure = controller_step(&c, &in, &out);
        in.x_out = cases[i][1];
        const int again = controller_step(&c, &in, &out);
        if (out.block_out != kept.block_out) printf("the output changed: ");
        printf("%%d %%d %%d %%s\\n", fine, failure, again, controller_message(failure));
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A controller with :class:`Faulty`, and a program that makes each failure happen."""
    folder = tmp_path_factory.mktemp("faulty")
    graph = runtime.Graph("faulty", dt=0.01, until=0.1).add("block", Faulty())
    for name, value in (("kind", 15.0), ("x", 2.0)):  # the case with the largest local arrays
        graph = graph.add(name, blocks.Sine(amplitude=0.0, offset=value))
        graph = graph.connect(f"{name}.out", f"block.{name}")
    graph = graph.add("reader", blocks.Gain(gain=2.0)).connect("block.out", "reader.input")
    export(graph, folder, blocks=["block"])
    rows = [f"{{{k}, {b if a is None else a}, {b}}}" for k, a, b, _ in CASES]
    (folder / "main.c").write_text(MAIN % (", ".join(rows), len(rows)))
    return folder


def outcomes(folder: Path, compiler: str, *flags: str) -> list[str]:
    """What the program prints: a line for each case."""
    program = folder / "faulty"
    command = [compiler, *STRICT, *flags, "controller.c", "main.c", "-lm", "-o", str(program)]
    made = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if "sanitize" in " ".join(flags) and "cannot find" in made.stderr:
        return []
    assert made.returncode == 0 and not made.stderr, made.stderr
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stdout + done.stderr
    return done.stdout.splitlines()


@needs_compiler
@pytest.mark.parametrize(
    "builds", [QUICK, pytest.param(BUILDS, marks=pytest.mark.slow)], ids=["few", "all"]
)
def test_each_failure_has_the_same_number_under_each_compiler_and_level(
    builds: list[tuple[str, ...]], faulty: Path
) -> None:
    found = {build: outcomes(faulty, *build) for build in builds}
    lines = found[builds[0]]
    assert len(lines) == len(CASES)
    for line, (kind, _, _, said) in zip(lines, CASES, strict=True):
        fine, failure, again, message = line.split(" ", 3)
        assert fine == "0" and int(failure) > 0 and again == failure, (kind, line)
        assert said in message, (kind, line)
    for build, others in found.items():
        assert others in (lines, []), build


@needs_compiler
def test_there_is_no_jump_and_no_function_but_those_of_math(faulty: Path) -> None:
    for name in ("controller.c", "controller.h"):
        text = (faulty / name).read_text()
        included = {line for line in text.splitlines() if line.startswith("#include <")}
        assert "jmp" not in text
        assert included <= {f"#include <{n}.h>" for n in ("math", "stdbool", "stddef", "stdint")}
