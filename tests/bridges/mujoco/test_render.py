"""Pictures and films of a run: positions in them, and the errors when there are none."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import runtime
from blocks import World
from runtime.errors import UsageError
from spikeblocks.mujoco.rendering.motion import Motion, recorded_motion
from spikeblocks.mujoco.rendering.views import MARGIN, bar_length, extent_of
from tests.conftest import Run
from tests.extras import install_line

SECONDS = 4.0
HEIGHT = 400


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot that turned and stands in its room; it was recorded twenty times a second."""
    graph = runtime.load("wall_following_mujoco").without("adaptive").set("plots", {})
    result = graph.set("metrics", {}).run(until=SECONDS, seed=2)
    return result.save(tmp_path_factory.mktemp("runs") / "a_run")


@pytest.fixture(scope="module")
def drawn(script: Path, run_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a picture and a film from above; skipped where nothing can draw."""
    folder = tmp_path_factory.mktemp("drawn") / "out"
    request = ["render", str(run_folder), "--out", str(folder), "--view", "top"]
    request += ["--height", str(HEIGHT), "--film-height", "128"]
    request += ["--from", "1", "--until", "3", "--speed", "2", "--fps", "4"]
    done = subprocess.run([str(script), *request], capture_output=True, text=True)
    if done.returncode == 4:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(folder / f"render.{e}") for e in ("png", "mp4")]
    return folder


def pixel(motion: Motion, x: float, y: float) -> tuple[int, int]:
    """Row and column of a position in a picture from above."""
    extent = extent_of(motion.world, motion.states[:, 1:3])
    scale = HEIGHT / (2.0 * extent.reach)
    return round(HEIGHT / 2 - (y - extent.y) * scale), round(HEIGHT / 2 + (x - extent.x) * scale)


def around(image: np.ndarray, at: tuple[int, int], half: int = 3) -> np.ndarray:
    row, column = at
    return image[row - half : row + half + 1, column - half : column + half + 1].reshape(-1, 3)


@pytest.mark.slow
def test_robot_trail_and_hits_are_in_their_positions(drawn: Path, run_folder: Path) -> None:
    motion = recorded_motion(run_folder)
    with Image.open(drawn / "render.png") as opened:
        image = np.asarray(opened).astype(int)
    assert image.shape == (HEIGHT, HEIGHT, 3)
    way = motion.states[:, 1:3]
    red, green, blue = np.moveaxis(image, -1, 0)
    # The LiDAR's turret is orange, the hull around it dark.
    turret = around(image, pixel(motion, *way[-1]), 1).mean(axis=0)
    assert turret[0] > 1.3 * turret[1] > 1.3 * turret[2]
    for angle in np.arange(4) * 0.5 * math.pi + 0.7:
        beside = way[-1] + 0.1 * np.array([math.cos(angle), math.sin(angle)])
        assert around(image, pixel(motion, *beside)).mean() < 80
    # The trail is green where the hull does not cover it.
    shown = way[np.hypot(*(way - way[-1]).T) > 0.2]
    greens = [(around(image, pixel(motion, *p)) @ (-1, 2, -1)).max() > 60 for p in shown]
    assert len(shown) > 20
    assert np.mean(greens) > 0.95
    # Red marks are only on surfaces.
    marks = np.argwhere((red > 180) & (green < 100) & (blue < 100))
    extent = extent_of(motion.world, way)
    scale = 2.0 * extent.reach / HEIGHT
    places = np.column_stack(
        (
            extent.x + (marks[:, 1] + 0.5 - HEIGHT / 2) * scale,
            extent.y - (marks[:, 0] + 0.5 - HEIGHT / 2) * scale,
        )
    )
    from_robot = np.hypot(*(places - way[-1]).T) > 0.2
    assert from_robot.sum() > 100
    assert np.abs(motion.world.distance(places[from_robot])).max() < 0.04


@pytest.mark.slow
def test_the_film_has_all_frames(drawn: Path) -> None:
    decode = (imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i")
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-")
    done = subprocess.run([*decode, str(drawn / "render.mp4"), *raw], capture_output=True)
    assert done.returncode == 0, done.stderr
    pictures = np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, 128, 128, 3).astype(int)
    assert len(pictures) == (3 - 1) / 2 * 4
    assert np.abs(pictures[-1] - pictures[0]).max() > 50, "something moved"


@pytest.mark.slow
def test_both_views_side_by_side_and_json(cli: Run, run_folder: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(run_folder, tmp_path / "copy")
    done = cli("render", str(copy), "--no-film", "--height", "120", "--at", "1", "--json")
    if done.returncode == 4:
        pytest.skip(done.stderr)
    assert json.loads(done.stdout) == {
        "schema_version": 1,
        "files": [str(copy / "plots" / "render.png")],
    }
    with Image.open(copy / "plots" / "render.png") as image:
        assert image.size == (120 + 160, 120)


def test_the_motion_is_what_was_recorded(run_folder: Path) -> None:
    motion = recorded_motion(run_folder, "plant")
    with np.load(run_folder / "probes.npz") as stored:
        np.testing.assert_array_equal(motion.states, stored["physics"])
        np.testing.assert_array_equal(motion.t, stored["physics.time"])
    assert motion.robot.body_radius == 0.17


@pytest.mark.parametrize(("width", "length"), [(4.3, 1.0), (39.0, 5.0), (0.9, 0.2), (8.0, 2.0)])
def test_the_scale_is_a_round_length_within_a_quarter_of_the_width(
    width: float, length: float
) -> None:
    assert bar_length(width) == pytest.approx(length)


@pytest.mark.slow
def test_the_scale_bar_is_as_long_as_it_says(drawn: Path, run_folder: Path) -> None:
    pixels = np.asarray(Image.open(drawn / "render.png").convert("RGB")).astype(int)
    motion = recorded_motion(run_folder)
    reach = extent_of(motion.world, motion.states[:, 1:3]).reach
    is_ink = (np.abs(pixels - 40) <= 2).all(axis=2)
    ends = [np.flatnonzero(np.diff(np.pad(row.astype(int), 1))) for row in is_ink]
    longest = max(int(np.diff(found)[::2].max(initial=0)) for found in ends)
    assert longest == pytest.approx(bar_length(2.0 * reach) * HEIGHT / (2.0 * reach), abs=2)


def test_an_extent_covers_everything() -> None:
    world = World({"circles": [[1.0, 0.0, 0.5]]})
    extent = extent_of(world, np.array([[-2.0, 0.0], [0.0, 1.0]]))
    assert (extent.x, extent.y) == (-0.25, 0.25)
    assert extent.reach == pytest.approx(1.75 + MARGIN)


@pytest.mark.slow
def test_runs_with_nothing_to_draw(cli: Run, run_folder: Path, tmp_path: Path) -> None:
    graph = runtime.load("wall_following").without("adaptive").set("plots", {})
    planar = graph.set("metrics", {}).run(until=0.1).save(tmp_path / "planar")
    done = cli("render", str(planar))
    assert done.returncode == 2
    assert "has no MujocoVacuum in its graph: nothing to render" in done.stderr
    bare = runtime.load("wall_following_mujoco").without("adaptive").set("plots", {})
    bare = bare.set("metrics", {}).set("probes.physics", None)
    done = cli("render", str(bare.run(until=0.1).save(tmp_path / "bare")))
    assert done.returncode == 2
    assert "record them with probes: {physics: {of: plant.physics, every: 50}}" in done.stderr
    done = cli("render", str(run_folder), "--from", "4")
    assert done.returncode == 2
    assert done.stderr == "the film cannot begin at 4 s: the recording ends at 3.95 s\n"
    done = cli("render", str(tmp_path / "nowhere"))
    assert done.returncode == 2
    assert "expected a run folder" in done.stderr
    with pytest.raises(UsageError, match="no MujocoVacuum 'plnt', did you mean 'plant'"):
        recorded_motion(run_folder, "plnt")


@pytest.mark.slow
def test_missing_libraries_are_named(cli: Run, run_folder: Path, tmp_path: Path) -> None:
    package = tmp_path / "hidden" / "imageio_ffmpeg"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('not here')", encoding="utf-8")
    hidden = {**os.environ, "PYTHONPATH": str(package.parent)}
    done = cli("render", str(run_folder), env=hidden)
    assert done.returncode == 4
    line = install_line("render")
    assert done.stderr == f"runtime render needs an optional extra: {line}\n"
    done = cli("render", str(run_folder), env={**os.environ, "MUJOCO_GL": "nonsense"})
    assert done.returncode == 4
    assert "nonsense: RuntimeError" in done.stderr
    assert "apt-get install libegl1" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--height", "101"), "expected an even number from 64 to 2160, got '101'"),
        (("--fps", "0"), "expected an integer from 1 to 240, got '0'"),
        (("--speed", "-1"), "expected a number of at least 0.001, got '-1'"),
        (("--view", "below"), "invalid choice: 'below'"),
    ],
)
def test_invalid_options(cli: Run, arguments: tuple[str, str], message: str) -> None:
    done = cli("render", "nowhere", *arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_latest_that_leads_elsewhere_is_not_written_through(cli: Run, tmp_path: Path) -> None:
    run = runtime.load("starters/adaptive").set("plots", {}).set("metrics", {}).run(until=0.01)
    run.save(tmp_path / "run")
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "latest").symlink_to(tmp_path / "run")
    done = cli("render", "foreign/latest")
    assert done.returncode == 2
    assert "is a link that leads to" in done.stderr
