"""``runtime compare`` through the real console script."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.compare import compare, open_runs
from tests.conftest import Run

GRAPH = """
graph: nudged
run: {dt: 0.01, until: 1.0}
blocks:
  go: {type: Constant, value: [1.0, 0.5], signal: Twist}
  nudge: {type: Nudge, module: nudge.py}
  plant: {type: DifferentialDrive}
wires:
  nudge: {command: go.value}
  plant: {command: nudge.out}
probes: {pose: plant.pose, command: nudge.out, path: {of: plant.pose.x, every: 10}}
plots: {way: {kind: trajectory, of: [pose]}}
metrics: {far: {kind: path_length, of: pose}, turned: {kind: final, of: plant.pose.theta}}
"""
NUDGE = '''
import math
from blocks import Block, Input, Output, Twist, param


class Nudge(Block):
    """Change a command by one bit, from a time on."""

    command = Input(Twist)
    out = Output(Twist, through="command")
    since: float = param(1e9, unit="s", doc="from when on")

    def output(self, state, t, command):
        v, omega = command
        return (math.nextafter(v, math.inf) if t > self.since else v), omega
'''


@pytest.fixture
def runs(cli: Run, tmp_path: Path) -> list[str]:
    """The folders of a run and of the same graph with a change after 0.565 s."""
    (tmp_path / "nudge.py").write_text(NUDGE)
    (tmp_path / "nudged.yaml").write_text(GRAPH)
    graph = runtime.load(tmp_path / "nudged.yaml")
    nudged = graph.set("nudge.since", 0.565)
    for name, variant in (("a", graph), ("b", nudged)):
        variant.run().save(tmp_path / name)
    return ["a", "b"]


def test_exact_finds_where_the_smallest_difference_begins(cli: Run, runs: list[str]) -> None:
    done = cli("compare", *runs, "--exact", "--no-plots")
    assert done.returncode == 1, done.stderr
    assert done.stderr == ""
    after = repr(math.nextafter(1.0, math.inf))
    assert "first difference at tick 57 (t = 0.57 s) in probe 'command'" in done.stdout
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("  command ")]
    assert line.split()[1:6] == ["57", "0.57", "nudge.out.v", "1.0", after]
    assert line.endswith("43 of 100")
    assert "~ blocks.nudge.since" in done.stdout or "+ blocks.nudge.since" in done.stdout


def test_exact_as_json(cli: Run, runs: list[str], tmp_path: Path) -> None:
    done = cli("compare", *runs, "--exact", "--no-plots", "--json")
    assert done.returncode == 1
    found = json.loads(done.stdout)
    assert found["against"] == "as written"
    (label,) = set(found["probes"])
    probes = found["probes"][label]
    assert probes["identical"] is False
    first = probes["first"]
    assert (first["probe"], first["tick"], first["column"]) == ("command", 57, "nudge.out.v")
    assert first["values"] == [1.0, math.nextafter(1.0, math.inf)]
    a, b = (runtime.open(tmp_path / name) for name in runs)
    rows = (a["pose"] != b["pose"]).any(axis=1)
    (pose,) = [place for place in probes["differences"] if place["probe"] == "pose"]
    assert pose["tick"] == int(rows.argmax())
    assert pose["rows_differing"] == int(rows.sum())


def test_a_repeated_run_has_the_same_bits(cli: Run, runs: list[str], tmp_path: Path) -> None:
    again = json.loads(cli("run", "a/graph.resolved.yaml", "--json", "--no-plots").stdout)["run"]
    done = cli("compare", "a", again, "--exact", "--no-plots")
    assert done.returncode == 0
    assert "every bit is equal" in done.stdout
    assert "graph: no difference" in done.stdout
    manifests = ["a/manifest.json", str(Path(again).parent / "latest")]
    found = json.loads(cli("compare", *manifests, "--exact", "--no-plots", "--json").stdout)
    assert all(probes["identical"] for probes in found["probes"].values())


def test_changed_code_is_reported(runs: list[str], tmp_path: Path) -> None:
    path = tmp_path / "nudge.py"
    path.write_text(NUDGE.replace("v, omega = command", "v, omega = 2.0 * command[0], command[1]"))
    runtime.load(tmp_path / "nudged.yaml").run().save(tmp_path / "c")
    found = compare(open_runs([tmp_path / "a", tmp_path / "c"]))
    assert found.graph == []
    (item,) = [item for item in found.circumstances if item.path.startswith("modules")]
    assert (item.path, item.change) == ("modules.nudge.py", "changed")
    digests = [hashlib.sha256(text.encode()).hexdigest() for text in (NUDGE, path.read_text())]
    assert list(item.values) == [digest[:12] for digest in digests]


@pytest.mark.slow
def test_by_tolerance(cli: Run, runs: list[str], tmp_path: Path) -> None:
    done = cli("compare", *runs)
    assert done.returncode == 0
    assert "4 of 4 probes are equal within 1e-12 + 1e-09 |x|" in done.stdout
    strict = cli("compare", *runs, "--rtol", "0", "--atol", "0", "--json")
    assert strict.returncode == 0
    found = json.loads(strict.stdout)
    (probes,) = found["probes"].values()
    pose = next(p for p in probes["probes"] if p["probe"] == "pose")
    a, b = (runtime.open(tmp_path / name)["pose"] for name in runs)
    assert [column["largest"] for column in pose["columns"]] == list(np.abs(a - b).max(axis=0))
    # The chords of 99 steps along an arc of 2 m.
    assert found["metrics"]["far"]["as written"] == pytest.approx(99 * 4.0 * math.sin(0.0025))
    assert {Path(plot).name for plot in found["plots"]} == {
        *("way.png", "pose.png", "command.png", "path.png", "plant.pose.theta.png"),
    }
    latest = tmp_path / "comparisons" / "nudged" / "latest"
    assert (latest / "way.png").read_bytes().startswith(b"\x89PNG")


def test_three_runs_with_given_labels(cli: Run, runs: list[str]) -> None:
    done = cli("compare", "a", "b", "a", "--labels", "one,two,three", "--no-plots")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[lines.index("metrics") + 1].split() == ["one", "two", "three"]
    far = next(line.split() for line in lines if line.startswith("  far"))
    assert far[1:] == ["0.99", "0.99", "0.99"]
    assert "three against one: 4 of 4 probes are equal" in done.stdout


def test_an_interrupted_run_is_compared_up_to_its_end(
    cli: Run, runs: list[str], tmp_path: Path
) -> None:
    graph = (
        runtime.load(tmp_path / "nudged.yaml").without("nudge").wire("plant.command", "go.value")
    )
    graph.run(until=0.4).save(tmp_path / "c")
    done = cli("compare", "a", "c", "--exact", "--no-plots")
    assert done.returncode == 1
    assert "all bits that both recorded are equal" in done.stdout
    assert "pose: 100 rows in as written, 40 in" in done.stdout
    assert "command: not recorded by" in done.stdout


OTHER = """
graph: other
blocks: {x: {type: Constant, value: 1.0}}
probes: {x: x.value}
run: {until: 0.01}
"""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a"], "expected two or more runs, got 1"),
        (["a", "nowhere"], "there is no 'nowhere'; expected a run folder"),
        (["a", "cut"], "'cut/probes.npz' is damaged"),
        (["a", "text"], "text/graph.resolved.yaml:1:10: not valid YAML"),
        (["a", "other"], "nothing to compare: 'a' (graph nudged) and 'other' (graph other)"),
        (["a", "b", "--probes", "pse"], "no run has a probe 'pse', did you mean 'pose'?"),
        (["a", "b", "--rtol", "-1"], "expected a number of at least 0, got '-1'"),
        (["a", "b", "--out", "nudge.py"], "cannot write 'nudge.py/"),
    ],
)
def test_errors_end_with_2_and_one_line(
    cli: Run, runs: list[str], tmp_path: Path, arguments: list[str], message: str
) -> None:
    runtime.load(_written(tmp_path / "other.yaml", OTHER)).run().save(tmp_path / "other")
    for name in ("cut", "text"):
        shutil.copytree(tmp_path / "a", tmp_path / name)
    content = (tmp_path / "cut" / "probes.npz").read_bytes()
    (tmp_path / "cut" / "probes.npz").write_bytes(content[: len(content) // 2])
    (tmp_path / "text" / "graph.resolved.yaml").write_text("{graph: [")
    done = cli("compare", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    errors = [line for line in done.stderr.splitlines() if "|" not in line[:9]]
    assert len(errors) == 1
    assert done.stdout == ""


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path
