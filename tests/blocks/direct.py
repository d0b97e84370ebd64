"""Calls a block's methods by hand, without an engine."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from blocks import Block, BlockContext, BlockState, SignalType

# A description alone: it can be read and checked, and has no binary.
FMU = Path(__file__).parents[1] / "bridges" / "fmu" / "description.fmu"
PUSH = Path(__file__).parents[2] / "graphs" / "gallery" / "recorded_push.csv"
BAG = Path(__file__).parents[2] / "examples" / "robot" / "log.mcap"
# What the types of the library cannot be made without, or cannot run without at 1 ms; a new type
# with such a parameter belongs here, and is then tested and checked with the others.
REQUIRED: dict[str, dict[str, Any]] = {
    "MatrixMultiply": {"rows": 2, "inner": 3},
    "WaypointPath": {"points": [[0, 0], [1, 0], [1, 1], [0, 1]]},
    "Constant": {"value": 1.0},
    "Contact": {"body": 0.2},
    "Gain": {"gain": 2.0},
    "Lowpass": {"tau": 0.1},
    "Weights": {"weights": [[1.0, -2.0, 0.5], [0.5, 0.1, 0.2], [0.0, 0.0, 1.0]]},
    "Decoder": {"weights": [[1.0, -2.0, 0.5, 0.0]]},
    "StateSpace": {"A": [[0, 1], [-1, -1]], "B": [0, 1], "C": [1, 0]},
    "KalmanFilter": {"A": [[1, 0.1], [0, 1]], "C": [1, 0], "Q": [[1, 0], [0, 1]], "R": 1.0},
    "LinearQuadraticRegulator": {"A": [[0, 1], [-1, 0]], "B": [0, 1], "Q": [1, 1], "R": 1.0},
    "SteadyStateKalman": {
        **{"A": [[0, 1], [-1, 0]], "B": [[1, 0], [0, 1]], "C": [[1, 0], [1, 1]]},
        **{"Q": [1, 1], "R": [1, 1]},
    },
    "DiscreteSteadyStateKalman": {
        **{"A": [[1, 0.1], [-0.1, 1]], "B": [[1, 0], [0, 1]], "C": [[1, 0], [1, 1]]},
        **{"Q": [1, 1], "R": [1, 1]},
    },
    "PlanarArm": {"lengths": [0.5, 0.4, 0.3], "masses": [2, 1, 0.5]},
    "Trials": {"phases": {"show": 0.02, "wait": 0.03}, "items": 3},
    "SemanticPointer": {"words": ["RED*CIRCLE"]},
    "Similarity": {"words": ["RED", "CIRCLE"]},
    "Superposition": {"words": ["RED", "CIRCLE"]},
    "Vocabulary": {"items": 3, "dimensions": 4},
    "LinearMPC": {"A": [[0, 1], [-1, 0]], "B": [0, 1], "Q": [1, 1], "R": 1.0},
    "LinearL1": {"A": [[0, 1], [-1, 0]], "B": [0, 1]},
    "LinearDisturbanceObserver": {
        **{"A": [[1, 0.1], [-0.1, 1]], "B": [0, 0.1], "C": [1, 0]},
        **{"Q": [1, 1], "R": 1, "D": [0.1]},
    },
    "ExtendedKalmanFilter": {
        "transition": ["x[0] + 0.1*sin(x[1])", "0.9*x[1] + u[0]"],
        "observation": "x[0]**2 + x[1]",
        "Q": [[0.1, 0], [0, 0.1]],
        "R": 1.0,
        "x0": [1, 0.5],
    },
    "DynamicSystem": {"derivative": ["x[1]", "-x[0]"], "initial": [1, 0]},
    "AlgebraicConstraint": {"expression": "z**3 + z - u[0]", "low": -1e3, "high": 1e3},
    "Butterworth": {"cutoff": 2.0},
    "DiscreteSystem": {"next": ["x[1]", "0.5*x[0] - 0.2*x[1]"], "initial": [1, 0]},
    "SecondOrder": {"natural_frequency": 3.0},
    "TransferFunction": {"numerator": [1], "denominator": [1, 1]},
    "ZeroPoleGain": {"poles": [-1]},
    "Backlash": {"width": 0.5},
    "DeadZone": {"low": -1.0, "high": 1.0},
    "Delay": {"delay": 0.03},
    "DiscreteStateSpace": {"A": [[0.9, 0.1], [0, 0.8]], "B": [0, 1], "C": [1, 0]},
    "DiscreteTransferFunction": {"numerator": [1], "denominator": [2, -1]},
    "FMU": {"file": str(FMU)},
    "ModelExchangeFMU": {"file": str(FMU)},
    "FromBag": {"file": str(BAG), "topic": "/cmd_vel"},
    "FromFile": {"file": str(PUSH), "outside": "hold"},
    "Function": {"expression": "sin(u[0]) + t"},
    "LookupTable": {"x": [-1, 0, 1], "y": [1, 0, 1]},
    "LookupTable2D": {"x": [-1, 1], "y": [-1, 1], "values": [[1, 2], [3, 4]]},
    "MovingAverage": {"samples": 3},
    "Piecewise": {"times": [0, 1, 2], "values": [1, 3, 2]},
    "PinkNoise": {"density": 0.1},
    "Quantizer": {"step": 0.1},
    "RandomWalk": {"density": 0.1},
    "RateLimiter": {"rising": 1.0},
    "Select": {"indices": [0]},
    "WhiteNoise": {"density": 0.1},
    "WhiteSignal": {"period": 1.0, "high": 5.0},
    "Saturator": {"omega_max": 1.0},
    "ActuatorLag": {"tau": 0.1},
    "ActuatorDelay": {"delay": 0.03},
    "MinimumSnap": {"waypoints": [[0, 0, 0], [1, 0, 1], [1, 2, 0]], "times": [0, 0.2, 0.5]},
    "Latency": {"latency": 0.03},
    "MujocoVacuum": {"physics_step": 0.001},
}


def state_of(
    block: Block,
    types: Mapping[str, SignalType] | None = None,
    *,
    dt: float = 0.01,
    seed: int = 0,
    terms: Mapping[str, tuple[bool, ...]] | None = None,
) -> BlockState:
    """A started state; the block's states must have shapes of numbers, or like a port's."""
    kinds: dict[str, Any] = {name: block.port_type(name) for name in block.spec.ports}
    context = BlockContext(dt, {**kinds, **(types or {})}, terms or {})
    block.validate_in(context)
    arrays = {
        name: np.zeros(context.types[s.like].shape if s.like else s.shape)
        for name, s in block.spec.states.items()
    }
    state = BlockState(context, np.random.SeedSequence(seed), arrays)
    block.start(state)
    return state
