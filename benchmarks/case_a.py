"""Case A as one graph: ours, nengo's, and what by-hand loops need; dt 1 ms, control at 100 Hz."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import runtime
from benchmarks.agreement import Run
from benchmarks.by_hand import CaseA
from benchmarks.tracking import run_of
from blocks import LQR, LinePath, MatchingPoint, TrackingError
from blocks.core import BlockContext, BlockState, FloatArray, Path

DT = 0.001
EVERY = 10
RADIUS = 2.0
KAPPA = (1e-8, 6e-6)
X0 = (math.pi / 2, 1.2, math.pi / 2)
ENSEMBLES = ("adaptive.snn_v", "adaptive.snn_omega")


def graph(neurons: int, ticks: int, engine: str) -> runtime.Graph:
    """The shipped graph, without probes and pictures beyond the pose."""
    loaded = runtime.load("line_actuator_failure").set("run.until", ticks * DT)
    loaded = loaded.set("blocks.adaptive.params.neurons", neurons).set("run.engine", engine)
    for section in ("plots", "metrics", "probes"):
        loaded = loaded.set(section, {})
    return loaded.set("probes.pose", {"of": "plant.pose", "every": EVERY})


class Ours:
    """The shipped graph, built once and run as often as wanted."""

    def __init__(self, neurons: int, ticks: int, engine: str) -> None:
        self.graph = graph(neurons, ticks, engine).check()

    def __call__(self) -> Run:
        return run_of(self.graph)


def numbers(neurons: int) -> CaseA:
    """What a loop by hand needs: the neurons that our graph draws, the path and the gains."""
    drawn = graph(neurons, 1, "python").set("probes", {})
    for name in ENSEMBLES:
        for state in ("scaled_encoders", "offset", "voltage"):
            drawn = drawn.probe(f"{name}.{state}", every=1)
    first = drawn.run()

    def both(state: str) -> FloatArray:
        return np.array([first[f"{name}.{state}"][0].ravel() for name in ENSEMBLES])

    path = LinePath(y=1.0, x_end=40.0, samples=4001).sampled
    _, gain = LQR(q=[0.03, 0.03, 0.03], r=[1, 1]).solve(DT * EVERY, 0.0)
    return CaseA(
        x0=X0,
        dt=DT,
        every=EVERY,
        path=np.ascontiguousarray(path[:, :3]),
        window=200,
        forward=1.0,
        k=np.ascontiguousarray(gain),
        kappa=KAPPA,
        encoders=both("scaled_encoders"),
        bias=both("offset"),
        voltage=both("voltage"),
    )


class Controller:
    """Matching point, error and LQR for a nengo Node: every tenth step, held between."""

    def __init__(self) -> None:
        track = LinePath(y=1.0, x_end=40.0, samples=4001)
        self.path = track.sampled
        self.match, self.error = MatchingPoint(window=2.0), TrackingError()
        self.lqr = LQR(q=[0.03, 0.03, 0.03], r=[1, 1])
        types = {"path": Path(4001)}
        self.states = {}
        for block, name in ((self.match, "match"), (self.error, "error"), (self.lqr, "lqr")):
            shapes = {"last_index": 1, "anchor": 2, "way": 1, "solved_at": 1}
            arrays = {
                key: np.zeros(shapes.get(key, (2, 3) if key == "gain" else (3, 3)))
                for key in block.spec.states
            }
            state = BlockState(BlockContext(DT * EVERY, types), np.random.SeedSequence(0), arrays)
            block.start(state)
            self.states[name] = state
        self.held = np.zeros(4)

    def __call__(self, t: float, pose: FloatArray) -> FloatArray:
        step = round(t / DT) - 1
        if step % EVERY == 0:
            where = (float(pose[0]), float(pose[1]), float(pose[2]))
            found = self.match.output(self.states["match"], t, where, self.path)
            reference, forward = found[0], found[1]
            self.match.update(self.states["match"], t, reference, found[3], found[4])
            state, position, heading, _, _ = self.error.output(
                self.states["error"], t, where, reference
            )
            v, omega = self.lqr.output(self.states["lqr"], t, state, reference)
            self.held = np.array([v + forward[0], omega + forward[1], position, heading])
        return self.held


class Plant:
    """Saturation, fault and unicycle, to be sensed by one nengo Node and moved by another."""

    def __init__(self) -> None:
        self.pose = X0

    def sense(self, t: float) -> tuple[float, float, float]:
        return self.pose

    def move(self, t: float, command: FloatArray) -> None:
        x, y, theta = self.pose
        v, omega = float(command[0]), float(command[1])
        if abs(omega) > 1.0:
            v, omega = v / abs(omega), math.copysign(1.0, omega)
        half = 0.5 * DT * 0.5 * omega
        chord = DT * v * (math.sin(half) / half if half else 1.0)
        self.pose = (
            x + chord * math.cos(theta + half),
            y + chord * math.sin(theta + half),
            theta + 2.0 * half,
        )


def nengo_model(neurons: int, seed: int = 0, fixed: CaseA | None = None) -> tuple[Any, Any]:
    """The diagram in nengo, and its probe of the pose; ``fixed`` puts in our own neurons."""
    import nengo

    with nengo.Network(seed=seed) as model:
        plant = Plant()
        sense = nengo.Node(plant.sense, size_out=3)
        controller = nengo.Node(Controller(), size_in=3, size_out=4)
        move = nengo.Node(plant.move, size_in=2)
        nengo.Connection(sense, controller, synapse=None)
        nengo.Connection(controller[:2], move, synapse=None)
        for axis, (kappa, signal) in enumerate(zip(KAPPA, (2, 3), strict=True)):
            ensemble = nengo.Ensemble(neurons, 1, radius=RADIUS, **_neurons(fixed, axis))
            nengo.Connection(controller[signal], ensemble, synapse=None)
            learnt = nengo.Connection(
                ensemble,
                move[axis],
                synapse=0.01,
                solver=nengo.solvers.NoSolver(np.zeros((neurons, 1))),
                learning_rule_type=nengo.PES(kappa, pre_synapse=nengo.Lowpass(0.01)),
            )
            nengo.Connection(controller[signal], learnt.learning_rule, synapse=None)
        return model, nengo.Probe(sense, sample_every=DT * EVERY)


def _neurons(fixed: CaseA | None, axis: int) -> dict[str, Any]:
    import nengo

    if fixed is None:
        return {"intercepts": nengo.dists.Uniform(-1, 0.9)}
    scaled = fixed.encoders[axis]
    voltage = nengo.dists.Samples(fixed.voltage[axis])
    return {
        "gain": np.abs(scaled) * RADIUS,
        "bias": fixed.bias[axis],
        "encoders": np.sign(scaled)[:, None],
        "neuron_type": nengo.LIF(initial_state={"voltage": voltage}),
    }


def nengo_run(fixed: CaseA, ticks: int) -> Run:
    """The same diagram in nengo, building left out.

    Nengo samples at the end of every tenth step: its row i is the pose at tick 10 i + 9.
    """
    import nengo

    model, probe = nengo_model(fixed.bias.shape[1], fixed=fixed)
    with nengo.Simulator(model, dt=DT, progress_bar=False) as simulator:
        began = time.perf_counter()
        simulator.run_steps(ticks)
        took = time.perf_counter() - began
        return Run(took, np.array(simulator.data[probe]))
