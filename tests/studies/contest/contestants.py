"""Who takes part, each as an experiment file: the same runs, budget and limit of effort."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.document import dump_yaml
from tests.studies.contest import rooms

HERE = Path(__file__).parent
EXPERIMENTS = HERE / "experiments"
TRIALS = 40
# Whose front of error against effort is sought, below a limit beyond which none is of use.
FRONT, WIDEST = "front", 0.5
FRONTS = ("LQR", "robust rule", "PurePursuit")

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
ROBUST = {"graph": "../../robust.yaml"}


def _tracker(kind: str, vary: dict[str, str], **more: Any) -> dict[str, Any]:
    """Another tracker in the LQR's place, without the adaptive part."""
    return {"without": "adaptive", "replace": {"lqr": kind}, **more, "vary": vary}


def _helped(kind: str, vary: dict[str, str]) -> dict[str, Any]:
    """Another tracker in the LQR's place, with the robust rule beside it."""
    return {**ROBUST, "replace": {"lqr": kind}, "vary": {**vary, **STEPS}}


CONTESTANTS: dict[str, dict[str, Any]] = {
    "LQR": {"without": "adaptive", "vary": WEIGHTS},
    "LQR without feedforward": {
        "without": "adaptive",
        "set": {"match.alpha": 0.0},
        "vary": WEIGHTS,
    },
    "robust rule": {**ROBUST, "vary": {**WEIGHTS, **STEPS}},
    "robust rule, one setting": {**ROBUST, "vary": WEIGHTS},
    "SNN as printed": {
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-3)",
            "adaptive.params.leak": "log(1e-3..5)",
        }
    },
    "lateral rule": {
        "graph": "../../lateral.yaml",
        "vary": {
            **WEIGHTS,
            "adaptive.params.rate_omega": "log(1e-6..1e-1)",
            "adaptive.params.leak": "log(1e-3..5)",
            "lateral.gain": "log(0.3..20)",
        },
    },
    "Stanley": _tracker("Stanley", STANLEY),
    "Stanley and robust rule": _helped("Stanley", STANLEY),
    "PathPID": _tracker("PathPID", PID),
    "PathPID and robust rule": _helped("PathPID", PID),
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
    "robust rule, MRAC for spikes": {
        **ROBUST,
        "replace": {"adaptive.snn_omega": "MRAC"},
        "vary": {**WEIGHTS, **STEPS},
    },
    "robust rule, integrator for spikes": {
        **ROBUST,
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


RATE = {
    "adaptive.params.rate_omega": "log(1e-7..1e-2)",
    "adaptive.params.leak": "log(1e-3..5)",
}


FED = "LQR, feedforward tuned"


def _on_track(graph: str, overlay: str) -> dict[str, dict[str, Any]]:
    """Who takes part in the cases A and B, with the paper's feedforward, alpha = 0.06."""
    own = {"graph": graph, "with": f"../../{overlay}.yaml"}
    robust = {**own, "graph": f"{graph}_robust"}
    return {
        "LQR": {**own, "without": "adaptive", "vary": WEIGHTS},
        FED: {
            **own,
            "without": "adaptive",
            "vary": {**WEIGHTS, "match.alpha": "log(0.01..5)"},
        },
        "robust rule": {**robust, "vary": {**WEIGHTS, **STEPS}},
        "robust rule, one setting": {**robust, "vary": WEIGHTS},
        "SNN as printed": {**own, "vary": {**WEIGHTS, **RATE}},
        "lateral rule": {
            **own,
            "graph": f"../../{overlay.replace('tuned', 'lateral')}.yaml",
            "vary": {**WEIGHTS, **RATE, "lateral.gain": "log(0.1..20)"},
        },
        "Stanley": {**own, **_tracker("Stanley", STANLEY)},
        "PathPID": {**own, **_tracker("PathPID", PID)},
        "PurePursuit": {**own, **_tracker("PurePursuit", {"lqr.lookahead_time": "log(0.2..4)"})},
    }


LINE = {
    "training": {
        "half of the turn rate lost": {},
        "the same from the other side": {"set": {"plant.x0": [1.0, 0.0, -0.6]}},
        "turn bias 0.15 rad/s": {"set": {"fault.gain": [1.0, 1.0], **BIAS}},
    },
    "held_out": {
        "from the left": {"set": {"plant.x0": [0.5, 2.5, 0.8]}},
        "from the right": {"set": {"plant.x0": [2.5, -0.5, 1.2]}},
        "no fault": {"set": {"fault.gain": [1.0, 1.0]}},
        "30 % lost": {"set": {"fault.gain": [1.0, 0.7]}},
        "80 % lost": {"set": {"fault.gain": [1.0, 0.2]}},
        "bias the other way": {"set": {"fault.gain": [1.0, 1.0], "fault.bias": [0.0, -0.2]}},
        "half lost at 0.6 m/s": {"set": {"params.v_r": 0.6}},
    },
}
SINE = {
    "training": {
        "the paper's": {},
        "a longer wave": {"set": {"track.wavelength": 8.0}},
        "another start": {"set": {"plant.x0": [1.0, 0.0, -0.6]}},
    },
    "held_out": {
        "a flat wave": {"set": {"track.amplitude": 0.6, "track.wavelength": 5.0}},
        "a high wave": {"set": {"track.amplitude": 1.4, "track.wavelength": 8.5}},
        "from the left": {"set": {"plant.x0": [0.5, 2.5, 0.8]}},
        "no noise": {"set": {"noise.sigma_position": 0.0, "noise.sigma_heading": 0.0}},
        "half of the noise": {"set": {"noise.sigma_position": 0.025, "noise.sigma_heading": 0.05}},
        "at 0.6 m/s": {"set": {"params.v_r": 0.6}},
    },
}


@dataclass(frozen=True)
class Task:
    """What contestants are tuned on: a case of the paper under a limit of effort.

    ``limit`` is what a command may change by from one record (50 ms) to the next, root of the mean
    square (rad/s), ``counts`` (m) the smallest difference of the error that counts.
    """

    case: str
    limit: float
    contestants: Mapping[str, dict[str, Any]]
    runs: Mapping[str, Mapping[str, dict[str, Any]]]
    counts: float

    @property
    def held_out(self) -> list[str]:
        """The names of the held-out conditions."""
        return list(self.runs["held_out"])


ON_LINE = _on_track("line_actuator_failure", "tuned_line")
ON_LINE.pop(FED)  # a line has no curvature
WALLS = {"training": TRAINING, "held_out": HELD_OUT}
TASKS = {
    "gentle": Task("C", 0.2, CONTESTANTS, WALLS, 1e-3),
    "stiff": Task("C", 0.3, CONTESTANTS, WALLS, 1e-3),
    "line": Task("A", 0.03, ON_LINE, LINE, 5e-3),
    "sine": Task("B", 0.25, _on_track("sine_estimation_error", "tuned_sine"), SINE, 5e-3),
    FRONT: Task("C", WIDEST, {name: CONTESTANTS[name] for name in FRONTS}, WALLS, 1e-3),
}
# Ranges that were widened since the optimum lay at an end of the range of all.
WIDER: dict[tuple[str, str], dict[str, str]] = {
    ("gentle", "MPC"): {"params.q_theta": "log(1e-6..1000)"},
    ("gentle", "Stanley and robust rule"): {"course.lookahead_time": "log(0.01..5)"},
    ("sine", "PathPID"): {"lqr.ki": "log(0.001..100)"},
    ("sine", "Stanley"): {"lqr.k": "log(0.01..10)", "lqr.wheel_base": "log(0.003..10)"},
    ("sine", "lateral rule"): {"params.q_theta": "log(1e-6..1000)"},
}
LIMITS = tuple(name for name in TASKS if name != FRONT)


def experiment(name: str, limit: str) -> dict[str, Any]:
    """The contents of a contestant's experiment file, in a task."""
    task = TASKS[limit]
    own = task.contestants[name]
    return {
        "experiment": f"{limit}_{name_of(name)}",
        "graph": "../../walls.yaml",
        **own,
        "vary": {**own["vary"], **WIDER.get((limit, name), {})},
        "minimize": ["error", "effort_change"] if limit == FRONT else "error",
        "constraints": {"effort_change": {"below": task.limit}},
        "trials": TRIALS,
        "sampler": "tpe",
        "training": {"seeds": "0..1", "conditions": dict(task.runs["training"])},
        "held_out": {"seeds": "100..102", "conditions": dict(task.runs["held_out"])},
    }


def name_of(name: str) -> str:
    """A contestant's name as that of a file."""
    return name.lower().replace(",", "").replace(" ", "_")


def file_of(name: str, limit: str) -> Path:
    """A contestant's experiment file."""
    return EXPERIMENTS / limit / f"{name_of(name)}.yaml"


def write() -> None:
    """Write all experiment files."""
    for limit, task in TASKS.items():
        (EXPERIMENTS / limit).mkdir(parents=True, exist_ok=True)
        for name in task.contestants:
            comment = f"# {name}: a contestant of the comparison at equal budget and effort.\n"
            comment += "# Written by python -m tests.studies.contest --files\n"
            text = comment + dump_yaml(experiment(name, limit))
            file_of(name, limit).write_text(text, encoding="utf-8")
