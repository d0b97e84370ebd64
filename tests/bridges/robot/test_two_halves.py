"""Case C in two halves, the robot of rigid bodies and its controller, joined by frames alone."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime

pytest.importorskip("mujoco")
pytest.importorskip("rosbags")
from spikeblocks.robot.driving import Driver
from spikeblocks.robot.frames import pack, topic_number
from spikeblocks.robot.ports import Ports, Topic, read_ports
from spikeblocks.robot.safety import Arrival, State
from spikeblocks.robot.transports import Adapter, Received, read_frame

EXAMPLES = Path(__file__).parents[3] / "examples" / "robot"
SECONDS = 30.0


class Wire(Adapter):
    """One end of a cable that takes no time."""

    def __init__(
        self, ports: Ports, own: deque[bytes], other: deque[bytes], clock: list[int]
    ) -> None:
        super().__init__({}, ports)
        self.own, self.other, self.clock = own, other, clock
        self.topics = {topic_number(t.name): t for t in self.incoming}

    def open(self) -> None: ...

    def close(self) -> None: ...

    def next(self, topic: Topic) -> Arrival:
        return replace(super().next(topic), stamp=self.clock[0])

    def send(self, topic: Topic, values: Any) -> None:
        self.other.append(pack(topic.name, values, self.next(topic)))

    def receive(self) -> list[Received]:
        return [read_frame(self.own.popleft(), self.topics) for _ in range(len(self.own))]


@pytest.mark.slow
def test_the_controller_follows_the_walls_as_in_one_process() -> None:
    clock = [10**12]
    queues: tuple[deque[bytes], deque[bytes]] = (deque(), deque())
    halves = []
    for name, is_plant in (("plant", True), ("controller", False)):
        graph = runtime.load(EXAMPLES / f"{name}.yaml").check()
        ports = read_ports(EXAMPLES / "robot.yaml", graph.network, is_plant)
        wire = Wire(ports, queues[is_plant], queues[not is_plant], clock)
        halves.append(Driver(graph, ports, wire, is_plant=is_plant, now=lambda: clock[0]))
    plant, controller = halves
    for _ in range(round(SECONDS / 0.01)):
        plant.step()
        controller.step()
        clock[0] += 10_000_000
    assert controller.states[State.DRIVING] >= SECONDS / 0.01 - 1
    assert controller.dropped.total() == plant.dropped.total() == 0
    apart = controller.session.result()
    whole = (
        runtime.load("wall_following_mujoco")
        .set("probes.pose.of", "plant.odometry")
        .set("run.until", SECONDS)
        .run()
    )
    # A period of delay is no more than the difference between two seeds.
    assert apart.metrics["time_to_engage"] == pytest.approx(
        whole.metrics["time_to_engage"], abs=0.2
    )
    assert apart.metrics["distance_mae"] < 0.02
    assert abs(apart.metrics["distance_mae"] - whole.metrics["distance_mae"]) < 0.01
    # It learns: the command of its neurons is there, and not at rest.
    learnt = apart["adaptive"][:, 1]
    assert np.ptp(learnt[len(learnt) // 2 :]) > 0.01
