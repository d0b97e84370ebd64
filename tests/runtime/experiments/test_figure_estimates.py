"""Figures show the estimates of tables; failures are marked, runs are at their own times."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from scipy import stats

from blocks.core import FloatArray
from runtime.experiments.analysis.ablation_plots import ablation_figure
from runtime.experiments.analysis.statistics import (
    estimate,
)
from runtime.experiments.analysis.study_figures import study_figures
from runtime.experiments.design import read_experiment
from runtime.experiments.execution import ablation_plan, sweep_plan
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

SEEDS = 4
NOISE = np.array([normal(seed) for seed in range(SEEDS)])
HEAD = "experiment: study\ngraph: draw.yaml\nseeds: 0..3\n"


def drawn(here: Run, folder: Path, verb: str, text: str) -> dict[str, Figure]:
    """The figures of an experiment that ran."""
    (folder / "study.yaml").write_text(HEAD + text)
    done = here(verb, "study.yaml", "--json", "--no-plots")
    assert done.returncode == 0, done.stderr
    experiment = read_experiment(str(folder / "study.yaml"))
    plan = (sweep_plan if verb == "sweep" else ablation_plan)(experiment)
    return dict(study_figures(plan, Path(folder / json.loads(done.stdout)["folder"])))


def test_an_interval_is_over_seeds_where_another_factor_is_crossed(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    text = (
        "vary: {params.gain: [1, 2], draw.level: [0, 10]}\nvariants: {same: {set: {sum.dt: 0.01}}}"
        "\nfigures: {total: {metric: total, over: params.gain}}\n"
    )
    (axes,) = drawn(here, tmp_path, "ablate", text)["total"].axes
    bars = axes.containers[0][2][0].get_segments()
    for gain, ends in zip((1.0, 2.0), bars, strict=True):
        # Of each seed the mean over both levels, not the two levels as two observations.
        per_seed = (1.0 + 0.5 * gain) * (5.0 + NOISE)
        half = stats.t.ppf(0.975, SEEDS - 1) * per_seed.std(ddof=1) / math.sqrt(SEEDS)
        wanted = [per_seed.mean() - half, per_seed.mean() + half]
        assert [y for _, y in ends] == pytest.approx(wanted)
    assert not axes.texts  # all seeds have a value: there is no 2/4


def test_dots_of_an_ablation_are_the_observations_of_its_interval(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    text = "vary: {draw.level: [0, 10]}\nvariants: {half: {bypass: half}}\n"
    drawn(here, tmp_path, "ablate", text)
    figure = ablation_figure(tmp_path / "ablations" / "study")
    dots = [line for line in figure.axes[0].lines if line.get_marker() == "."]
    assert sorted(dots[0].get_xdata()) == pytest.approx(sorted(5.0 + NOISE))
    caption = " ".join(text.get_text() for text in figure.artists if isinstance(text, Annotation))
    assert "a dot: one seed, its mean over 2 settings" in caption


def test_a_setting_in_which_every_run_failed_is_a_marked_gap(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    text = (
        "vary: {draw.how: [fine, raise], params.gain: [1, 2]}\nfigures:\n"
        "  curve: {metric: total, over: draw.how}\n"
        "  map: {metric: total, over: [draw.how, params.gain]}\n"
    )
    figures = drawn(here, tmp_path, "sweep", text)
    (axes,) = figures["curve"].axes
    means = axes.containers[0][0].get_ydata()
    assert np.isfinite(means[0]) and math.isnan(means[1])
    assert [text.get_text() for text in axes.texts] == ["failed, 0 of 4"]
    crosses = [line for line in figures["map"].axes[0].lines if line.get_marker() == "x"]
    assert [sorted(line.get_xdata()) for line in crosses] == [[1.0, 1.0]]


RAMP = """
graph: ramp
run: {dt: 0.01, until: 4.0, stop: {when: go.out, above: 1.0}}
blocks:
  draw: {type: Draw, module: own.py}
  m: {type: Function, expression: "t + 0.01 * u"}
  go: {type: Function, expression: "t / (1.5 + min(2, abs(u)))"}
wires: {m: {u: draw.out}, go: {u: draw.out}}
metrics: {last: {kind: final, of: m.out}}
"""


def test_runs_that_end_are_drawn_at_their_own_times(here: Run, draw: Path, tmp_path: Path) -> None:
    (tmp_path / "draw.yaml").write_text(RAMP)
    text = "vary: {draw.level: [0]}\nfigures: {m: {signal: m.out}}\n"
    (axes,) = drawn(here, tmp_path, "sweep", text)["m"].axes
    ends = np.sort(1.5 + np.minimum(2.0, np.abs(NOISE)))
    t, mean = (np.asarray(each, dtype=float) for each in axes.lines[0].get_data())
    assert t[-1] == pytest.approx(ends[-1], abs=0.011)
    # The mean of runs that are t + 0.01 n is never farther from t than their noise.
    assert np.abs(mean - t).max() < 0.01 * np.abs(NOISE).max() + 1e-9
    (band,) = axes.collections
    last: FloatArray = np.concatenate([path.vertices[:, 0] for path in band.get_paths()])
    assert last.max() == pytest.approx(ends[-2], abs=0.011)  # one run is left then: no band
    shares = {text.get_text() for text in axes.texts}
    assert shares and shares <= {"3/4", "2/4", "1/4"} and "1/4" in shares


def test_nan_is_no_value_and_not_never() -> None:
    found = estimate([math.nan, 1.0, None, math.inf, math.inf], failed=1)
    assert (found.n, found.mean, found.never, found.failed) == (1, 1.0, 1, 1)
