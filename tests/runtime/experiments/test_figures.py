"""Figures show the numbers of the index."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.text import Annotation
from scipy import stats

from runtime.experiments.analysis import sweep_data
from runtime.experiments.analysis.ablation_plots import ablation_figure
from runtime.experiments.analysis.figures import MARK
from runtime.experiments.analysis.study_figures import study_figures
from runtime.experiments.analysis.sweep_data import read_sweep
from runtime.experiments.analysis.sweep_plots import sweep_figures
from runtime.experiments.design import read_experiment
from runtime.experiments.execution import sweep_plan
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

SWEEP = ("sweep", "draw.yaml", "-j", "2", "--no-plots", "--seeds", "0..2")
MEAN = sum(map(normal, range(3))) / 3


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "sweeps" / "draw"


def test_a_curve_for_one_factor(here: Run, draw: Path, folder: Path) -> None:
    assert here(*SWEEP, "--vary", "draw.level=log(0.1..10):3").returncode == 0
    [(name, figure)] = sweep_figures(folder)
    assert name == "curves"
    drawn, total = figure.axes[:2]
    assert [axes.get_title("left") for axes in (drawn, total)] == ["drawn", "total"]
    assert drawn.get_xscale() == "log"
    x, y = drawn.lines[0].get_data()
    assert np.allclose(x, [0.1, 1.0, 10.0])
    assert np.allclose(y, np.add(x, MEAN))
    assert np.allclose(total.lines[0].get_ydata(), 2.0 * np.add(x, MEAN))
    bars = drawn.containers[0][2][0].get_segments()
    assert np.allclose(np.diff(bars, axis=1)[:, 0, 1], np.diff(bars, axis=1)[0, 0, 1])


def test_a_heat_map_for_two(here: Run, draw: Path, folder: Path) -> None:
    factors = ("--vary", "draw.level=[3, 1]", "--vary", "params.gain=0..4:3")
    assert here(*SWEEP, *factors).returncode == 0
    [(name, figure)] = sweep_figures(folder)
    assert name == "maps"
    [total] = [axes for axes in figure.axes if axes.get_title("left") == "total"]
    image = np.asarray(total.images[0].get_array())
    levels, gains = np.array([1.0, 3.0]), np.array([0.0, 2.0, 4.0])
    assert np.allclose(image, (levels + MEAN) * (1.0 + 0.5 * gains[:, None]))
    assert [text.get_text() for text in total.get_xticklabels()] == ["1", "3"]
    assert [text.get_text() for text in total.get_yticklabels()] == ["0", "2", "4"]


def shares(levels: list[float]) -> list[int]:
    """How many of the seeds have a value of ``above_two``, for each level."""
    return [sum(level + normal(seed) > 2.0 for seed in range(3)) for level in levels]


def test_means_over_some_of_the_seeds_are_marked(here: Run, draw: Path, folder: Path) -> None:
    levels = [-50.0, 2.5, 3.5, 50.0]
    assert shares(levels) == [0, 1, 2, 3]
    factors = ("--vary", f"draw.level={levels}", "--vary", "params.gain=[1, 2]")
    assert here(*SWEEP, *factors).returncode == 0
    [(_, figure)] = sweep_figures(folder)
    facts = [each.get_text() for each in figure.artists if isinstance(each, Annotation)]
    assert "n/N or red" in facts[0]
    panels = {axes.get_title("left"): axes for axes in figure.axes}
    written = [text.get_text() for text in panels["above_two [s]"].texts]
    assert [text for text in written if "\n" in text] == ["0\n1/3", "0\n2/3"] * 2
    assert written.count("0/3") == 2
    assert not any("\n" in text.get_text() for text in panels["drawn"].texts)
    assert read_sweep(folder).is_partial("above_two").sum() == 4


@pytest.mark.slow
def test_means_over_some_of_the_seeds_are_marked_where_numbers_have_no_room(
    here: Run, draw: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.experiments.analysis.sweep_plots.FEW_CELLS", 0)
    monkeypatch.setattr("runtime.experiments.analysis.sweep_plots.CROWD", 0)
    levels = [-50.0, 2.5, 3.5, 50.0]
    factors = ("--vary", f"draw.level={levels}", "--vary", "params.gain=[1, 2]")
    more = ("--vary", "draw.count=[0]")
    for name, chosen in (("one", factors[:2]), ("two", factors), ("three", (*factors, *more))):
        assert here(*SWEEP, *chosen, "--name", name).returncode == 0
        figures = dict(sweep_figures(folder.with_name(name)))
        figure = figures.get("parallel_above_two") or next(iter(figures.values()))
        titles = {axes.get_title("left"): axes for axes in figure.axes}
        axes = titles.get("above_two [s]", figure.axes[0])
        marks = [line for line in axes.lines if line.get_color() == MARK]
        assert sum(len(line.get_xdata()) for line in marks) == (2 if name == "one" else 4)


def test_samples_with_some_of_the_seeds_are_marked(here: Run, draw: Path, folder: Path) -> None:
    factors = ("--vary", "draw.level=0..4", "--vary", "params.gain=1..2", "--sobol", "16")
    assert here(*SWEEP, *factors).returncode == 0
    [(_, figure)] = sweep_figures(folder)
    [axes] = [axes for axes in figure.axes if axes.get_title("left") == "above_two [s]"]
    data = read_sweep(folder)
    some = data.is_partial("above_two")
    assert some.any()
    red = [tuple(colour) == to_rgba(MARK) for colour in axes.collections[1].get_edgecolor()]
    known = np.isfinite(data.means("above_two"))
    assert red == some[known].tolist()


def test_parallel_coordinates_beyond(here: Run, draw: Path, folder: Path) -> None:
    factors = ("--vary", "draw.level=0..1", "--vary", "params.gain=1..2", "--sobol", "16")
    assert here(*SWEEP, *factors, "--vary", "draw.how=[fine, raise]").returncode == 0
    figures = dict(sweep_figures(folder))
    assert set(figures) == {"parallel_drawn", "parallel_total"}
    axes = figures["parallel_total"].axes[0]
    _, lost, lines = (item for item in axes.collections if isinstance(item, LineCollection))
    data = read_sweep(folder)
    known = np.isfinite(data.means("total"))
    assert len(lines.get_segments()) == known.sum()
    assert len(lost.get_segments()) == (~known).sum() > 0
    # The smallest is drawn last, on top of all others.
    assert lines.get_segments()[-1][-1][1] == 0.0
    assert lines.get_segments()[0][-1][1] == 1.0


def test_names_have_positions_on_the_axis(here: Run, draw: Path, folder: Path) -> None:
    assert here(*SWEEP, "--vary", "without=[[], [half], [sum]]").returncode == 0
    [(_, figure)] = sweep_figures(folder)
    labels = [text.get_text() for text in figure.axes[1].get_xticklabels()]
    assert labels == ["[]", "[half]", "[sum]"]


def test_more_configurations_than_a_page_shows(
    here: Run, draw: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_data, "MOST", 4)
    assert here(*SWEEP, "--vary", "draw.level=0..9:10").returncode == 0
    data = read_sweep(folder)
    assert data.axes[0].positions.tolist() == [0.0, 4.0, 8.0]
    assert data.skipped == 7


def test_an_ablation(here: Run, draw: Path, tmp_path: Path) -> None:
    variants = ("--bypass", "half", "--without", "sum", "--seeds", "0..4", "-j", "2")
    assert here("ablate", "draw.yaml", *variants, "--no-plots").returncode == 0
    figure = ablation_figure(tmp_path / "ablations" / "draw")
    drawn, total = figure.axes[:2]
    assert [text.get_text() for text in drawn.get_yticklabels()] == [
        *("baseline", "bypass half", "without sum")
    ]
    outs = np.array([1.0 + normal(seed) for seed in range(5)])
    dots = [line for line in total.lines if line.get_marker() == "."]
    assert np.allclose(sorted(dots[0].get_xdata()), sorted(2.0 * outs))
    assert np.allclose(sorted(dots[1].get_xdata()), sorted(3.0 * outs))
    means = [each[0] for each in total.containers]
    assert [mean.get_xdata()[0] for mean in means] == pytest.approx(
        [2.0 * outs.mean(), 3.0 * outs.mean()]
    )
    assert [text.get_text() for text in total.texts] == ["removed"]
    # Equal to the baseline on every seed: hollow.
    hollow = drawn.containers[1][0]
    assert to_hex(hollow.get_markerfacecolor()) == "#ffffff"


STUDY = """
experiment: study
graph: draw.yaml
seeds: 0..3
vary: {draw.level: [1, 2, 4], params.gain: [1, 2]}
variants: {no half: {without: half}}
figures:
  total:
    {metric: total, over: draw.level, at: {params.gain: 2}, log: xy, labels: {baseline: both}}
  mean: {metric: drawn, over: draw.level, style: screen, y: "drawn"}
  plane: {metric: total, over: [draw.level, params.gain], contours: 2}
  out: {signal: sum.out, at: {draw.level: 4}}
"""


def test_the_figures_of_a_paper(here: Run, draw: Path, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    done = here("sweep", "study.yaml", "--json")
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "sweeps" / "study"
    names = {path.name for path in (folder / "plots").iterdir()}
    shown = ("total", "mean", "plane", "out")
    assert names == {"maps.png"} | {f"{n}.{kind}" for n in shown for kind in ("pdf", "png")}
    plan = sweep_plan(read_experiment(str(tmp_path / "study.yaml")))
    figures = dict(study_figures(plan, folder))
    noise = np.array([normal(seed) for seed in range(4)])
    (axes,) = figures["total"].axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    lines = {each.get_label(): each[0] for each in axes.containers}
    # total = (1 + gain / 2)(level + noise), and level + noise without half of it.
    for name, factor in (("both", 2.0), ("no half", 1.0)):
        x, y = lines[name].get_data()
        assert list(x) == [1.0, 2.0, 4.0]
        assert y == pytest.approx([factor * (level + noise.mean()) for level in x])
    assert figures["total"].get_size_inches()[0] == 3.5
    # Without 'at', a metric is the mean over the other factor, which the draw does not depend on.
    averaged = figures["mean"].axes[0].containers[0][0].get_ydata()
    assert averaged == pytest.approx(np.array([1, 2, 4]) + noise.mean())
    (axes,) = figures["out"].axes
    curves = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert curves["baseline"] == pytest.approx(1.5 * (4.0 + noise.mean()))  # the first gain: 1
    assert curves["no half"] == pytest.approx(4.0 + noise.mean())
    (band, _) = axes.collections
    half = stats.t.ppf(0.975, 3) * 1.5 * noise.std(ddof=1) / 2.0
    ends = band.get_paths()[0].vertices[:, 1]
    middle = 1.5 * (4.0 + noise.mean())
    assert (ends.min(), ends.max()) == pytest.approx((middle - half, middle + half))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{over: draw.level}", "expected a metric or a signal, as in"),
        ("{metric: totl, over: draw.level}", "the graph has no metric 'totl', did you mean"),
        ("{metric: total, over: draw.levl}", "there is no factor 'draw.levl', did you mean"),
        ("{metric: total}", "over: expected one factor, or two for a map"),
        ("{signal: sum.ot}", "figures.f.signal: 'sum' has no output or state 'ot', did you mean"),
        ("{metric: total, over: draw.level, log: z}", "log: expected x, y, xy, got the string 'z'"),
    ],
)
def test_a_figure_that_is_wrong(
    here: Run, draw: Path, tmp_path: Path, entry: str, message: str
) -> None:
    (tmp_path / "e.yaml").write_text(
        f"experiment: e\ngraph: draw.yaml\nvary: {{draw.level: [1, 2]}}\nfigures:\n  f: {entry}\n"
    )
    done = here("sweep", "e.yaml")
    assert done.returncode == 2 and message in done.stderr, done.stderr


def test_figures_of_experiments_fit_a_column_of_paper(here: Run, draw: Path, folder: Path) -> None:
    factors = ("--vary", "draw.level=[0, 1]", "--style", "paper", "--figures", "pdf")
    with_plots = (word for word in SWEEP if word != "--no-plots")
    assert here(*with_plots, *factors).returncode == 0
    (written,) = (folder / "plots").iterdir()
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", written.read_bytes())
    assert written.suffix == ".pdf" and box is not None
    assert float(box[1]) == pytest.approx(3.5 * 72.0)
    [(_, paper)] = sweep_figures(folder, "paper")
    assert paper.get_suptitle() == ""  # it is left to the caption
    assert len({axes.get_position().x0 for axes in paper.axes if axes.get_visible()}) == 1
