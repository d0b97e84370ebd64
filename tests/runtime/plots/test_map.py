"""Maps, wall distances and scans show the recorded data; their options are checked."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.text import Text
from PIL import Image

import runtime
from blocks.core.signals import FloatArray
from blocks.world.world import World
from runtime.errors import GraphError, UsageError
from runtime.observation.reader import PlotSpec
from runtime.observation.run_data import Recording
from runtime.plots import animate, animated_plot, film, scans
from runtime.plots import map as maps
from runtime.plots.figures import draw
from runtime.plots.style import run_end
from runtime.runs import read_run
from runtime.runs.result import Result

ROOM = {
    "room": [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]],
    "circles": [[0.3, -1.5, 0.5]],
}
PLOTS: dict[str, dict[str, Any]] = {
    "room": {
        "kind": "map",
        "of": ["pose", "match.reference"],
        "engaged": "explore.engaged",
        "distance": 0.2,
    },
    "distance": {"kind": "wall_distance", "of": "pose", "distance": 0.2},
    "scans": {
        "kind": "scans",
        "of": ["pose", "lidar.scan", "fitter.wall", "fitter.path"],
        "distance": 0.2,
    },
}


def graph(**changes: Any) -> dict[str, Any]:
    """A robot with a LiDAR that drives an arc past walls."""
    plain: dict[str, Any] = {
        "graph": "arc",
        "run": {"dt": 0.01, "until": 1.5, "seed": 0},
        "world": ROOM,
        "blocks": {
            "lidar": {"type": "Lidar", "beams": 180, "angle_min": -2.0, "angle_max": 1.5},
            "explore": {"type": "Explorer", "engage_distance": 1.6, "explore_time": 0.5},
            "fitter": {
                "type": "WallFitter",
                "angle_min": -2.0,
                "angle_max": 1.5,
                "window": [-2, 1],
            },
            "match": {"type": "MatchingPoint"},
            "go": {"type": "Constant", "signal": "Twist", "value": [0.5, 0.3]},
            "plant": {"type": "DifferentialDrive", "x0": [-1.0, -1.6, 0.0], "body_radius": 0.1},
        },
        "wires": {
            "lidar": {"pose": "plant.pose"},
            "explore": {"scan": "lidar.scan", "pose": "plant.pose"},
            "fitter": {"scan": "lidar.scan", "pose": "plant.pose"},
            "match": {"pose": "plant.pose", "path": "fitter.path"},
            "plant": {"command": "go.value"},
        },
        "probes": {"pose": "plant.pose"},
        "plots": PLOTS,
    }
    for name in ("lidar", "explore", "fitter"):
        plain["blocks"][name]["dt"] = 0.1
    return {**plain, **changes}


@pytest.fixture(scope="module")
def run() -> Result:
    done = runtime.load(graph()).run()
    assert isinstance(done, Result)
    return done


def picture(run: Result, name: str) -> Figure:
    figure = run.plot(name)
    assert isinstance(figure, Figure)
    return figure


def line(axes: Axes, label: str) -> FloatArray:
    """The points of the line with a label, (points, 2)."""
    (found,) = [item for item in axes.lines if item.get_label() == label]
    return np.asarray(found.get_xydata(), dtype=np.float64)


def body(axes: Axes) -> Circle:
    (found,) = [item for item in axes.patches if item.get_gid() == "robot"]
    assert isinstance(found, Circle)
    return found


def problems(**plot: Any) -> list[str]:
    """The error of a graph whose only plot is this one."""
    with pytest.raises(GraphError) as caught:
        runtime.load(graph(plots={"p": plot})).check()
    return [f"{problem.address}: {problem.text}" for problem in caught.value.problems]


class TestMap:
    def test_shows_the_trajectory_and_its_dots(self, run: Result) -> None:
        axes = picture(run, "room").axes[0]
        pose = run["pose"]
        np.testing.assert_array_equal(line(axes, "trajectory"), pose[:, :2])
        np.testing.assert_array_equal(line(axes, "start"), pose[:1, :2])
        engaged = float(run.time("explore.engaged")[np.argmax(run["explore.engaged"] > 0.5)])
        assert engaged > 0.0
        at = round(engaged / 0.01)
        np.testing.assert_array_equal(line(axes, "following begins"), pose[at : at + 1, :2])

    def test_reference_points_from_engagement_on(self, run: Result) -> None:
        axes = picture(run, "room").axes[0]
        engaged = float(run.time("explore.engaged")[np.argmax(run["explore.engaged"] > 0.5)])
        late = run["match.reference"][run.time("match.reference") >= engaged - 1e-9, :2]
        shown = [np.asarray(item.get_xydata()) for item in axes.lines if item.get_marker() == "."]
        np.testing.assert_array_equal(shown[0], late)

    def test_contour_and_walls(self, run: Result) -> None:
        axes = picture(run, "room").axes[0]
        contour = line(axes, "200 mm from walls")
        kept = contour[np.isfinite(contour).all(axis=1)]
        assert np.allclose(World(ROOM).distance(kept), 0.2, atol=1e-9)
        corners = {tuple(row) for patch in axes.patches for row in patch.get_path().vertices}
        assert {(-2.0, -2.0), (2.0, 2.0)} <= corners

    def test_robot_at_the_end_with_its_heading(self, run: Result) -> None:
        axes = picture(run, "room").axes[0]
        x, y, theta = run["pose"][-1]
        assert body(axes).get_center() == (x, y)
        assert body(axes).get_radius() == 0.1
        ahead = [x + 0.1 * math.cos(theta), y + 0.1 * math.sin(theta)]
        assert any(np.allclose(item.get_xydata()[-1:], ahead) for item in axes.lines)

    def test_both_axes_have_the_same_scale(self, run: Result) -> None:
        assert picture(run, "room").axes[0].get_aspect() == 1.0

    def test_no_reference_points_before_engagement(self) -> None:
        quiet = runtime.load(graph()).set("blocks.explore.explore_time", 60.0).run()
        axes = picture(quiet, "room").axes[0]
        dots = [item for item in axes.lines if item.get_marker() == "."]
        assert len(np.asarray(dots[0].get_xydata())) == 0

    def test_obstacles_are_closed_and_in_view(self) -> None:
        axes = Figure().subplots()
        world = World({"obstacles": [[[1, 0], [2, 0], [2, 1], [1, 1]]]})
        maps.draw_world(axes, world)
        corners = np.asarray(axes.patches[0].get_path().vertices)
        np.testing.assert_array_equal(corners[0], corners[-1])
        low, high = maps.view_limits(world, np.array([[0.0, 0.0], [np.nan, 1.0]]))
        assert (low < [0.0, 0.0]).all()
        assert (high > [2.0, 1.0]).all()

    def test_without_options(self) -> None:
        plain = runtime.load(graph(plots={"p": {"kind": "map", "of": "plant.pose"}})).run()
        labels = [item.get_label() for item in picture(plain, "p").axes[0].lines]
        assert "trajectory" in labels
        assert "following begins" not in labels


class TestWallDistance:
    def test_is_the_distance_minus_the_reference(self, run: Result) -> None:
        axes = picture(run, "distance").axes[0]
        shown = line(axes, "error")
        expected = 1e3 * (World(ROOM).distance(run["pose"][:, :2]) - 0.2)
        np.testing.assert_allclose(shown[:, 1], expected)
        np.testing.assert_array_equal(shown[:, 0], run.time("pose"))


class TestScans:
    def test_scanned_points_lie_on_the_walls(self, run: Result) -> None:
        for axes in picture(run, "scans").axes:
            points = line(axes, "scan")
            assert len(points) > 100
            assert np.abs(World(ROOM).distance(points)).max() < 0.06  # six sigma

    def test_wall_and_path_at_that_time(self, run: Result) -> None:
        plot = next(plot for plot in run.plots if plot.name == "scans")
        figure = picture(run, "scans")
        for axes, t in zip(figure.axes, scans.panel_times(plot, run), strict=True):
            row = int((t + 1e-9) / 0.1)
            np.testing.assert_array_equal(
                line(axes, "reference path"), run["fitter.path"][row, :, :2]
            )
            wall = line(axes, "fitted wall")
            kept = wall[np.isfinite(wall).all(axis=1)]
            np.testing.assert_array_equal(kept, run["fitter.wall"][row])

    def test_panel_times(self, run: Result) -> None:
        plot = PlotSpec("p", "scans", ("pose", "lidar.scan"), "P", {"at": [0.4, 0.9, 7.0]})
        assert scans.panel_times(plot, run) == [0.4, 0.9]
        assert len(draw(plot, run).axes) == 2
        assert scans.panel_times(PlotSpec("p", "scans", ("pose",), "P", {"at": 9}), run) == [1.5]

    def test_bearings_and_radius_come_from_the_blocks(self, run: Result) -> None:
        plot = next(plot for plot in run.plots if plot.name == "scans")
        assert plot.options["angles"] == [-2.0, 1.5]
        assert plot.options["body_radius"] == 0.1

    def test_beams_without_a_hit_are_left_out(self) -> None:
        scan = np.array([1.0, np.inf, np.nan, 2.0])
        points = maps.scan_points(scan, np.array([1.0, 1.0, math.pi / 2.0]), (0.0, math.tau))
        np.testing.assert_allclose(points, [[1.0, 2.0], [3.0, 1.0]])

    def test_several_walls_are_not_joined(self) -> None:
        x = np.array([0.0, 0.1, 0.2, 2.0, 2.1])
        broken = maps.split_curves(np.column_stack([x, x]))
        assert np.flatnonzero(np.isnan(broken[:, 0])).tolist() == [3]
        assert len(maps.split_curves(np.ones((3, 2)))) == 3


class TestOptions:
    def test_needs_a_world(self) -> None:
        plain = graph(plots={"p": {"kind": "map", "of": "go.value"}})
        blocks = {name: plain["blocks"][name] for name in ("go", "plant")}
        plain |= {"blocks": blocks, "wires": {"plant": {"command": "go.value"}}, "world": None}
        plain["blocks"]["plant"] = {"type": "DifferentialDrive"}
        plain["plots"]["p"]["of"] = "plant.pose"
        with pytest.raises(GraphError, match=r"plots\.p\.kind: needs a world, as in 'world:"):
            runtime.load(plain).check()

    @pytest.mark.parametrize(
        ("plot", "text"),
        [
            ({"distence": 0.2}, "plots.p.distence: unknown key, did you mean 'distance'?"),
            ({"at": 3.0}, "plots.p.at: unknown key"),
            ({"distance": 0}, "plots.p.distance: expected a number above 0 m, got 0"),
            ({"distance": "far"}, "plots.p.distance: expected a number above 0 m, got the string"),
            ({"body_radius": -1}, "plots.p.body_radius: expected a number above 0 m, got -1"),
            ({"engaged": "explore.engage"}, "plots.p.engaged: 'explore' has no output"),
            ({"engaged": "pose"}, "plots.p.engaged: expected one column, got 3; name one of them"),
            ({"engaged": 3}, "plots.p.engaged: expected a probe's name or an address, got 3"),
            ({"of": ["pose", "lidar.scan"]}, "plots.p.of: a map needs one Pose, as in plant.pose"),
        ],
    )
    def test_of_a_map(self, plot: dict[str, Any], text: str) -> None:
        (message,) = problems(**{"kind": "map", "of": "pose", **plot})
        assert message.startswith(text)

    @pytest.mark.parametrize(
        ("plot", "text"),
        [
            (
                {"at": []},
                "plots.p.at: expected a number or an array of n numbers",
            ),
            (
                {"at": [1, -2]},
                "plots.p.at: expected a number or an array of n numbers",
            ),
            ({"angles": [1.0]}, "plots.p.angles: expected an array of 2 numbers in rad, got [1.0]"),
            ({"angles": [1.0, -1.0]}, "plots.p.angles: expected the scan's first bearing below"),
            ({"of": "lidar.scan"}, "plots.p.of: expected the robot's Pose among them"),
            ({"of": ["pose", "match.reference"]}, "plots.p.of: expected one Pose, got 2"),
            ({"of": ["pose", "go.value"]}, "plots.p.of: scans need one Pose, Scan, PointCloud"),
        ],
    )
    def test_of_scans(self, plot: dict[str, Any], text: str) -> None:
        (message,) = problems(**{"kind": "scans", "of": ["pose", "lidar.scan"], **plot})
        assert message.startswith(text)

    def test_of_a_distance(self) -> None:
        (message,) = problems(kind="wall_distance", of="pose")
        assert message == (
            "plots.p.distance: missing; expected a number above 0 m: "
            "the distance from the walls to follow"
        )
        (message,) = problems(kind="wall_distance", of=["pose", "match.reference"], distance=0.2)
        assert message == "plots.p.of: expected one Pose, got 2 signals"

    def test_other_plots_have_no_such_options(self) -> None:
        (message,) = problems(kind="timeseries", of="pose", distance=0.2)
        assert message.startswith(
            "plots.p.distance: unknown key; expected kind, of, title, labels, "
        )

    def test_removed_signals_are_left_out(self) -> None:
        cut = runtime.load(graph()).without("match", "fitter").run()
        assert [plot.of for plot in cut.plots] == [("pose",), ("pose",), ("pose", "lidar.scan")]
        assert all(isinstance(cut.plot(plot.name), Figure) for plot in cut.plots)


class TestSaved:
    def test_world_and_options_are_read_back(self, run: Result, tmp_path: Path) -> None:
        again = runtime.open(run.save(tmp_path / "run"))
        assert again.world == run.world == World(ROOM)
        assert again.plots == run.plots
        axes = picture(again, "room").axes[0]
        np.testing.assert_array_equal(line(axes, "trajectory"), run["pose"][:, :2])

    def test_a_run_without_world_has_no_map(self, run: Result) -> None:
        bare = Result("bare", run.probes, {}, run.plots, run.manifest)
        for plot in bare.plots:
            with pytest.raises(UsageError, match=f"plot '{plot.name}' needs a world"):
                draw(plot, bare)

    def test_nothing_recorded(self, run: Result) -> None:
        empty = {
            name: Recording(
                name, r.t[:0], r.values[:0], r.labels, r.units, r.kinds, dict(r.addresses)
            )
            for name, r in run.probes.items()
        }
        failed = Result(
            "f", empty, {}, run.plots, {"ticks": 0, "status": "failed"}, world=run.world
        )
        for plot in failed.plots:
            figure = draw(plot, failed)
            figure.draw_without_rendering()
            shown = [text.get_text() for axes in figure.axes for text in axes.texts]
            assert "f  ·  failed at 0 s" in shown
            drawn = {
                item.get_label()
                for axes in figure.axes
                for item in axes.lines
                if len(item.get_xdata())
            }
            assert drawn <= {"200 mm from walls"}
            assert ("nothing recorded" in shown) == (not drawn)


class TestAnimation:
    @pytest.mark.slow
    def test_is_a_gif_that_moves(
        self, run: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(film, "FRAMES", 8)
        file = animate(run, tmp_path / "new" / "run.gif")
        with Image.open(file) as gif:
            assert gif.format == "GIF"
            assert getattr(gif, "n_frames", 0) == 8
            first = np.asarray(gif.convert("RGB"), dtype=int)
            gif.seek(7)
            last = np.asarray(gif.convert("RGB"), dtype=int)
        assert first.shape == last.shape
        assert np.abs(first - last).max() > 100

    def test_time_is_above_what_was_run(
        self, run: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown: list[str] = []

        def watched(figure: Any, canvas: Any, frame: Any = film._frame) -> Any:
            axes = figure.axes[0]
            (subtitle,) = (t for t in axes.texts if t.get_gid() == "subtitle")
            (clock,) = (t for t in axes.findobj(Text) if "real time" in t.get_text())
            lower, upper = subtitle.get_window_extent(), clock.get_window_extent()
            assert lower.y1 <= upper.y0 and upper.y1 <= figure.bbox.y1
            shown.append(clock.get_text())
            return frame(figure, canvas)

        monkeypatch.setattr(film, "FRAMES", 3)
        monkeypatch.setattr(film, "_frame", watched)
        animate(run, tmp_path / "run.gif")
        end = run_end(run)
        speed = f"{end * film.RATE / 3:.2g} × real time"
        assert shown == [f"t = {t:5.1f} s, {speed}" for t in (0.0, end / 2, end)]

    def test_a_frame_is_what_was_drawn_though_only_its_changes_are_written(
        self, run: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        drawn: list[Any] = []

        def watched(figure: Any, canvas: Any, frame: Any = film._frame) -> Any:
            drawn.append(frame(figure, canvas))
            return drawn[-1]

        monkeypatch.setattr(film, "FRAMES", 5)
        monkeypatch.setattr(film, "_frame", watched)
        with Image.open(animate(run, tmp_path / "run.gif")) as written:
            shown = []
            for i in range(5):
                written.seek(i)
                shown.append(np.asarray(written.convert("RGB"), float))
        for now, image in zip(shown, drawn, strict=True):
            off = np.abs(now - np.asarray(image, float))
            assert np.mean(off) < 1.0 and np.mean(off.max(axis=2) > 48) < 2e-3
            assert (now[0, 0] == 255.0).all()
        full = tmp_path / "full.gif"
        drawn[0].save(full, save_all=True, append_images=drawn[1:], optimize=False)
        assert (tmp_path / "run.gif").stat().st_size < 0.6 * full.stat().st_size

    def test_of_a_run_without_ticks(self, run: Result, tmp_path: Path) -> None:
        none = {
            name: Recording(
                name, r.t[:0], r.values[:0], r.labels, r.units, r.kinds, dict(r.addresses)
            )
            for name, r in run.probes.items()
        }
        failed = Result("f", none, {}, run.plots, {"ticks": 0, "status": "failed"}, world=run.world)
        assert animate(failed, tmp_path / "f.gif").exists()

    def test_scans_come_before_a_map_and_a_map_before_a_trajectory(self, run: Result) -> None:
        way = PlotSpec("way", "trajectory", ("pose",), "Way")
        plots = [way, *run.plots]
        assert animated_plot(plots, run.world).kind == "scans"
        assert animated_plot(plots[:2], run.world).kind == "map"
        assert animated_plot(plots, None) is way
        with pytest.raises(UsageError, match=r"add one, as in 'plots: \{path: \{kind: trajectory"):
            animated_plot(run.plots, None)

    def test_refused_before_the_run(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        from runtime.cli import run as cli

        out = tmp_path / "runs"
        assert cli(["run", "gallery/pendulum", "--animate", "--out", str(out)]) == 2
        assert "nothing to animate" in capsys.readouterr().err
        assert not out.exists()

    @pytest.mark.parametrize("vs", [[], ["--vs", "without=adaptive"]])
    def test_two_robots_without_a_world_are_in_one_film(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
        vs: list[str],
    ) -> None:
        from runtime.cli import run as cli

        seen: list[tuple[list[str], list[FloatArray]]] = []

        def watched(figure: Any, canvas: Any, frame: Any = film._frame) -> Any:
            axes = figure.axes[0]
            bodies = [p.get_center() for p in axes.patches if p.get_gid() == "robot"]
            names = [t.get_text() for t in figure.legends[0].get_texts()]
            seen.append((names, [np.array(at) for at in bodies]))
            return frame(figure, canvas)

        monkeypatch.setattr(film, "FRAMES", 3)
        monkeypatch.setattr(film, "_frame", watched)
        run = ["run", "line_actuator_failure", "--until", "4", "--animate", "--no-plots", "-q", *vs]
        assert cli([*run, "--out", str(tmp_path)]) == 0, capsys.readouterr().err
        names, bodies = seen[-1]
        assert len(bodies) == (2 if vs else 1)
        assert ("with adaptive" in names and "without adaptive" in names) == bool(vs)
        made = runtime.load("line_actuator_failure").set("run.until", 4.0)
        for graph, body in zip((made, made.without("adaptive")), bodies, strict=False):
            np.testing.assert_allclose(body, graph.run()["pose"][-1, :2], atol=0.02)

    def test_from_the_command_line(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        from runtime.cli import run as cli

        monkeypatch.setattr(film, "FRAMES", 3)
        run = ["run", "wall_following", "--until", "0.5", "--animate", "--no-plots", "-q"]
        assert cli([*run, "--out", str(tmp_path)]) == 0
        assert "plots/animation.gif" in capsys.readouterr().out
        files = sorted((tmp_path / "wall_following" / "latest" / "plots").iterdir())
        assert [file.name for file in files] == ["animation.gif"]


def touching(run: Result, **plot: Any) -> list[FloatArray]:
    """The positions that are marked as contacts in a figure."""
    figure = draw(PlotSpec("p", title="P", **plot), run)
    return [
        np.asarray(line.get_xydata())
        for axes in figure.axes
        for line in axes.lines
        if line.get_label() == "contact"
    ]


@pytest.mark.parametrize("kind", ["map", "trajectory"])
def test_contacts_are_marked(kind: str, tmp_path: Path) -> None:
    """A robot drives straight into a wall at x = 2: its body of 0.1 m touches from x = 1.9 on."""
    blocks = {
        "go": {"type": "Constant", "value": [1.0, 0.0], "signal": "Twist"},
        "plant": {"type": "DifferentialDrive", "body_radius": 0.1},
    }
    document: dict[str, Any] = {
        "run": {"dt": 0.01, "until": 3.0},
        "world": {"room": ROOM["room"]},
        "blocks": blocks,
        "wires": {"plant": {"command": "go.value"}},
        "probes": {"pose": "plant.pose", "contact": "plant.contact"},
        "plots": {"way": {"kind": kind, "of": "pose"}},
    }
    run = runtime.load(document).run()
    options = run.plots[0].options
    assert options["body_radius"] == 0.1
    (marked,) = touching(run, kind=kind, of=("pose",), options=options)
    np.testing.assert_array_equal(marked, run["pose"][run["contact"] > 0.5, :2])
    np.testing.assert_allclose(marked, [[1.9, 0.0]] * len(marked), atol=1e-5)
    assert 100 < len(marked) < 115
    free = runtime.load(document).set("run.until", 1.0).run()
    assert touching(free, kind=kind, of=("pose",), options=options) == []
    kept = read_run(run.save(tmp_path / "run"))
    legend = draw(kept.plots[0], kept).legends[0]
    assert "contact" in [text.get_text() for text in legend.get_texts()]


def test_robot_without_known_radius() -> None:
    axes = Figure().subplots()
    maps.Robot(axes, None).move(np.array([1.0, 2.0, 0.0]))
    assert body(axes).get_center() == (1.0, 2.0)
    assert isinstance(axes.lines[0], Line2D)
