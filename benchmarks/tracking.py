"""The control part alone: unicycle, line, error, feedback, sum, saturator, fault; no neurons.

What each box computes stands here once; every contestant wires these boxes in its own way. The
unicycle takes Euler steps, which all of them can.
"""

from __future__ import annotations

import math
from functools import cache

import runtime
from benchmarks.agreement import Run
from blocks import LQR, Block, Input, Output, Pose
from blocks.core import PoseValue

X0 = (math.pi / 2, 1.2, math.pi / 2)
LINE_Y = 1.0
FORWARD = (1.0, 0.0)
OMEGA_MAX = 1.0
FAULT = (1.0, 0.5)
WEIGHTS = {"q": [0.03, 0.03, 0.03], "r": [1.0, 1.0]}

Triple = tuple[float, float, float]
Pair = tuple[float, float]
Gain = tuple[Triple, Triple]


@cache
def gain(dt: float) -> Gain:
    """K_ss about the line, (2, 3)."""
    rows = LQR(**WEIGHTS, v_r=FORWARD[0]).solve(dt, 0.0)[1].tolist()
    return tuple(rows[0]), tuple(rows[1])


def line(x: float, y: float, theta: float) -> Triple:
    """The point of the line beside the robot."""
    return x, LINE_Y, 0.0


def error(x: float, y: float, theta: float, x_r: float, y_r: float, theta_r: float) -> Triple:
    """Pose minus reference."""
    return x - x_r, y - y_r, math.remainder(theta - theta_r, math.tau)


def feedback(k: Gain, dx: float, dy: float, dtheta: float) -> Pair:
    """u = -K e."""
    (k00, k01, k02), (k10, k11, k12) = k
    return -(k00 * dx + k01 * dy + k02 * dtheta), -(k10 * dx + k11 * dy + k12 * dtheta)


def saturate(v: float, omega: float) -> Pair:
    """Limit the turn rate and slow down in proportion."""
    if abs(omega) <= OMEGA_MAX:
        return v, omega
    return v * (OMEGA_MAX / abs(omega)), math.copysign(OMEGA_MAX, omega)


def fault(v: float, omega: float) -> Pair:
    """Half of the turn rate is lost."""
    return FAULT[0] * v, FAULT[1] * omega


def slope(theta: float, v: float, omega: float) -> Triple:
    """x', y' and theta' of the unicycle."""
    return v * math.cos(theta), v * math.sin(theta), omega


class LineReference(Block):
    """The point of the line y = ``LINE_Y`` beside the robot.

    pose ─▶ [ LineReference ] ─▶ reference
    """

    pose = Input(Pose, doc="where the robot is")
    reference = Output(Pose, doc="the point of the line beside it")

    def output(self, state, t: float, pose: PoseValue) -> PoseValue:  # type: ignore[no-untyped-def]
        return pose[0], LINE_Y, 0.0


def graph(steps: int, dt: float, engine: str) -> runtime.Graph:
    """The diagram as one of ours; the pose is recorded at every step."""
    made = runtime.load(
        {
            "graph": "tracking",
            "run": {"dt": dt, "until": steps * dt, "engine": engine},
            "blocks": {
                "error": {"type": "TrackingError"},
                "lqr": {"type": "LQR", **WEIGHTS, "v_r": FORWARD[0]},
                "forward": {"type": "Constant", "value": list(FORWARD), "signal": "Twist"},
                "total": {"type": "Sum"},
                "limit": {"type": "Saturator", "omega_max": OMEGA_MAX},
                "fault": {"type": "ActuatorFault", "gain": list(FAULT)},
                "robot": {"type": "DifferentialDrive", "x0": list(X0), "integrator": "euler"},
            },
            "wires": {
                "error": {"pose": "robot.pose"},
                "lqr": {"error": "error.state"},
                "total": {"terms": ["lqr.command", "forward.value"]},
                "limit": {"command": "total.out"},
                "fault": {"command": "limit.limited"},
                "robot": {"command": "fault.actual"},
            },
            "probes": {"pose": {"of": "robot.pose", "every": 1}},
        }
    )
    made = made.add("line", LineReference()).connect("robot.pose", "line.pose")
    return made.connect("line.reference", "error.reference").connect(
        "line.reference", "lqr.reference"
    )


class Ours:
    """Our diagram, built once and run as often as wanted."""

    def __init__(self, steps: int, dt: float, engine: str) -> None:
        self.graph = graph(steps, dt, engine).check()

    def __call__(self) -> Run:
        return run_of(self.graph)


def run_of(checked: runtime.Graph) -> Run:
    """A run of a checked graph: the seconds of its ticks, and its probe ``pose``."""
    result = checked.run()
    seconds = result.manifest["us_per_tick"] * 1e-6 * result.manifest["ticks"]
    return Run(seconds, result["pose"])
