"""Exported C compiles everywhere without a warning and does what the graph does."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import blocks
import runtime
from blocks import Block, Input, Output, Scalar, State
from runtime import toolchain
from runtime.errors import UsageError
from runtime.export import export
from runtime.export.recording import thinned, usual_ticks
from runtime.export.report import cortex_sizes
from runtime.export.selection import select
from runtime.runs import read_run
from runtime.toolchain import TranslationUnit, build
from tests.conftest import Run

CONTROLLER = ("line_actuator_failure", "--except", "plant,fault")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off")
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")
CORTEX = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
BOARD = Path(__file__).parent / "cortex_m4"
EMULATOR = ("qemu-system-arm", "-M", "mps2-an386", "-nographic")
LATE = "    if (c->tick == 2499) c->block__weights[0] += 1.0"
SEMIHOSTING = ("-semihosting-config", "enable=on,target=native", "-kernel")

needs_compiler = pytest.mark.skipif(
    not toolchain.available(), reason=f"no C compiler: {toolchain.install_command()}"
)


@pytest.fixture(scope="module")
def case_a(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Case A but the robot, with two ensembles that learn."""
    folder = tmp_path_factory.mktemp("case_a")
    graph = runtime.load("line_actuator_failure")
    export(graph, folder, others=["plant", "fault"], ticks=500)
    return folder


@pytest.fixture(scope="module")
def case_a_float(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same in float."""
    folder = tmp_path_factory.mktemp("case_a_float")
    graph = runtime.load("line_actuator_failure")
    export(graph, folder, others=["plant", "fault"], ticks=500, float32=True, tolerance=0.2)
    return folder


def replayed(folder: Path, *flags: str) -> str:
    """Compile the generated test natively and run it; its output."""
    files = ("controller.c", "controller_test.c")
    compiler = toolchain.find_compiler().command
    made = subprocess.run(
        [*compiler, *STRICT, *flags, *files, "-lm", "-o", "replay"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if "sanitize" in "".join(flags) and "cannot find" in made.stderr:
        pytest.skip("the compiler has no sanitizers")
    assert made.returncode == 0 and made.stderr == "", made.stderr
    done = subprocess.run([folder / "replay"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_compiler
@pytest.mark.parametrize(
    ("kind", "flags"),
    [
        ("case_a", ("-O1", *SANITIZE)),
        ("case_a_float", ("-O2",)),
        pytest.param("case_a", ("-O2",), marks=pytest.mark.slow),
        pytest.param("case_a_float", ("-O1", *SANITIZE), marks=pytest.mark.slow),
    ],
)
def test_the_generated_test_passes(
    kind: str, flags: tuple[str, ...], request: pytest.FixtureRequest
) -> None:
    folder = request.getfixturevalue(kind)
    assert "500 ticks" in replayed(folder, *flags)


@needs_compiler
def test_float_is_float_throughout(case_a_float: Path) -> None:
    source = (case_a_float / "controller.c").read_text()
    assert "double" not in source.split("/*", 1)[1].split("*/", 1)[1]
    compiler = toolchain.find_compiler().command
    flags = (*STRICT, "-Wdouble-promotion", "-O2", "-c", "-o", "/dev/null")
    subprocess.run([*compiler, *flags, "controller.c"], cwd=case_a_float, check=True)
    told = (case_a_float / "controller_test.c").read_text()
    assert "of its range, by float instead of double" in told
    assert "TOLERANCE 0.2" in told  # what was asked for, whatever was seen


@pytest.mark.parametrize("kind", ["case_a", "case_a_float"])
def test_a_cortex_m4_does_the_same(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None or shutil.which(EMULATOR[0]) is None:
        pytest.skip("needs the packages gcc-arm-none-eabi and qemu-system-arm")
    folder = request.getfixturevalue(kind)
    sources = [BOARD / "boot.c", folder / "controller.c", folder / "controller_test.c"]
    flags = ("-std=gnu99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", *CORTEX)
    link = ("--specs=rdimon.specs", "-nostartfiles", "-T", BOARD / "memory.ld", "-lm")
    program = tmp_path / "replay.elf"
    subprocess.run([compiler, *flags, *sources, *link, "-o", program], check=True)
    done = subprocess.run(
        [*EMULATOR, *SEMIHOSTING, program], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "500 ticks" in done.stdout


ON_BOARD = """
#include <stdio.h>
#include "controller.h"
static struct controller one, other;
static unsigned char saved[CONTROLLER_SAVED], learnt[CONTROLLER_LEARNT];
static struct controller_outputs drive(struct controller *c, int tick)
{
    struct controller_inputs in = {.plant_pose = {0.001 * tick, 0.3, 0.1}};
    struct controller_outputs out = {0};
    if (controller_step(c, &in, &out)) printf("failure at %d\\n", tick);
    return out;
}
int main(void)
{
    int wrong = 0;
    controller_init(&one);
    for (int k = 0; k < 100; k++) drive(&one, k);
    if (controller_set(&one, "limit.omega_max", 0, 0.125)) wrong |= 1;
    if (drive(&one, 100).limit_limited[1] > 0.125) wrong |= 2;
    controller_save(&one, saved);
    controller_save_learnt(&one, learnt);
    controller_init(&other);
    if (controller_load(&other, saved)) wrong |= 4;
    for (int k = 101; k < 200; k++) {
        const struct controller_outputs a = drive(&one, k), b = drive(&other, k);
        for (int i = 0; i < 2; i++) wrong |= 8 * (a.limit_limited[i] != b.limit_limited[i]);
    }
    learnt[20] ^= 1;
    if (!controller_load_learnt(&other, learnt)) wrong |= 16;
    learnt[20] ^= 1;
    controller_init(&other);
    if (controller_load_learnt(&other, learnt)) wrong |= 32;
    other.learning = false;
    const double weight = other.adaptive_snn_v__weights[0];
    for (int k = 0; k < 50; k++) drive(&other, k);
    if (other.adaptive_snn_v__weights[0] != weight) wrong |= 64;
    printf("%s: %d bytes saved, %d learnt, problems %d\\n", wrong ? "WRONG" : "fine",
        CONTROLLER_SAVED, CONTROLLER_LEARNT, wrong);
    return wrong != 0;
}
"""


@pytest.mark.slow
def test_parameters_change_and_weights_are_saved_on_a_cortex_m4(
    case_a: Path, tmp_path: Path
) -> None:
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None or shutil.which(EMULATOR[0]) is None:
        pytest.skip("needs the packages gcc-arm-none-eabi and qemu-system-arm")
    (tmp_path / "main.c").write_text(ON_BOARD)
    sources = [BOARD / "boot.c", case_a / "controller.c", tmp_path / "main.c"]
    flags = ("-std=gnu99", "-O2", "-ffp-contract=off", "-Wall", "-Werror", f"-I{case_a}", *CORTEX)
    link = ("--specs=rdimon.specs", "-nostartfiles", "-T", BOARD / "memory.ld", "-lm")
    program = tmp_path / "board.elf"
    subprocess.run([compiler, *flags, *sources, *link, "-o", program], check=True)
    done = subprocess.run(
        [*EMULATOR, *SEMIHOSTING, program], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0 and done.stdout.startswith("fine"), done.stdout + done.stderr


@needs_compiler
def test_a_test_that_replays_something_else_fails(case_a: Path, tmp_path: Path) -> None:
    for name in ("controller.c", "controller.h", "controller_test.c"):
        shutil.copy(case_a / name, tmp_path)
    source = (tmp_path / "controller.c").read_text()
    (tmp_path / "controller.c").write_text(source.replace("c->tick++", "c->tick += 2"))
    with pytest.raises(AssertionError, match="WRONG"):
        replayed(tmp_path)


class Stepped:
    """An exported controller with scalar inputs and outputs, called from Python."""

    def __init__(self, folder: Path, inputs: int, outputs: int) -> None:
        header, source = (folder / f"controller.{suffix}" for suffix in "hc")
        text = source.read_text().replace('#include "controller.h"', header.read_text())
        text += (
            "int size(void);\nint size(void)\n{\n    return (int)sizeof(struct controller);\n}\n"
        )
        self.functions = build([TranslationUnit("controller", text)]).functions
        self.functions.controller_message.restype = ctypes.c_char_p
        self.memory = np.zeros(self.functions.size(), dtype=np.uint8)
        self.inputs, self.outputs = np.zeros(max(1, inputs)), np.zeros(outputs)
        self.init()

    def init(self) -> None:
        self.functions.controller_init(self._place(self.memory))

    def reset(self) -> None:
        self.functions.controller_reset(self._place(self.memory))

    def step(self, *inputs: float) -> str:
        """One step; returns the failure's text."""
        self.inputs[: len(inputs)] = inputs
        places = [self._place(a) for a in (self.memory, self.inputs, self.outputs)]
        failure = self.functions.controller_step(*places)
        return self.functions.controller_message(failure).decode() if failure else ""

    @staticmethod
    def _place(array: np.ndarray[Any, Any]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)


def chain(block: Block, every: int = 1) -> runtime.Graph:
    """A signal, a block, and what reads it."""
    graph = runtime.Graph("chain", dt=0.01, until=0.5)
    graph = graph.add("signal", blocks.Constant(value=1.0)).add("noise", blocks.UnitDelay())
    graph = graph.add("block", block, dt=0.01 * every).add("reader", blocks.Gain(gain=2.0))
    graph = graph.connect("signal.value", "noise.input").connect("noise.out", "block.input")
    return graph.connect("block.out", "reader.input")


@needs_compiler
def test_the_replay_is_of_the_whole_run(tmp_path: Path) -> None:
    """A fault of the last tick is found, which is not among the first thousand."""
    graph = chain(Total()).set("run.until", 25.0).set("blocks.noise.initial", 1.0)
    made = export(graph, tmp_path, blocks=["block"])
    assert "Replay of all 2500 ticks of the run" in made.report
    assert "2500 ticks, 900 of them compared" in replayed(tmp_path)  # 100, and each third
    source = (tmp_path / "controller.c").read_text()
    (tmp_path / "controller.c").write_text(source.replace("c->tick++", "c->tick++;\n" + LATE, 1))
    with pytest.raises(AssertionError, match="WRONG block.out"):
        replayed(tmp_path)
    first = export(graph, tmp_path, blocks=["block"], ticks=1500)
    assert "Replay of the first 1500 of 2500 ticks" in first.report


def test_the_replay_has_an_upper_limit() -> None:
    graph = chain(Total()).set("run.until", 1000.0)
    network = graph.network
    one = select(network, graph.program().plan, frozenset({"block"}))
    assert network.ticks == 100_000 and usual_ticks(one) == 50_000
    many = replace(one, inputs=one.inputs * 8)
    assert usual_ticks(many) == 25_000  # 200,000 numbers
    assert thinned(one, 50_000) == 50


@needs_compiler
def test_float_is_measured_and_its_test_can_fail(tmp_path: Path) -> None:
    """The gain gives 0.3 and then 0.1, each with the error of float32."""
    graph = chain(blocks.Gain(gain=0.1)).set("blocks.noise.initial", 3.0)
    fine = export(graph, tmp_path, blocks=["block"], float32=True)
    expected = abs(float(np.float32(0.1) * np.float32(3.0)) - 0.1 * 3.0)
    worst = max(expected, abs(float(np.float32(0.1)) - 0.1))
    assert f"difference {worst:.3g}, which is {worst / 0.2:.3g} of its range, 0.2" in fine.report
    assert "tolerance 0.001" in fine.report and "warning" not in fine.report
    assert "fine" in replayed(tmp_path)
    strict = export(graph, tmp_path, blocks=["block"], float32=True, tolerance=worst)
    assert (
        "warning: more than the tolerance, so that controller_test fails; if it is small enough"
        in strict.report
    )
    with pytest.raises(AssertionError, match="WRONG block.out"):
        replayed(tmp_path)
    with pytest.raises(UsageError, match="for --float32"):
        export(graph, tmp_path, blocks=["block"], tolerance=0.1)


@needs_compiler
def test_a_filter_is_that_of_scipy(tmp_path: Path) -> None:
    export(chain(blocks.Lowpass(tau=0.05)), tmp_path, blocks=["block"])
    made, rng = Stepped(tmp_path, 1, 1), np.random.default_rng(0)
    x, y = rng.normal(size=300), np.zeros(300)
    for k in range(300):
        assert made.step(x[k]) == ""
        y[k] = made.outputs[0]
    # Its output is its memory, which an input changes for the next step.
    share = -math.expm1(-0.01 / 0.05)
    expected = lfilter([0.0, share], [1.0, share - 1.0], x)
    np.testing.assert_allclose(y, expected, rtol=1e-12, atol=1e-12)


@needs_compiler
def test_a_slow_block_holds_its_output(tmp_path: Path) -> None:
    export(chain(blocks.Gain(gain=3.0), every=5), tmp_path, blocks=["block"])
    made = Stepped(tmp_path, 1, 1)
    seen = []
    for k in range(12):
        made.step(float(k))
        seen.append(made.outputs[0])
    assert seen == [0.0] * 5 + [15.0] * 5 + [30.0] * 2


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="needs gcc-arm-none-eabi")
def test_the_size_of_the_code_grows_with_the_blocks(tmp_path: Path) -> None:
    def size(*names: str) -> int:
        made = tmp_path / "-".join(names)
        export(chain(blocks.Lowpass(tau=0.05)), made, blocks=names)
        sizes = cortex_sizes({path.name: path.read_text() for path in made.glob("controller.[ch]")})
        assert sizes is not None and sizes["static"] == 0
        return sizes["text"]

    assert 50 < size("reader") < size("block", "reader")


class Reciprocal(Block):
    """input ─▶ [ Reciprocal ] ─▶ out: one over the input."""

    input = Input(Scalar, doc="x")
    out = Output(Scalar, doc="1 / x")

    def output(self, state: Any, t: float, input: float) -> float:
        return 1.0 / input


class Total(Block):
    """input ─▶ [ Total ] ─▶ out: the sum of all inputs before this one."""

    input = Input(Scalar, doc="x")
    out = Output(Scalar, doc="sum of x")
    weights = State(2, doc="sum of x, and of 1")

    def output(self, state: Any, t: float) -> float:
        return float(state.weights[0])

    def update(self, state: Any, t: float, input: float) -> None:
        state.weights[0] += input
        state.weights[1] += 1.0


@needs_compiler
def test_a_failure_is_reported_and_stays_until_reset(tmp_path: Path) -> None:
    graph = chain(Reciprocal()).set("blocks.noise.initial", 1.0)
    export(graph, tmp_path, blocks=["block"])
    made = Stepped(tmp_path, 1, 1)
    assert made.step(4.0) == "" and made.outputs[0] == 0.25
    assert "division by zero" in made.step(0.0)
    assert "division by zero" in made.step(4.0) and made.outputs[0] == 0.25
    made.reset()
    assert made.step(8.0) == "" and made.outputs[0] == 0.125
    assert made.step(math.nan) == "input noise.out is not finite"
    made.reset()
    assert made.step(1e-320) == "output block.out is not finite"


@needs_compiler
def test_a_reset_keeps_what_was_learnt(tmp_path: Path) -> None:
    export(chain(Total()), tmp_path, blocks=["block"])
    made = Stepped(tmp_path, 1, 1)
    for x in (1.0, 2.0, 4.0):
        made.step(x)
    assert made.outputs[0] == 3.0
    made.reset()
    made.step(0.0)
    assert made.outputs[0] == 7.0
    made.init()
    made.step(0.0)
    assert made.outputs[0] == 0.0


@needs_compiler
def test_a_recording_in_which_nothing_moves_is_named(tmp_path: Path) -> None:
    still = export(chain(blocks.Gain(gain=0.0)), tmp_path, blocks=["block"])
    assert "warning: block.out does not change in the recording" in still.report
    moving = export(chain(blocks.Gain(gain=2.0)), tmp_path, blocks=["block"])
    assert "warning" not in moving.report


@needs_compiler
@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 5])
def test_local_arrays_have_the_memory_that_they_reserve(every: int, tmp_path: Path) -> None:
    for block, port in ((blocks.DiscretePID(kd=0.1), "error"), (blocks.Delay(delay=0.1), "input")):
        graph = runtime.Graph("reserved", dt=0.01, until=0.5).add("signal", blocks.Sine())
        graph = graph.add("block", block, dt=0.01 * every).connect("signal.out", f"block.{port}")
        made = export(graph, tmp_path / port, blocks=["block"], ticks=5)
        assert "largest difference 0" in made.report


@needs_compiler
def test_weights_of_a_run_are_the_initial_ones(cli: Run, tmp_path: Path) -> None:
    ran = cli("run", "line_actuator_failure", "--until", "0.6", "--no-plots")
    assert ran.returncode == 0, ran.stderr
    folder = tmp_path / "runs" / "line_actuator_failure" / "latest"
    name = "adaptive.snn_omega.weights"
    last = read_run(folder).states[name].ravel()
    assert np.abs(last).max() > 0.0
    done = cli("export", *CONTROLLER, "out", "--initial", f"{name}={folder}", "--ticks", "50")
    assert done.returncode == 0, done.stderr
    source = (tmp_path / "out" / "controller.c").read_text()
    assert all(repr(float(value)) in source for value in last[[0, 57, 99]])
    assert f"begin as an earlier run ended: {name}" in source
    assert "50 ticks" in replayed(tmp_path / "out")


@needs_compiler
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_all_of_a_folder_and_replays(tmp_path: Path) -> None:
    folder, build = tmp_path / "controllers", tmp_path / "build"
    for name in ("one", "two"):
        made = export(runtime.load("starters/own_block"), folder, name=name, ticks=5)
        assert not made.note
    for command in (
        ("cmake", "-S", folder, "-B", build),
        ("cmake", "--build", build),
        ("cmake", "-E", "chdir", build, "ctest", "--output-on-failure", "--no-tests=error"),
    ):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed, 0 tests failed out of 2" in done.stdout


def test_a_build_that_is_there_is_kept(tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text("project(own)\n")
    made = export(runtime.load("starters/own_block"), tmp_path, ticks=5)
    assert "CMakeLists.txt" not in made.files
    assert made.note.startswith("not written: ")
    assert (tmp_path / "CMakeLists.txt").read_text() == "project(own)\n"


def test_the_command_line(cli: Run, tmp_path: Path) -> None:
    done = cli("export", *CONTROLLER, "out", "--name", "lqr", "--ticks", "20", "--json")
    assert done.returncode == 0, done.stderr
    assert '"limit.limited"' in done.stdout and '"plant.pose"' in done.stdout
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"lqr.c", "lqr.h", "lqr_test.c", "CMakeLists.txt", "report.txt"}
    assert "int lqr_step(struct lqr *c" in (tmp_path / "out" / "lqr.h").read_text()
    report = (tmp_path / "out" / "report.txt").read_text()
    assert "functions of math.h" in report and "every 1 or 10 steps" in report


REFUSED = {
    "solver": (
        ["gallery/dc_motor", "out", "--block", "motor"],
        "its continuous states are integrated together with what",
    ),
    "order": (
        ["line_actuator_failure", "out", "--except", "plant,total"],
        "is computed from its output 'adaptive.join.out' in the same tick",
    ),
    "unknown": (["line_actuator_failure", "out", "--block", "lqq"], "did you mean 'lqr'?"),
    "nothing left": (["line_actuator_failure", "out", "--block", "lqr", "--except", "lqr"], "left"),
    "no name": (["line_actuator_failure", "out", "--block", "lqr", "--name", "1 2"], "--name"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_exported_is_refused_with_the_reason(
    case: str, cli: Run, tmp_path: Path
) -> None:
    arguments, reason = REFUSED[case]
    done = cli("export", *arguments)
    assert done.returncode == 2 and reason in done.stderr
    assert "Traceback" not in done.stderr and not (tmp_path / "out").exists()


def test_without_a_compiler_the_files_are_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    made = export(chain(blocks.Gain(gain=3.0)), tmp_path / "out", blocks=["block"])
    assert "not run: there is no C compiler on this computer" in made.report
    if shutil.which("gcc"):
        monkeypatch.setenv("CC", "gcc")
        assert "fine" in replayed(tmp_path / "out")


@needs_compiler
@pytest.mark.slow
def test_the_wall_fitter_and_all_that_steers_by_it(tmp_path: Path) -> None:
    graph = runtime.load("wall_following")
    others = ["plant", "lidar", "fault", "explore"]
    export(graph, tmp_path, others=others, ticks=12_000)
    assert "12000 ticks" in replayed(tmp_path, "-O1", *SANITIZE)


def test_a_switch_that_a_run_locates_decides_on_ticks(tmp_path: Path) -> None:
    graph = runtime.load("gallery/thermostat")
    exported = export(graph, tmp_path / "c", blocks=["heater"])
    assert "Events on ticks, as with run: {events: ticks}: heater." in exported.report
    assert "heater.out: largest difference 0\n" in exported.report
