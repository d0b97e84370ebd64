"""Figures for a paper: options of plots, formats, columns of a page, and two runs in one figure."""

from __future__ import annotations

import json
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import runtime
from runtime.plots import LOOKS, draw, save_figure, save_plots, symbol
from runtime.plots.figures import DPI
from tests.browser import find
from tests.conftest import Run


def graph(speed: float = 0.0, **plots: Any) -> runtime.Graph:
    """A robot that turns at a constant rate, with the given plots."""
    return runtime.load(
        {
            "graph": "turning",
            "run": {"dt": 0.01, "until": 2.0, "seed": 4},
            "blocks": {
                "go": {"type": "Constant", "signal": "Twist", "value": [speed, 0.5]},
                "plant": {"type": "DifferentialDrive"},
            },
            "wires": {"plant": {"command": "go.value"}},
            "probes": {"turn": "plant.pose.theta", "pose": "plant.pose"},
            "plots": plots,
        }
    )


def drawn(look: str = "screen", speed: float = 0.0, **plot: Any) -> Figure:
    result = graph(speed, p=plot).run()
    return draw(result.plots[0], result, look)


def bands(axes: Axes) -> list[list[float]]:
    """The lower and upper end of each shaded range."""
    return [
        [float(p.get_extents().y0), float(p.get_extents().y1)]
        for p in (
            patch.get_path().transformed(patch.get_patch_transform()) for patch in axes.patches
        )
    ]


def test_limits_of_axes_and_size_are_as_written() -> None:
    plot = {"kind": "timeseries", "of": "turn", "xlim": [0.5, 1.5], "ylim": [-2, 3], "size": [3, 2]}
    figure = drawn(**plot)
    assert figure.axes[0].get_xlim() == (0.5, 1.5)
    assert figure.axes[0].get_ylim() == (-2.0, 3.0)
    assert figure.get_size_inches().tolist() == [3.0, 2.0]


def test_levels_and_band_are_drawn() -> None:
    axes = drawn(kind="timeseries", of="turn", limits=[0.2, 0.9], band=0.3).axes[0]
    levels = [line.get_ydata()[0] for line in axes.lines if len(set(line.get_ydata())) == 1]
    assert levels[-2:] == [0.2, 0.9]
    assert bands(axes) == [pytest.approx([0.0, 0.3])]


@pytest.mark.parametrize(("turn", "low"), [(0.5, 0.0), (-0.5, -0.3)])
def test_a_band_goes_below_zero_where_values_do(turn: float, low: float) -> None:
    """A distance is never negative: half of its band would be empty."""
    changed = graph(p={"kind": "timeseries", "of": "turn", "band": 0.3})
    result = changed.set("blocks.go.value", [0.0, turn]).run()
    axes = draw(result.plots[0], result).axes[0]
    assert bands(axes) == [pytest.approx([low, 0.3])]
    assert (axes.get_ylim()[0] < -0.2) == (low < 0.0)


def test_a_time_series_shows_the_band_of_its_settling_time() -> None:
    settled = graph(p={"kind": "timeseries", "of": "turn"}).metric(
        "m", "settling_time", "turn", band=0.25
    )
    result = settled.run()
    assert bands(draw(result.plots[0], result).axes[0]) == [pytest.approx([0.0, 0.25])]
    plain = graph(p={"kind": "timeseries", "of": "turn"}).run()
    assert bands(draw(plain.plots[0], plain).axes[0]) == []


def test_lines_are_named_as_asked_or_not_at_all() -> None:
    plot = {"kind": "timeseries", "of": "pose", "labels": ["ahead", "left", "course"]}
    figure = drawn(speed=1.0, **plot)
    (legend,) = [a.get_legend() for a in figure.axes if a.get_legend()]
    assert [text.get_text() for text in legend.get_texts()] == ["ahead", "left"]
    assert figure.axes[1].get_ylabel() == "course [rad]"
    assert [a.get_legend() for a in drawn(speed=1.0, **plot, legend=False).axes] == [None, None]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"xlim": [2, 1]}, "plots.p.xlim: expected the lower end first, as in [0, 1], got [2, 1]"),
        (
            {"size": [0, 1]},
            "plots.p.size: expected an array of 2 numbers above 0 and at",
        ),
        ({"labels": [1]}, "plots.p.labels[0]: expected a string for each line, as in [position, "),
        ({"legend": 3}, "plots.p.legend: expected true or false, got 3"),
    ],
)
def test_options_are_checked(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(runtime.GraphError) as error:
        graph(p={"kind": "timeseries", "of": "turn", **wrong}).check()
    assert str(error.value).startswith(message)


def test_options_survive_the_run_folder(tmp_path: Path) -> None:
    plot = {"kind": "timeseries", "of": "pose", "labels": ["a", "b"], "ylim": [0, 1], "band": 0.1}
    result = graph(p=plot).run()
    assert runtime.open(result.save(tmp_path / "run")).plots == result.plots


def test_what_is_zero_throughout_is_left_out_with_a_note() -> None:
    figure = drawn(kind="timeseries", of="pose")  # it turns on the spot
    assert [axes.get_ylabel() for axes in figure.axes] == ["θ [rad]"]
    assert "not shown, since it is 0 throughout: x, y" in [
        t.get_text() for t in figure.axes[0].texts
    ]


@pytest.mark.parametrize("look", ["paper", "paper2"])
@pytest.mark.parametrize("kind", ["timeseries", "trajectory", "heatmap"])
def test_a_figure_fits_a_column_and_nothing_is_cut(look: str, kind: str) -> None:
    figure = drawn(look, kind=kind, of="pose")
    assert figure.get_size_inches()[0] == LOOKS[look].width
    figure.draw_without_rendering()
    inside = figure.bbox.padded(1.0)
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box is not None
        assert inside.contains(box.x0, box.y0)
        assert inside.contains(box.x1, box.y1)
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert inside.contains(box.x0, box.y0)
        assert inside.contains(box.x1, box.y1)


@pytest.mark.slow
def test_every_format_is_written_and_the_same_run_gives_the_same_file(tmp_path: Path) -> None:
    result = graph(p={"kind": "timeseries", "of": "turn"}).run()
    paths = save_plots(result, tmp_path / "a", formats=("png", "pdf", "svg"))
    again = save_plots(result, tmp_path / "b", formats=("png", "pdf", "svg"))
    starts = [path.read_bytes()[:4] for path in paths]
    assert starts == [b"\x89PNG", b"%PDF", b"<?xm"]
    assert [path.read_bytes() for path in paths] == [path.read_bytes() for path in again]


@pytest.mark.parametrize(("kind", "of"), [("timeseries", "turn"), ("trajectory", "pose")])
def test_a_png_that_is_drawn_once_has_the_bytes_of_savefig(
    tmp_path: Path, kind: str, of: str
) -> None:
    save_figure(drawn("screen", kind=kind, of=of), tmp_path / "a.png")
    figure, expected = drawn("screen", kind=kind, of=of), BytesIO()
    figure.savefig(expected, dpi=DPI, format="png", metadata={})
    assert (tmp_path / "a.png").read_bytes() == expected.getvalue()
    # The figure is what it was, so that it can be saved in another format, too.
    size, canvas = figure.dpi, figure.canvas
    save_figure(figure, tmp_path / "b.png")
    assert (figure.dpi, figure.canvas) == (size, canvas)


def test_greek_letters_stand_for_components_alone() -> None:
    assert [symbol(n) for n in ("plant.pose.theta", "omega", "omega.out")] == [
        "plant.pose.θ",
        "ω",
        "omega.out",
    ]


def test_the_subtitle_says_what_ran(tmp_path: Path) -> None:
    made = graph(p={"kind": "timeseries", "of": "turn"})
    (tmp_path / "fast.yaml").write_text("blocks: {go: {value: [0.0, 1.0]}}\n")
    result = made.overlay(tmp_path / "fast.yaml").run(seed=9)
    texts = [text.get_text() for text in draw(result.plots[0], result).axes[0].texts]
    assert "turning  ·  with fast  ·  seed 9" in texts


def test_two_runs_share_a_figure(cli: Run, tmp_path: Path) -> None:
    done = cli("run", "starters/adaptive", "--until", "0.5", "--vs", "without=adaptive", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    alone = runtime.load("starters/adaptive").without("adaptive").run(until=0.5)
    assert found["vs"] == {"change": "without=adaptive", "metrics": alone.metrics}
    assert found["metrics"]["mean_error"] != alone.metrics["mean_error"]
    assert len(list((tmp_path / "runs" / "adaptive_line").glob("2*"))) == 2
    plots = Path(found["run"], "plots")
    assert {p.name for p in (tmp_path / plots).iterdir()} == {
        *("path.png", "errors.png", "turn.png")
    }


def test_what_a_change_drops_is_told(cli: Run) -> None:
    change = ("--vs", "replace=lqr=PathPID")
    done = cli("run", "starters/adaptive", "--until", "0.1", *change, "--no-plots")
    assert done.returncode == 0, done.stderr
    assert "note: replace=lqr=PathPID: 'lqr' is now a PathPID, which has no " in done.stderr


def test_two_runs_have_the_names_that_are_given(cli: Run, tmp_path: Path) -> None:
    named = ("--vs", "without=adaptive", "--labels", "with SNN, LQR alone", "--figures", "svg")
    done = cli("run", "starters/adaptive", "--until", "0.2", *named)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^ +with SNN +LQR alone$", done.stdout, re.M)
    figure = next((tmp_path / "runs").rglob("errors.svg")).read_text(encoding="utf-8")
    assert "LQR alone" in figure


def test_lines_of_both_runs_are_their_recordings() -> None:
    from runtime.compare import Run as Compared
    from runtime.compare.overlay import versus

    made = runtime.load("starters/adaptive")
    results = [made.run(until=0.2), made.without("adaptive").run(until=0.2)]
    runs = [Compared(n, Path(), r, {}) for n, r in zip("ab", results, strict=True)]
    plot = next(p for p in results[0].plots if p.name == "turn")
    above, below = versus(runs, plot).axes
    for run, line in zip(runs, above.lines, strict=False):
        *rows, last = np.asarray(line.get_ydata()).tolist()
        assert rows == run.result["turn"].reshape(20, -1)[:, 0].tolist()
        assert last == rows[-1]  # a sampled signal is held to the end of the last step
    # The ablated block has no line of the other run.
    assert [line.get_label() for line in below.lines][:1] == ["a"]
    assert "b" not in [line.get_label() for line in below.lines]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--figures", "pdf,jpeg"],
            "argument --figures: expected some of pdf, svg, png, got 'jpeg'",
        ),
        (
            ["--vs", "adaptive"],
            "--vs adaptive: expected CHANGE=VALUE with one of without, ",
        ),
        (["--vs", "without=adaptiv"], "there is no block 'adaptiv', did you mean 'adaptive'?"),
        (["--labels", "a,b"], "--labels a,b: names the two runs of --vs, which is not given"),
        (
            ["--vs", "without=adaptive", "--labels", "a,b,c"],
            "--labels a,b,c: expected two names for --vs, as in 'mine,theirs'",
        ),
        (
            ("--vs", "without=adaptive", "--vs", "bypass=limit"),
            "--vs is given twice; it takes one value",
        ),
    ],
)
def test_wrong_options_end_before_the_run(
    arguments: list[str], message: str, cli: Run, tmp_path: Path
) -> None:
    done = cli("run", "starters/adaptive", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "runs").exists()


def test_a_notebook_shows_a_run_once_with_metrics_and_pictures() -> None:
    made = graph(p={"kind": "timeseries", "of": "turn"}).metric("last", "final", "turn")
    result = made.run()
    shown = result._repr_html_()
    assert [cell.text for cell in find(shown, "td")] == ["last", "0.995 rad"]
    assert shown.count("<img ") == 1
    figures = result.plot()
    assert isinstance(figures, dict)
    assert figures._repr_html_().count("<img ") == 1
    assert result.plot("p")._repr_png_().startswith(b"\x89PNG")
    unsettled = made.metric("never", "settling_time", "turn", band=0.0).run()._repr_html_()
    assert [cell.text for cell in find(unsettled, "td")[2:]] == ["never", "never settled"]
