"""A graph that needs an extra that is missing: exit code 4 and the pip line before it runs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.extras import install_line

PIP_LINE = install_line("physics")


@pytest.fixture
def without_mujoco(tmp_path: Path) -> dict[str, str]:
    """An environment in which mujoco cannot be imported."""
    package = tmp_path / "hidden" / "mujoco"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('not here')", encoding="utf-8")
    return {**os.environ, "PYTHONPATH": str(package.parent)}


@pytest.mark.parametrize("verb", ["run", "validate", "explain"])
def test_only_the_pip_line_is_printed(
    cli: Run, without_mujoco: dict[str, str], verb: str, tmp_path: Path
) -> None:
    done = cli(verb, "wall_following_mujoco", env=without_mujoco)
    assert done.returncode == 4
    assert done.stdout == ""
    assert done.stderr == f"MujocoVacuum needs an optional extra: {PIP_LINE}\n"
    assert not (tmp_path / "runs").exists()


def test_faults_of_the_graph_come_first(cli: Run, without_mujoco: dict[str, str]) -> None:
    done = cli("validate", "wall_following_mujoco", "--set", "lqr.Q=[1, 1, 1]", env=without_mujoco)
    assert done.returncode == 2
    assert "did you mean 'q'?" in done.stderr
    assert "pip" not in done.stderr


def test_the_other_graphs_are_checked_as_well(cli: Run, without_mujoco: dict[str, str]) -> None:
    names = ("wall_following_mujoco", "wall_following", "wall_following_mujoco_robust")
    done = cli("validate", *names, env=without_mujoco)
    assert done.returncode == 4
    assert done.stdout.startswith("wall_following: fine")
    assert done.stderr.count(PIP_LINE) == 2


def test_other_graphs_run(cli: Run, without_mujoco: dict[str, str]) -> None:
    done = cli("run", "wall_following", "--until", "0.1", "--no-plots", env=without_mujoco)
    assert done.returncode == 0


def test_a_graphics_setting_that_does_not_load_is_named(cli: Run) -> None:
    done = cli("validate", "wall_following_mujoco", env={**os.environ, "MUJOCO_GL": "nonsense"})
    assert done.returncode == 2
    assert "mujoco does not load with MUJOCO_GL=nonsense" in done.stderr
    assert "Traceback" not in done.stderr
