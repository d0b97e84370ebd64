"""Every block of the library in its two forms: the methods that Python runs, and the text that is
compiled. The text is run as plain Python on many random runs, and compiled on one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import blocks
from blocks import (
    Block,
    Path,
    Pose,
    Scalar,
    Scan,
    SignalType,
    Twist,
    Vector,
)
from blocks.generic.mathematics import COMPARISONS, LOGIC
from blocks.library.index import TYPES
from blocks.library.registry import BUILTIN
from blocks.vehicle.contact import slide
from blocks.world.lidar import bearings
from blocks.world.surfaces import cast_kernel, from_surface, nearest_kernel
from blocks.world.world import World
from runtime.checking.bench import Bench
from runtime.checking.check import context_for
from runtime.compiler.fields import NotCompilableError
from runtime.compiler.translate import Translated, translate
from tests.blocks.direct import PUSH, REQUIRED
from tests.blocks.worlds import OVERLAPPING, SHIPPED, SQUARE, worlds
from tests.compilers import needs_compiler
from tests.examples import examples
from tests.runtime.engine.compiled_block import CompiledBlock

Draw = Callable[[np.random.Generator], Any]
ROOM = World(SHIPPED["paper_room"])
TICKS = 40
STREAMS = (0, 1, 2)
# Called from Python under the compiled engine: they compute with other libraries.


@dataclass(frozen=True)
class Case:
    """A block whose two forms are compared.

    types : of inputs, where they are not those of ``check_block``.
    inputs : makes a port's value, in place of the bench's random one.
    free : states in which any number is a sound one; they are drawn anew now and then.
    """

    block: Block
    types: dict[str, SignalType] = field(default_factory=dict)
    inputs: dict[str, Draw] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    dt: float = 0.01
    absent: bool = False
    world: World = ROOM

    def __str__(self) -> str:
        kinds = [f"{name}: {kind}" for name, kind in self.types.items()]
        return " ".join([repr(self.block), *kinds, *(["absent"] if self.absent else [])])


def normal(*sizes: float) -> Draw:
    """A record of normal numbers."""
    return lambda draw: tuple((np.array(sizes) * draw.standard_normal(len(sizes))).tolist())


def uniform(*highs: float) -> Draw:
    """A record of numbers between -high and high."""
    return lambda draw: tuple(draw.uniform(-np.array(highs), highs).tolist())


def seldom_new(of: Draw) -> Draw:
    """The same value as before, most of the time."""
    kept: dict[int, Any] = {}

    def value(draw: np.random.Generator) -> Any:
        if id(draw) not in kept or draw.random() < 0.2:
            kept.clear()
            kept[id(draw)] = of(draw)
        return kept[id(draw)]

    return value


def with_misses(draw: np.random.Generator) -> Any:
    """A scan that no LiDAR returns: near and far points everywhere, misses, NaN."""
    scan = draw.uniform(0.05, draw.choice([0.5, 3.0, 30.0]), 30)
    scan[draw.random(30) < 0.3] = math.inf
    scan[draw.random(30) < 0.05] = math.nan
    return np.full(30, math.inf) if draw.random() < 0.1 else scan


def seen_in_a_room(draw: np.random.Generator) -> Any:
    """A scan of a room with pillars."""
    x, y, theta = draw.uniform(-0.5, 0.5, 3).tolist()
    return ROOM.cast(x, y, theta + bearings(360, -math.pi, math.pi))


def ring(samples: int, radius: float) -> Draw:
    """A closed path."""
    turn = np.linspace(0.0, 2.0 * math.pi, samples, endpoint=False)
    rows = np.column_stack((radius * np.cos(turn), radius * np.sin(turn), turn, turn / radius))
    return lambda draw: rows


def generic(block: Block, *free: str) -> list[Case]:
    """A block that takes any type, with types of every form."""
    kinds = (blocks.Scalar, Pose, Vector(4), Path(5))
    return [Case(block, {block_input(block): kind}, free=free) for kind in kinds]


def elementwise(block: Block, *free: str) -> list[Case]:
    """A block that takes numbers, records and vectors, with each of them."""
    kinds = (Scalar, Pose, Vector(4))
    return [Case(block, {"input": kind}, free=free) for kind in kinds]


def block_input(block: Block) -> str:
    return next(name for name, port in block.spec.inputs.items() if port.type == blocks.Same("T"))


def some_stamps(draw: np.random.Generator) -> Any:
    """Stamps that are new, old, too old, and of nothing yet."""
    return tuple(draw.choice([-1.0, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3], 2).tolist())


# Measurements with a rate and a delay, and with stamps, some of which are late.
SEVERAL: dict[str, Any] = {
    "transition": ["p + 0.1*v*cos(t)", "v - 0.2*sin(p) + 0.1*u[0]"],
    "states": ["p", "v"],
    "measurements": {
        "slow": {"observation": "p", "R": 1, "dt": 0.04, "offset": 0.01, "delay": 0.03},
        "two": {"observation": ["atan2(v, p)", "v"], "R": [[1, 0.1], [0.1, 2]], "angles": [0]},
        "last": {"observation": "p*v", "R": 0.5},
    },
    "Q": [[0.1, 0], [0, 0.1]],
    "x0": [1, 0.5],
    "lag": 0.08,
}
WANDERING: dict[str, Draw] = {"pose": uniform(1.5, 1.5, 9.0)}
PUSHING: dict[str, Draw] = {"command": seldom_new(uniform(3.0, 3.0))}
TRACKING: dict[str, Draw] = {"error": normal(0.3, 0.3, 1.0), "reference": uniform(3.0, 3.0, 9.0)}
TURNING: dict[str, Draw] = {**TRACKING, "reference": seldom_new(uniform(3.0, 3.0, 9.0))}
NEURAL = ("weights", "activity")
WEIGHTS = [[1.0, -2.0, 0.5, 0.0], [0.3, 0.1, -0.7, 2.0]]
TWO = {"input": Vector(2), "error": Vector(2)}

CASES: dict[str, list[Case]] = {
    "MatchingPoint": [
        Case(blocks.MatchingPoint(), {"path": Path(50)}, free=("way",)),
        Case(blocks.MatchingPoint(window=0.1, curvature="unsigned"), {"path": Path(50)}),
        Case(blocks.MatchingPoint(window=0.5), {"path": Path(60)}, {"path": ring(60, 1.0)}),
        Case(blocks.MatchingPoint(window=9.0), {"path": Path(60)}, {"path": ring(60, 1.0)}),
    ],
    "CourseError": [Case(blocks.CourseError(lookahead_time=0.5), inputs=TRACKING)],
    "TrackingError": [Case(blocks.TrackingError(), inputs={"pose": uniform(3.0, 3.0, 9.0)})],
    "LQR": [
        Case(blocks.LQR(), inputs=TRACKING),
        Case(blocks.LQR(q=[1, 2, 3], v_r=-0.5), inputs=TURNING),
        Case(blocks.LQR(q=[0.01, 0.03, 0], r=[[1, 0.3], [0.3, 2]], model="exact"), inputs=TURNING),
        Case(blocks.LQR(q=[0, 1, 1]), inputs=TURNING, dt=0.1),
    ],
    "PathPID": [
        Case(blocks.PathPID(limit=2.0, ki=3.0), inputs=TRACKING, free=("integral", "smooth"))
    ],
    "PurePursuit": [Case(blocks.PurePursuit(), inputs=TRACKING)],
    "Stanley": [
        Case(blocks.Stanley(), inputs=TRACKING),
        Case(blocks.Stanley(wheel_base=0.2, delta_max=0.5), inputs=TRACKING),
    ],
    "LQI": [
        Case(blocks.LQI(limit=1.0), inputs=TRACKING, free=("integral",)),
        Case(blocks.LQI(v_r=-0.5), inputs=TRACKING, absent=True),
    ],
    "DisturbanceObserver": [
        Case(blocks.DisturbanceObserver(), inputs=TRACKING, free=("estimated",)),
        Case(blocks.DisturbanceObserver(limit=0.5, v_r=-0.3), inputs=TRACKING, absent=True),
    ],
    "L1Adaptive": [
        Case(blocks.L1Adaptive(), inputs=TRACKING, free=("estimated",)),
        Case(blocks.L1Adaptive(limit=0.5, filter=9.0), inputs=TRACKING, absent=True),
    ],
    "MRAC": [
        Case(blocks.MRAC(), free=("bias", "weights")),
        Case(blocks.MRAC(normalised=True, learning_rate=0.5), TWO, free=("bias", "weights")),
        Case(blocks.MRAC(leak=1.0, e_leak=0.5, limit=0.5, power=9e3), TWO, free=("weights",)),
    ],
    "AdaptiveEnsemble": [
        Case(blocks.AdaptiveEnsemble(), free=NEURAL, dt=0.001),
        Case(blocks.AdaptiveEnsemble(leak=1.0, limit=0.5), TWO, free=NEURAL, dt=0.001),
        Case(blocks.AdaptiveEnsemble(neurons=7), free=NEURAL, dt=0.002, absent=True),
    ],
    "RateEnsemble": [
        Case(blocks.RateEnsemble(), free=NEURAL),
        Case(blocks.RateEnsemble(leak=1.0, limit=0.5, neurons=33), TWO, free=NEURAL),
        Case(blocks.RateEnsemble(normalised=True, e_leak=0.3), TWO, free=NEURAL),
    ],
    "Ensemble": [
        Case(blocks.Ensemble(neurons=30, dimensions=2), free=("drive",), dt=0.001),
        Case(blocks.Ensemble(dimensions=1, neuron="AdaptiveLIF"), dt=0.002, absent=True),
        Case(blocks.Ensemble(dimensions=8, groups=2, neuron="LIFRate", neurons=9), dt=0.001),
        Case(blocks.Ensemble(dimensions=1, neuron="Izhikevich", max_rates=30), dt=0.001),
    ],
    "FeedthroughEnsemble": [
        Case(
            blocks.FeedthroughEnsemble(neurons=9, neuron=neuron, **more), free=("drive",), dt=0.001
        )
        for neuron, more in (
            ("LIF", {"dimensions": 4, "groups": 2}),
            ({"type": "ReLU", "spikes": "regular", "amplitude": 0.5}, {"dimensions": 1}),
            ("AdaptiveLIF", {"dimensions": 1, "noise": 0.1, "noise_synapse": 0.01}),
            ("Izhikevich", {"dimensions": 1, "max_rates": 30}),
        )
    ],
    "Decoder": [
        Case(blocks.Decoder(weights=WEIGHTS, synapse=synapse), dt=0.001)
        for synapse in (0.01, "alpha(0.1)")
    ]
    + [
        Case(blocks.Decoder(weights=WEIGHTS, learning="rls", filter="spikes"), dt=0.001),
        Case(blocks.Decoder(weights=WEIGHTS, learning="pes"), free=("pending",), dt=0.001),
    ],
    "SemanticPointer": [
        Case(blocks.SemanticPointer(words=["A", "B*C"], times=[0.0, 0.002], dimensions=5), dt=0.001)
    ],
    "Similarity": [Case(blocks.Similarity(words=["A", "B*C"], dimensions=4), dt=0.001)],
    "Superposition": [Case(blocks.Superposition(words=["A", "B*C"], dimensions=4), dt=0.001)],
    "SynapticFilter": [
        Case(blocks.SynapticFilter(synapse="triangle(0.005)"), dt=0.001),
        Case(
            blocks.SynapticFilter(synapse={"type": "linear", "num": [1, 2], "den": [1, 30]}),
            dt=0.001,
        ),
    ],
    "Weights": [Case(blocks.Weights(weights=WEIGHTS, learning={"rule": "bcm"}), dt=0.001)],
    "AdaptiveBias": [
        Case(blocks.AdaptiveBias(), free=("bias",)),
        Case(blocks.AdaptiveBias(leak=1.0, limit=0.5, power=1e4), free=("bias",)),
    ],
    "Lidar": [
        Case(blocks.Lidar(), inputs=WANDERING),
        Case(blocks.Lidar(beams=40, dropout=0.3, range_max=1.5, angle_min=-1.0), inputs=WANDERING),
        Case(
            blocks.Lidar(beams=60, sigma=0.0, range_max=math.inf),
            inputs=WANDERING,
            world=World(SHIPPED["outdoor"]),
        ),
    ],
    "WallFitter": [
        Case(
            blocks.WallFitter(),
            {"scan": Scan(360)},
            {"scan": seldom_new(seen_in_a_room), **WANDERING},
        )
    ],
    "Explorer": [
        Case(
            blocks.Explorer(explore_time=1.0, wander_hold=0.2),
            {"scan": Scan(30)},
            {"scan": with_misses, **WANDERING},
            free=("course",),
            dt=0.05,
        )
    ],
    "Sum": [
        *generic(blocks.Sum(signs=[1, -1])),
        Case(blocks.Sum(), {"terms": Twist}),
        Case(blocks.Sum(), {"terms": Twist}, absent=True),
    ],
    "Mux": [Case(blocks.Mux()), Case(blocks.Mux(), absent=True)],
    "Gain": [
        *generic(blocks.Gain(gain=-0.7)),
        Case(blocks.Gain(gain=[2, -3]), {"input": Twist}),
        Case(blocks.Gain(gain=[2, -3]), {"input": Vector(2)}),
        Case(blocks.Gain(gain=[[1, 2, 3], [4, 5, 6]])),
    ],
    "FourierTransform": [Case(blocks.FourierTransform(), {"input": Vector(n)}) for n in (1, 6, 7)],
    "InverseFourierTransform": [
        Case(blocks.InverseFourierTransform(odd=odd), {"re": Vector(4), "im": Vector(4)})
        for odd in (False, True)
    ],
    "Product": [
        Case(blocks.Product(powers=[1, -1])),
        Case(blocks.Product(), {"factors": Twist}),
        Case(blocks.Product(), {"factors": Vector(3)}, absent=True),
    ],
    "Norm": [
        *(Case(blocks.Norm(order=order)) for order in ("1", "2", "max")),
        Case(blocks.Norm(), absent=True),
    ],
    "Wrap": [*elementwise(blocks.Wrap()), Case(blocks.Wrap(low=0.0), {"input": Pose})],
    "Compare": [Case(blocks.Compare(operator=name, value=0.5)) for name in COMPARISONS],
    "Enable": [Case(blocks.Enable())],
    "Trigger": [Case(blocks.Trigger(edge=edge)) for edge in ("rising", "falling", "either")],
    "Logic": [
        *(Case(blocks.Logic(operator=name)) for name in LOGIC),
        Case(blocks.Logic(operator="nor"), absent=True),
    ],
    "Function": [
        Case(blocks.Function(expression="a*u[0]*u[1] - sin(t)", constants={"a": 2})),
        Case(blocks.Function(expression=["x**3", "clip(y, -1, 1)", "t"], names=["x", "y"])),
        Case(blocks.Function(expression=["min(u)", "norm(u)"], signal="Twist")),
        Case(blocks.Function(expression="x if 0 < x < 1 else -floor(x)%3", names=["x"])),
        Case(blocks.Function(expression="u[1]**4 + exp(-u[0]**2)/(1+u[0]**2)**0.5"), absent=True),
    ],
    "Concatenate": [Case(blocks.Concatenate()), Case(blocks.Concatenate(), absent=True)],
    "Broadcast": [Case(blocks.Broadcast(n=5)), Case(blocks.Broadcast(n=1))],
    "Cross": [Case(blocks.Cross())],
    "Normalize": [Case(blocks.Normalize())],
    "MatrixMultiply": [
        Case(blocks.MatrixMultiply(rows=2, inner=3)),
        Case(blocks.MatrixMultiply(rows=2, inner=3, columns=4)),
    ],
    "Rotate": [Case(blocks.Rotate()), Case(blocks.Rotate(inverse=True))],
    "QuaternionMultiply": [
        Case(blocks.QuaternionMultiply()),
        Case(blocks.QuaternionMultiply(inverse_left=True)),
    ],
    "QuaternionIntegrator": [
        Case(blocks.QuaternionIntegrator(), free=("q",)),
        Case(blocks.QuaternionIntegrator(frame="world", initial=[1, 1, 0, 0]), free=("q",)),
    ],
    "Select": [
        Case(blocks.Select(indices=[1, 0, 1])),
        Case(blocks.Select(indices=[0]), absent=True),
    ],
    "MultiportSwitch": [
        Case(blocks.MultiportSwitch(), {"inputs": kind}) for kind in (Scalar, Twist, Vector(3))
    ],
    "Clock": [Case(blocks.Clock())],
    "Sine": [Case(blocks.Sine(frequency=3.0, phase=1.0, offset=2.0))],
    "Step": [Case(blocks.Step(time=0.1, before=-1.0))],
    "Ramp": [Case(blocks.Ramp(start=0.1, stop=0.2, slope=-3.0))],
    "Pulse": [
        Case(blocks.Pulse(period=0.1)),
        Case(blocks.Pulse(period=0.1, rise=0.03, fall=0.02, width=0.01, start=0.05, count=2)),
    ],
    "Chirp": [Case(blocks.Chirp()), Case(blocks.Chirp(method="logarithmic", duration=0.3))],
    "Piecewise": [
        Case(blocks.Piecewise(times=[0, 0.1, 0.2, 0.25], values=[1, 3, 2, 5], method=method))
        for method in ("hold", "linear", "cubic")
    ]
    + [Case(blocks.Piecewise(times=[0.05, 0.1], values=[[1, 2], [3, 4]], signal="Twist"))],
    "Trials": [
        Case(blocks.Trials(phases={"show": 0.02, "wait": 0.03}, items=3, order="shuffled")),
        Case(blocks.Trials(phases={"a": 0.02, "b": 0.01}, items=2, by="phase", rounds=[2, 0])),
    ],
    "Vocabulary": [Case(blocks.Vocabulary(items=3, dimensions=4))],
    "FromFile": [
        Case(blocks.FromFile(file=str(PUSH), outside=outside, method=method))
        for outside, method in (("error", "cubic"), ("zero", "linear"))
    ]
    + [Case(blocks.FromFile(file=str(PUSH), columns=["force"], outside="zero"))],
    "WhiteNoise": [
        Case(blocks.WhiteNoise(density=0.1)),
        Case(blocks.WhiteNoise(density=[0.1, 0.2], mean=1.0, signal="Twist")),
    ],
    "PinkNoise": [
        Case(blocks.PinkNoise(density=0.1)),
        Case(blocks.PinkNoise(density=[0.1, 0.2], lowest=1.0, signal="Twist")),
    ],
    "WhiteSignal": [
        Case(blocks.WhiteSignal(period=0.1, high=30.0)),
        Case(blocks.WhiteSignal(period=0.2, high=10.0, rms=[0.1, 0.2], signal="Twist")),
    ],
    "RandomWalk": [Case(blocks.RandomWalk(density=0.1, initial=[1, 2], signal="Vector(2)"))],
    "Clip": [
        *elementwise(blocks.Clip(low=-0.5)),
        Case(blocks.Clip(high=[0.1, 0]), {"input": Twist}),
    ],
    "DeadZone": elementwise(blocks.DeadZone(low=-0.5, high=0.2)),
    "Quantizer": elementwise(blocks.Quantizer(step=0.25, offset=0.1)),
    "RateLimiter": elementwise(blocks.RateLimiter(rising=5.0, falling=-30.0), "previous"),
    "Backlash": elementwise(blocks.Backlash(width=0.5, initial=0.3), "previous"),
    "HitCrossing": [
        Case(blocks.HitCrossing(level=0.2, direction=direction))
        for direction in ("rising", "falling", "either")
    ],
    "Relay": elementwise(blocks.Relay(switch_on=0.5, switch_off=-0.5, low=-1.0), "previous"),
    "LookupTable": [
        Case(blocks.LookupTable(x=[-1, 0, 0.5, 1], y=[0, 1, -1, 2], method=method, outside=outside))
        for method in ("hold", "linear", "cubic", "pchip")
        for outside in ("hold", "extrapolate")
    ],
    "LookupTable2D": [
        Case(
            blocks.LookupTable2D(
                x=[-1, 0, 1], y=[-0.5, 0.5], values=[[1, 2], [3, 5], [0, 1]], **options
            )
        )
        for options in ({}, {"method": "hold"}, {"outside": "extrapolate"})
    ],
    "TransferFunction": [
        Case(blocks.TransferFunction(numerator=[1, 3], denominator=[1, 2, 5]), free=("x",)),
        Case(blocks.TransferFunction(numerator=[2, 1], denominator=[1, 3]), free=("x",)),
    ],
    "ZeroPoleGain": [
        Case(blocks.ZeroPoleGain(zeros=[1], poles=[-1], complex_poles=[[-1, 2]]), free=("x",))
    ],
    "SecondOrder": [Case(blocks.SecondOrder(natural_frequency=5.0), free=("x",))],
    "KalmanFilter": [
        Case(blocks.KalmanFilter(A=[[1, 0.1], [0, 1]], C=[1, 0], Q=[[1, 0], [0, 1]], R=2.0)),
        Case(
            blocks.KalmanFilter(
                A=[[1, 0.1], [0, 1]],
                B=[[0, 1], [1, 0]],
                C=[[1, 0], [1, 2]],
                Q=[[1, 0], [0, 1]],
                R=[[2, 1], [1, 2]],
            )
        ),
    ],
    "Derivative": elementwise(blocks.Derivative(tau=0.1), "x"),
    "PID": [
        Case(
            blocks.PID(ki=2.0, kd=0.1, upper=0.5, lower=-1.0),
            {"error": kind},
            free=("integral", "filtered"),
        )
        for kind in (Scalar, Pose, Vector(4))
    ],
    "DiscretePID": [
        Case(blocks.DiscretePID(ki=2.0, kd=0.1, n=n, upper=0.5, lower=-1.0), {"error": kind})
        for kind, n in ((Scalar, None), (Pose, 20.0), (Vector(4), 5.0))
    ],
    "AlgebraicConstraint": [
        Case(blocks.AlgebraicConstraint(**REQUIRED["AlgebraicConstraint"])),
        Case(
            blocks.AlgebraicConstraint(
                expression="a*(exp(z) - 1) - u[0] + z", low=-50, high=50, constants={"a": 0.1}
            )
        ),
    ],
    "Butterworth": [
        Case(blocks.Butterworth(cutoff=2.0, order=3)),
        Case(blocks.Butterworth(cutoff=[2.0, 5.0], band="bandstop")),
    ],
    "DiscreteSystem": [
        Case(blocks.DiscreteSystem(**REQUIRED["DiscreteSystem"])),
        Case(
            blocks.DiscreteSystem(
                next=["n + 1 if u[0] > u[1] else n", "a*v + sin(t)"],
                states=["n", "v"],
                constants={"a": 0.3},
                initial=[0, 1],
                output="n + u[0]",
            )
        ),
    ],
    "LinearQuadraticRegulator": [
        Case(
            blocks.LinearQuadraticRegulator(
                A=[[0, 1], [2, 0]], B=[[1, 0], [0, 1]], Q=[1, 1], R=[1, 2], x0=[1, 2], u0=[3, 4]
            )
        ),
        Case(blocks.LinearQuadraticRegulator(**REQUIRED["LinearQuadraticRegulator"])),
    ],
    "LinearMPC": [
        Case(blocks.LinearMPC(**REQUIRED["LinearMPC"])),
        Case(
            blocks.LinearMPC(
                **REQUIRED["LinearMPC"] | {"low": -1.0, "high": 0.5, "rate": 20.0, "steps": 6}
            )
        ),
        Case(
            blocks.LinearMPC(
                **{"A": [[0, 1], [2, 0]], "B": [[1, 0], [0, 1]], "Q": [1, 1], "R": [1, 2]},
                **{"low": [-0.5, -math.inf], "high": [0.2, 1], "steps": 4, "x0": [1, 2]},
                states_high=[math.inf, 2.5],
            ),
            {"reference": Vector(2)},
        ),
    ],
    "MPC": [
        Case(blocks.MPC(), inputs=TRACKING),
        Case(blocks.MPC(omega_max=0.7, omega_rate=2.0, v_max=1.2, steps=5), inputs=TRACKING),
    ],
    "LinearL1": [
        Case(blocks.LinearL1(**REQUIRED["LinearL1"])),
        Case(
            blocks.LinearL1(
                A=[[0, 1], [2, 0]], B=[[1, 0], [0, 1]], x0=[1, 2], u0=[3, 4], limit=0.5, filter=20.0
            ),
            {"baseline": Vector(2)},
        ),
    ],
    "LinearDisturbanceObserver": [
        Case(blocks.LinearDisturbanceObserver(**REQUIRED["LinearDisturbanceObserver"])),
        Case(
            blocks.LinearDisturbanceObserver(
                A=[[1, 0.1], [0, 1]],
                B=[[0.1, 0], [0, 0.1]],
                C=[[1, 0], [0, 1]],
                Q=[0.1, 0.1],
                R=[0.1, 0.2],
                D=[0.1, 0.3],
                x0=[1, 2],
                u0=[3, 4],
                initial=[0, 1],
            )
        ),
    ],
    "SteadyStateKalman": [Case(blocks.SteadyStateKalman(**REQUIRED["SteadyStateKalman"]))],
    "DiscreteSteadyStateKalman": [
        Case(blocks.DiscreteSteadyStateKalman(**REQUIRED["DiscreteSteadyStateKalman"]))
    ],
    "ExtendedKalmanFilter": [
        Case(blocks.ExtendedKalmanFilter(**REQUIRED["ExtendedKalmanFilter"])),
        Case(
            blocks.ExtendedKalmanFilter(
                transition=["p + 0.1*v*cos(t)", "v - k*sin(p)"],
                observation=["atan2(v, p)", "sqrt(1 + p**2)"],
                states=["p", "v"],
                constants={"k": 0.2},
                Q=[[0.1, 0], [0, 0.1]],
                R=[[1, 0.1], [0.1, 2]],
                x0=[1, 0.5],
                angles=[0],
            ),
        ),
        Case(blocks.ExtendedKalmanFilter(**SEVERAL), inputs={"stamp": some_stamps}),
    ],
    "DynamicSystem": [
        Case(blocks.DynamicSystem(derivative=["x[1]", "-sin(x[0])"], initial=[1, 0]), free=("x",)),
        Case(
            blocks.DynamicSystem(
                derivative=["v", "-g + u[1]"],
                initial=[1, 0],
                states=["h", "v"],
                constants={"g": 9.81},
                output=["h", "v*u[0]"],
                when="h < 0 and v < 0",
                then=["0", "-0.8*v"],
                signal="Twist",
            ),
            free=("x",),
        ),
        Case(blocks.DynamicSystem(derivative="-x[0]", initial=1.0), absent=True),
        Case(
            blocks.DynamicSystem(
                derivative=["v", "solve(m + outer(p, p), -r*p) - v/norm(v, 1)"],
                initial=[1, 0.5, 0, 0.8],
                states=["p(2)", "v(2)"],
                constants={"m": [[2, 0.5], [0.5, 1]]},
                let={"r": "1/norm(p)**3 if norm(p) > 0.1 and det(inv(m)) > 0 else 0"},
            ),
            free=("x",),
        ),
    ],
    "Unicycle": [Case(blocks.Unicycle(), free=("x",))],
    "Bicycle": [
        Case(blocks.Bicycle(v_max=1.0), free=("x",)),
        Case(blocks.Bicycle(body_radius=0.3), free=("x",), world=World({"room": SQUARE})),
    ],
    "Contact": [
        Case(blocks.Contact(body=0.2), world=World(OVERLAPPING)),
        Case(blocks.Contact(body=[[-1, -1], [1, -1], [1, 1]]), world=World(OVERLAPPING)),
    ],
    "Pendulum": [Case(blocks.Pendulum(damping=0.1), free=("x",))],
    "CartPole": [Case(blocks.CartPole(friction=0.1), free=("x",))],
    "MassSpringDamper": [Case(blocks.MassSpringDamper(damping=0.1), free=("x",))],
    "DoubleIntegrator": [
        Case(blocks.DoubleIntegrator(), {"acceleration": kind}, free=("x", "v"))
        for kind in (Scalar, Twist, Vector(3))
    ],
    "RigidBody": [
        Case(blocks.RigidBody(attitude0=[1, 2, 3, 4], gravity=9.81)),
        Case(blocks.RigidBody(inertia=[[2, 0.1, 0], [0.1, 3, 0], [0, 0, 4]], frame="body")),
    ],
    "Quadrotor": [
        Case(blocks.Quadrotor(drag=[0.1, 0.2, 0.3], attitude0=[1, 0.2, 0.3, 0.4])),
        Case(blocks.Quadrotor(layout="cross", hovers=False)),
    ],
    "RotorMixer": [Case(blocks.RotorMixer()), Case(blocks.RotorMixer(layout="cross"))],
    "GeometricControl": [Case(blocks.GeometricControl())],
    "Lemniscate": [Case(blocks.Lemniscate(size=[1, 2, 3], centre=[0, 1, 0], period=0.3))],
    "MinimumSnap": [Case(blocks.MinimumSnap(**REQUIRED["MinimumSnap"]))],
    "DrydenWind": [Case(blocks.DrydenWind(mean=[1, 2, 3], direction=0.5), free=("lags",))],
    "IMU": [Case(blocks.IMU(gyro_bias=[0.1, 0, 0]))],
    "GPS": [Case(blocks.GPS(drift=[1, 1, 2], tau=0.1))],
    "Compass": [
        Case(blocks.Compass(deviation=[0.1, 0.2], declination=0.1)),
    ],
    "WheelOdometry": [
        Case(blocks.WheelOdometry(scale=[1.1, 0.9])),
        Case(blocks.WheelOdometry(resolution=0.001)),
    ],
    "Dropout": [
        Case(blocks.Dropout(probability=0.3), {"input": kind}) for kind in (Scalar, Pose, Vector(4))
    ]
    + [Case(blocks.Dropout(probability=0.3, burst=4))],
    "Latency": [
        Case(blocks.Latency(latency=0.02, jitter=0.05), {"input": kind})
        for kind in (Scalar, Pose, Vector(4))
    ]
    + [Case(blocks.Latency(latency=0.02, jitter=0.05, ordered=False))],
    "PlanarArm": [
        Case(blocks.PlanarArm(**REQUIRED["PlanarArm"]), free=("x",)),
        Case(blocks.PlanarArm(lengths=[0.5], masses=[1.0], friction=0.1), free=("x",)),
    ],
    "TwoLinkArm": [Case(blocks.TwoLinkArm(friction=[0.1, 0.2]), free=("x",))],
    "Delay": [*elementwise(blocks.Delay(delay=0.05), "ring"), Case(blocks.Delay(delay=0.0333))],
    "Hold": elementwise(blocks.Hold()),
    "FirstOrderHold": elementwise(blocks.FirstOrderHold()),
    "MovingAverage": [
        *elementwise(blocks.MovingAverage(samples=4, initial=1.0), "ring"),
        Case(blocks.MovingAverage(samples=1)),
    ],
    "DiscreteTransferFunction": [
        *elementwise(
            blocks.DiscreteTransferFunction(numerator=[0.2, 0.1], denominator=[2, -1, 0.3]),
            "memory",
        ),
        Case(blocks.DiscreteTransferFunction(numerator=[1, 0.5], denominator=[1, -0.3])),
        Case(blocks.DiscreteTransferFunction(numerator=[3], denominator=[2])),
    ],
    "DiscreteIntegrator": [
        *elementwise(blocks.DiscreteIntegrator(), "total"),
        Case(blocks.DiscreteIntegrator(method="backward", upper=0.02, gain=2.0), {"input": Twist}),
        Case(blocks.DiscreteIntegrator(method="trapezoidal", initial=1.0)),
    ],
    "DiscreteStateSpace": [
        Case(blocks.DiscreteStateSpace(A=[[0.9, 0.1], [0, 0.8]], B=[0, 1], C=[1, 0]), free=("x",)),
        Case(
            blocks.DiscreteStateSpace(
                A=[[0.5]], B=[[1, 2]], C=[[1], [2]], D=[[1, 0], [0, 1]], x0=[1]
            ),
            free=("x",),
        ),
    ],
    "Switch": generic(blocks.Switch()),
    "UnitDelay": [
        *generic(blocks.UnitDelay(), "memory"),
        Case(blocks.UnitDelay(initial=[1, 2]), {"input": Twist}),
    ],
    "Lowpass": generic(blocks.Lowpass(tau=0.1, initial=3), "memory"),
    "Integrator": [
        *generic(blocks.Integrator(initial=0.5), "integral"),
        *generic(blocks.Integrator(lower=-0.1, upper=0.2), "integral"),
    ],
    "StateSpace": [
        Case(blocks.StateSpace(A=[[0, 1], [-1, -1]], B=[0, 1], C=[1, 0]), free=("x",)),
        Case(
            blocks.StateSpace(A=[[-1]], B=[[1, 2]], C=[[1], [2], [3]], D=0.5, x0=[1.0]),
            free=("x",),
        ),
    ],
    "Saturator": [Case(blocks.Saturator(omega_max=1))],
    "ActuatorFault": [
        Case(blocks.ActuatorFault(gain=[1, 0.5], bias=[0, 0.1], start=0.1, stop=0.3))
    ],
    "ActuatorLag": [Case(blocks.ActuatorLag(tau=0.1), free=("reached",))],
    "ActuatorDelay": [Case(blocks.ActuatorDelay(delay=0.07, capacity=9), free=("ring",))],
    "WheelSlip": [Case(blocks.WheelSlip(correlation_time=0.02))],
    "PoseNoise": [Case(blocks.PoseNoise())],
    "DifferentialDrive": [
        *(
            Case(blocks.DifferentialDrive(integrator=name), free=("pose_state",))
            for name in ("euler", "rk4", "exact")
        ),
        Case(blocks.DifferentialDrive(body_radius=0.12), inputs=PUSHING, dt=0.1),
        Case(
            blocks.DifferentialDrive(body_radius=0.25, x0=[0, -1, 0]),
            inputs=PUSHING,
            dt=0.1,
            world=World(OVERLAPPING),
        ),
    ],
}
EVERY = [case for cases in CASES.values() for case in cases]


def has_work(cls: type[Block]) -> bool:
    """Whether a block runs in a tick: constants are computed once, in Python."""
    outputs = cls.spec.outputs.values()
    return cls.spec.update is not None or not all(port.constant for port in outputs)


def test_every_block_that_runs_in_a_tick_is_here() -> None:
    working = {name for name in TYPES if has_work(BUILTIN[name])}
    assert working == CASES.keys()
    for name, cases in CASES.items():
        assert all(type(case.block) is BUILTIN[name] for case in cases)


class Run:
    """One run of a block, in one of its forms, fed with random inputs."""

    def __init__(self, case: Case, seed: int) -> None:
        self.case = case
        context = context_for(case.block, case.types, case.dt, case.world)
        self.bench = Bench(case.block, context, 1, open_inputs=case.absent)
        self.state = self.bench._state(seed)
        case.block.start(self.state)

    def call(self, method: str, t: float, *arguments: Any) -> Any:
        return getattr(self.case.block, method)(self.state, t, *arguments)

    def terms(self) -> dict[str, int]:
        flags = self.state.context.terms
        return {name: sum(connected) for name, connected in flags.items()}

    def tick(self, t: float, inputs: dict[str, Any]) -> dict[str, Any]:
        """All outputs and states of a tick, after its update."""
        spec, values = self.case.block.spec, dict(inputs)
        for evaluation in spec.evaluations:
            left = self.case.block.indirect
            arguments = [values[port] for port in evaluation.needs if port not in left]
            found = self.call(evaluation.method, t, *arguments)
            found = found if len(evaluation.outputs) > 1 else (found,)
            values.update(zip(evaluation.outputs, found, strict=True))
        if spec.update is not None:
            self.call(spec.update.method, t, *[values[port] for port in spec.update.needs])
        if spec.derivative is not None:
            needs = [values[port] for port in spec.derivative.needs]
            rates = self.call(spec.derivative.method, t, *needs)
            rates = rates if len(spec.continuous) > 1 else (rates,)
            for name, rate in zip(spec.continuous, rates, strict=True):
                getattr(self.state, name)[...] += self.case.dt * np.asarray(rate)
        if spec.projects:
            self.project()
        states = {name: getattr(self.state, name).copy() for name in spec.states}
        return {**{name: values[name] for name in spec.outputs}, **states}

    def project(self) -> None:
        self.case.block.project(self.state)  # type: ignore[attr-defined]


class TextRun(Run):
    """A run of the text that is compiled, as plain Python."""

    def __init__(self, case: Case, seed: int) -> None:
        super().__init__(case, seed)
        self.made = translate(case.block, self.state, self.terms())
        self.functions = self.loaded(self.made)
        self.fields = self.made.fields.values(case.block, self.state)

    def loaded(self, made: Translated) -> dict[str, Any]:
        scope: dict[str, Any] = {}
        exec(compile(made.text, f"<{type(self.case.block).__name__}>", "exec"), scope)
        return {method: scope[function] for method, function in made.methods.items()}

    def call(self, method: str, t: float, *arguments: Any) -> Any:
        with np.errstate(
            invalid="ignore"
        ):  # such as infinity times zero; compiled text does not warn
            return self.functions[method](self.fields, t, *arguments)

    def project(self) -> None:
        self.functions["project"](self.fields)


class CompiledRun(Run):
    """A run of the compiled block."""

    checked = False

    def __init__(self, case: Case, seed: int) -> None:
        super().__init__(case, seed)
        self.compiled = CompiledBlock(case.block, self.state, self.terms(), self.checked)

    def call(self, method: str, t: float, *arguments: Any) -> Any:
        return self.compiled.call(method, t, *arguments)

    def project(self) -> None:
        self.compiled.call("project", 0.0)


class CheckedRun(CompiledRun):
    """A run of the compiled block that checks its indices."""

    checked = True


def check_equal(case: Case, form: type[Run], stream: int, ticks: int = TICKS) -> None:
    """Run both forms on the same random inputs, and compare outputs and states in each tick."""
    python, other = Run(case, stream), form(case, stream)
    draw = np.random.default_rng(stream)
    for k in range(ticks):
        t = k * case.dt
        inputs = python.bench._inputs(draw)
        inputs.update({name: make(draw) for name, make in case.inputs.items()})
        if k % 10 == 5:
            for name in case.free:
                drawn = draw.standard_normal(getattr(python.state, name).shape)
                getattr(python.state, name)[...] = getattr(other.state, name)[...] = drawn
        expected, found = python.tick(t, inputs), other.tick(t, inputs)
        for name, value in expected.items():
            message = f"{name} at tick {k} of stream {stream}"
            assert np.shape(found[name]) == np.shape(value), message
            # A difference is as accurate as its terms.
            np.testing.assert_allclose(found[name], value, 1e-12, 1e-12, err_msg=message)


@pytest.mark.parametrize(
    "streams", [STREAMS[:1], pytest.param(STREAMS[1:], marks=pytest.mark.slow)], ids=str
)
@pytest.mark.parametrize("case", EVERY, ids=str)
def test_the_text_computes_what_the_block_computes(case: Case, streams: tuple[int, ...]) -> None:
    for stream in streams:
        check_equal(case, TextRun, stream)


def compiled() -> Iterator[Any]:
    """All cases; all but the first one of a block take long for what they show."""
    for cases in CASES.values():
        for i, case in enumerate(cases):
            yield pytest.param(case, id=str(case), marks=[pytest.mark.slow] if i else [])


@needs_compiler
@pytest.mark.parametrize("form", [CompiledRun, pytest.param(CheckedRun, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", list(compiled()))
def test_the_compiled_block_computes_what_the_block_computes(case: Case, form: type[Run]) -> None:
    check_equal(case, form, len(STREAMS))


def test_a_solver_of_another_library_is_not_compiled() -> None:
    with pytest.raises(NotCompilableError, match=r"imports 'scipy.linalg' \(.*lqr.py:\d+\)"):
        TextRun(Case(blocks.LQR(q=[1, 2, 3], solver="dare")), 0)


places = st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5))


@examples(40)
@given(worlds(), places)
def test_nearest_in_loops(world: World, place: tuple[float, float]) -> None:
    found, expected = nearest_kernel(world.arrays, *place), world.nearest(*place)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@examples(40)
@given(worlds(), st.integers(0, 2**32 - 1))
def test_nearest_behind_surfaces_is_the_distance(world: World, seed: int) -> None:
    """By an independent computation: World.distance, and the direction of the normal."""
    points = np.random.default_rng(seed).uniform(-2.5, 2.5, (50, 2))
    distance = world.distance(points)
    for (x, y), d in zip(points.tolist(), distance.tolist(), strict=True):
        found, nx, ny = from_surface(world.arrays[3], x, y, d < 0.0)
        assert found == pytest.approx(d, rel=1e-12, abs=1e-12)
        assert math.hypot(nx, ny) == pytest.approx(1.0, abs=1e-9)
        on_surface = np.array([[x - found * nx, y - found * ny]])
        assert abs(world.distance(on_surface)[0]) < 1e-9


@examples(40)
@given(worlds(), places, st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)))
def test_sliding_in_loops(
    world: World, place: tuple[float, float], way: tuple[float, float]
) -> None:
    class Loops:
        """The world as the arrays that compiled text uses."""

        def nearest(self, x: float, y: float) -> Any:
            return nearest_kernel(world.arrays, x, y)

    gap = world.nearest(*place)[0] - 0.1
    assume(gap >= 0.0)
    loops: Any = Loops()
    found, expected = (slide(w, *place, gap, *way, 0.1) for w in (loops, world))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@examples(40)
@given(worlds(), st.integers(0, 2**32 - 1))
def test_cast_in_loops(world: World, seed: int) -> None:
    """From generic positions and at generic angles: on a corner, rounding decides."""
    draw = np.random.default_rng(seed)
    points = draw.uniform(-2.5, 2.5, (20, 2))
    points = points[world.distance(points) > 1e-3][:3]
    ahead = np.sort(draw.uniform(-math.pi, math.pi, 60))
    theta = float(draw.uniform(-9.0, 9.0))
    for x, y in points.tolist():
        expected = world.cast(x, y, ahead + theta)
        found = cast_kernel(world.arrays, x, y, theta, ahead)
        # Along a wall, a range is as uncertain as the angle is, times the range's slope.
        with np.errstate(invalid="ignore"):  # infinity minus infinity
            slope = np.abs(world.cast(x, y, ahead + theta + 1e-7) - expected) / 1e-7
            room = 1e-12 * (1.0 + np.abs(expected) + np.nan_to_num(slope))
            same = (found == expected) | (np.abs(found - expected) <= room)
        assert same.all(), (found[~same], expected[~same])
