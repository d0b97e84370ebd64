"""The point of a path to follow, and how far the robot is from it, to which side.

A pose and a path (samples of x, y, theta, kappa) go in; the reference, its feedforward and the
error come out, which a tracker corrects::

    match: {type: MatchingPoint, window: 2.0, v_r: 0.2, alpha: 0.2}
"""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    Path,
    Pose,
    PoseValue,
    Scalar,
    State,
    TrackingState,
    Twist,
    TwistValue,
    kernel_of,
    param,
    wrap,
)


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
    position = Output(Scalar, unit="m", label="$e_p$", doc="distance e_p, never negative")
    heading = Output(Scalar, unit="rad", label=r"$e_\theta$", doc="heading error e_theta")
    lateral = Output(
        Scalar, unit="m", label="$e_y$", doc="cross-track error, positive to the left of the path"
    )
    along = Output(
        Scalar, unit="m", label="$e_x$", doc="along-track error, positive ahead of the reference"
    )

    def output(
        self, state: BlockState, t: float, pose: PoseValue, reference: PoseValue
    ) -> tuple[PoseValue, float, float, float, float]:
        dx = pose[0] - reference[0]
        dy = pose[1] - reference[1]
        error = (dx, dy, wrap(pose[2] - reference[2]))
        along, lateral = offsets(error, reference[2])
        return error, math.hypot(dx, dy), error[2], lateral, along


class CourseError(Block):
    """How far the robot's course is from the one that leads to the path.

        error, reference ─▶ [ CourseError ] ─▶ course

    course = wrap(e_theta + atan(e / (v_r lookahead_time))), the deviation of the heading from the
    direction to a point on the path's tangent, v_r * lookahead_time ahead (line-of-sight guidance;
    Fossen, Breivik and Skjetne, 2003). Near the path it is e_theta + lambda e with lambda = 1 /
    (v_r lookahead_time), so that one time serves every speed; far from it, it is limited. A learner
    that brings it to zero leaves no lateral offset.
    """

    error = Input(TrackingState, doc="pose minus reference")
    reference = Input(Pose, doc="the point of the path that is followed")

    course = Output(Scalar, unit="rad", doc="the deviation, positive to the left")

    v_r: float = param(1.0, unit="m/s", above=0.0, tunable=True, doc="reference speed")
    lookahead_time: float = param(
        1.0, unit="s", above=0.0, tunable=True, doc="how far ahead the point lies"
    )

    def output(self, state: BlockState, t: float, error: PoseValue, reference: PoseValue) -> float:
        _, lateral = offsets(error, reference[2])
        return wrap(error[2] + math.atan(lateral / (self.v_r * self.lookahead_time)))


class Tracker(Block):
    """The ports of a controller that keeps a robot on its path; any can replace another.

        error, reference ─▶ [ Tracker ] ─▶ command

    The command corrects the feedforward [v_r, v_r kappa]: on the path, looking along it, it is 0.
    """

    error = Input(TrackingState, doc="pose minus reference")
    reference = Input(Pose, doc="the point of the path that is followed")

    command = Output(Twist, doc="correction of speed and turn rate")

    def output(
        self, state: BlockState, t: float, error: PoseValue, reference: PoseValue
    ) -> TwistValue:
        raise NotImplementedError


class MatchingPoint(Block):
    """Find the path sample nearest to the robot, and its feedforward (paper, section III-C).

        pose, path ─▶ [ MatchingPoint ] ─▶ reference, feedforward, curvature, index, progress

    m_r = argmin_m (x - x_m)^2 + (y - y_m)^2, over the samples within ``window`` of the last one
    (over the whole path on the first tick; around the end of a closed path). u_f = [v_r, alpha
    kappa]. When the path itself changes, the search continues from the sample of the new path that
    is nearest to the last reference point.
    """

    pose = Input(Pose, doc="where the robot believes it is")
    path = Input(Path("n"), doc="the path to follow")

    reference = Output(Pose, doc="the matching point x_r, y_r, theta_r")
    feedforward = Output(Twist, doc="u_f = [v_r, alpha kappa]")
    kappa = Output(
        Scalar,
        unit="1/m",
        name="curvature",
        label=r"$\kappa$",
        doc="curvature at the matching point",
    )
    index = Output(Scalar, doc="number of the matching sample")
    progress = Output(
        Scalar, unit="m", doc="distance travelled along the path since the first tick"
    )

    window: float = param(2.0, unit="m", above=0.0, doc="how far to search in either direction")
    v_r: float = param(1.0, unit="m/s", tunable=True, doc="reference speed")
    alpha: float = param(
        0.06, unit="m/s", tunable=True, doc="feedforward turn rate per curvature; v_r is exact"
    )
    sign: str = param(
        "signed",
        choices=("signed", "unsigned"),
        name="curvature",
        doc="unsigned: the paper's |kappa|, which feeds every bend forward to the left",
    )

    last = State(1, name="last_index", doc="the sample matched last")
    anchor = State(2, unit="m", doc="the matched sample's x and y; NaN before the first")
    way = State(1, unit="m", doc="distance travelled along the path")

    def start(self, state: BlockState) -> None:
        state.anchor[:] = math.nan

    def output(
        self, state: BlockState, t: float, pose: PoseValue, path: FloatArray
    ) -> tuple[PoseValue, TwistValue, float, float, float]:
        # Only near the last match: a path that passes a place twice has two nearest points there,
        # and the robot must not jump from one to the other.
        n = len(path)
        closed, spacing = _geometry(path)
        begin = self._begin(state, pose, path)
        reach = max(1, round(self.window / spacing))
        if closed:
            window = np.arange(begin - reach, begin + reach + 1) % n if 2 * reach < n else slice(n)
            low = 0
        else:
            low = max(0, begin - reach)
            window = slice(low, begin + reach + 1)
        near = path[window]
        nearest = _nearest(near, pose[0], pose[1])
        index = low + nearest if isinstance(window, slice) else int(window[nearest])
        return self._matched(state, path, begin, index)

    def _matched(
        self, state: BlockState, path: FloatArray, begin: int, index: int
    ) -> tuple[PoseValue, TwistValue, float, float, float]:
        """The outputs at a sample, having searched around another one."""
        n = len(path)
        closed, spacing = _geometry(path)
        step = index - begin
        if closed and abs(step) > n // 2:
            step -= int(math.copysign(n, step))
        x, y, theta, kappa = path[index].tolist()
        if self.sign == "unsigned":
            kappa = abs(kappa)
        progress = float(state.way[0]) + step * spacing
        return (x, y, theta), (self.v_r, self.alpha * kappa), kappa, float(index), progress

    @kernel_of(output)
    def _output_kernel(
        self, state: BlockState, t: float, pose: PoseValue, path: FloatArray
    ) -> tuple[PoseValue, TwistValue, float, float, float]:
        n = len(path)
        closed, spacing = _geometry(path)
        begin = self._begin(state, pose, path)
        reach = max(1, round(self.window / spacing))
        first, last = max(0, begin - reach), min(n, begin + reach + 1)
        if closed:
            first, last = (0, n) if 2 * reach >= n else (begin - reach, begin + reach + 1)
        index, least = first, math.inf
        for i in range(first, last):
            dx, dy = path[i % n, 0] - pose[0], path[i % n, 1] - pose[1]
            square = dx * dx + dy * dy
            if square < least:
                index, least = i % n, square
        return self._matched(state, path, begin, index)

    def _begin(self, state: BlockState, pose: PoseValue, path: FloatArray) -> int:
        """The sample around which to search."""
        x, y = state.anchor.tolist()
        if math.isnan(x):
            return _nearest(path, pose[0], pose[1])
        last = int(state.last_index[0])
        # The same sample at the same place: the path is the one of the last tick. Otherwise the
        # numbers of its samples mean other places, as with a path that is fitted anew.
        if last < len(path) and path[last, 0] == x and path[last, 1] == y:
            return last
        return _nearest(path, x, y)

    def update(
        self, state: BlockState, t: float, reference: PoseValue, index: float, progress: float
    ) -> None:
        state.anchor[0], state.anchor[1] = reference[0], reference[1]
        state.last_index[0] = index
        state.way[0] = progress


def _nearest(path: FloatArray, x: float, y: float) -> int:
    # In place, and without the root, which does not change the order.
    dx = path[:, 0] - x
    dy = path[:, 1] - y
    dx *= dx
    dy *= dy
    dx += dy
    return int(dx.argmin())


@kernel_of(_nearest)
def _nearest_kernel(path: FloatArray, x: float, y: float) -> int:
    # As fast as the above, which in exported C has two arrays as long as the path.
    index, least = 0, math.inf
    for i in range(len(path)):
        dx, dy = path[i, 0] - x, path[i, 1] - y
        square = dx * dx + dy * dy
        if square < least:
            index, least = i, square
    return index


def _geometry(path: FloatArray) -> tuple[bool, float]:
    """Whether the path closes on itself, and the spacing of its samples (m)."""
    (x0, y0), (x1, y1), (xn, yn) = path[0, :2].tolist(), path[1, :2].tolist(), path[-1, :2].tolist()
    spacing = math.hypot(x1 - x0, y1 - y0)
    return len(path) > 3 and math.hypot(xn - x0, yn - y0) < 1.5 * spacing, spacing


@kernel_of(_geometry)
def _geometry_kernel(path: FloatArray) -> tuple[bool, float]:
    spacing = math.hypot(path[1, 0] - path[0, 0], path[1, 1] - path[0, 1])
    apart = math.hypot(path[-1, 0] - path[0, 0], path[-1, 1] - path[0, 1])
    return len(path) > 3 and apart < 1.5 * spacing, spacing
