"""What figures call their lines, what lies in front, and plots that compare."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import runtime
from runtime.plots import display_names, draw, layers, style
from runtime.plots.formulas import is_formula
from runtime.plots.log_axes import label_log, power_text
from runtime.plots.style import coincident
from runtime.runs import Result
from tests.conftest import Run

GRAPH = """
graph: tracking
extends: starters/tracking
run: {until: 0.5}
probes:
  pose: {of: plant.pose, label: robot}
  line: {of: track.path, label: path to follow}
  turn: {of: [total.out.omega, lqr.command.omega], label: [$\\omega$, correction]}
plots:
  path: {kind: trajectory, of: [pose, line], labels: null}
  turn: {kind: timeseries, of: turn}
  both: {kind: timeseries, of: [error.position, error.lateral]}
  errors: {compare: replace=lqr=PathPID}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "labels.yaml"
    path.write_text(GRAPH, encoding="utf-8")
    return path


def named(result: Result, plot: str) -> list[str]:
    """The legends' texts of a plot."""
    figure = result.plot(plot)
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]  # type: ignore[union-attr]
    return [text.get_text() for each in legends if each is not None for text in each.get_texts()]


@pytest.mark.slow
def test_labels_of_probes_are_shown_and_stored(file: Path, tmp_path: Path) -> None:
    result = runtime.load(file).run()
    again = runtime.open(result.save(tmp_path / "run"))
    for found in (result, again):
        assert named(found, "path")[:2] == ["robot", "path to follow"]
        assert named(found, "turn") == ["$\\omega$", "correction"]
        assert named(found, "both") == ["$e_p$", "$e_y$"]
    assert list(result.to_dataframe("turn").columns) == ["total.out.omega", "lqr.command.omega"]


def test_equal_names_are_not_used() -> None:
    assert display_names(["a.e", "b.e"], ["$e$", "$e$"]) == ["a", "b"]
    assert display_names(["a.e", "b.theta"], ["$e$", "b.theta"]) == ["$e$", "b.θ"]


def test_only_formulas_are_formulas() -> None:
    assert is_formula("$e_p$ [m]")
    for text in ("costs $5 and $6", "$", "a_b", "$\\nonsense$", "$e_p$ for 5 $", ""):
        assert not is_formula(text)


def test_noise_is_drawn_behind_what_it_would_hide() -> None:
    t = np.linspace(0.0, 10.0, 2000)
    smooth = np.sin(t)
    noisy = smooth + 0.1 * np.random.default_rng(0).normal(size=t.size)
    held = np.repeat(smooth[::10], 10)
    front = layers([smooth, noisy, held, np.zeros(1), np.full(9, np.nan)])
    assert front[1] < front[0] == front[2] == front[3] == front[4]
    plane = np.column_stack([t, smooth]), np.column_stack([t + noisy, noisy])
    assert layers(plane)[1] < layers(plane)[0]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{of: plant.pose, label: [a, b]}", "string for the signal, or for each of the 3 columns"),
        ("{of: plant.pose, unit: cm}", "'plant.pose' has a unit of its own: m, rad"),
        ("{of: plant.pose, unit: 3}", "expected a string, got 3"),
        ("{of: plant.pose, label: {a: b}}", "expected a string"),
        ("{of: plant.pose, labl: a}", "did you mean 'label'?"),
    ],
)
def test_wrong_labels_are_reported(file: Path, entry: str, message: str) -> None:
    file.write_text(GRAPH.replace("{of: plant.pose, label: robot}", entry), encoding="utf-8")
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load(file).check()
    assert message in str(caught.value)
    assert "labels.yaml:6" in str(caught.value)


COLUMNS = """
graph: columns
run: {dt: 0.001, until: 1.0}
blocks:
  model: {type: DynamicSystem, states: [x, v], derivative: [v, -x], initial: [3, 0]}
  same: {type: Gain, gain: 1.0}
wires: {same: {input: model.out}}
probes:
  motion: {of: model.out, label: [position, speed], unit: [m, m/s]}
  both: [model.out.0, same.out.0]
  scaled: {of: same.out, label: state, unit: m}
plots:
  phase: {kind: xy, of: motion}
  other: {kind: xy, of: ["model.out[0]", "model.out[1]"], labels: [x, v]}
  motion: {kind: timeseries, of: motion}
  late: {kind: timeseries, of: motion, xlim: [0.5, 1.0]}
  both: {kind: timeseries, of: both, labels: [first, second]}
  spectrum: {kind: spectrum, of: motion}
"""


@pytest.fixture
def columns(tmp_path: Path) -> Path:
    path = tmp_path / "columns.yaml"
    path.write_text(COLUMNS, encoding="utf-8")
    return path


def test_a_label_without_a_line_is_an_error(columns: Path) -> None:
    columns.write_text(COLUMNS.replace("[first, second]", "[first, second, third]"), "utf-8")
    with pytest.raises(runtime.GraphError, match="for each line, 2 at the most, got 3"):
        runtime.load(columns).check()


def test_columns_of_one_signal_have_names_and_units(columns: Path, tmp_path: Path) -> None:
    result = runtime.load(columns).run()
    for found in (result, runtime.open(result.save(tmp_path / "run"))):
        axes = found.plot("phase").axes[0]
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("position [m]", "speed [m/s]")
        axes = found.plot("other").axes[0]
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x", "v")
        upper, lower = found.plot("motion").axes
        assert (upper.get_ylabel(), lower.get_ylabel()) == ("position [m]", "speed [m/s]")
        assert found.probes["scaled"].units == ("m", "m")
    without = runtime.load(columns).without("same").run()
    assert "scaled" not in without.probes and without.probes["motion"].units == ("m", "m/s")


def test_the_vertical_axis_fits_what_the_horizontal_one_shows(columns: Path) -> None:
    result = runtime.load(columns).run()
    low, high = result.plot("late").axes[0].get_ylim()
    t = result.time("motion")
    shown = result["motion"][t >= 0.5, 0]
    margin = 0.05 * (shown.max() - shown.min())
    assert low == pytest.approx(shown.min() - margin)
    assert high == pytest.approx(shown.max() + margin)


def test_a_line_that_covers_another_is_dashed(columns: Path) -> None:
    axes = runtime.load(columns).run().plot("both").axes[0]
    first, second = axes.get_lines()[:2]
    assert (first.is_dashed(), second.is_dashed()) == (False, True)
    assert axes.get_ylabel() == "value"  # the legend has their names
    waves = [np.sin(np.linspace(0, 9, 50) + shift) for shift in (0.0, 1.0, 0.0, 1.0, 0.0)]
    assert coincident([*waves, np.zeros(50), np.full(50, np.nan)]) == [0, 0, 1, 1, 2, 0, 0]


def test_powers_of_ten_are_drawn_as_such(columns: Path) -> None:
    figure = runtime.load(columns).run().plot("spectrum")
    figure.canvas.draw()
    ticks = [label for axes in figure.axes for label in axes.get_yticklabels()]
    assert any(re.search("10[⁻⁰-⁹²³]", label.get_text()) for label in ticks)


@pytest.mark.slow
def test_a_plot_compares_with_a_change(file: Path, cli: Run) -> None:
    done = cli("run", str(file))
    assert done.returncode == 0, done.stderr
    assert "as written  replace lqr=PathPID" in done.stdout


def test_a_wrong_change_is_reported_before_anything_runs(file: Path, cli: Run) -> None:
    text = GRAPH.replace("replace=lqr=PathPID", "without=lqrr")
    file.write_text(text, encoding="utf-8")
    done = cli("run", str(file))
    assert done.returncode == 2
    assert "did you mean 'lqr'" in done.stderr
    file.write_text(GRAPH.replace("replace=lqr=PathPID", "lqr"), encoding="utf-8")
    done = cli("validate", str(file))
    assert done.returncode == 2
    assert "labels.yaml:13:21: plots.errors.compare: expected a change" in done.stderr


@pytest.fixture
def watching(file: Path) -> Iterator[subprocess.Popen[str]]:
    script = "from runtime.cli import main; main()"
    command = [sys.executable, "-c", script, "run", file.name, "--watch", "--until", "0.1"]
    process = subprocess.Popen(
        command, cwd=file.parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    yield process
    process.kill()
    process.communicate()


def read_until(process: subprocess.Popen[str], start: str) -> list[str]:
    """The lines that a process prints up to one that starts so."""
    assert process.stdout is not None
    lines: list[str] = []
    for line in process.stdout:
        lines.append(line.rstrip())
        if line.startswith(start):
            return lines
    raise AssertionError("\n".join(lines))


@pytest.mark.slow
def test_watch_runs_again_after_each_save(file: Path, watching: subprocess.Popen[str]) -> None:
    first = read_until(watching, "watching")
    assert not any("before" in line for line in first)
    text = file.read_text(encoding="utf-8").replace("compare: replace=lqr=PathPID", "xlim: [0, 1]")
    file.write_text(text.replace("label: robot}", "labl: robot}"), encoding="utf-8")
    assert read_until(watching, "watching")[:-1] == []  # an error, on stderr
    file.write_text(text, encoding="utf-8")
    second = read_until(watching, "watching")
    assert any(line.split() == ["now", "before"] for line in second)
    assert "  plots/diagram.svg" in second
    watching.send_signal(signal.SIGINT)
    _, errors = watching.communicate(timeout=60)
    assert watching.returncode == 0
    assert "did you mean 'label'?" in errors


@pytest.mark.parametrize("look", ["screen", "paper"])
def test_twelve_lines_have_twelve_looks_and_room_for_their_names(look: str) -> None:
    names = [f"line_{i}" for i in range(12)]
    blocks = {n: {"type": "Sine", "phase": 0.5 * i} for i, n in enumerate(names)}
    probes = {"all": {"of": [f"{n}.out" for n in names], "label": names}}
    plain = {"graph": "lines", "run": {"dt": 0.01, "until": 2.0}, "blocks": blocks}
    plots = {"lines": {"kind": "timeseries", "of": "all"}}
    result = runtime.load({**plain, "probes": probes, "plots": plots}).run(engine="python")
    figure = draw(result.plots[0], result, look)
    figure.draw_without_rendering()
    lines = [line for line in figure.axes[0].lines if line.get_label() in names]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 12
    (legend,) = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    assert [text.get_text() for text in legend.get_texts()] == names
    box, page = legend.get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1


def test_references_are_grey_dashes_and_take_no_colour(columns: Path) -> None:
    text = columns.read_text(encoding="utf-8").replace("same", "ideal")
    columns.write_text(text, encoding="utf-8")
    model, ideal = runtime.load(columns).run().plot("both").axes[0].get_lines()[:2]
    assert ideal.get_color() == style.REFERENCE["color"] and ideal.is_dashed()
    assert model.get_color() == style.COLOURS[0] and not model.is_dashed()


@pytest.mark.parametrize(
    ("low", "high", "at", "labels"),
    [
        (2.4e-6, 5.2e-6, [2.5e-6, 3.54e-6, 5e-6], ["2.5 × 10⁻⁶", "3.54 × 10⁻⁶", "5 × 10⁻⁶"]),
        (1.05, 1.95, [1.1, 1.32, 1.58, 1.9], ["1.1", "1.32", "1.58", "1.9"]),
        (1.0, 9.0, [], ["1", "2", "5"]),
        (1.1, 1.9, [], ["1.2", "1.4", "1.6", "1.8"]),
        (0.02, 0.3, np.geomspace(0.02, 0.3, 20), ["0.02", "0.05", "0.1", "0.2"]),
        (9e-6, 3e-5, [], ["10⁻⁵", "2 × 10⁻⁵"]),
    ],
)
def test_a_logarithmic_axis_has_two_labels_or_more(
    low: float, high: float, at: list[float], labels: list[str]
) -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    label_log(axes.xaxis, at=at)
    figure.canvas.draw()
    shown = [text.get_text() for text in axes.xaxis.get_majorticklabels()]
    places = axes.xaxis.get_majorticklocs()
    inside = [t for t, x in zip(shown, places, strict=True) if low <= x <= high]
    assert inside == labels
    assert not any(text.get_text() for text in axes.xaxis.get_minorticklabels())


def test_decades_are_powers_of_ten() -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_xlim(1.0, 100.0)
    label_log(axes.xaxis)
    figure.canvas.draw()
    shown = [text.get_text() for text in axes.xaxis.get_majorticklabels()]
    assert {"1", "10", "100"} <= set(shown)
    texts = [power_text(x) for x in (0.0, 0.02, 5e-6, 1e4, -2.5e7)]
    assert texts == ["0", "0.02", "5 × 10⁻⁶", "10⁴", "-2.5 × 10⁷"]
