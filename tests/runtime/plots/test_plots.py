"""Figures show and label the recorded data, and are drawn even when there is none."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

import runtime
from blocks.core.signals import FloatArray
from runtime.errors import UsageError
from runtime.observation.reader import PlotSpec
from runtime.observation.run_data import Recording
from runtime.plots import style, titles
from runtime.plots.figures import draw, save_plots
from runtime.plots.thinning import block_means, thin
from runtime.runs.result import Result

KINDS = ("timeseries", "trajectory", "raster", "heatmap")
DT = 0.001


def recorded(
    name: str,
    values: Any,
    labels: list[str],
    units: list[str],
    kinds: list[str],
    dt: float = DT,
) -> Recording:
    """A probe of one signal, or of scalars."""
    array: FloatArray = np.asarray(values, dtype=np.float64)
    if len(kinds) == 1:
        addresses = {name: (0, len(labels))}
    else:
        addresses = {label: (i, i + 1) for i, label in enumerate(labels)}
    t: FloatArray = np.arange(len(array), dtype=np.float64) * dt
    return Recording(name, t, array, tuple(labels), tuple(units), tuple(kinds), addresses)


def pose(name: str, rows: Any) -> Recording:
    labels = [f"{name}.{c}" for c in ("x", "y", "theta")]
    return recorded(name, np.reshape(rows, (-1, 3)), labels, ["m", "m", "rad"], ["Pose"])


def path(name: str, *rows: Any) -> Recording:
    labels = [f"{name}.{c}" for c in ("x", "y", "theta", "kappa")]
    table = np.zeros((len(rows), len(rows[0]) if rows else 5, 4))
    for i, row in enumerate(rows):
        table[i, :, :2] = row
    return recorded(name, table, labels, ["m", "m", "rad", "1/m"], ["Path"])


def vector(
    name: str, values: Any, unit: str = "", kind: str = "State", dt: float = DT
) -> Recording:
    count = np.shape(values)[1]
    return recorded(
        name, values, [f"{name}[{i}]" for i in range(count)], [unit] * count, [kind], dt
    )


def spikes(name: str, values: Any, dt: float = DT) -> Recording:
    return vector(name, values, "1/s", "Spikes", dt)


def result(*probes: Recording, **manifest: Any) -> Result:
    rows = max((len(p.t) for p in probes), default=0)
    about = {"status": "complete", "ticks": rows, "dt": DT, "removed": {}, "overrides": []}
    return Result("demo", {p.name: p for p in probes}, {}, [], {**about, **manifest})


def picture(kind: str, *probes: Recording, title: str = "Title", **manifest: Any) -> Figure:
    spec = PlotSpec("plot", kind, tuple(p.name for p in probes), title)
    return draw(spec, result(*probes, **manifest))


def rendered(figure: Figure) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=40)
    return file.getvalue()


def lines(axes: Axes) -> dict[str, Line2D]:
    """The lines that carry data, by label."""
    return {str(a.get_label()): a for a in axes.lines if not str(a.get_label()).startswith("_")}


def xy(line: Line2D) -> FloatArray:
    """The points of a line, (points, 2)."""
    return np.asarray(line.get_xydata(), dtype=np.float64)


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def walk() -> Recording:
    """20 m along x, swinging by 0.2 m, as fast as it goes."""
    x = np.linspace(0.0, 20.0, 400)
    return pose("plant.pose", np.column_stack([x, 0.2 * np.cos(x), np.arctan(-0.2 * np.sin(x))]))


def far_path() -> Recording:
    s = np.linspace(0.0, 40.0, 401)
    return path("track.path", np.column_stack([s, np.ones_like(s)]))


@pytest.fixture(scope="module")
def circle() -> Result:
    """A robot that drives a circle of 2 m radius, and plots of it."""
    graph = {
        "graph": "circle",
        "run": {"dt": 0.01, "until": 3.0, "seed": 0},
        "blocks": {
            "command": {"type": "Constant", "signal": "Twist", "value": [1.0, 0.5]},
            "plant": {"type": "DifferentialDrive"},
            "track": {"type": "CirclePath", "radius": 2.0},
        },
        "wires": {"plant": {"command": "command.value"}},
        "probes": {"pose": "plant.pose"},
        "plots": {
            "way": {"kind": "trajectory", "of": ["pose", "track.path"], "title": "Round"},
            "pose": {"kind": "timeseries", "of": "pose"},
            "heat": {"kind": "heatmap", "of": "pose"},
        },
    }
    done = runtime.load(graph).run()
    assert isinstance(done, Result)
    return done


class TestAllKinds:
    def test_title_and_subtitle(self) -> None:
        removed = {"adaptive.snn_v": "without", "adaptive.join": "without", "limit": "bypass"}
        about = {"removed": removed, "overrides": ["without adaptive", "set run.seed=1"]}
        axes = picture("timeseries", vector("a", np.ones((5, 2))), title="Errors", **about).axes[0]
        assert axes.get_title(loc="left") == "Errors"
        assert "demo  ·  without adaptive  ·  bypassing limit" in texts(axes)

    def test_powers_of_ten_do_not_overlap_the_subtitle(self) -> None:
        figure = picture("timeseries", vector("a", np.linspace(0.0, 3e-5, 20)[:, None]))
        rendered(figure)
        axes = figure.axes[0]
        power = axes.yaxis.get_offset_text()
        (below,) = (text for text in axes.texts if text.get_gid() == "subtitle")
        assert power.get_text() == "×10⁻⁵"
        assert not power.get_window_extent().overlaps(below.get_window_extent())

    def test_subtitle_names_blocks_that_were_not_removed_as_a_part(self) -> None:
        removed = {f"part.b{i}": "without" for i in range(5)}
        message = titles.subtitle(result(removed=removed))
        assert message == "demo  ·  without part.b0, part.b1, part.b2 and 2 more"

    def test_subtitle_has_the_end_of_an_interrupted_run(self) -> None:
        message = titles.subtitle(result(status="interrupted", ticks=1234))
        assert message == "demo  ·  interrupted at 1.234 s"

    def test_a_run_without_these_entries_in_its_manifest(self) -> None:
        bare = Result("bare", {"a": vector("a", np.ones((4, 2)))}, {}, [], {})
        figure = draw(PlotSpec("p", "timeseries", ("a",), "A"), bare)
        assert rendered(figure)
        assert "bare" in texts(figure.axes[0])  # the subtitle without overrides, nor an end

    @pytest.mark.parametrize("rows", [0, 1, 2])
    @pytest.mark.parametrize("kind", KINDS)
    def test_runs_that_were_interrupted_early(self, kind: str, rows: int) -> None:
        probes = {
            "timeseries": vector("a", np.ones((rows, 3)), "m"),
            "trajectory": pose("p", np.ones((rows, 3))),
            "raster": spikes("s", np.full((rows, 4), 1000.0)),
            "heatmap": recorded("w", np.ones((rows, 2, 3)), ["w[0]", "w[1]"], ["", ""], ["State"]),
        }
        figure = picture(kind, probes[kind], status="interrupted")
        assert rendered(figure)
        assert ("nothing recorded" in texts(figure.axes[0])) == (rows == 0)

    def test_an_empty_path_and_an_empty_pose(self) -> None:
        figure = picture("trajectory", pose("p", []), path("track"))
        assert rendered(figure)
        assert "nothing recorded" in texts(figure.axes[0])

    def test_unknown_kind(self) -> None:
        with pytest.raises(UsageError, match="timeseries, trajectory, xy, .*, heatmap, got 'pie'"):
            picture("pie", walk())

    def test_probe_that_was_not_recorded(self) -> None:
        with pytest.raises(UsageError, match="'gone', which was not recorded"):
            draw(PlotSpec("p", "heatmap", ("gone",), "P"), result(walk()))

    def test_matplotlib_settings_are_not_changed(self) -> None:
        before = dict(matplotlib.rcParams)
        rendered(picture("trajectory", walk(), far_path()))
        assert dict(matplotlib.rcParams) == before

    @pytest.mark.slow
    def test_pyplot_is_not_imported(self) -> None:
        script = (
            "import sys, tempfile, pathlib, runtime, runtime.plots.figures\n"
            "graph = runtime.Graph('g', dt=0.01, until=0.1)\n"
            "from blocks import Constant\n"
            "graph = graph.add('c', Constant(value=1.0)).plot('p', 'timeseries', 'c.value')\n"
            "runtime.plots.figures.save_plots(graph.run(), pathlib.Path(tempfile.mkdtemp()))\n"
            "sys.exit('matplotlib.pyplot' in sys.modules)\n"
        )
        root = Path(__file__).parents[3]
        subprocess.run([sys.executable, "-c", script], cwd=root, check=True)


class TestSavePlots:
    def test_a_png_per_plot(self, circle: Result, tmp_path: Path) -> None:
        paths = save_plots(circle, tmp_path / "new" / "plots")
        assert [p.name for p in paths] == ["way.png", "pose.png", "heat.png"]
        for file, spec in zip(paths, circle.plots, strict=True):
            data = file.read_bytes()
            assert data.startswith(b"\x89PNG")
            width, height = struct.unpack(">II", data[16:24])
            inches = draw(spec, circle).get_size_inches()
            np.testing.assert_allclose([width, height], 150.0 * inches, atol=1.0)

    def test_names_fit_for_files(self, tmp_path: Path) -> None:
        run = result(walk())
        run.plots.append(PlotSpec("../a b", "trajectory", ("plant.pose",), "T"))
        assert save_plots(run, tmp_path) == [tmp_path / "a_b.png"]

    def test_result_plot(self, circle: Result) -> None:
        figures = circle.plot()
        assert isinstance(figures, dict)
        assert list(figures) == ["way", "pose", "heat"]
        assert isinstance(circle.plot("way"), Figure)


class TestTimeseries:
    def test_one_axes_per_unit(self, circle: Result) -> None:
        figure = draw(circle.plots[1], circle)
        above, below = figure.axes
        assert [above.get_ylabel(), below.get_ylabel()] == ["plant.pose [m]", "θ [rad]"]
        assert [above.get_xlabel(), below.get_xlabel()] == ["", "time [s]"]
        for axes, column, name in ((above, 0, "x"), (above, 1, "y"), (below, 2, "θ")):
            line = lines(axes)[name]
            rows, last = xy(line)[:-1], xy(line)[-1]
            np.testing.assert_array_equal(rows[:, 0], circle.time("pose"))
            np.testing.assert_array_equal(rows[:, 1], circle["pose"][:, column])
            # A plant in discrete time holds its pose to the end of the last step.
            np.testing.assert_allclose(last, [3.0, rows[-1, 1]])
        np.testing.assert_allclose(below.get_xlim(), (0.0, 3.0))

    def test_one_line_needs_no_legend(self) -> None:
        probe = recorded(
            "e", np.ones((5, 2)), ["e.position", "e.heading"], ["m", "rad"], ["Scalar"] * 2
        )
        for axes in picture("timeseries", probe).axes:
            assert axes.get_legend() is None

    def test_probes_of_different_rates_share_an_axes(self) -> None:
        fast = recorded("a.out", np.arange(100.0), ["a.out"], ["m"], ["Scalar"])
        slow = recorded("b.out", np.arange(10.0), ["b.out"], ["m"], ["Scalar"], dt=10 * DT)
        axes = picture("timeseries", fast, slow).axes[0]
        assert {k: len(xy(v)) for k, v in lines(axes).items()} == {"a": 100, "b": 10}
        legend = axes.get_legend()
        assert legend is not None
        assert [text.get_text() for text in legend.get_texts()] == ["a", "b"]

    @pytest.mark.parametrize(("low", "drawn"), [(-1.0, True), (0.5, False)])
    def test_zero_line_where_data_crosses_it(self, low: float, drawn: bool) -> None:
        axes = picture("timeseries", vector("a", np.linspace(low, 1.0, 9)[:, None])).axes[0]
        flat = [line for line in axes.lines if list(xy(line)[:, 1]) == [0.0, 0.0]]
        assert len(flat) == drawn

    def test_many_columns_have_colours_in_place_of_a_legend(self) -> None:
        values = np.random.default_rng(0).normal(size=(50, 100))
        axes, bar = picture("timeseries", vector("snn.activity", values, "1/s")).axes
        assert axes.get_legend() is None
        assert axes.get_ylabel() == "activity [1/s]"
        assert bar.get_ylabel() == "index"
        assert len(lines(axes)) == 100
        drawn = np.column_stack([xy(line)[:, 1] for line in lines(axes).values()])
        np.testing.assert_array_equal(drawn, values)
        assert len({str(line.get_color()) for line in lines(axes).values()}) == 100

    def test_ten_lines_are_distinguishable(self) -> None:
        axes = picture("timeseries", vector("a", np.ones((5, 10)))).axes[0]
        looks = {(line.get_color(), line.get_linestyle()) for line in lines(axes).values()}
        assert len(looks) == 10

    def test_infinity_leaves_a_gap(self) -> None:
        values = np.array([[1.0], [np.inf], [3.0], [-np.inf]])
        figure = picture("timeseries", vector("scan", values, "m"))
        rendered(figure)
        (line,) = lines(figure.axes[0]).values()
        np.testing.assert_array_equal(xy(line)[:, 1], [1.0, np.nan, 3.0, np.nan])
        assert figure.axes[0].get_ylim()[1] < 4.0

    def test_a_constant_is_held_over_the_run(self) -> None:
        reference = recorded("r.value", [2.0], ["r.value"], ["m"], ["Scalar"])
        moving = recorded("y.value", np.arange(100.0), ["y.value"], ["m"], ["Scalar"])
        axes = picture("timeseries", reference, moving).axes[0]
        marked = lines(axes)["r"]
        assert xy(marked).tolist() == [[0.0, 2.0]]
        assert any(list(xy(line)[:, 0]) == [0.0, 100 * DT] for line in axes.lines)

    def test_a_long_series_keeps_its_extremes(self) -> None:
        y = np.sin(np.arange(300_000) * 1e-4)
        y[123_457], y[200_001] = 7.0, -5.0
        axes = picture("timeseries", vector("a", y[:, None])).axes[0]
        (line,) = lines(axes).values()
        drawn = xy(line)[:, 1]
        assert len(drawn) < 10_000
        assert (drawn.max(), drawn.min()) == (7.0, -5.0)

    def test_a_table_is_flattened(self) -> None:
        table = recorded("w", np.arange(12.0).reshape(2, 1, 6), ["w[0]"], ["V"], ["State"])
        axes = picture("timeseries", table).axes[0]
        assert axes.get_ylabel() == "w [V]"
        drawn = np.column_stack([xy(line)[:, 1] for line in lines(axes).values()])
        np.testing.assert_array_equal(drawn, np.arange(12.0).reshape(2, 6))


class TestTrajectory:
    def test_the_trajectory_is_the_recorded_one(self, circle: Result) -> None:
        axes = draw(circle.plots[0], circle).axes[0]
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
        assert axes.get_title(loc="left") == "Round"
        way, track = lines(axes)["plant.pose"], lines(axes)["track.path"]
        np.testing.assert_array_equal(xy(way), circle["pose"][:, :2])
        np.testing.assert_array_equal(xy(track), circle["track.path"][0, :, :2])
        assert way.get_linestyle() == "-"
        assert track.get_linestyle() == "--"

    def test_start_and_end_are_marked(self) -> None:
        axes = picture("trajectory", walk()).axes[0]
        way = walk().values[:, :2]
        for name, row in (("start", way[0]), ("end", way[-1])):
            np.testing.assert_array_equal(xy(lines(axes)[name])[0], row)

    def test_triangles_point_along_the_heading(self) -> None:
        rows = walk().values
        axes = picture("trajectory", walk()).axes[0]
        small, big = (c for c in axes.collections if isinstance(c, Quiver))
        assert big.N == 2
        assert small.N >= 10
        for arrows in (small, big):
            for x, y, u, v in np.column_stack([arrows.XY, arrows.U, arrows.V]):
                (row,) = rows[(rows[:, 0] == x) & (rows[:, 1] == y)]
                np.testing.assert_allclose((u, v), (np.cos(row[2]), np.sin(row[2])))
        apart = np.hypot(*np.diff(small.XY, axis=0).T)
        assert apart.max() < 1.3 * apart.min()

    def test_a_robot_that_turns_on_the_spot(self) -> None:
        rows = np.column_stack([np.ones(50), np.ones(50), np.linspace(0.0, 6.0, 50)])
        figure = picture("trajectory", pose("p", rows))
        rendered(figure)
        small = next(c for c in figure.axes[0].collections if isinstance(c, Quiver))
        assert small.N >= 10

    @pytest.mark.parametrize("turned", [False, True])
    def test_equal_scales_fill_a_page_shaped_for_the_data(self, turned: bool) -> None:
        rows = walk().values
        rows = rows[:, [1, 0, 2]] if turned else rows
        figure = picture("trajectory", pose("p", rows))
        rendered(figure)
        axes = figure.axes[0]
        box = axes.get_window_extent()
        metres = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
        assert metres[0] / box.width == pytest.approx(metres[1] / box.height, rel=1e-3)
        width, height = figure.get_size_inches()
        assert (height > width) == turned
        assert min(width, height) > 2.0

    def test_the_view_shows_the_poses_and_the_nearest_part_of_the_path(self) -> None:
        axes = picture("trajectory", walk(), far_path()).axes[0]
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert left < 0.0 < 20.0 < right < 25.0
        assert bottom < -0.2 < 1.0 < top

    def test_poses_differ_in_colour(self) -> None:
        axes = picture("trajectory", walk(), pose("odometry.pose", walk().values + 0.1)).axes[0]
        assert lines(axes)["plant.pose"].get_color() != lines(axes)["odometry.pose"].get_color()

    def test_the_last_row_of_a_moving_path_is_drawn(self) -> None:
        first, last = np.zeros((6, 2)), np.arange(12.0).reshape(6, 2)
        axes = picture("trajectory", path("plan", first, first, last)).axes[0]
        np.testing.assert_array_equal(xy(lines(axes)["plan"]), last)

    def test_point_clouds_are_dots(self) -> None:
        points = np.array([[[1.0, 2.0], [np.inf, 0.0], [3.0, 1.0]]])
        cloud = recorded("map", points, ["map.x", "map.y"], ["m", "m"], ["PointCloud"])
        axes = picture("trajectory", walk(), cloud).axes[0]
        dots = lines(axes)["map"]
        assert (dots.get_marker(), dots.get_linestyle()) == (".", "None")
        np.testing.assert_array_equal(xy(dots), [[1.0, 2.0], [3.0, 1.0]])

    def test_a_pose_beside_other_signals_of_a_probe(self) -> None:
        values = np.column_stack([np.full(9, 77.0), walk().values[:9]])
        labels = ("e.lateral", "plant.pose.x", "plant.pose.y", "plant.pose.theta")
        addresses = {"e.lateral": (0, 1), "plant.pose": (1, 4)}
        kinds = ("Scalar", "Pose")
        probe = Recording("mix", np.arange(9.0), values, labels, ("m",) * 4, kinds, addresses)
        axes = picture("trajectory", probe).axes[0]
        way = xy(lines(axes)["plant.pose"])
        np.testing.assert_array_equal(way, values[:, 1:3])


class TestRaster:
    def test_every_spike_is_marked_while_they_are_few(self) -> None:
        values = 1000.0 * (np.random.default_rng(1).random((500, 20)) < 0.05)
        above, below = picture("raster", spikes("snn.spikes", values)).axes
        (marks,) = lines(above).values()
        t, neuron = xy(marks).T
        given_trains = Counter(tuple(np.nonzero(column)[0]) for column in values.T)
        drawn = Counter(tuple(np.round(t[neuron == i] / DT).astype(int)) for i in range(20))
        assert drawn == given_trains
        assert "neuron" in above.get_ylabel()
        assert (below.get_ylabel(), below.get_xlabel()) == ("mean rate [Hz]", "time [s]")
        assert above.get_xlim() == below.get_xlim()

    def test_neurons_of_opposite_encoders_are_at_opposite_ends(self) -> None:
        early = np.arange(1000) < 500
        kind = np.random.default_rng(2).permutation(np.repeat([True, False], 10))
        firing = early[:, None] == kind[None, :]
        regular = (np.arange(1000) % 5 == 0)[:, None]
        above = picture("raster", spikes("s", 1000.0 * (firing & regular))).axes[0]
        t, neuron = xy(next(iter(lines(above).values()))).T
        upper = neuron >= 10
        assert len(np.unique(t[upper] < 0.5)) == 1
        assert len(np.unique(t[~upper] < 0.5)) == 1

    def test_dense_spikes_are_binned_to_rates(self) -> None:
        values = 1000.0 * (np.random.default_rng(3).random((4000, 30)) < 0.3)
        above, below, bar = picture("raster", spikes("s", values)).axes
        (image,) = above.images
        rates = np.asarray(image.get_array())
        assert rates.shape == (30, 400)
        expected = values.reshape(400, 10, 30).mean(axis=1)
        np.testing.assert_allclose(np.sort(rates.sum(axis=1)), np.sort(expected.sum(axis=0)))
        np.testing.assert_allclose(rates.mean(axis=0), expected.mean(axis=1))
        assert bar.get_ylabel() == "rate in 10 ms bins [Hz]"
        np.testing.assert_allclose(image.get_extent(), (0.0, 4.0, -0.5, 29.5))
        assert below.get_xlim() == pytest.approx((0.0, 4.0))

    def test_population_rate_of_a_regular_population(self) -> None:
        # One of ten neurons fires at each tick of 1 ms: 100 Hz each, at the ends of the run too.
        values = np.tile(1000.0 * np.eye(10), (40, 1))
        below = picture("raster", spikes("s", values)).axes[-1]
        (line,) = lines(below).values()
        np.testing.assert_allclose(xy(line)[:, 1], 100.0)

    def test_no_spikes(self) -> None:
        figure = picture("raster", spikes("s", np.zeros((100, 5))))
        assert rendered(figure)
        assert "no spikes" in texts(figure.axes[0])

    def test_ticks_that_were_not_recorded_are_noted(self) -> None:
        values = 1000.0 * (np.random.default_rng(4).random((200, 5)) < 0.2)
        figure = picture("raster", spikes("s", values, dt=10 * DT))
        assert any("1 tick in 10 recorded" in text for text in texts(figure.axes[-1]))

    @pytest.mark.parametrize("chance", [0.01, 0.5])
    def test_two_ensembles(self, chance: float) -> None:
        rng = np.random.default_rng(5)
        probes = [
            spikes(f"{name}.spikes", 1000.0 * (rng.random((3000, n)) < chance))
            for name, n in (("snn_v", 20), ("snn_omega", 40))
        ]
        figure = picture("raster", *probes)
        rendered(figure)
        first, second, rates = figure.axes[:3]
        assert first.get_ylabel().startswith("snn_v\n")
        assert second.get_ylabel().startswith("snn_omega\n")
        assert list(lines(rates)) == ["snn_v", "snn_omega"]

    def test_an_ensemble_of_the_library(self) -> None:
        graph = {
            "run": {"dt": 0.001, "until": 0.2},
            "blocks": {
                "x": {"type": "Constant", "value": 0.5},
                "snn": {"type": "AdaptiveEnsemble", "neurons": 30},
            },
            "wires": {"snn": {"input": "x.value", "error": "x.value"}},
            "plots": {"s": {"kind": "raster", "of": "snn.spikes"}},
        }
        run = runtime.load(graph).run()
        above, below = run.plot("s").axes
        (marks,), (rate,) = lines(above).values(), lines(below).values()
        assert len(xy(marks)) == np.count_nonzero(run["snn.spikes"])
        assert np.isfinite(xy(rate)).all()
        # A moving mean keeps the total, except at the ends of the run.
        assert xy(rate)[:, 1].mean() == pytest.approx(run["snn.spikes"].mean(), rel=0.1)


class TestHeatmap:
    def test_values_of_both_signs_have_a_diverging_colour_map(self) -> None:
        values = np.random.default_rng(6).normal(size=(50, 30)) + 0.5
        axes, bar = picture("heatmap", vector("snn.w", values, "V")).axes
        (image,) = axes.images
        np.testing.assert_array_equal(np.asarray(image.get_array()), values.T)
        low, high = image.get_clim()
        assert (low, high) == (-np.abs(values).max(), np.abs(values).max())
        assert image.get_cmap().name == "RdBu_r"
        assert (bar.get_ylabel(), axes.get_ylabel(), axes.get_xlabel()) == (
            "snn.w [V]",
            "index",
            "time [s]",
        )
        np.testing.assert_allclose(image.get_extent(), (0.0, 0.05, -0.5, 29.5))

    def test_values_of_one_sign_have_a_sequential_colour_map(self) -> None:
        values = np.linspace(1.0, 2.0, 60).reshape(20, 3)
        (image,) = picture("heatmap", vector("w", values)).axes[0].images
        assert image.get_cmap().name == "viridis"
        assert image.get_clim() == (1.0, 2.0)

    def test_tables_are_flattened(self) -> None:
        values = np.arange(24.0).reshape(4, 2, 3) - 10.0
        table = recorded("a.weights", values, ["a.weights[0]", "a.weights[1]"], ["", ""], ["State"])
        axes, bar = picture("heatmap", table).axes
        (image,) = axes.images
        np.testing.assert_array_equal(np.asarray(image.get_array()), values.reshape(4, 6).T)
        assert bar.get_ylabel() == "a.weights"

    def test_few_rows_have_names(self, circle: Result) -> None:
        axes, bar = draw(circle.plots[2], circle).axes
        assert [label.get_text() for label in axes.get_yticklabels()] == ["x", "y", "theta"]
        assert bar.get_ylabel() == "plant.pose [mixed units]"

    def test_long_recordings_are_averaged(self) -> None:
        values = np.random.default_rng(7).normal(size=(10_500, 4))
        (image,) = picture("heatmap", vector("w", values)).axes[0].images
        drawn = np.asarray(image.get_array()).T
        assert len(drawn) <= 1000
        np.testing.assert_allclose(drawn[0], values[:11].mean(axis=0))
        np.testing.assert_allclose(drawn[-1], values[11 * (len(drawn) - 1) :].mean(axis=0))

    def test_infinity_is_left_out_of_means_and_scales(self) -> None:
        values = np.ones((2000, 3))
        values[::2, 0] = np.inf
        values[:, 1] = np.inf
        values[:, 2] = 5.0
        figure = picture("heatmap", vector("scan", values, "m", "Scan"))
        rendered(figure)
        (image,) = figure.axes[0].images
        assert image.get_clim() == (1.0, 5.0)
        array = np.ma.getmaskarray(np.ma.masked_invalid(np.ma.asarray(image.get_array())))
        assert array[1].all()
        assert not array[[0, 2]].any()

    def test_all_equal_and_all_infinite(self) -> None:
        for value in (0.0, 3.0, np.inf):
            assert rendered(picture("heatmap", vector("w", np.full((5, 3), value))))


class TestNames:
    @pytest.mark.parametrize(
        ("labels", "expected"),
        [
            (["error.position", "error.heading"], ["position", "heading"]),
            (["plant.pose.x", "plant.pose.y"], ["x", "y"]),
            (["snn_v.output", "snn_omega.output"], ["snn_v", "snn_omega"]),
            (["adaptive.command.omega"], ["command.omega"]),
            (["w.out.0", "w.out.1"], ["out.0", "out.1"]),
            (["a.x", "a.x.x"], ["x", "x.x"]),
            (["a.x", "b.y"], ["a.x", "b.y"]),
            (["x", "y"], ["x", "y"]),
            ([], []),
        ],
    )
    def test_short_labels(self, labels: list[str], expected: list[str]) -> None:
        assert style.short_labels(labels) == expected

    @given(
        st.lists(
            st.lists(st.sampled_from("ab0"), min_size=1, max_size=4).map(".".join), unique=True
        )
    )
    def test_short_labels_stay_distinct(self, labels: list[str]) -> None:
        assert len(set(style.short_labels(labels))) == len(labels)

    @pytest.mark.parametrize(
        ("labels", "unit", "expected"),
        [
            (["position"], "m", "position [m]"),
            (["v"], "", "v"),
            (["x", "y"], "m", "x, y [m]"),
            ([f"w[{i}]" for i in range(8)], "1/s", "w [1/s]"),
            (["a", "b", "c", "d"], "m", "[m]"),
            (["a_rather_long_name.of_it"], "rad/s", "a_rather_long_name.of_it\n[rad/s]"),
        ],
    )
    def test_axis_label(self, labels: list[str], unit: str, expected: str) -> None:
        assert style.axis_label(labels, unit) == expected


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300).map(np.array),
    st.integers(min_value=4, max_value=50),
)
def test_thinning_keeps_points_ends_and_extremes(y: Any, most: int) -> None:
    t = np.arange(len(y), dtype=np.float64)
    thin_t, thin_y = thin(t, y, most)
    np.testing.assert_array_equal(thin_y, y[thin_t.astype(int)])
    assert (thin_t[0], thin_t[-1]) == (0.0, len(y) - 1)
    assert (thin_y.min(), thin_y.max()) == (y.min(), y.max())
    assert len(thin_y) <= most + 4
    assert (np.diff(thin_t) > 0.0).all()


@given(st.integers(1, 60), st.integers(1, 20))
def test_block_means_are_means_of_equal_blocks(rows: int, size: int) -> None:
    values = np.random.default_rng(rows).normal(size=(rows, 3))
    expected = [values[i : i + size].mean(axis=0) for i in range(0, rows, size)]
    np.testing.assert_allclose(block_means(values, size), expected)


def test_a_wrapped_angle_has_gaps_and_a_plane_equal_scales() -> None:
    graph = {
        "graph": "g",
        "run": {"dt": 0.01, "until": 10.0},
        "blocks": {
            "turn": {"type": "DifferentialDrive", "x0": [1.0, 0.0, 1.5]},
            "spin": {"type": "Constant", "value": [1.0, 1.0], "signal": "Twist"},
        },
        "wires": {"turn": {"command": "spin.value"}},
        "plots": {
            "heading": {"kind": "timeseries", "of": "turn.pose.theta"},
            "way": {"kind": "xy", "of": ["turn.pose.x", "turn.pose.y"]},
        },
    }
    figures = runtime.load(graph).run().plot()
    assert figures["way"].axes[0].get_aspect() == 1.0
    t = np.linspace(0.0, 9.0, 901)
    wrapped = np.remainder(t + np.pi, 2.0 * np.pi) - np.pi
    shown = style.gaps_at_turns(t, wrapped)
    assert np.isnan(shown[1]).sum() == 1 and np.nanmax(np.abs(np.diff(shown[1]))) < 0.02
    assert style.gaps_at_turns(t, 2.0 * wrapped)[1] is not wrapped
    np.testing.assert_array_equal(style.gaps_at_turns(t, 2.0 * wrapped)[1], 2.0 * wrapped)
