"""``runtime validate`` says what the language service says, in any kind of file."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from runtime.language import Model, Surroundings, diagnose
from tests.conftest import Run
from tests.runtime.language.texts import GRAPHS

CHANGES = {
    "wall_following.yaml": ("q: [10", "Q: [10"),
    "parts/adaptive_snn.yaml": ("v: snn_v.output", "v: snn_v.outptu"),
    "worlds/paper_room.yaml": ("[0.3, -1.5, 0.5]", "[0.3, -1.5, -0.5]"),
    "conditions/lag.yaml": ("tau: 0.1", "tua: 0.1"),
    "experiments/walls.yaml": ("lqr.q: [113.8", "lqr.qq: [113.8"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_shipped_file_is_fine(cli: Run, name: str) -> None:
    done = cli("validate", name)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{name}: fine (")


@pytest.mark.parametrize("name", CHANGES)
def test_messages_and_ranges_are_those_of_the_language_service(
    cli: Run, tmp_path: Path, name: str
) -> None:
    old, new = CHANGES[name]
    text = (GRAPHS / name).read_text(encoding="utf-8")
    for folder in ("parts", "worlds", "conditions", "rules"):
        (tmp_path / folder).symlink_to(GRAPHS / folder)
    path = tmp_path / Path(name).name
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    done = cli("validate", str(path), "--json")
    assert done.returncode == 2
    report = json.loads(done.stdout)
    model = Model(path.read_text(encoding="utf-8"), path, Surroundings(modules=True))
    assert report["problems"][str(path)] == [str(problem) for problem in model.problems]
    expected = [
        [each.message, *(list(_line_column(model, offset)) for offset in each.span)]
        for each in diagnose(model)
    ]
    shown = [[d["message"], d["start"], d["end"]] for d in report["diagnostics"][str(path)]]
    assert shown == expected != []


def _line_column(model: Model, offset: int) -> tuple[int, int]:
    before = model.text.source[:offset]
    return before.count("\n") + 1, offset - before.rfind("\n")


def test_options_change_a_graph_and_the_baseline_of_an_experiment(cli: Run) -> None:
    for name in ("line_actuator_failure", "experiments/line.yaml"):
        assert cli("validate", name, "--set", "lqr.q=[1, 1, 1]").returncode == 0
        done = cli("validate", name, "--set", "lqr.q=[1]")
        assert done.returncode == 2
        assert done.stderr.startswith("--set lqr.q=[1]: blocks.lqr.q: expected an array of 3")


def test_a_world_takes_no_options_of_graphs(cli: Run) -> None:
    done = cli("validate", "worlds/l_room.yaml", "--seed", "3")
    assert done.returncode == 2
    assert "a world has no blocks" in done.stderr


SINGULAR = """\
graph: singular
run: {dt: 0.001, until: 0.01}
blocks:
  x: {type: Sine}
  a: {type: Ensemble, neurons: 30, intercepts: "uniform(0.5, 0.6)"}
  out:
    type: Decoder
    solver: {type: l2, reg: REG}
    eval_points: [[AT], [0.9]]
wires:
  a: {input: x.out}
  out: {spikes: a.spikes}
"""


@pytest.mark.parametrize(
    ("reg", "at", "said"),
    [
        ("0", "0.4", "the system is singular: .* neurons are silent at all points"),
        ("0.1", "0.4", ""),
        ("0.1", "0.9", ""),
    ],
)
def test_weights_that_cannot_be_solved_are_found_without_a_run(
    cli: Run, tmp_path: Path, reg: str, at: str, said: str
) -> None:
    path = tmp_path / "singular.yaml"
    text = SINGULAR.replace("REG", reg).replace("AT", at)
    path.write_text(text.replace("uniform(0.5, 0.6)", "uniform(0.5, 0.95)"), encoding="utf-8")
    done = cli("validate", str(path))
    assert done.returncode == (2 if said else 0)
    assert re.search(f"singular.yaml:8:13: blocks.out.solver: {said}", done.stderr) or not said


def test_neurons_that_are_silent_at_all_points_are_found_without_a_run(
    cli: Run, tmp_path: Path
) -> None:
    path = tmp_path / "silent.yaml"
    text = SINGULAR.replace("REG", "0.1").replace("AT", "0.1").replace("[0.9]", "[0.2]")
    path.write_text(text, encoding="utf-8")
    done = cli("validate", str(path))
    assert done.returncode == 2
    assert "silent.yaml:8:13: blocks.out.solver: no neuron fires at any" in done.stderr
    assert cli("run", "--no-plots", str(path)).returncode == 3
