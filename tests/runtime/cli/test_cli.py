"""The command line through the real console script."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import runtime
from tests.conftest import Run

SMALL = """
graph: small
run: {dt: 0.01, until: 1.0, seed: 3}
blocks:
  go: {type: Constant, value: [1.0, 0.5], signal: Twist}
  limit: {type: Saturator, omega_max: 0.25}
  plant: {type: DifferentialDrive}
  noise: {type: PoseNoise}
wires:
  limit: {command: go.value}
  plant: {command: limit.limited}
  noise: {pose: plant.pose}
probes:
  pose: plant.pose
  seen: noise.measured
plots:
  way: {kind: trajectory, of: [pose, seen]}
metrics:
  turned: {kind: final, of: plant.pose.theta}
"""


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def test_run_writes_a_folder_with_everything(cli: Run, small: Path, tmp_path: Path) -> None:
    done = cli("run", "small.yaml")
    assert done.returncode == 0, done.stderr
    assert re.search(r"turned +0\.2475", done.stdout)
    folder = (tmp_path / "runs" / "small" / "latest").resolve()
    names = {path.name for path in folder.iterdir()}
    assert names == {
        *("manifest.json", "graph.yaml", "graph.resolved.yaml"),
        *("probes.npz", "states.npz", "metrics.json", "diagram.json", "plots"),
    }
    assert (folder / "graph.yaml").read_text() == SMALL
    assert (folder / "plots" / "way.png").read_bytes().startswith(b"\x89PNG")
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "complete"
    assert manifest["seed"] == 3
    assert manifest["ticks"] == 100
    assert manifest["argv"][1:] == ["run", "small.yaml"]
    assert set(manifest["versions"]) >= {"python", "numpy", "spikeblocks"}


def test_json_prints_one_object_and_nothing_else(cli: Run, small: Path, tmp_path: Path) -> None:
    done = cli("run", "small.yaml", "--json", "--seed", "5", "--until", "0.5")
    assert done.returncode == 0
    assert done.stderr == ""
    summary = json.loads(done.stdout)
    assert summary["schema_version"] == 1
    assert summary["status"] == "complete"
    assert summary["ticks"] == 50
    assert summary["seed"] == 5
    assert summary["metrics"]["turned"] == pytest.approx(0.49 * 0.25)
    assert summary["wall_s"] > 0.0
    # The first tick, and the time before it, are measured separately from the others.
    running = summary["wall_s"] - summary["ready_s"]
    assert summary["us_per_tick"] == pytest.approx(1e6 * running / 49)
    assert (tmp_path / summary["run"] / "probes.npz").is_file()


@pytest.mark.parametrize(("until", "value", "code"), [("0.01", 1.0, 0), ("1", 0.0, 3)])
def test_a_run_without_a_second_tick_has_no_time_per_tick(
    cli: Run, tmp_path: Path, until: str, value: float, code: int
) -> None:
    graph = {
        "run": {"dt": 0.01, "until": 1.0},
        "blocks": {
            "x": {"type": "Constant", "value": value},
            "f": {"type": "Function", "expression": "1 / u"},
        },
        "wires": {"f": {"u": "x.value"}},
        "probes": {"y": "f.out"},
    }
    (tmp_path / "g.yaml").write_text(json.dumps(graph), encoding="utf-8")
    done = cli("run", "g.yaml", "--until", until, "--profile", "--no-plots")
    assert done.returncode == code, done.stderr
    assert "s a tick" not in done.stdout
    assert "us/tick" not in done.stdout
    manifest = json.loads(next(tmp_path.glob("runs/*/2*/manifest.json")).read_text("utf-8"))
    assert manifest["us_per_tick"] is None
    assert cli("report", "runs/graph/latest").returncode == 0


def test_changes_apply_in_the_order_written(cli: Run, small: Path) -> None:
    done = cli(
        *("run", "small.yaml", "--json", "--no-plots", "--bypass", "limit"),
        *("--set", "go.value=[1, 1]", "--set", "blocks.go.value=[1, 2]", "--without", "noise"),
    )
    summary = json.loads(done.stdout)
    assert summary["metrics"]["turned"] == pytest.approx(0.99 * 2.0)
    assert any("noise" in note for note in summary["notes"])


def test_wire_moves_an_input(cli: Run, small: Path) -> None:
    done = cli("run", "--no-plots", "small.yaml", "--json", "--wire", "plant.command=go.value")
    assert json.loads(done.stdout)["metrics"]["turned"] == pytest.approx(0.99 * 0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nosuch.yaml"], "no such graph"),
        (["run", "smal.yaml"], "did you mean 'small.yaml'?"),
        (["run"], "the following arguments are required: graph"),
        (["rum", "small.yaml"], "invalid choice"),
        (["run", "small.yaml", "--set", "limit"], "expected PATH=VALUE"),
        (["run", "small.yaml", "--set", "limt.omega_max=1"], "did you mean 'limit'?"),
        (["run", "small.yaml", "--set", "limit.omega_max=-1"], "expected a number above 0 rad/s"),
        (["run", "small.yaml", "--without", "plnt"], "did you mean 'plant'?"),
        (["run", "small.yaml", "--without", "go"], "input 'limit.command' (Twist)"),
        (["run", "small.yaml", "--bypass", "plant"], "has no pass-through"),
        (["run", "small.yaml", "--seed", "x"], "expected an integer, got 'x'"),
        (["run", "small.yaml", "--seed", "-1"], "run.seed: expected a non-negative integer"),
        (["run", "small.yaml", "--until", "0"], "run.until: expected a number of seconds above 0"),
        (["draw", "small.yaml", "-o", "x.bmp"], "svg, png, pdf, tikz, dot, mermaid"),
        (["blocks", "Saturater"], "did you mean 'Saturator'?"),
    ],
)
def test_errors_end_with_2_and_no_traceback(
    cli: Run, small: Path, tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = cli(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not (tmp_path / "runs").exists()


def test_validate_shows_the_problems_of_all_graphs(cli: Run, small: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text(SMALL.replace("omega_max", "omega_mx").replace("go.value}", "go.valu}"))
    done = cli("validate", "small.yaml", "bad.yaml")
    assert done.returncode == 2
    assert "small.yaml: fine" in done.stdout
    assert "bad.yaml:6:28: blocks.limit.omega_mx: unknown parameter, did you mean" in done.stderr
    assert "bad.yaml:10:20: wires.limit.command: 'go' has no output 'valu'" in done.stderr
    report = json.loads(cli("validate", "small.yaml", "bad.yaml", "--json").stdout)
    assert report["problems"]["small.yaml"] == []
    assert len(report["problems"]["bad.yaml"]) == 2


def test_shipped_graphs_are_found_by_name_from_any_folder(cli: Run) -> None:
    done = cli("validate", "line_actuator_failure", "sine_estimation_error_robust")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("form", ["svg", "png", "dot", "mermaid"])
def test_draw_writes_each_format(cli: Run, small: Path, tmp_path: Path, form: str) -> None:
    done = cli("draw", "small.yaml", "--format", form)
    assert done.returncode == 0, done.stderr
    content = (tmp_path / done.stdout.strip()).read_bytes()
    start = {"svg": b"<", "png": b"\x89PNG", "dot": b"digraph", "mermaid": b"---"}[form]
    assert content.startswith(start)


def test_explain_prints_order_and_function(cli: Run, small: Path) -> None:
    done = cli("explain", "small.yaml")
    assert done.returncode == 0
    assert re.search(r"limit +100 Hz +limited: Twist, saturated: Scalar from command", done.stdout)
    assert "def run(" not in done.stdout
    assert "def run(" in cli("explain", "small.yaml", "--code").stdout
    facts = json.loads(cli("explain", "small.yaml", "--json").stdout)
    assert facts["order"][0]["block"] == "go"


def test_blocks_lists_and_describes(cli: Run) -> None:
    assert "Saturator" in cli("blocks").stdout
    shown = cli("blocks", "Saturator").stdout
    assert "above 0 rad/s" in shown
    assert "bypass wires command straight to limited" in shown


def test_version_and_help(cli: Run) -> None:
    assert cli("--version").stdout.startswith("spikeblocks ")
    done = cli()
    assert done.returncode == 2
    assert "run" in done.stdout


def test_an_expectation_that_fails_ends_with_1(cli: Run, small: Path) -> None:
    done = cli("run", "small.yaml", "--no-plots", "--set", "metrics.turned.below=0.1")
    assert done.returncode == 1
    assert "metric 'turned': expected below 0.1, got 0.2" in done.stderr


FAILING = """
import blocks

class Failing(blocks.Block):
    \"\"\"Fails at half a second.\"\"\"
    x = blocks.Input(blocks.Pose)
    out = blocks.Output(blocks.Scalar)
    how: str = blocks.param("raise", doc="raise or nan")

    def output(self, state, t, x):
        if t < 0.5:
            return 1.0
        if self.how == "raise":
            raise RuntimeError("it broke")
        return float(self.how)
"""


@pytest.mark.parametrize(
    ("how", "message"),
    [
        (
            "raise",
            r"block 'bad' at tick 50 \(t = 0\.5 s\): RuntimeError: it broke \(.*own\.py:14\)",
        ),
        ("nan", r"block 'bad' at tick 50 \(t = 0\.5 s\): output 'out' is not finite: nan"),
        ("inf", r"block 'bad' at tick 50 \(t = 0\.5 s\): output 'out' is not finite: inf"),
    ],
)
def test_a_failure_keeps_what_was_recorded(
    cli: Run, small: Path, tmp_path: Path, how: str, message: str
) -> None:
    (tmp_path / "own.py").write_text(FAILING)
    entry = f"{{type: Failing, module: {tmp_path / 'own.py'}, how: {how}}}"
    changes = ("--set", f"blocks.bad={entry}", "--wire", "bad.x=plant.pose")
    done = cli("run", "small.yaml", *changes, "--vs", "without=bad")
    assert done.returncode == 3
    assert "the run with without=bad was left out, since this one failed" in done.stderr
    assert re.search(message, done.stderr)
    assert "Traceback" not in done.stderr
    result = runtime.open(tmp_path / "runs" / "small" / "latest")
    assert result.status == "failed"
    assert result["plant.pose"].shape == (50, 3)
    assert np.isfinite(result["plant.pose"]).all()
    assert "at tick 50" in result.manifest["error"]


INTERRUPTING = """
import os, signal, blocks

class Interrupting(blocks.Block):
    \"\"\"Presses Ctrl-C at half a second.\"\"\"
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t):
        if abs(t - 0.5) < 1e-9:
            os.kill(os.getpid(), signal.SIGINT)
        return 0.0
"""


def test_ctrl_c_keeps_what_was_recorded(cli: Run, small: Path, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(INTERRUPTING)
    entry = f"{{type: Interrupting, module: {tmp_path / 'own.py'}}}"
    done = cli("run", "--no-plots", "small.yaml", "--set", f"blocks.key={entry}", "--json")
    assert done.returncode == 130
    summary = json.loads(done.stdout)
    assert summary["status"] == "interrupted"
    result = runtime.open(tmp_path / summary["run"])
    assert 50 <= len(result["plant.pose"]) <= 51
    whole = runtime.load(small).run()
    rows = len(result["plant.pose"])
    assert np.array_equal(result["plant.pose"], whole["plant.pose"][:rows])


LAST = """
import os, sys, blocks

class Half(blocks.Block):
    \"\"\"Half of the input.\"\"\"
    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t, x):
        return 0.5 * x

class Last:
    def __del__(self, kill=os.kill, pid=os.getpid()):
        kill(pid, 2)

sys.last = Last()  # presses Ctrl-C while Python takes its modules down
"""


def test_ctrl_c_after_the_work_changes_no_exit_code(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(LAST)
    done = cli("check", "own.py", env=dict(os.environ))  # a new interpreter
    assert done.returncode == 0, done.stderr
    assert "Half: fine" in done.stdout


@pytest.mark.slow
def test_a_bar_with_time_left_on_a_terminal_only(terminal: Callable[..., bytes]) -> None:
    seen = terminal("run", "line_actuator_failure", "--no-plots", "--until", "3")
    assert b"s left" in seen
    assert "█".encode() in seen


def test_no_bar_without_a_terminal(cli: Run, small: Path) -> None:
    assert "left" not in cli("run", "small.yaml", "--no-plots").stderr


def test_a_closed_pipe_is_no_error(script: Path) -> None:
    command = f"{script} explain line_actuator_failure | head -1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith("line_actuator_failure")
    assert done.stderr == ""


def test_import_and_help_stay_light() -> None:
    heavy = ("matplotlib", "scipy", "networkx", "numpy", "yaml", "numba")
    code = (
        "import sys, runtime, runtime.cli\n"
        "runtime.cli.make_parser()  # imports the modules of all verbs\n"
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    # Spiking neurons take expm1 and log1p from one extension module of SciPy, without the package.
    code = (
        "import sys, runtime\n"
        "runtime.load('line_actuator_failure').run(until=0.01)\n"
        "print([m for m in ('matplotlib', 'scipy') if m in sys.modules])"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "closed",
    [
        "<&- >&- 2>&-",
        *(pytest.param(closed, marks=pytest.mark.slow) for closed in ("<&-", ">&-", "2>&-")),
    ],
)
@pytest.mark.slow
def test_closed_streams_lose_nothing(script: Path, tmp_path: Path, closed: str) -> None:
    for _ in range(2):  # the second names what the first would have left behind
        command = f"'{script}' run line_actuator_failure --until 0.05 --no-plots {closed}"
        assert subprocess.run(command, shell=True, cwd=tmp_path, check=False).returncode == 0
    inside = sorted(path.name for path in (tmp_path / "runs" / "line_actuator_failure").iterdir())
    assert len(inside) == 3 and inside[-1] == "latest"
