"""Case A as one graph against nengo: the same two ensembles, plant and LQR as Nodes, dt 1 ms."""

from __future__ import annotations

import math
import time

import numpy as np

import runtime
from blocks import LQR, LinePath, MatchingPoint, TrackingError
from blocks.block import BlockState, Setting
from blocks.signals import FloatArray, Path

DT = 0.001
EVERY = 10
X0 = (math.pi / 2, 1.2, math.pi / 2)


def graph(until: float) -> runtime.Graph:
    """The shipped graph, without probes and pictures beyond the pose."""
    loaded = runtime.load("line_actuator_failure").set("run.until", until)
    for section in ("plots", "metrics", "probes"):
        loaded = loaded.set(section, {})
    return loaded.set("probes.pose", {"of": "plant.pose", "every": EVERY})


def ours(until: float) -> float:
    """Seconds of one run, building left out."""
    prepared = graph(until)
    prepared.check()
    return float(prepared.run().manifest["wall_s"])


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
            state = BlockState(Setting(DT * EVERY, types), np.random.SeedSequence(0), arrays)
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
    """Saturation, fault and unicycle for a nengo Node; returns the pose before the step."""

    def __init__(self) -> None:
        self.pose = X0

    def __call__(self, t: float, command: FloatArray) -> tuple[float, float, float]:
        x, y, theta = now = self.pose
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
        return now


def nengo_run(until: float) -> float:
    """Seconds of one run of the same diagram in nengo, building left out."""
    import nengo

    with nengo.Network(seed=0) as model:
        plant = nengo.Node(Plant(), size_in=2, size_out=3)
        controller = nengo.Node(Controller(), size_in=3, size_out=4)
        nengo.Connection(plant, controller, synapse=0)
        nengo.Connection(controller[:2], plant, synapse=None)
        for axis, (kappa, signal) in enumerate(((1e-8, 2), (6e-6, 3))):
            ensemble = nengo.Ensemble(100, 1, radius=2.0, intercepts=nengo.dists.Uniform(-1, 0.9))
            nengo.Connection(controller[signal], ensemble, synapse=None)
            learnt = nengo.Connection(
                ensemble,
                plant[axis],
                synapse=0.01,
                solver=nengo.solvers.NoSolver(np.zeros((100, 1))),
                learning_rule_type=nengo.PES(kappa, pre_synapse=nengo.Lowpass(0.01)),
            )
            nengo.Connection(controller[signal], learnt.learning_rule, synapse=None)
        probe = nengo.Probe(plant, sample_every=DT * EVERY)
    with nengo.Simulator(model, dt=DT, progress_bar=False) as simulator:
        began = time.perf_counter()
        simulator.run(until)
        took = time.perf_counter() - began
        final = simulator.data[probe][-1]
    if not (np.isfinite(final).all() and final[0] > X0[0] + 0.5 * (until - 5.0)):
        raise RuntimeError(f"nengo's robot went astray, to {final}; the comparison is void")
    return took
