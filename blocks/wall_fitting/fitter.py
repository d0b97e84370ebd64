"""The paper's wall fitting: B-splines through a scan, and the reference path beside them."""

from __future__ import annotations

import math

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    IntArray,
    Output,
    ParameterError,
    Path,
    PointCloud,
    Pose,
    PoseValue,
    Scalar,
    Scan,
    State,
    kernel_of,
    param,
    product,
    small_product,
)
from blocks.wall_fitting.bspline import Samples, arc_length, control_points, fit_even, projection
from blocks.wall_fitting.contour import Beams, Returns, chain
from blocks.wall_fitting.curves import STEP, WallCurve, offset_pieces, wall_curves
from blocks.wall_fitting.kernels.bspline import (
    arc_length_kernel,
    banded_matrices,
    even_basis,
    fit_kernel,
    positions,
    sampled_evenly_kernel,
)
from blocks.wall_fitting.kernels.contour import (
    averages_kernel,
    chain_arcs_kernel,
    chain_kernel,
    returned,
)
from blocks.wall_fitting.kernels.curves import (
    coarseness,
    fitted_points,
    offset_pieces_kernel,
    offset_rows,
    wall_curves_kernel,
)
from blocks.wall_fitting.kernels.fitter import (
    against_kernel,
    ahead,
    between,
    copied,
    nearest_row,
    placed,
    shown,
    sound,
    with_ends,
)
from blocks.wall_fitting.kernels.offset import (
    filleted_kernel,
    followed_kernel,
    onward_kernel,
    stretch_kernel,
)
from blocks.wall_fitting.offset import (
    END,
    against,
    filleted,
    followed,
    onward,
    resampled,
    stretch,
)

CALM = 0.05  # m between control points that smooth the offset before its kinks are rounded
FLAT = 0.003  # m by which the smoothed offset may vary without counting as a kink
MARGIN = 0.05  # m by which the path's spline is longer than the path, at each end
SHARP = 3.0  # times 1 / spacing: largest curvature that the path's control points can represent
CLEAR = 5  # rows to leave out around a place that is too sharp
BEYOND = 0.5  # m of offset used beyond the path's ends
BESIDE = 0.25  # times distance: how far a row may be from the offset that it follows


class WallFitter(Block):
    """Fit B-splines to the walls of a scan and compute a path beside them (paper, section III-A).

        scan, pose ─▶ [ WallFitter ] ─▶ path, wall, valid

    P(t) = sum_i N_{i,k}(t) P_i with quasi-uniform clamped knots, see ``bspline``. In
    the paper the P_i are the points themselves; ``fit: control_points`` takes their averages over
    ``bin`` metres of wall (``bin: 0``: the points), ``fit: least_squares`` finds one P_i for each
    ``wall_spacing`` so that the curve is nearest to all points.

    The path (rows of x, y in m, theta in rad, kappa in 1/m, signed, left positive) is this curve
    moved by ``distance`` to the robot's side. Points nearer than that to any wall, or behind
    one, are dropped; where beams pass the end of a wall, the curve goes round the edge; gaps are
    bridged; what does not link to the part nearest to the robot is left out; turns off the wall
    tighter than ``fillet`` are rounded; and another spline is fitted to that. Rows are ``step``
    apart, in the direction of travel, with straight ends where there were no returns, and where it
    would run against the direction of the wall.

    A scan that gives no path keeps the last one, with ``valid`` 0. Before the first one
    the path runs straight ahead through the robot, and the wall's points are at the robot.
    """

    scan = Input(
        Scan("beams"), doc="ranges; values that are not finite and positive are not returns"
    )
    pose = Input(Pose, doc="the estimate of the pose at which the scan was taken")

    path = Output(Path("samples"), doc="the reference path, in the direction of travel")
    wall = Output(PointCloud("wall_points"), doc="the fitted walls within reach, for plots")
    valid = Output(Scalar, doc="1 if this scan gave the path, 0 if the last one was kept")

    side: str = param("right", choices=("right", "left"), doc="which side of the robot the wall is")
    distance: float = param(0.18, unit="m", above=0.0, doc="stand-off d from the wall")
    degree: int = param(3, at_least=2, at_most=7, doc="degree k of the splines")
    form: str = param(
        "control_points",
        name="fit",
        choices=("control_points", "least_squares"),
        doc="control_points: the (averaged) points are the P_i, as in the paper",
    )
    bin: float = param(0.03, unit="m", at_least=0.0, doc="arc over which points are averaged")
    wall_spacing: float = param(0.08, unit="m", at_least=0.02, doc="least_squares: gap of P_i")
    spacing: float = param(0.1, unit="m", at_least=0.02, doc="gap of the path's control points")
    fillet: float = param(0.15, unit="m", at_least=0.0, doc="smallest radius of turns off the wall")
    reach: float = param(0.9, unit="m", above=0.0, doc="returns farther than that are left out")
    window: FloatArray = param(
        (math.radians(-200.0), math.radians(80.0)),
        unit="rad",
        shape=(2,),
        doc="first and last bearing to use, the wall on the right; mirrored for the left",
    )
    sigma: float = param(0.01, unit="m", at_least=0.0, doc="the LiDAR's range noise")
    incidence: float = param(
        0.14, unit="rad", above=0.0, below=1.5, doc="flattest beam at which walls are linked"
    )
    trim: float = param(0.01, unit="m", at_least=0.0, doc="by how much points may be nearer than d")
    bridge: float = param(0.5, unit="m", at_least=0.0, doc="longest gap that the path bridges")
    shortest: float = param(0.15, unit="m", above=0.0, doc="shortest path that counts as valid")
    behind: float = param(
        0.3, unit="m", at_least=0.0, doc="distance from the path's beginning to the robot"
    )
    step: float = param(0.01, unit="m", at_least=0.001, doc="distance of the path's rows")
    samples: int = param(150, at_least=4, doc="number of the path's rows")
    wall_points: int = param(100, at_least=1, doc="number of the wall's points")
    angle_min: float = param(-math.pi, unit="rad", doc="bearing of the first beam")
    angle_max: float = param(math.pi, unit="rad", doc="bearing that would follow the last beam")

    last_path = State("samples", 4, doc="the last valid path: m, m, rad, 1/m")
    last_wall = State("wall_points", 2, unit="m", doc="the wall that goes with it")
    fitted = State(1, doc="1 once there was one")

    def validate(self) -> None:
        low, high = self.window.tolist()
        problems = []
        if not low < high <= low + math.tau:
            problems.append(
                ("window", f"expected first < last <= first + 2 pi, got {low:g}, {high:g}")
            )
        if not self.angle_min < self.angle_max <= self.angle_min + math.tau + 1e-9:
            message = f"must be above angle_min = {self.angle_min:g} by 2 pi at most"
            problems.append(("angle_max", message))
        length = (self.samples - 1) * self.step
        if self.behind >= length:
            message = f"the path is {length:g} m long and ends ahead of the robot; expected less"
            problems.append(("behind", message))
        if problems:
            raise ParameterError(problems)

    def start(self, state: BlockState) -> None:
        beams = self.beams(state.context)
        state.beams = beams
        # What the kernels need: the beams, and the reference spline, whose length is fixed.
        state.order, state.bearing, state.direction = beams.order, beams.bearing, beams.direction
        state.limit = beams.incidence(self.incidence)
        n = control_points(self._length, self.spacing, self.degree)
        state.projection = np.ascontiguousarray(projection(n, self.degree, 6 * n))
        state.first, state.bands = banded_matrices(n, self.degree, 2 * self.samples)

    def beams(self, context: BlockContext) -> Beams:
        """The beams to use of the scans that are wired to the block."""
        low, high = self.window.tolist()
        (beams,) = context.types["scan"].shape
        mirror = self.side == "left"
        return Beams.of(beams, self.angle_min, self.angle_max, (low, high), mirror)

    def output(
        self, state: BlockState, t: float, scan: FloatArray, pose: PoseValue
    ) -> tuple[FloatArray, FloatArray, float]:
        curves, sampled = self.survey(scan, state.beams)
        if sampled is not None:
            walls = np.concatenate([curve.position for curve in curves])
            shown = np.linspace(0.0, len(walls) - 1.0, self.wall_points).astype(np.intp)
            return self._rows(sampled, pose), self._placed(walls[shown], pose), 1.0
        if state.fitted[0]:
            return state.last_path.copy(), state.last_wall.copy(), 0.0
        ahead = np.arange(self.samples) * self.step - self.behind
        straight = np.column_stack((ahead, np.zeros(self.samples)))
        path = np.column_stack((self._placed(straight, pose), np.zeros((self.samples, 2))))
        path[:, 2] = pose[2]
        return path, np.tile(pose[:2], (self.wall_points, 1)), 0.0

    def update(
        self, state: BlockState, t: float, path: FloatArray, wall: FloatArray, valid: float
    ) -> None:
        if valid:
            state.last_path[:] = path
            state.last_wall[:] = wall
            state.fitted[0] = 1.0

    def survey(self, scan: FloatArray, beams: Beams) -> tuple[list[WallCurve], Samples | None]:
        """The walls of a scan, and the path along them, in the robot's (mirrored) frame.

        Parameters
        ----------
        scan : ranges (m), one per beam.
        beams : see :meth:`beams`.

        Returns
        -------
        The fitted walls, and the samples of the path, or None if there is none.
        """
        returns = Returns.of(scan, beams)
        if len(returns) < 2:
            return [], None
        limit = beams.incidence(self.incidence)
        chains = chain(returns, beams.bearing[[0, -1]], self.reach, self.sigma, limit)
        if chains is None:
            return [], None
        spacing = self.wall_spacing if self.form == "least_squares" else None
        curves = wall_curves(chains, self.degree, self.bin, spacing)
        pieces = offset_pieces(curves, chains, returns, self.distance, self.trim, limit)
        rows = self._joined(pieces)
        return curves, self.reference(self._line(rows), rows) if len(rows) else None

    def _joined(self, pieces: list[FloatArray]) -> FloatArray:
        """Join the pieces to follow near the robot; no rows if that is too short."""
        if not pieces:
            return np.empty((0, 4))
        rows = onward(followed(pieces, self.bridge))
        line = rows[:, :2]
        arc = arc_length(line)
        here = arc[int(np.einsum("ij,ij->i", line, line).argmin())]
        ahead = self.samples * self.step - self.behind
        near = (arc > here - self.behind - BEYOND) & (arc < here + ahead + BEYOND)
        kept: FloatArray = rows[near]
        long_enough = float(arc_length(kept[:, :2])[-1]) >= self.shortest
        return kept if long_enough else kept[:0]

    def _line(self, rows: FloatArray) -> FloatArray:
        """The rows to follow as a line, smooth and filleted."""
        # Straight ends, so that a kink has room for its fillet even if the wall behind it is no
        # longer in the window. They go along the wall: a noisy line's last points do not.
        room = max(END, 2.0 * self.fillet)
        first, last = rows[0, :2] - room * rows[0, 2:], rows[-1, :2] + room * rows[-1, 2:]
        line = np.vstack((first, rows[:, :2], last))
        length = float(arc_length(line)[-1])
        # In steps of four, so that matrices are cached.
        n = 4 * math.ceil(control_points(length, CALM, self.degree) / 4)
        even = resampled(line, 5 * n)
        calm = fit_even(even, n, self.degree).positions(5 * n)
        even = resampled(calm, max(4, round(length / STEP)))
        return filleted(even, self.fillet, STEP, FLAT)

    def reference(self, line: FloatArray, rows: FloatArray) -> Samples | None:
        """Fit the reference spline to a line and sample it evenly, in the robot's frame.

        Where it turns about a point, as the fit to an offset that noise has folded may do, or runs
        against the direction of travel of the ``rows`` that it follows, it ends and goes on
        straight; None if little is left of it near the robot.
        """
        length = self._length
        n = control_points(length, self.spacing, self.degree)
        for _ in range(3):
            here = arc_length(line)[int(np.einsum("ij,ij->i", line, line).argmin())]
            data = stretch(line, float(here) - self.behind - MARGIN, length, 6 * n)
            spline = fit_even(data, n, self.degree)
            sampled = spline.sampled_evenly(self.step, self.samples, MARGIN, 2 * self.samples)
            # A cusp may lie between two rows: then it shows in their directions alone.
            turn = np.abs(np.diff(sampled.theta, append=sampled.theta[-1])) / self.step
            bend = np.maximum(np.abs(sampled.kappa), turn)
            wrong = bend > SHARP / self.spacing
            wrong |= against(sampled.position, sampled.theta, rows, BESIDE * self.distance)
            if not wrong.any():
                return sampled
            nearby, places = round(self.behind / self.step), np.flatnonzero(wrong).tolist()
            low = max((k + CLEAR for k in places if k <= nearby), default=0)
            high = min((k - CLEAR for k in places if k > nearby), default=self.samples)
            if (high - low) * self.step < self.shortest:
                return None
            line = sampled.position[low:high]
        return None

    @property
    def _length(self) -> float:
        """The length (m) of the reference spline."""
        return (self.samples - 1) * self.step + 2.0 * MARGIN

    def _rows(self, sampled: Samples, pose: PoseValue) -> FloatArray:
        mirror = -1.0 if self.side == "left" else 1.0
        heading = pose[2] + mirror * sampled.theta
        return np.column_stack(
            (self._placed(sampled.position, pose), heading, mirror * sampled.kappa)
        )

    def _placed(self, points: FloatArray, pose: PoseValue) -> FloatArray:
        """Points of the robot's (mirrored) frame in the world."""
        x, y, theta = pose
        c, s = math.cos(theta), math.sin(theta)
        mirror = -1.0 if self.side == "left" else 1.0
        turn = np.array([[c, s], [-mirror * s, mirror * c]])
        return np.asarray(product(points, turn) + np.array((x, y)))

    @kernel_of(output)
    def _output_kernel(
        self, state: BlockState, t: float, scan: FloatArray, pose: PoseValue
    ) -> tuple[FloatArray, FloatArray, float]:
        returns = returned(scan, state.order, state.bearing, state.direction)
        points, bounds, edges = chain_kernel(
            returns, state.bearing, self.reach, self.sigma, state.limit
        )
        arc = chain_arcs_kernel(points, bounds)
        step = coarseness(arc, bounds)
        shortest = 1.5 * max(self.bin, 2.0 * step)
        if self.form == "least_squares":
            control, first = fitted_points(
                points, bounds, arc, self.degree, self.wall_spacing, shortest
            )
            each = max(2, round(self.wall_spacing / step))
        else:
            gap = max(self.bin, 2.0 * step) if self.bin > 0.0 else 0.0
            control, first = averages_kernel(points, bounds, arc, gap)
            each = max(2, round(self.bin / step))
        curves, ends = wall_curves_kernel(
            control, first, points, bounds, arc, self.degree, each, shortest
        )
        rows, stops = offset_rows(curves, ends, edges, self.distance)
        closest = self.distance - self.trim
        pieces = offset_pieces_kernel(rows, stops, curves, ends, returns, closest, state.limit)
        joined = self._joined_rows(rows, pieces)
        path = self._reference_rows(state, self._line_rows(joined), joined)
        mirror = -1.0 if self.side == "left" else 1.0
        if len(path) > 0:
            return placed(path, pose, mirror), shown(curves, self.wall_points, pose, mirror), 1.0
        if state.fitted[0] > 0.0:
            return state.last_path.copy(), state.last_wall.copy(), 0.0
        path = placed(ahead(self.samples, self.step, self.behind), pose, mirror)
        return path, shown(np.zeros((1, 4)), self.wall_points, pose, mirror), 0.0

    def _joined_rows(self, rows: FloatArray, pieces: IntArray) -> FloatArray:
        """Join the pieces (first and past-the-last of the rows); no rows if that is too short."""
        rows = onward_kernel(followed_kernel(rows, pieces, self.bridge))
        arc = arc_length_kernel(rows)
        here = arc[nearest_row(rows)] if len(rows) > 0 else 0.0
        onward = self.samples * self.step - self.behind
        rows = between(rows, arc, here - self.behind - BEYOND, here + onward + BEYOND)
        arc = arc_length_kernel(rows)
        length = arc[-1] if len(rows) > 0 else 0.0
        return rows if length >= self.shortest else rows[:0]

    def _line_rows(self, rows: FloatArray) -> FloatArray:
        """The joined rows as a line, smoothed and filleted."""
        if len(rows) == 0:
            return np.zeros((0, 2))
        line = with_ends(rows, max(END, 2.0 * self.fillet))
        arc = arc_length_kernel(line)
        length = arc[-1]
        n = 4 * math.ceil(control_points(length, CALM, self.degree) / 4)
        even = stretch_kernel(line, arc, 0.0, length, 5 * n)
        first, values = even_basis(n, self.degree, 5 * n)
        calm = positions(first, values, fit_kernel(first, values, even, n, 0.0))
        arc = arc_length_kernel(calm)
        even = stretch_kernel(calm, arc, 0.0, arc[-1], max(4, round(length / STEP)))
        return filleted_kernel(even, self.fillet, STEP, FLAT)

    def _reference_rows(
        self, state: BlockState, line: FloatArray, joined: FloatArray
    ) -> FloatArray:
        """Rows of the reference spline along a line; none if little is left of it."""
        nearby = round(self.behind / self.step)
        for _ in range(3):
            if len(line) == 0:
                break
            arc = arc_length_kernel(line)
            start = arc[nearest_row(line)] - self.behind - MARGIN
            data = stretch_kernel(line, arc, start, self._length, state.projection.shape[1])
            points = small_product(state.projection, data)
            rows = sampled_evenly_kernel(
                state.first, state.bands, points, self.step, self.samples, MARGIN
            )
            wrong = against_kernel(rows, joined, BESIDE * self.distance)
            low, high = sound(rows, wrong, self.step, SHARP / self.spacing, nearby, CLEAR)
            if low == 0 and high == self.samples:
                return rows
            if (high - low) * self.step < self.shortest:
                break
            line = copied(rows, low, high)
        return np.zeros((0, 4))
