"""The diagram in pydrake: LeafSystems in Python, the robot with a periodic discrete update."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Adder, ConstantVectorSource, LogVectorOutput

from benchmarks import tracking
from benchmarks.agreement import Run


class Box(LeafSystem):  # type: ignore[misc]
    """A function of vectors."""

    def __init__(self, function: Callable[..., Any], sizes: tuple[int, ...], width: int) -> None:
        super().__init__()
        self.function = function
        self.ports = [self.DeclareVectorInputPort(f"in{i}", n) for i, n in enumerate(sizes)]
        self.DeclareVectorOutputPort("out", width, self.calculate)

    def calculate(self, context: Any, output: Any) -> None:
        values = [number for port in self.ports for number in port.Eval(context).tolist()]
        output.SetFromVector(self.function(*values))


class Robot(LeafSystem):  # type: ignore[misc]
    """The unicycle."""

    def __init__(self, dt: float) -> None:
        super().__init__()
        self.dt = dt
        state = self.DeclareDiscreteState(np.array(tracking.X0))
        self.command = self.DeclareVectorInputPort("command", 2)
        self.DeclareStateOutputPort("pose", state)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self.step)

    def step(self, context: Any, state: Any) -> None:
        pose = context.get_discrete_state_vector().value()
        slope = tracking.slope(pose.item(2), *self.command.Eval(context).tolist())
        state.set_value(pose + self.dt * np.array(slope))


def poses(steps: int, dt: float) -> Run:
    k = tracking.gain(dt)
    builder = DiagramBuilder()
    robot = builder.AddSystem(Robot(dt))
    line = builder.AddSystem(Box(tracking.line, (3,), 3))
    error = builder.AddSystem(Box(tracking.error, (3, 3), 3))
    feedback = builder.AddSystem(Box(lambda *e: tracking.feedback(k, *e), (3,), 2))
    forward = builder.AddSystem(ConstantVectorSource(np.array(tracking.FORWARD)))
    total = builder.AddSystem(Adder(2, 2))
    limit = builder.AddSystem(Box(tracking.saturate, (2,), 2))
    fault = builder.AddSystem(Box(tracking.fault, (2,), 2))
    for source, target, port in (
        (robot, line, 0),
        (robot, error, 0),
        (line, error, 1),
        (error, feedback, 0),
        (feedback, total, 0),
        (forward, total, 1),
        (total, limit, 0),
        (limit, fault, 0),
        (fault, robot, 0),
    ):
        builder.Connect(source.get_output_port(0), target.get_input_port(port))
    sink = LogVectorOutput(robot.get_output_port(0), builder, dt)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    began = time.perf_counter()
    simulator.AdvanceTo(steps * dt)
    took = time.perf_counter() - began
    return Run(took, sink.FindLog(simulator.get_context()).data().T[:steps])
