"""Bags: read by rosbags and by mcap, and read from what ROS 1 and ROS 2 write."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from blocks import Pose, Scan, Twist
from runtime.errors import GraphError, UsageError

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
from rosbags.interfaces import Nodetype  # noqa: F401
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from spikeblocks.robot.bags import BagReader, BagWriter
from spikeblocks.robot.messages import SECOND, Codec, factory
from tests.compilers import needs_compiler

EXAMPLES = Path(__file__).parents[3] / "examples" / "robot"
EPOCH = 1_700_000_000 * SECOND
TIMES = (0.0, 0.25, 1.0)
SPEEDS = ((0.0, 1.0), (0.5, -1.0), (2.0, 0.0))


def ros1(path: Path, messages: list[tuple[int, Any]]) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "geometry_msgs/msg/Twist"
    with Writer1(path.with_suffix(".bag")) as bag:
        connection = bag.add_connection("/cmd_vel", kind, typestore=store)
        for stamp, message in messages:
            bag.write(connection, stamp, store.serialize_ros1(message, kind))
    return path.with_suffix(".bag")


def ros2(path: Path, messages: list[tuple[int, Any]], plugin: StoragePlugin) -> Path:
    store, kind = factory().store, "geometry_msgs/msg/Twist"
    with Writer2(path, version=9, storage_plugin=plugin) as bag:
        connection = bag.add_connection("/cmd_vel", kind, typestore=store)
        for stamp, message in messages:
            bag.write(connection, stamp, store.serialize_cdr(message, kind))
    return path


def twists(rows=SPEEDS, times=TIMES) -> list[tuple[int, Any]]:
    stamps = [EPOCH + round(t * SECOND) for t in times]
    return [(s, factory().twist(np.array(row))) for s, row in zip(stamps, rows, strict=True)]


@pytest.fixture(
    params=["ros1", "sqlite3 folder", "sqlite3 file", "mcap folder", "mcap file", "ours"]
)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The same three commands as written by each kind of recorder."""
    place = tmp_path / "log"
    if request.param == "ros1":
        return ros1(place, twists())
    if request.param == "ours":
        with BagWriter(tmp_path / "log.mcap") as out:
            for t, row in zip(TIMES, SPEEDS, strict=True):
                out.write("/cmd_vel", Codec.of(Twist), row, EPOCH + round(t * SECOND))
        return tmp_path / "log.mcap"
    plugin = StoragePlugin.SQLITE3 if "sqlite3" in request.param else StoragePlugin.MCAP
    folder = ros2(place, twists(), plugin)
    is_file = request.param.endswith("file")
    return next(p for p in folder.iterdir() if p.suffix in (".db3", ".mcap")) if is_file else folder


def played(
    tmp_path: Path, entry: dict[str, Any], until: float = 1.5, dt: float = 0.05
) -> np.ndarray:
    graph = runtime.load(
        {
            "graph": "played",
            "run": {"dt": dt, "until": until},
            "blocks": {"bag": {"type": "FromBag", **entry}},
            "probes": {"out": "bag.out"},
        }
    )
    result = graph.run()
    assert len(result["out"]) == round(until / dt)
    return result["out"]


def test_a_topic_of_any_bag_holds_between_its_messages(bag: Path, tmp_path: Path) -> None:
    found = played(tmp_path, {"file": str(bag), "topic": "/cmd_vel"})
    ticks = 0.05 * np.arange(30)
    rows = np.searchsorted(TIMES, ticks + 1e-9, side="right") - 1
    assert found.tolist() == np.array(SPEEDS)[rows].tolist()


def test_a_topic_of_any_bag_changes_linearly(bag: Path, tmp_path: Path) -> None:
    found = played(tmp_path, {"file": str(bag), "topic": "/cmd_vel", "method": "linear"})
    ticks = 0.05 * np.arange(30)
    for column in (0, 1):
        expected = np.interp(ticks, TIMES, np.array(SPEEDS)[:, column])
        assert np.allclose(found[:, column], expected, atol=1e-12)


@pytest.mark.parametrize(("start", "shift"), [(EPOCH / SECOND - 0.5, 0.5), ("topic", 0.0)])
def test_the_beginning_can_be_a_time_since_the_epoch(start, shift: float, tmp_path: Path) -> None:
    bag = ros1(tmp_path / "log", twists())
    entry = {"file": str(bag), "topic": "/cmd_vel", "start": str(start)}
    found = played(tmp_path, entry)
    rows = np.searchsorted(TIMES, 0.05 * np.arange(30) - shift + 1e-6, side="right") - 1
    assert found.tolist() == np.array(SPEEDS)[np.maximum(rows, 0)].tolist()


def test_an_angle_goes_on_over_pi(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "log.mcap") as out:
        for k in range(5):
            out.write("/pose", Codec.of(Pose), (0.0, 0.0, 3.0 + 0.1 * k), EPOCH + k * SECOND // 10)
    entry = {"file": str(tmp_path / "log.mcap"), "topic": "/pose", "method": "linear"}
    found = played(tmp_path, entry, until=0.4)
    assert np.allclose(found[:, 2], 3.0 + 0.05 * np.arange(8))


def test_bad_messages_are_counted_and_left_out(tmp_path: Path) -> None:
    rows = [(0.1, 0.0), (math.nan, 0.0), (0.2, 0.0), (0.3, math.inf), (0.4, 0.0)]
    bag = ros1(tmp_path / "log", twists(rows, (0.0, 0.1, 0.2, 0.3, 0.4)))
    with BagReader(bag) as reader:
        found = reader.read("/cmd_vel", Twist)
    assert found.values[:, 0].tolist() == [0.1, 0.2, 0.4]
    expected = "expected finite numbers for a Twist, got nan at [0]"
    assert found.notes == [f"2 bad messages left out; the first: message 2 of /cmd_vel: {expected}"]
    blocks = {"bag": {"type": "FromBag", "file": str(bag), "topic": "/cmd_vel"}}
    result = runtime.load({"graph": "a", "run": {"dt": 0.1, "until": 1}, "blocks": blocks}).run()
    assert any("2 bad messages left out" in note for note in result.notes)


def test_equal_stamps_are_left_out(tmp_path: Path) -> None:
    bag = ros1(tmp_path / "log", twists(times=(0.0, 0.5, 0.5)))
    with BagReader(bag) as reader:
        found = reader.read("/cmd_vel")
    assert len(found.values) == 2
    assert found.notes == ["1 messages left out that are not after the one before"]


@pytest.mark.parametrize(
    ("entry", "problem"),
    [
        ({"topic": "/cmd_vle"}, "topic: .* has no topic '/cmd_vle', did you mean '/cmd_vel'"),
        ({"topic": "/cmd_vel", "signal": "Pose"}, "holds no Pose"),
        ({"topic": "/cmd_vel", "file": "none.mcap"}, "file: cannot read .*No such file"),
        ({"topic": "/cmd_vel", "file": __file__}, "is no bag; expected .bag, .mcap"),
        ({"topic": "/cmd_vel", "start": "noon"}, "start: expected bag, topic or a time"),
    ],
)
def test_what_cannot_be_played_is_an_error_with_its_place(
    entry: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    bag = ros1(tmp_path / "log", twists())
    with pytest.raises(GraphError, match=problem):
        played(tmp_path, {"file": str(bag), **entry})


@pytest.mark.parametrize("length", [0, 10, 300])
def test_a_damaged_bag_is_an_error_and_no_traceback(length: int, tmp_path: Path) -> None:
    whole = (EXAMPLES / "log.mcap").read_bytes()
    damaged = tmp_path / "a.mcap"
    damaged.write_bytes(whole[:length])
    with pytest.raises(UsageError, match="is no bag, or damaged"), BagReader(damaged) as reader:
        reader.read("/scan")


def test_a_run_goes_on_from_its_own_folder(tmp_path: Path) -> None:
    graph = runtime.load(
        {
            "graph": "again",
            "run": {"dt": 0.1, "until": 1.0},
            "blocks": {
                "bag": {"type": "FromBag", "file": str(EXAMPLES / "log.mcap"), "topic": "/scan"}
            },
            "probes": {"out": "bag.out"},
        }
    )
    first = graph.run()
    folder = first.save(tmp_path / "run")
    again = runtime.load(folder / "graph.resolved.yaml").run()
    assert again["out"].tobytes() == first["out"].tobytes()


@needs_compiler
@pytest.mark.parametrize(("topic", "method"), [("/scan", "hold"), ("/odom", "linear")])
def test_both_engines_play_the_same_bits(topic: str, method: str) -> None:
    entry = {"type": "FromBag", "file": str(EXAMPLES / "log.mcap"), "topic": topic}
    runs = [
        runtime.load(
            {
                "graph": "bits",
                "run": {"dt": 0.007, "until": 12.5, "engine": engine},
                "blocks": {"bag": {**entry, "method": method}},
                "probes": {"out": "bag.out"},
            }
        ).run()
        for engine in ("python", "compiled")
    ]
    assert runs[0]["out"].tobytes() == runs[1]["out"].tobytes()


# The commands


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[runtime.Result, Path]:
    """Half a second of case C, and its folder."""
    result = runtime.load("wall_following").set("run.until", 0.5).run()
    return result, result.save(tmp_path_factory.mktemp("runs") / "run")


def test_a_run_as_a_bag_is_read_by_rosbags_and_by_mcap(cli, recorded, tmp_path: Path) -> None:
    from mcap.reader import make_reader
    from rosbags.highlevel import AnyReader

    result, folder = recorded
    mapping = tmp_path / "robot.yaml"
    mapping.write_text("ros: {plant.pose: {topic: /odom, type: nav_msgs/Odometry}}\n")
    done = cli(
        "bag", str(folder), "-o", str(tmp_path / "a.mcap"), "--ports", str(mapping), "--json"
    )
    assert done.returncode == 0, done.stderr
    topics = json.loads(done.stdout)["topics"]
    with AnyReader([tmp_path / "a.mcap"]) as bag:
        read = {
            c.topic: (t, bag.deserialize(data, c.msgtype)) for c, t, data in bag.messages()
        }  # the last of each
        assert {c.topic: c.msgcount for c in bag.connections} == {
            topic: found["messages"] for topic, found in topics.items()
        }
    assert topics["/odom"]["type"] == "nav_msgs/msg/Odometry"
    stamp, odometry = read["/odom"]
    x, y, theta = result["plant.pose"][-1]
    assert (odometry.pose.pose.position.x, odometry.pose.pose.position.y) == (x, y)
    assert math.isclose(2 * math.asin(odometry.pose.pose.orientation.z), theta)
    assert odometry.header.frame_id == "odom"
    assert odometry.header.stamp.sec * SECOND + odometry.header.stamp.nanosec == stamp
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        stamps = {"/odom": [m.log_time for _, c, m in reader.iter_messages(topics=["/odom"])]}
        schema = next(s for s in reader.get_summary().schemas.values() if "LaserScan" in s.name)
    assert np.allclose(np.diff(stamps["/odom"]) / SECOND, 0.01)  # as the metrics record it
    assert schema.encoding == "ros2msg"
    assert b"MSG: std_msgs/Header" in schema.data
    with BagReader(tmp_path / "a.mcap") as ours:
        topic = next(topic for topic, found in topics.items() if found["signal"] == "lidar.scan")
        scans = ours.read(topic, Scan(360))
    assert np.allclose(scans.values, result["lidar.scan"], rtol=1e-7)


def test_the_same_run_gives_the_same_bytes(cli, recorded, tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        assert cli("bag", str(recorded[1]), "-o", str(tmp_path / name)).returncode == 0
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize(
    ("mapping", "problem"),
    [
        ("ros: {plant.pos: {}}", "no recording of 'plant.pos', did you mean 'plant.pose'"),
        ("ros: {plant.pose: {type: a/B}}", "no messages of type 'a/msg/B'"),
        ("ros: {plant.pose: {tpic: /x}}", "robot.yaml:1:20: ros.plant.pose.tpic: unknown entry"),
        ("ros: {plant.pose: {topic: /a}, match.reference: {topic: /a}}", "topic '/a' is of"),
    ],
)
def test_a_wrong_mapping_is_an_error_with_its_place(
    cli, recorded, mapping: str, problem: str, tmp_path: Path
) -> None:
    (tmp_path / "robot.yaml").write_text(mapping)
    out = tmp_path / "a.mcap"
    done = cli("bag", str(recorded[1]), "-o", str(out), "--ports", str(tmp_path / "robot.yaml"))
    assert done.returncode == 2
    assert problem in done.stderr
    assert not out.exists()


@pytest.mark.slow
def test_recorded_scans_give_the_recorded_commands(cli, tmp_path: Path) -> None:
    done = cli(
        *("play", str(EXAMPLES / "controller.yaml"), "--bag", str(EXAMPLES / "log.mcap")),
        *("--ports", str(EXAMPLES / "robot.yaml"), "--json", "--tolerance", "1e-4"),
        *("--out", str(tmp_path)),
    )
    assert done.returncode == 0, done.stderr
    outputs = json.loads(done.stdout)["outputs"]
    assert outputs["command.omega"]["recorded"] > 0.1
    # Ranges are of single precision: a part in 1.7e7, which the fit and the gains enlarge.
    assert outputs["command.omega"]["largest"] < 1e-4
    assert outputs["command.v"]["messages"] == 1200


def test_play_compares_with_a_closed_form(cli, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(
        "graph: twice\nrun: {dt: 0.01, until: 1}\n"
        "inputs: {speed: {type: Twist, default: 0.0}}\noutputs: {command: gain.out}\n"
        "blocks: {gain: {type: Gain, gain: 2.0}}\nwires: {gain: {input: inputs.speed}}\n"
    )
    with BagWriter(tmp_path / "log.mcap") as out:
        for k in range(20):
            stamp = EPOCH + k * SECOND // 20
            out.write("/speed", Codec.of(Twist), (k, -k), stamp)
            # One message is off by 0.5.
            out.write("/command", Codec.of(Twist), (2 * k + 0.5 * (k == 7), -2 * k), stamp)
    options = ("--bag", str(tmp_path / "log.mcap"), "--out", str(tmp_path / "runs"))
    done = cli("play", str(tmp_path / "g.yaml"), *options, "--json")
    assert done.returncode == 0, done.stderr
    outputs = json.loads(done.stdout)["outputs"]
    assert outputs["command.v"]["largest"] == 0.5
    assert outputs["command.v"]["at"] == pytest.approx(0.35)
    assert outputs["command.v"]["rms"] == pytest.approx(0.5 / math.sqrt(20))
    assert outputs["command.omega"]["largest"] == 0.0
    assert cli("play", str(tmp_path / "g.yaml"), *options, "--tolerance", "0.1").returncode == 1
    assert cli("play", str(tmp_path / "g.yaml"), *options, "--tolerance", "0.6").returncode == 0
