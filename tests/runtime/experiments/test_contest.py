"""``runtime contest`` and ``tune --repeats``: equal budgets, a paired table, values by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

CONTEST = """
experiment: gains
graph: draw.yaml
minimize: total
budget: 30
repeats: 2
training:
  seeds: 0..1
  conditions: {low: {}, high: {set: {draw.level: 3}}}
held_out:
  seeds: 10..12
  conditions:
    a: {set: {draw.level: 2}}
    b: {set: {draw.level: 4}}
    c: {set: {draw.level: 8}}
contestants:
  gain: {vary: {params.gain: 0.5..1.9}}
  alone: {without: half}
  fails: {set: {draw.how: raise}}
"""


@pytest.fixture
def contest(here: Run, draw: Path, tmp_path: Path) -> dict[str, Any]:
    (tmp_path / "gains.yaml").write_text(CONTEST)
    done = here("contest", "gains.yaml", "--json", "-j", "1")
    assert done.returncode == 0, done.stderr
    facts: dict[str, Any] = json.loads(done.stdout)
    return facts


def test_a_contest(contest: dict[str, Any], here: Run, tmp_path: Path) -> None:
    """total = (1 + gain / 2)(level + noise), and level + noise without half of it."""
    folder = tmp_path / "contests" / "gains"
    tunings = contest["contestants"]["gain"]
    assert [each["sampling_seed"] for each in tunings] == [0, 1]
    assert all(24 < each["runs"] <= 30 for each in tunings)  # a configuration has 4 runs
    assert contest["contestants"]["alone"][0]["values"] is None
    lines = {(line["variant"], line["reference"]): line for line in contest["table"]}
    noise = np.mean([normal(seed) for seed in (10, 11, 12)])
    levels = np.array([2.0, 4.0, 8.0]) + noise
    gain = np.mean([each["values"]["params.gain"] for each in tunings])
    own = lines["gain", None]
    assert own["mean"] == pytest.approx(float(np.mean((1.0 + gain / 2.0) * levels)))
    assert own["runs"] == 3  # conditions, not their nine runs
    apart = lines["alone", "gain"]["difference"]
    assert apart["mean"] == pytest.approx(float(np.mean(-gain / 2.0 * levels)))
    assert lines["fails", "gain"]["failed"] == 3  # conditions
    assert lines["fails", "alone"]["difference"]["verdict"] == "no"  # three conditions are few
    names = {path.name for path in (folder / "plots").iterdir()}
    assert names == {"contest.png", "contest.pdf"}
    again = here("contest", "--no-plots", "gains.yaml", "--resume", "-j", "1")
    assert "gain: total of 2 tunings from" in again.stdout and "alone - gain" in again.stdout
    # What won is carried into an ablation by its name.
    (tmp_path / "with.yaml").write_text(
        "experiment: tuned\ngraph: draw.yaml\nseeds: 0..5\n"
        "variants: {tuned: {with: 'tuning:contests/gains/gain-1'}}\n"
    )
    done = here("ablate", "with.yaml", "--json", "--no-plots", "-j", "1")
    assert done.returncode == 0, done.stderr
    table = {(x["variant"], x["metric"]): x for x in json.loads(done.stdout)["table"]}
    ratio = table["tuned", "total"]["mean"] / table["baseline", "total"]["mean"]
    assert ratio == pytest.approx((1.0 + tunings[1]["values"]["params.gain"] / 2.0) / 2.0)
    wrong = (tmp_path / "with.yaml").read_text().replace("gain-1", "gone")
    (tmp_path / "with.yaml").write_text(wrong)
    done = here("ablate", "with.yaml")
    assert done.returncode == 2 and "there is no tuning 'contests/gains/gone'" in done.stderr


def test_a_violated_constraint_is_marked(here: Run, draw: Path, tmp_path: Path) -> None:
    """Held out, total is (1 + gain / 2) (4.67 + noise) in the mean."""
    (tmp_path / "bound.yaml").write_text(
        CONTEST.replace("budget: 30\nrepeats: 2", "trials: 3\nconstraints: [total below 5]")
        .replace("low: {}, high: {set: {draw.level: 3}}", "low: {set: {draw.level: 2}}")
        .replace("  fails: {set: {draw.how: raise}}\n", "  low: {vary: {params.gain: 0..0.1}}\n")
    )
    done = here("contest", "bound.yaml", "--json", "-j", "1")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    for own in facts["contestants"].values():
        mean = own[0]["metrics"]["total"]
        assert own[0]["violated"] == (["total below 5"] if mean > 5.0 else [])
    violating = [name for name, own in facts["contestants"].items() if own[0]["violated"]]
    assert violating == ["gain"]
    again = here("contest", "--no-plots", "bound.yaml", "--resume", "-j", "1")
    assert "; not total below 5" in again.stdout
    assert "differences are between these controllers" in again.stdout
    done = here("report", "contests/gains")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "contests" / "gains" / "report.html").read_text()
    assert "; not total below 5" in page and "violate that constraint" in page


def test_repeated_tunings_tell_how_far_they_agree(here: Run, draw: Path, tmp_path: Path) -> None:
    tune = ("tune", "draw.yaml", "--vary", "draw.level=0..10", "--trials", "6", "-j", "1")
    done = here(*tune, "--held-out", "10..12", "--repeats", "3", "--sampling-seed", "4")
    assert done.returncode == 0, done.stderr
    found = []
    for seed in (4, 5, 6):
        stored = json.loads(
            (tmp_path / "tunings" / "draw" / f"draw-{seed}" / "tuning.json").read_text()
        )
        found.append(stored["table"][-1]["held_out"]["over"] if stored["front"] else None)
    assert "draw: drawn of 3 tunings from" in done.stdout
    assert len(set(found)) > 1


def test_a_contest_needs_contestants(here: Run, draw: Path) -> None:
    done = here("contest", "draw.yaml")
    assert done.returncode == 2 and "there are no contestants; write" in done.stderr
