"""The paper's error computation: how far the robot is from its reference, and to which side."""

from __future__ import annotations

import math

from blocks.core import Block, BlockState, Input, Output, Pose, PoseValue, Scalar, TrackingState


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    rest = math.remainder(angle, math.tau)
    return math.pi if rest == -math.pi else rest


def offsets(error: PoseValue, heading: float) -> tuple[float, float]:
    """The along-track and lateral parts of an error, forward and left positive, about a heading."""
    c, s = math.cos(heading), math.sin(heading)
    return c * error[0] + s * error[1], c * error[1] - s * error[0]


class TrackingError(Block):
    """Compare a pose with its reference (paper, section III-D).

        pose, reference ─▶ [ TrackingError ] ─▶ state, position, heading, lateral, along

    state = [x - x_r, y - y_r, wrap(theta - theta_r)];  position e_p = |(x - x_r, y - y_r)|;
    heading e_theta = wrap(theta - theta_r). ``along`` and ``lateral`` are the same offset in the
    reference's frame, forward and left positive.
    """

    pose = Input(Pose, doc="where the robot is")
    reference = Input(Pose, doc="where it should be")

    error = Output(TrackingState, name="state", doc="pose minus reference, the angle wrapped")
    position = Output(Scalar, unit="m", doc="distance e_p, never negative")
    heading = Output(Scalar, unit="rad", doc="heading error e_theta")
    lateral = Output(Scalar, unit="m", doc="cross-track error, positive to the left of the path")
    along = Output(Scalar, unit="m", doc="along-track error, positive ahead of the reference")

    def output(
        self, state: BlockState, t: float, pose: PoseValue, reference: PoseValue
    ) -> tuple[PoseValue, float, float, float, float]:
        dx = pose[0] - reference[0]
        dy = pose[1] - reference[1]
        error = (dx, dy, wrap(pose[2] - reference[2]))
        along, lateral = offsets(error, reference[2])
        return error, math.hypot(dx, dy), error[2], lateral, along
