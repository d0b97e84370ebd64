"""Who takes part, each as an experiment file: the same runs, budget and limit of effort."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from runtime.document import dump_yaml
from tests.studies.contest import rooms

HERE = Path(__file__).parent
EXPERIMENTS = HERE / "experiments"
# What a command may change by from one record (50 ms) to the next, root of the mean square (rad/s).
LIMITS = {"gentle": 0.2, "stiff": 0.3}
TRIALS = 40
# Whose front of error against effort is sought, below a limit beyond which none is of use.
FRONT, WIDEST = "front", 0.5
FRONTS = ("LQR", "robust rule", "our rule", "PurePursuit")

WEIGHTS = {"params.q_y": "log(1..100000)", "params.q_theta": "log(0.001..1000)"}
LEARN = {"lqr.learn": "learning.out"}
STEPS = {
    "adaptive.params.learning_rate": "log(0.02..100)",
    "adaptive.params.leak": "log(0.001..5)",
    "course.lookahead_time": "log(0.3..5)",
    "adaptive.params.e_leak": "log(0.001..10)",
}


STANLEY = {"lqr.k": "log(0.1..10)", "lqr.wheel_base": "log(0.003..0.5)"}
PID = {
    "lqr.kp": "log(0.3..20)",
    "lqr.ki": "log(0.001..5)",
    "lqr.kd": "log(0.001..2)",
    "lqr.lookahead_time": "log(0.2..4)",
}
COURSE = {"graph": "../../course.yaml"}


def _tracker(kind: str, vary: dict[str, str], **more: Any) -> dict[str, Any]:
    """Another tracker in the LQR's place, without the adaptive part."""
    return {"without": "adaptive", "replace": {"lqr": kind}, **more, "vary": vary}


def _helped(kind: str, vary: dict[str, str]) -> dict[str, Any]:
    """Another tracker in the LQR's place, with our rule beside it."""
    return {**COURSE, "replace": {"lqr": kind}, "vary": {**vary, **STEPS}}


CONTESTANTS: dict[str, dict[str, Any]] = {
    "LQR": {"without": "adaptive", "vary": WEIGHTS},
    "LQR without feedforward": {
        "without": "adaptive",
        "set": {"match.alpha": 0.0},
        "vary": WEIGHTS,
    },
    "our rule": {**COURSE, "vary": {**WEIGHTS, **STEPS}},
    "our rule, one setting": {**COURSE, "vary": WEIGHTS},
    "SNN as printed": {
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-3)",
            "adaptive.params.leak": "log(1e-3..5)",
        }
    },
    "robust rule": {
        "graph": "../../robust.yaml",
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-1)",
            "adaptive.params.leak": "log(1e-3..5)",
            "lateral.gain": "log(0.3..20)",
        },
    },
    "Stanley": _tracker("Stanley", STANLEY),
    "Stanley and our rule": _helped("Stanley", STANLEY),
    "PathPID": _tracker("PathPID", PID),
    "PathPID and our rule": _helped("PathPID", PID),
    "LQI": _tracker(
        "LQI",
        {**WEIGHTS, "lqr.q_integral": "log(0.01..10000)"},
        set={"lqr.r": [1.0, 1.0]},
        wire=LEARN,
    ),
    "DisturbanceObserver": _tracker(
        "DisturbanceObserver", {"lqr.rate": "log(0.3..10)", "lqr.tau": "log(0.05..5)"}, wire=LEARN
    ),
    "L1Adaptive": _tracker(
        "L1Adaptive",
        {"lqr.rate": "log(0.3..10)", "lqr.predictor": "log(0.1..20)", "lqr.filter": "log(0.1..20)"},
        wire=LEARN,
    ),
    "MPC": _tracker(
        "MPC",
        {**WEIGHTS, "lqr.omega_rate": "log(0.5..50)"},
        set={"lqr.r": [1.0, 1.0], "lqr.omega_max": 1.5},
        wire={"lqr.turn": "match.feedforward.omega"},
    ),
    "PurePursuit": _tracker("PurePursuit", {"lqr.lookahead_time": "log(0.2..4)"}),
    "our rule, MRAC for spikes": {
        **COURSE,
        "replace": {"adaptive.snn_omega": "MRAC"},
        "vary": {**WEIGHTS, **STEPS},
    },
    "our rule, integrator for spikes": {
        **COURSE,
        "replace": {"adaptive.snn_omega": "AdaptiveBias"},
        "vary": {**WEIGHTS, **STEPS},
    },
}

HALF = {"fault.gain": [1.0, 0.5]}
BIAS = {"fault.bias": [0.0, 0.15]}
TRAINING = {
    "half of the turn rate lost, heals": {"set": HALF},
    "turn bias 0.15 rad/s, motors lag 0.15 s, range noise 2 cm": {
        "set": {**BIAS, "lag.tau": 0.15, "lidar.sigma": 0.02}
    },
}
HELD_OUT = {
    "no fault": {},
    "30 % lost, heals": {"set": {"fault.gain": [1.0, 0.7]}},
    "80 % lost, heals": {"set": {"fault.gain": [1.0, 0.2]}},
    # One wheel 30 % slower, to first order about v_r, with wheels 0.23 m apart.
    "weak wheel": {"set": {"fault.gain": [0.85, 0.85], "fault.bias": [0.0, -0.26]}},
    "half lost at 0.4 m/s": {"set": {"params.v_r": 0.4, **HALF}},
    "half lost, range noise 3 cm": {"set": {"lidar.sigma": 0.03, **HALF}},
    "turn bias in a cluttered room": {"set": {"world": "worlds/cluttered_room.yaml", **BIAS}},
    **{
        f"half lost, random room {seed}": {
            "set": {
                "world": f"../../rooms/random_{seed}.yaml",
                "plant.x0": [0.0, 0.0, rooms.heading(seed)],
                **HALF,
            }
        }
        for seed in rooms.SEEDS
    },
    "rigid-body physics, weak wheel, slippery patch": {
        "with": "../../mujoco.yaml",
        "set": {
            "plant.wheel_gain": [0.75, 1.0],
            "plant.patch": [1.5, -1.5, 0.45],
            "plant.patch_friction": 0.02,
            "plant.start": 60.0,
            "plant.stop": 90.0,
        },
    },
}


def experiment(name: str, limit: str) -> dict[str, Any]:
    """The contents of a contestant's experiment file, under a limit of effort or for a front."""
    return {
        "experiment": f"{limit}_{name_of(name)}",
        "graph": "../../walls.yaml",
        **CONTESTANTS[name],
        "minimize": ["error", "effort_change"] if limit == FRONT else "error",
        "constraints": {"effort_change": {"below": LIMITS.get(limit, WIDEST)}},
        "trials": TRIALS,
        "sampler": "tpe",
        "training": {"seeds": "0..1", "conditions": TRAINING},
        "held_out": {"seeds": "100..102", "conditions": HELD_OUT},
    }


def name_of(name: str) -> str:
    """A contestant's name as that of a file."""
    return name.lower().replace(",", "").replace(" ", "_")


def file_of(name: str, limit: str) -> Path:
    """A contestant's experiment file."""
    return EXPERIMENTS / limit / f"{name_of(name)}.yaml"


def write() -> None:
    """Write all experiment files."""
    written = [(limit, name) for limit in LIMITS for name in CONTESTANTS]
    for limit, name in [*written, *((FRONT, name) for name in FRONTS)]:
        (EXPERIMENTS / limit).mkdir(parents=True, exist_ok=True)
        comment = f"# {name}: a contestant of the comparison at equal budget and effort.\n"
        comment += "# Written by python -m tests.studies.contest --files\n"
        text = comment + dump_yaml(experiment(name, limit))
        file_of(name, limit).write_text(text, encoding="utf-8")
