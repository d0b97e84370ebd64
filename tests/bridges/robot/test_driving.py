"""A session between topics: over fake and real transports, with peers that fail."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks import Scan, Twist
from runtime.errors import GraphError, SimulationError, UsageError

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
from spikeblocks.robot.bags import BagReader, BagWriter
from spikeblocks.robot.driving import Driver
from spikeblocks.robot.frames import c_header, pack, stuff, unstuff
from spikeblocks.robot.messages import Codec
from spikeblocks.robot.ports import Ports, Topic, read_ports
from spikeblocks.robot.safety import Arrival
from spikeblocks.robot.transports import Adapter, Received, adapter_of, bad

TWICE = """
graph: twice
run: {dt: 0.01, until: 100}
inputs: {speed: {type: Twist, default: 0.0, max: 10}}
outputs: {command: gain.out}
blocks:
  gain: {type: Gain, gain: 2.0}
  limit: {type: Function, expression: "1 / (u[0] - 3)"}
wires: {gain: {input: inputs.speed}, limit: {u: inputs.speed.v}}
probes: {speed: inputs.speed}
"""
PORTS = """
transport: {type: udp, listen: "127.0.0.1:0", peer: "127.0.0.1:9"}
inputs: {speed: {timeout: 0.105}}
outputs: {command: {min: -4, max: 4}}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "g.yaml").write_text(TWICE)
    (tmp_path / "robot.yaml").write_text(PORTS)
    return tmp_path / "g.yaml", tmp_path / "robot.yaml"


class Scripted(Adapter):
    """Gives messages of a script, one list a period, and keeps what is sent."""

    def __init__(self, ports: Ports, script: list[Any]) -> None:
        super().__init__({}, ports)
        self.script, self.kept, self.now = iter(script), [], 0
        self.is_open = False

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def send(self, topic: Topic, values: Any) -> None:
        self.kept.append(np.array(values).tolist())

    def receive(self) -> list[Received]:
        entry = next(self.script, None)
        if isinstance(entry, BaseException):
            raise entry
        return [] if entry is None else [entry]


class Clock:
    """Time that passes only while the loop waits."""

    def __init__(self) -> None:
        self.time = 10**12

    def now(self) -> int:
        self.time += 1
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += round(1e9 * seconds)


def speed(k: int, *values: float, sender: int = 1) -> Received:
    """The message of period k, by a clock that is ahead."""
    return Received("speed", Arrival(k * 10_000_000 + 5 * 10**12, sender, k + 1), np.array(values))


def drive(files: tuple[Path, Path], script: list[Any], seconds: float, **options: Any):
    graph = runtime.load(files[0]).check()
    ports = read_ports(files[1], graph.network)
    adapter, clock = Scripted(ports, script), Clock()
    driver = Driver(graph, ports, adapter, now=clock.now, sleep=clock.sleep, **options)
    problem: BaseException | None = None
    try:
        driver.run(seconds)
    except BaseException as error:  # noqa: BLE001 -- of the script
        problem = error
    assert not adapter.is_open
    return driver, adapter.kept, problem


def test_commands_begin_when_all_inputs_are_seen_and_end_when_they_are_lost(files) -> None:
    script = [None, None, *(speed(k, 0.5, -1.0) for k in range(2, 12))]
    driver, kept, _ = drive(files, script, 0.4)
    moving = [k for k, command in enumerate(kept) if any(command)]
    # From the period of the first message to 0.1 s after the last one.
    assert moving == list(range(2, 11 + 10 + 1))
    assert [kept[k] for k in moving] == [[1.0, -2.0]] * 20
    # The graph's time passed only while it drove.
    assert driver.session.t == pytest.approx(0.2)
    assert [c["state"].split(" (")[0] for c in driver.facts()["changes"]] == [
        "driving",
        "stopped: an input is too old",
        "stopped for good",
    ]


@pytest.mark.parametrize(
    "ends", [KeyboardInterrupt(), OSError("the cable"), ValueError("in an adapter")]
)
def test_whatever_ends_the_loop_zero_commands_are_last(files, ends: BaseException) -> None:
    script = [*(speed(k, 1.0, 1.0) for k in range(5)), ends]
    driver, kept, problem = drive(files, script, 1.0)
    assert problem is ends
    assert kept == [[2.0, 2.0]] * 5 + [[0.0, 0.0]] * 3
    assert driver.facts()["changes"][-1]["state"].startswith("stopped for good")


def test_a_block_that_fails_stops_the_robot(files) -> None:
    script = [speed(k, 3.0 if k == 4 else 1.0, 1.0) for k in range(9)]
    _driver, kept, problem = drive(files, script, 1.0)
    assert isinstance(problem, SimulationError)
    assert kept[-3:] == [[0.0, 0.0]] * 3
    assert kept[0] == [2.0, 2.0]


def test_limits_hold(files) -> None:
    _, kept, _ = drive(files, [speed(k, 9.0, -9.0) for k in range(9)], 0.09)
    assert kept[:9] == [[4.0, -4.0]] * 9


def test_bad_messages_are_counted_with_the_first_and_never_an_exception(files) -> None:
    script = [
        speed(0, 1.0, 1.0),
        bad("a frame with a wrong checksum"),
        bad("12 bytes that are no frame"),
        speed(3, 11.0, 0.0),
        speed(0, 1.0, 1.0),
    ]
    driver, kept, problem = drive(files, script, 0.05)
    assert problem is None
    dropped = driver.facts()["dropped"]
    assert dropped["-"] == {"messages": 2, "first": "a frame with a wrong checksum"}
    assert dropped["speed"]["messages"] == 2
    assert "expected at most 10 m/s, rad/s, got 11" in dropped["speed"]["first"]
    assert driver.facts()["received"] == {"speed": 1}
    assert kept[:5] == [[2.0, 2.0]] * 5


def test_a_plant_goes_on_without_commands_which_are_zero_then(files) -> None:
    script = [speed(k, 1.0, 1.0) for k in range(3)]
    driver, _kept, _ = drive(files, script, 0.3, is_plant=True)
    assert driver.session.t == pytest.approx(0.3)
    recorded = driver.session.result()["speed"]
    assert recorded[:13].tolist() == [[1.0, 1.0]] * 13
    assert not recorded[13:].any()


def test_every_message_and_command_is_in_the_log(files, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "log.mcap") as log:
        drive(files, [speed(k, 0.1 * k, 0.0) for k in range(5)], 0.05, log=log)
    with BagReader(tmp_path / "log.mcap") as bag:
        assert bag.read("/speed", Twist).values[:, 0].tolist() == [0.1 * k for k in range(5)]
        assert bag.read("/command", Twist).values[:5, 0].tolist() == [0.2 * k for k in range(5)]


# Frames


@given(st.binary(max_size=2000) | st.binary(max_size=600).map(lambda b: b"\0" + b * 2))
def test_stuffed_bytes_have_no_zero_and_come_back(data: bytes) -> None:
    stuffed = stuff(data)
    assert stuffed.index(0) == len(stuffed) - 1
    assert unstuff(stuffed[:-1]) == data


PROGRAM = r"""
#include <stdio.h>
#include "robot_frames.h"
/* Doubles what arrives, as another topic; damaged frames are answered with nothing. */
int main(void) {
    static uint8_t bytes[4096], out[4096];
    static double values[ROBOT_SCAN_COUNT];
    robot_frame frame;
    size_t size = fread(bytes, 1, sizeof bytes, stdin);
    if (!robot_unpack(bytes, size, &frame, values, ROBOT_SCAN_COUNT))
        return 3;
    if (frame.topic != ROBOT_SCAN_TOPIC)
        return 4;
    for (uint32_t i = 0; i < frame.count; ++i)
        values[i] *= 2.0;
    frame.topic = ROBOT_CMD_VEL_TOPIC;
    fwrite(out, 1, robot_pack(out, &frame, values), stdout);
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no cc")
def test_frames_in_c_are_the_same_bytes(tmp_path: Path) -> None:
    scan, command = (
        Topic("scan", "/scan", Codec.of(Scan(40))),
        Topic("c", "/cmd_vel", Codec.of(Twist)),
    )
    ports = Ports(Path("robot.yaml"), {"scan": scan}, {"c": command}, {}, 0.01, None, {})
    (tmp_path / "robot_frames.h").write_text(c_header(ports))
    (tmp_path / "a.c").write_text(PROGRAM)
    build = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-o", "a", "a.c"]
    subprocess.run(build, cwd=tmp_path, check=True)
    values = np.linspace(-1e3, 1e300, 40)
    arrival = Arrival(-5_000_000_000_123, 0xFEDCBA98, 77)
    frame = pack("/scan", values, arrival)
    run = [str(tmp_path / "a")]
    assert subprocess.run(run, input=frame, capture_output=True).stdout == pack(
        "/cmd_vel", 2.0 * values, arrival
    )
    for place in range(0, len(frame), 7):
        damaged = frame[:place] + bytes([frame[place] ^ 1]) + frame[place + 1 :]
        assert subprocess.run(run, input=damaged, capture_output=True).returncode == 3


# Transports


def both(first: dict[str, Any], second: dict[str, Any]) -> tuple[Adapter, Adapter, Topic]:
    """Two adapters of a scan, the first of which sends it and the second receives it."""
    scan = Topic("scan", "/scan", Codec.of(Scan(360)))
    out = Ports(Path("r.yaml"), {}, {"scan": scan}, first, 0.01, None, {})
    back = Ports(Path("r.yaml"), {"scan": scan}, {}, second, 0.01, None, {})
    sender, receiver = adapter_of(out), adapter_of(back)
    receiver.open()
    sender.open()
    return sender, receiver, scan


def collect(receiver: Adapter, count: int) -> list[Received]:
    """What arrives, until it is enough; what never does fails after 20 s."""
    found: list[Received] = []
    until = time.monotonic() + 20.0
    while len(found) < count and time.monotonic() < until:
        found += receiver.receive()
    return found


def free_port() -> int:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("kind", ["udp", "zenoh"])
def test_values_arrive_in_order_with_their_sender(kind: str) -> None:
    one, two = (f"127.0.0.1:{free_port()}" for _ in range(2))
    options = {"type": kind, "listen": one, "peer": two}, {"type": kind, "listen": two, "peer": one}
    if kind == "zenoh":
        pytest.importorskip("zenoh")
        options = {"type": kind, "peer": f"tcp/{two}"}, {"type": kind, "listen": f"tcp/{two}"}
    sender, receiver, scan = both(*options)
    ranges = np.random.default_rng(0).uniform(0.1, 5.0, (5, 360)).astype(np.float32)
    until = time.monotonic() + 20.0
    # A publisher of zenoh knows of a subscriber some time after both exist.
    while not receiver.receive() and time.monotonic() < until:
        sender.send(scan, ranges[0])
    for row in ranges:
        sender.send(scan, row)
    found: list[Received] = []
    while not (found and np.array_equal(found[-1].values, ranges[-1])) and time.monotonic() < until:
        found += receiver.receive()
    sender.close()
    receiver.close()
    found = found[-5:]
    assert [message.problem for message in found] == [""] * 5
    assert np.array_equal([message.values for message in found], ranges)
    assert np.diff([message.arrival.sequence for message in found]).tolist() == [1] * 4
    assert np.diff([message.arrival.stamp for message in found]).min() > 0
    assert {message.arrival.sender for message in found} == {sender.sender}


def test_a_serial_line_carries_frames_between_noise() -> None:
    if sys.platform == "win32":
        pytest.skip("no pseudo-terminals")
    pytest.importorskip("serial")
    here, there = os.openpty()
    tty.setraw(there)
    scan = Topic("scan", "/scan", Codec.of(Scan(360)))
    options = {"type": "serial", "device": os.ttyname(there)}
    adapter = adapter_of(Ports(Path("r.yaml"), {"scan": scan}, {}, options, 0.01, None, {}))
    adapter.open()
    frame = stuff(pack("/scan", np.arange(360.0), Arrival(5, 6, 7)))
    os.write(here, b"noise\0" + frame[:100])
    os.write(here, frame[100:])
    found = collect(adapter, 2)
    assert found[0].problem == "a frame that is cut"
    assert (found[1].arrival, found[1].port) == (Arrival(5, 6, 7), "scan")
    assert np.array_equal(found[1].values, np.arange(360.0))
    adapter.send(scan, np.ones(360))
    data = b""
    while not data.endswith(b"\0"):
        data += os.read(here, 4096)
    assert unstuff(data[:-1])[32:] == np.ones(360).tobytes()
    adapter.close()
    os.close(here)
    os.close(there)


def test_an_adapter_of_ones_own_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "from spikeblocks.robot.transports import Adapter\n"
        "class Mine(Adapter):\n"
        "    def open(self): self.word = self.option('word')\n"
        "    def close(self): pass\n"
        "    def send(self, topic, values): pass\n"
        "    def receive(self): return []\n"
    )
    options = {"type": "mine.py:Mine", "word": "hello"}
    ports = Ports(tmp_path / "robot.yaml", {}, {}, options, 0.01, None, {})
    adapter = adapter_of(ports)
    adapter.open()
    assert vars(adapter)["word"] == "hello"
    with pytest.raises(UsageError, match="refused \\(--no-modules\\)"):
        adapter_of(ports, modules=False)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("inputs: {sped: {}}", "inputs.sped: unknown port of the graph, did you mean 'speed'"),
        ("inputs: {speed: {timeout: 0}}", "robot.yaml:1:27: inputs.speed.timeout: expected a time"),
        ("outputs: {command: {max: [1]}}", "outputs.command.max: expected a number, or 2 numbers"),
        ("outputs: {command: {min: 1}}", "0 is not between min and max"),
        ("outputs: {command: {rate: 0}}", "outputs.command.rate: expected numbers above 0"),
        ("inputs: {speed: {type: sensor_msgs/LaserScan}}", "holds no Twist; such signals are in"),
        ("perid: 0.1", "robot.yaml:1:1: perid: unknown entry, did you mean 'period'"),
        ("dead_man: 3", "dead_man: expected a mapping, got 3"),
        ("inputs: {speed: {min: 3}}", "inputs.speed.min: unknown entry"),
    ],
)
def test_a_wrong_robot_yaml_is_an_error_with_its_place(files, text: str, problem: str) -> None:
    files[1].write_text(text + "\n")
    with pytest.raises(GraphError) as raised:
        read_ports(files[1], runtime.load(files[0]).network)
    assert problem in str(raised.value)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"type": "upd"}, "no adapter 'upd'; known are udp, serial, zenoh, FILE:CLASS"),
        ({"type": "none.py:A"}, "there is no file"),
        ({"type": "no_such_package:A"}, "cannot import 'no_such_package'"),
        ({"type": "math:pi"}, "'math' has no subclass of Adapter named 'pi'"),
        ({"type": "udp", "peer": "a:1"}, "'listen' is missing, for udp"),
        ({"type": "udp", "listen": "nowhere", "peer": "a:1"}, "expected HOST:PORT, got 'nowhere'"),
    ],
)
def test_a_wrong_transport_is_an_error(options: dict[str, Any], problem: str) -> None:
    with pytest.raises(UsageError, match=problem):
        adapter_of(Ports(Path("robot.yaml"), {}, {}, options, 0.01, None, {})).open()


def test_a_period_is_a_whole_number_of_ticks(files) -> None:
    files[1].write_text(PORTS + "period: 0.015\n")
    with pytest.raises(UsageError, match="period: expected a whole number of ticks of 0.01 s"):
        drive(files, [], 1.0)


def test_the_commands_say_what_is_missing_and_write_the_header(cli, files, tmp_path: Path) -> None:
    ports = ("--ports", str(files[1]))
    done = cli("drive", str(files[0]), *ports, "--header", str(tmp_path / "a.h"))
    assert done.returncode == 0, done.stderr
    assert "#define ROBOT_SPEED_COUNT 2" in (tmp_path / "a.h").read_text()
    # The inputs of the controller are outputs of its plant, which this graph is not.
    done = cli("serve-plant", str(files[0]), *ports)
    assert done.returncode == 2
    assert "inputs.speed: unknown port of the graph" in done.stderr
    files[1].write_text(PORTS.replace("127.0.0.1:0", "256.0.0.1:70"))
    done = cli("drive", str(files[0]), *ports, "--for", "1", "--out", str(tmp_path))
    assert done.returncode == 2
    assert "transport: " in done.stderr
    assert "Traceback" not in done.stderr


# Two processes


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[str]]]:
    """Processes of a test, which end with it."""
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_two_processes_over_udp_and_a_peer_that_is_killed(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    script = Path(sys.executable).parent / "runtime"
    one, two = free_port(), free_port()
    (tmp_path / "plant.yaml").write_text(
        "graph: plant\nrun: {dt: 0.01, until: 100}\n"
        "inputs: {command: {type: Twist, default: 0.0}}\noutputs: {speed: lag.out}\n"
        "blocks: {one: {type: Constant, value: [1, 0], signal: Twist}, sum: {type: Sum},\n"
        "  lag: {type: UnitDelay}}\n"
        "wires: {sum: {terms: [inputs.command, one.value]}, lag: {input: sum.out}}\n"
        "probes: {command: inputs.command}\n"
    )
    (tmp_path / "g.yaml").write_text(TWICE.replace("gain: 2.0", "gain: -0.5"))
    (tmp_path / "robot.yaml").write_text(
        f'transport: {{listen: "127.0.0.1:{one}", peer: "127.0.0.1:{two}"}}\n'
        "inputs: {speed: {timeout: 0.3}}\noutputs: {command: {}}\n"
    )
    serving = [str(script), "serve-plant", "plant.yaml", "--ports", "robot.yaml"]
    plant = subprocess.Popen(serving, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    started.append(plant)
    driving = [str(script), "drive", "g.yaml", "--ports", "robot.yaml", "--log", "drive.mcap"]
    controller = subprocess.Popen(driving, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    started.append(controller)
    read_until(controller, "driving")
    plant.kill()
    plant.wait()
    read_until(controller, "stopped: an input is too old (speed)")
    controller.send_signal(signal.SIGINT)
    assert "stopped for good (KeyboardInterrupt)" in controller.communicate(timeout=60)[1]
    assert controller.returncode == 130
    with BagReader(tmp_path / "drive.mcap") as bag:
        commands = bag.read("/command", Twist).values
    assert commands[:, 0].min() < 0.0
    assert not commands[-3:].any()


def read_until(process: subprocess.Popen[str], text: str) -> list[str]:
    """The lines of a process up to one that has a text."""
    lines: list[str] = []
    while not lines or text not in lines[-1]:
        line = process.stderr.readline()
        assert line, "".join(lines)
        lines.append(line)
    return lines
