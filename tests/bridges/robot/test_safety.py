"""The safety of a controller in random histories of a network, its clocks and its peer."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from blocks import Scalar, Twist

pytest.importorskip("rosbags")
from spikeblocks.robot.frames import pack, topic_number, unpack
from spikeblocks.robot.messages import Codec, UnfitMessageError
from spikeblocks.robot.ports import DEAD_MAN, Topic
from spikeblocks.robot.safety import LONGEST_STEP, Arrival, Guard, State

MS = 1_000_000
TIMEOUT = 100  # ms
LIMIT, RATE = np.array([0.5, 1.0]), np.array([2.0, math.inf])
WANTED = np.array([1.0, -0.75])  # more than the limit, and less
INPUTS = {
    name: Topic(name, f"/{name}", Codec.of(Scalar), TIMEOUT / 1000) for name in ("scan", "pose")
}
OUTPUTS = {"command": Topic("command", "/cmd_vel", Codec.of(Twist), 1.0, -LIMIT, LIMIT, RATE)}
PRESSED = Topic(DEAD_MAN, "/enable", Codec.of(Scalar, "std_msgs/msg/Bool"), TIMEOUT / 1000)
TOPICS = {**INPUTS, DEAD_MAN: PRESSED}
NUMBERS = {topic_number(topic.name): topic for topic in TOPICS.values()}


@dataclass
class Sent:
    """A frame on its way: the true time when it was sent and when it arrives (ms), its bytes."""

    name: str
    sender: int
    sequence: int
    at: int
    due: int
    data: bytes
    is_good: bool
    value: float


@dataclass
class World:
    """A robot, a network and two clocks, which know the truth that a guard does not."""

    guard: Guard = field(default_factory=lambda: Guard(INPUTS, OUTPUTS, PRESSED))
    time: int = 0  # the true time in ms
    sender_clock: int = 7_000_000
    own_clock: int = 1_000_000
    sender: int = 1
    is_alive: bool = True
    has_jumped: bool = False
    count: int = 0
    flying: list[Sent] = field(default_factory=list)
    past: list[Sent] = field(default_factory=list)
    came: set[tuple[int, str, int]] = field(default_factory=set)
    # Of each input: when the last message came that never came before; of each sender of it, when
    # the newest one that came was sent.
    new_at: dict[str, int] = field(default_factory=dict)
    newest: dict[tuple[int, str], int] = field(default_factory=dict)
    first_delay: dict[tuple[int, str], int] = field(default_factory=dict)
    is_released: bool = False
    before: tuple[np.ndarray, int] = (np.zeros(2), 0)
    commands: list[np.ndarray] = field(default_factory=list)

    @property
    def now(self) -> int:
        return (self.own_clock + self.time) * MS

    def send(self, name: str, delays: list[int], damage: str, value: float) -> None:
        if not self.is_alive:
            return
        self.count += 1
        number = math.nan if damage == "nan" else value
        arrival = Arrival((self.sender_clock + self.time) * MS, self.sender, self.count)
        data = pack(TOPICS[name].name, np.array(number), arrival)
        if damage == "flip":
            data = data[:20] + bytes([data[20] ^ 16]) + data[21:]
        elif damage == "cut":
            data = data[: len(data) // 2]
        for delay in delays:
            due = self.time + delay
            sent = (name, self.sender, self.count, self.time, due, data, not damage, value)
            self.flying.append(Sent(*sent))
            self.past.append(self.flying[-1])

    def deliver(self) -> None:
        due = sorted((each for each in self.flying if each.due <= self.time), key=lambda s: s.due)
        self.flying = [each for each in self.flying if each.due > self.time]
        for each in due:
            self.take(each)

    def take(self, sent: Sent) -> None:
        try:
            topic, arrival, values = unpack(sent.data, NUMBERS)
        except UnfitMessageError:
            assert not sent.is_good
            return
        assert sent.is_good
        problem = self.guard.accept(topic.port, arrival, self.now, float(values))
        key = (sent.sender, sent.name, sent.sequence)
        if key not in self.came:
            self.came.add(key)
            self.new_at[sent.name] = self.time
            by = sent.sender, sent.name
            self.newest[by] = max(self.newest.get(by, -1), sent.at)
        if not problem:
            self.first_delay.setdefault((sent.sender, sent.name), self.time - sent.at)
        if sent.name == DEAD_MAN:
            self.is_released = sent.value < 0.5 or (self.is_released and bool(problem))

    def check(self) -> None:
        """Ask for a command, and compare it with what is true."""
        self.deliver()
        command = self.guard.command("command", WANTED, self.now)
        self.commands.append(command)
        before, at = self.before
        self.before = command, self.now
        assert (np.abs(command) <= LIMIT).all()
        if not command.any():
            return
        assert self.guard.state is State.DRIVING
        step = min(LONGEST_STEP, (self.now - at) / 1e9)
        assert abs(command[0] - before[0]) <= RATE[0] * step + 1e-12
        assert not self.is_released
        for name in TOPICS:
            # Something that never came before has come within the limit.
            assert self.time - self.new_at[name] <= TIMEOUT
            if not self.has_jumped:
                # And of one sender it is no older than that, beside the delay of its first message.
                assert any(
                    self.time - sent <= TIMEOUT + self.first_delay[by] + 1e-3 * self.time
                    for by, sent in self.newest.items()
                    if by[1] == name and by in self.first_delay
                )

    def act(self, event: tuple[Any, ...]) -> None:
        kind, *rest = event
        if kind == "wait":
            self.time += rest[0]
        elif kind == "round":  # what a robot does: all inputs, then a little time
            for name in TOPICS:
                self.send(name, [rest[0]], "", 1.0)
            self.time += rest[1]
        elif kind == "replay":  # what has come, or was lost, comes again, all at once
            again = self.past[rest[0] :] if rest[1] else self.past[: rest[0]]
            self.flying += [replace(each, due=self.time) for each in again]
        elif kind == "send":
            self.send(*rest)
        elif kind == "kill":
            self.is_alive = False
        elif kind == "restart":
            self.is_alive, self.sender = True, self.sender + 1
            self.sender_clock += rest[0]
            self.count = 0
        elif kind == "their clock":
            self.sender_clock += rest[0]
            self.has_jumped = True
        else:
            self.own_clock += rest[0]
            self.has_jumped = True
        self.check()


DELAY = st.integers(0, 30) | st.integers(0, 2000)
JUMP = st.integers(-5000, 5000)
ROUND = st.tuples(st.just("round"), st.integers(0, 5), st.integers(1, 40))
HELD = st.tuples(st.just("round"), st.integers(0, 600), st.integers(0, 40))
REPLAY = st.tuples(st.just("replay"), st.integers(-9, 9), st.booleans())
EVENT = st.one_of(
    ROUND,
    ROUND,
    HELD,
    REPLAY,
    st.tuples(st.just("wait"), st.integers(0, 40) | st.integers(0, 3000)),
    st.tuples(
        st.just("send"),
        st.sampled_from(sorted(TOPICS)),
        st.lists(DELAY, max_size=3),  # lost, late, repeated
        st.sampled_from(["", "", "", "nan", "flip", "cut"]),
        st.sampled_from([0.0, 1.0]),
    ),
    st.tuples(st.just("kill")),
    st.tuples(st.just("restart"), JUMP),
    st.tuples(st.just("their clock"), JUMP),
    st.tuples(st.just("own clock"), JUMP),
)
HISTORY = st.lists(EVENT, max_size=40)
STEADY = [("round", 0, 20)] * 4


def live(history: list[tuple[Any, ...]]) -> World:
    world = World()
    for event in history:
        world.act(event)
    return world


@given(HISTORY)
@example([*STEADY, ("kill",), ("wait", 90), ("wait", 20), ("wait", 3000)])
@example([*STEADY, ("round", 500, 10), ("kill",), ("wait", 490), ("wait", 10)])
@example([*STEADY, ("kill",), ("wait", 200), ("replay", -9, True), ("wait", 1)])
@example([*STEADY, ("restart", 0), *STEADY, ("wait", 200), ("replay", 9, False), ("wait", 1)])
@example([("round", 0, 1), ("wait", 101), ("own clock", -1), ("replay", 0, True)])
@example([*STEADY, ("round", 300, 300), ("own clock", -1), ("wait", 200), ("replay", -3, True)])
@example([*STEADY, ("send", DEAD_MAN, [0], "", 0.0), ("replay", 3, False), ("wait", 1)])
@example([*STEADY, ("their clock", -4000), *STEADY, ("restart", 0), *STEADY])
@example([*STEADY, ("send", DEAD_MAN, [5], "", 0.0), ("wait", 6), ("wait", 1)])
def test_a_command_is_zero_unless_all_that_is_true_allows_it(
    history: list[tuple[Any, ...]],
) -> None:
    live(history)


@pytest.mark.slow
@settings(max_examples=10_000, suppress_health_check=list(HealthCheck))
@given(HISTORY)
def test_ten_thousand_histories(history: list[tuple[Any, ...]]) -> None:
    live(history)


@given(HISTORY, st.lists(st.tuples(st.just("wait"), st.integers(0, 200)), max_size=20))
def test_commands_stay_zero_after_a_loss(
    history: list[tuple[Any, ...]], after: list[tuple[Any, ...]]
) -> None:
    """The peer dies; what is still on its way arrives, late and repeated."""
    world = live([*history, ("kill",)])
    world.flying += [
        Sent(s.name, s.sender, s.sequence, s.at, s.due + 2500, s.data, s.is_good, s.value)
        for s in world.flying
    ]
    world.act(("wait", 5000))
    while world.flying:
        world.act(("wait", 50))
    world.act(("wait", TIMEOUT + 1))
    del world.commands[:]
    for event in after:
        world.act(event)
    assert not np.any(world.commands)


def test_a_network_without_faults_drives_at_once_and_within_the_limits() -> None:
    world = live([("round", 3, 20)] * 50)
    assert [bool(c.any()) for c in world.commands[:2]] == [False, True] or world.commands[0].any()
    assert world.commands[-1].tolist() == [0.5, -0.75]
    speeds = [c[0] for c in world.commands]
    # 2 per s, every 20 ms: 0.04 a step up to 0.5.
    assert np.allclose(np.diff(speeds)[1:12], 0.04)


@given(HISTORY)
def test_stopped_is_for_good(history: list[tuple[Any, ...]]) -> None:
    world = live(STEADY)
    assert world.guard.state is State.DRIVING
    assert not world.guard.command("command", np.array([math.nan, 0.0]), world.now).any()
    assert world.guard.reason == "output 'command' is not finite: [nan  0.]"
    del world.commands[:]
    for event in history:
        world.act(event)
    assert not np.any(world.commands)
    assert world.guard.state is State.STOPPED


@pytest.mark.parametrize(
    ("events", "state", "reason"),
    [
        ([], State.WAITING, "scan, pose, dead_man"),
        (STEADY, State.DRIVING, ""),
        ([*STEADY, ("wait", 200)], State.STALE, "scan, pose, dead_man"),
        ([*STEADY, ("send", DEAD_MAN, [0], "", 0.0)], State.HELD, "released"),
        ([*STEADY, ("own clock", -10)], State.WAITING, "scan, pose, dead_man"),
        ([*STEADY, ("wait", 200), *STEADY], State.DRIVING, ""),
        ([*STEADY, ("kill",), ("wait", 200), ("restart", -4000), *STEADY], State.DRIVING, ""),
        ([*STEADY, ("their clock", -4000), *STEADY, *STEADY], State.STALE, "scan, pose, dead_man"),
        ([*STEADY, ("their clock", 4000), *STEADY], State.DRIVING, ""),
    ],
)
def test_each_state_has_its_reason(events, state: State, reason: str) -> None:
    world = live([*events, ("wait", 0)])
    assert (world.guard.state, world.guard.reason) == (state, reason)


def test_the_drawing_in_the_docs_has_every_state() -> None:
    page = (Path(__file__).parents[3] / "docs" / "robot.md").read_text(encoding="utf-8")
    assert [state.name for state in State if f"`{state.name}`" not in page] == []


@pytest.mark.parametrize(
    ("arrival", "after", "problem"),
    [
        (Arrival(20 * MS, 1, 2), 20, ""),
        (Arrival(20 * MS, 1, 1), 20, "not newer than the one before"),
        (Arrival(0, 1, 2), 20, "not newer than the one before"),
        (Arrival(20 * MS, 1, 2), 119, ""),
        (Arrival(20 * MS, 1, 2), 121, "late by 0.101 s"),
        (Arrival(-(10**15), 2, 1), 20, ""),
    ],
)
def test_an_older_value_never_replaces_a_newer_one(
    arrival: Arrival, after: int, problem: str
) -> None:
    guard, begin = Guard(INPUTS, OUTPUTS, None), 10**12
    assert guard.accept("scan", Arrival(0, 1, 1), begin) == ""
    assert guard.accept("scan", arrival, begin + after * MS) == problem
