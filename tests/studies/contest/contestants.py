"""Who takes part, each as an experiment file: the same runs, budget and limit of effort."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from runtime.document import dump_yaml

HERE = Path(__file__).parent
EXPERIMENTS = HERE / "experiments"
# What a command may change by from one record (50 ms) to the next, root of the mean square (rad/s).
EFFORT = 0.15

WEIGHTS = {"params.q_y": "log(1..10000)", "params.q_theta": "log(0.1..1000)"}
LEARN = {"lqr.learn": "learning.out"}
STEPS = {
    "adaptive.params.learning_rate": "log(0.02..5)",
    "course.lookahead_time": "log(0.3..5)",
    "adaptive.params.e_leak": "log(0.001..10)",
}


def _tracker(kind: str, vary: dict[str, str], **more: Any) -> dict[str, Any]:
    """Another tracker in the LQR's place, without the adaptive part."""
    return {"without": "adaptive", "replace": {"lqr": kind}, **more, "vary": vary}


CONTESTANTS: dict[str, dict[str, Any]] = {
    "LQR": {"without": "adaptive", "vary": WEIGHTS},
    "our rule": {"graph": "../course.yaml", "vary": {**WEIGHTS, **STEPS}},
    "DisturbanceObserver": _tracker(
        "DisturbanceObserver", {"lqr.rate": "log(0.3..10)", "lqr.tau": "log(0.05..5)"}, wire=LEARN
    ),
    "Stanley": _tracker("Stanley", {"lqr.k": "log(0.3..10)", "lqr.wheel_base": "log(0.01..0.5)"}),
    "PathPID": _tracker(
        "PathPID",
        {
            "lqr.kp": "log(0.3..20)",
            "lqr.ki": "log(0.001..5)",
            "lqr.kd": "log(0.001..2)",
            "lqr.lookahead_time": "log(0.2..4)",
        },
    ),
    "our rule, MRAC for spikes": {
        "graph": "../course.yaml",
        "replace": {"adaptive.snn_omega": "MRAC"},
        "vary": {**WEIGHTS, **STEPS},
    },
    "SNN as printed": {
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-3)",
            "adaptive.params.leak": "log(1e-3..5)",
        }
    },
    "robust rule": {
        "graph": "../robust.yaml",
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-3)",
            "adaptive.params.leak": "log(1e-3..5)",
            "lateral.gain": "log(0.3..20)",
        },
    },
    "LQI": _tracker(
        "LQI",
        {**WEIGHTS, "lqr.q_integral": "log(0.01..10000)"},
        set={"lqr.r": [1.0, 1.0]},
        wire=LEARN,
    ),
    "L1Adaptive": _tracker(
        "L1Adaptive",
        {"lqr.rate": "log(0.3..10)", "lqr.predictor": "log(0.1..20)", "lqr.filter": "log(0.1..20)"},
        wire=LEARN,
    ),
    "our rule, integrator for spikes": {
        "graph": "../course.yaml",
        "replace": {"adaptive.snn_omega": "AdaptiveBias"},
        "vary": {**WEIGHTS, **STEPS},
    },
    "PurePursuit": _tracker("PurePursuit", {"lqr.lookahead_time": "log(0.2..4)"}),
    "MPC": _tracker(
        "MPC",
        {**WEIGHTS, "lqr.omega_rate": "log(0.5..50)"},
        set={"lqr.r": [1.0, 1.0], "lqr.omega_max": 1.5},
        wire={"lqr.turn": "match.feedforward.omega"},
    ),
}

TRAINING = {
    "half of the turn rate lost, heals": {"set": {"fault.gain": [1.0, 0.5]}},
    "turn bias 0.15 rad/s, motors lag 0.15 s": {
        "set": {"fault.bias": [0.0, 0.15], "lag.tau": 0.15}
    },
}
HELD_OUT = {
    "no fault": {},
    "30 % lost, heals": {"set": {"fault.gain": [1.0, 0.7]}},
    "80 % lost, heals": {"set": {"fault.gain": [1.0, 0.2]}},
    # One wheel 30 % slower, to first order about v_r, with wheels 0.23 m apart.
    "weak wheel": {"set": {"fault.gain": [0.85, 0.85], "fault.bias": [0.0, -0.26]}},
    "half lost at 0.4 m/s": {"set": {"params.v_r": 0.4, "fault.gain": [1.0, 0.5]}},
    "half lost, range noise 3 cm": {"set": {"lidar.sigma": 0.03, "fault.gain": [1.0, 0.5]}},
    "half lost in another room": {"set": {"world": "worlds/l_room.yaml", "fault.gain": [1.0, 0.5]}},
    "turn bias in a cluttered room, another heading": {
        "set": {
            "world": "worlds/cluttered_room.yaml",
            "fault.bias": [0.0, 0.15],
            "plant.x0": [0.0, 0.0, 2.0],
        }
    },
}


def experiment(name: str) -> dict[str, Any]:
    """The contents of a contestant's experiment file."""
    return {
        "experiment": name_of(name),
        "graph": "../walls.yaml",
        **CONTESTANTS[name],
        "minimize": "error",
        "constraints": {"effort_change": {"below": EFFORT}},
        "trials": 100,
        "sampler": "tpe",
        "training": {"seeds": "0..1", "conditions": TRAINING},
        "held_out": {"seeds": "100..104", "conditions": HELD_OUT},
    }


def name_of(name: str) -> str:
    """A contestant's name as that of a file."""
    return name.lower().replace(",", "").replace(" ", "_")


def write() -> list[Path]:
    """Write all experiment files."""
    EXPERIMENTS.mkdir(exist_ok=True)
    files = []
    for name in CONTESTANTS:
        path = EXPERIMENTS / f"{name_of(name)}.yaml"
        comment = f"# {name}: a contestant of the comparison at equal budget and effort.\n"
        comment += "# Written by python -m tests.studies.contest --files\n"
        path.write_text(comment + dump_yaml(experiment(name)), encoding="utf-8")
        files.append(path)
    return files
