"""Reading runs: the data equals what was saved, and damaged files give an error of one line."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

import runtime
from runtime.document import RUN_KEYS
from runtime.errors import UsageError
from runtime.runs.draft import link_latest
from runtime.runs.folder import run_folder
from runtime.runs.result import open_run
from tests.examples import examples

GRAPH = {
    "graph": "small",
    "run": {"dt": 0.01, "until": 0.2, "seed": 3},
    "world": {"circles": [[3.0, 0.0, 0.5]]},
    "blocks": {
        "go": {"type": "Constant", "value": [1.0, 0.5], "signal": "Twist"},
        "plant": {"type": "DifferentialDrive"},
        "track": {"type": "LinePath", "samples": 7},
    },
    "wires": {"plant": {"command": "go.value"}},
    "probes": {
        "pose": {"of": "plant.pose", "every": 5},
        "both": ["plant.pose.x", "plant.pose"],
        "path": "track.path",
    },
    "plots": {"way": {"kind": "map", "of": ["plant.pose"], "distance": 0.5}},
    "metrics": {"end": {"kind": "final", "of": "plant.pose.theta"}},
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[runtime.Result, Path]:
    result = runtime.load(GRAPH).run()
    return result, result.save(tmp_path_factory.mktemp("runs") / "small" / "one")


@pytest.fixture
def run(saved: tuple[runtime.Result, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(saved[1], tmp_path / "small" / "one"))


def test_a_run_read_equals_the_run_saved(saved: tuple[runtime.Result, Path]) -> None:
    result, folder = saved
    again = open_run(folder)
    assert list(again.probes) == list(result.probes)
    for name, recorded in result.probes.items():
        there = again.probes[name]
        assert np.array_equal(there.values, recorded.values)
        assert np.array_equal(there.t, recorded.t)
        assert (there.labels, there.units, there.kinds) == (
            *(recorded.labels, recorded.units, recorded.kinds),
        )
        assert dict(there.addresses) == dict(recorded.addresses)
    assert again.plots == result.plots
    assert again.metrics == result.metrics
    assert again.texts == result.texts
    assert again.world is not None and result.world is not None
    assert again.world.description == result.world.description
    assert {key: again.manifest[key] for key in result.manifest} == result.manifest


def test_a_folder_a_link_and_a_manifest_name_the_same_run(run: Path) -> None:
    link_latest(run)
    ways = [run, run.parent / "latest", run / "manifest.json", run.parent / "latest/manifest.json"]
    assert {run_folder(way).resolve() for way in ways} == {run.resolve()}


def test_a_file_with_the_name_of_the_link_stays(run: Path) -> None:
    mine = run.parent / "latest"
    mine.write_text("my notes")
    link_latest(run)
    assert mine.read_text() == "my notes"


def test_a_folder_of_runs_gives_a_suggestion(run: Path) -> None:
    with pytest.raises(UsageError, match="holds no run.*did you mean '.*one'"):
        open_run(run.parent)
    link_latest(run)
    with pytest.raises(UsageError, match="holds no run.*did you mean '.*latest'"):
        open_run(run.parent)


@pytest.mark.parametrize(
    ("path", "message"),
    [("nothing", "there is no"), ("file.txt", "is a file"), (".", "holds no run")],
)
def test_a_path_without_a_run(tmp_path: Path, path: str, message: str) -> None:
    (tmp_path / "file.txt").write_text("x")
    with pytest.raises(UsageError, match=message):
        open_run(tmp_path / path)


FILES = ("manifest.json", "metrics.json", "probes.npz", "graph.resolved.yaml", "graph.yaml")


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(run: Path, name: str) -> None:
    (run / name).unlink()
    with pytest.raises(UsageError, match=name):
        open_run(run)


@pytest.mark.parametrize("name", ("manifest.json", "metrics.json", "probes.npz"))
@pytest.mark.parametrize("part", (0.0, 0.3, 0.9))
def test_a_file_that_is_cut_off_is_named(run: Path, name: str, part: float) -> None:
    content = (run / name).read_bytes()
    (run / name).write_bytes(content[: int(part * len(content))])
    with pytest.raises(UsageError, match=rf"{name}' is damaged") as raised:
        open_run(run)
    assert "\n" not in str(raised.value)


@examples(40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_flipped_bytes_of_the_arrays_are_found(
    saved: tuple[runtime.Result, Path], tmp_path: Path, data: st.DataObject
) -> None:
    result, folder = saved
    content = bytearray((folder / "probes.npz").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    broken = tmp_path / "broken"
    shutil.copytree(folder, broken, dirs_exist_ok=True)
    (broken / "probes.npz").write_bytes(bytes(content))
    try:
        again = open_run(broken)
    except UsageError:
        return
    # Bytes that are not read, such as the date of an archive's member, do not matter.
    for name, recorded in result.probes.items():
        assert np.array_equal(again.probes[name].values, recorded.values)


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every path in a JSON value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in inside:
        yield (*path, key)
        if isinstance(item, (dict, list)):
            yield from _places(item, (*path, key))


def _changed(value: Any, path: tuple[Any, ...], change: Callable[[Any, Any], None]) -> Any:
    value = copy.deepcopy(value)
    owner = value
    for key in path[:-1]:
        owner = owner[key]
    change(owner, path[-1])
    return value


WRONG: tuple[Any, ...] = (None, True, -1, 1e300, "text", [], ["x"], {}, {"a": None}, [[None]])


@examples(80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_manifest_with_something_else_in_it_is_read_or_refused(
    saved: tuple[runtime.Result, Path], tmp_path: Path, data: st.DataObject
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(saved[1], broken, dirs_exist_ok=True)
    manifest = json.loads((saved[1] / "manifest.json").read_text())
    path = data.draw(st.sampled_from(list(_places(manifest))))
    wrong = data.draw(st.sampled_from([*WRONG, ...]))

    def change(owner: Any, key: Any) -> None:
        if wrong is ...:
            del owner[key]
        else:
            owner[key] = wrong

    text = json.dumps(_changed(manifest, path, change))
    (broken / "manifest.json").write_text(text)
    try:
        again = open_run(broken)
    except UsageError as error:
        assert "\n" not in str(error)
        return
    assert set(again.probes) <= set(saved[0].probes)


def test_a_newer_format_is_refused(run: Path) -> None:
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps({**manifest, "schema_version": 99}))
    with pytest.raises(UsageError, match="newer version.*upgrade"):
        open_run(run)


def test_metrics_that_are_not_numbers_are_refused(run: Path) -> None:
    (run / "metrics.json").write_text('{"end": "many"}')
    with pytest.raises(UsageError, match=r"metrics.json' is damaged: expected a number or null"):
        open_run(run)


@pytest.mark.parametrize("name", ["manifest.json", "metrics.json", "probes.npz"])
@pytest.mark.parametrize("damage", ["empty", "half", "zeros", "bit", "folder"])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, name: str, damage: str) -> None:
    saved = runtime.load("starters/tracking").set("run.until", 0.05).run().save(tmp_path / "run")
    path = saved / name
    content = path.read_bytes()
    half = len(content) // 2
    path.unlink()
    if damage == "folder":
        path.mkdir()
    else:
        path.write_bytes(
            {
                "empty": b"",
                "half": content[:half],
                "zeros": bytes(len(content)),
                "bit": content[:half] + bytes([content[half] ^ 0x80]) + content[half + 1 :],
            }[damage]
        )
    with pytest.raises(UsageError) as caught:
        open_run(saved)
    message = str(caught.value)
    if name == "manifest.json" and damage == "folder":
        assert "holds no run (no manifest.json in it)" in message
    else:
        assert message.startswith((f"'{path}' is damaged: ", f"cannot read '{path}': "))
        assert message.endswith(f"runtime run {saved / 'graph.resolved.yaml'}")


def test_the_resolved_graph_has_all_entries_of_the_run_section(tmp_path: Path) -> None:
    run = {"dt": 0.01, "until": 0.2, "seed": 3, "engine": "python", "memory": 2 * 1024**2}
    run |= {"keep": 0.1, "states": "all", "time_unit": "ms", "events": "ticks", "loops": "solve"}
    run |= {"solver": "dopri5", "rtol": 1e-5, "atol": 1e-7, "max_step": 0.005}
    run |= {"stop": {"when": "plant.pose.x", "above": 9.0}}
    assert run.keys() == set(RUN_KEYS)
    folder = runtime.load({**GRAPH, "run": run}).run().save(tmp_path / "a")
    assert runtime.load(folder / "graph.resolved.yaml").to_dict()["run"] == run
