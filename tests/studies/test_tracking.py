"""Whole loops without neurons: LQR and feedforward against what the linear model foretells."""

from __future__ import annotations

import math

import numpy as np
import pytest

import blocks
import runtime
from blocks.core.signals import FloatArray


def loop(
    path: blocks.Block,
    x0: list[float],
    lqr: blocks.LQR,
    *,
    alpha: float,
    dt: float = 0.01,
    until: float = 20.0,
) -> runtime.Graph:
    """A robot that follows a path: u = u_l + u_f."""
    graph = runtime.Graph(dt=dt, until=until)
    graph = graph.add("track", path)
    graph = graph.add("match", blocks.MatchingPoint(v_r=lqr.v_r, alpha=alpha))
    graph = graph.add("error", blocks.TrackingError()).add("lqr", lqr).add("total", blocks.Sum())
    graph = graph.add("plant", blocks.DifferentialDrive(x0=x0))
    graph = graph.connect("track.path", "match.path").connect("plant.pose", "match.pose")
    graph = graph.connect("plant.pose", "error.pose").connect("match.reference", "error.reference")
    graph = graph.connect("error.state", "lqr.error").connect("match.reference", "lqr.reference")
    graph = graph.connect("lqr.command", "total.terms").connect("match.feedforward", "total.terms")
    graph = graph.connect("total.out", "plant.command")
    for signal in ("plant.pose", "error.lateral", "error.heading", "match.progress"):
        graph = graph.probe(signal)
    return graph


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("v_r", [1.0, pytest.param(0.5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("model", ["paper", "exact"])
@pytest.mark.slow
def test_exact_feedforward_settles_on_a_circle(clockwise: bool, v_r: float, model: str) -> None:
    """alpha = v_r makes the circle an equilibrium: from beside it the error dies out."""
    side = -1.0 if clockwise else 1.0
    path = blocks.CirclePath(radius=2.0, clockwise=clockwise, samples=12566)
    lqr = blocks.LQR(q=[1, 1, 1], v_r=v_r, model=model)
    x0 = [2.4, 0.1, side * 0.5 * math.pi + 0.4]
    result = loop(path, x0, lqr, alpha=v_r, until=40.0).run()
    radius = np.hypot(*result["plant.pose"][:, :2].T)
    assert abs(radius[0] - 2.0) > 0.3
    # Samples are 1 mm apart, so the reference's heading is off by up to 0.25 mrad.
    assert np.abs(radius[-1000:] - 2.0).max() < 5e-4
    assert np.abs(result["error.heading"][-1000:]).max() < 5e-4
    # One lap takes the circumference over v_r.
    way = result["match.progress"]
    assert way[-1] - way[-1001] == pytest.approx(10.0 * v_r, rel=1e-3)


@pytest.mark.parametrize("alpha", [0.0, 0.06, 0.5])
def test_less_feedforward_leaves_the_offset_that_balances_it(alpha: float) -> None:
    """At rest the turn rates add up: alpha kappa - K_omega e = v kappa_robot, with e_theta = 0.

    The robot goes around a circle of its own, radius R + e_y inside out, at v = v_r.
    """
    lqr = blocks.LQR(q=[4, 4, 1], v_r=1.0)
    result = loop(
        blocks.CirclePath(radius=3.0, samples=20000),
        [3.0, 0.0, 0.5 * math.pi],
        lqr,
        alpha=alpha,
        until=30.0,
    ).run()
    _, gain = lqr.solve(0.01, 0.0)
    lateral, heading = result["error.lateral"], result["error.heading"]
    np.testing.assert_allclose(lateral[-1000:], lateral[-1], atol=1e-3)
    assert abs(lateral[-1]) > 0.05
    radius = 3.0 - lateral[-1]  # left of a counterclockwise circle is its inside
    turn = alpha / 3.0 - gain[1, 1] * lateral[-1] - gain[1, 2] * heading[-1]
    assert turn == pytest.approx(1.0 / radius, rel=2e-3)
    assert np.abs(heading[-1000:]).max() < 2e-3


def closed_loop(lqr: blocks.LQR, dt: float) -> FloatArray:
    """A - B K of the exact model at heading 0, for the lateral and the heading error."""
    v = lqr.v_r
    a = np.array([[1.0, v * dt], [0.0, 1.0]])
    b = np.array([[0.5 * v * dt**2], [dt]])
    _, gain = lqr.solve(dt, 0.0)
    return np.asarray(a - b @ gain[1:, 1:])


@pytest.mark.parametrize("q", [[0, 1, 1], [0, 20, 0.5], [0, 0.03, 0.03]])
@pytest.mark.parametrize(("dt", "v_r"), [(0.01, 1.0), (0.1, 0.4), (0.1, -0.4)])
def test_exact_model_foretells_the_approach_to_a_line(
    q: list[float], dt: float, v_r: float
) -> None:
    """From a small error each tick is a multiplication by A - B K, to the last of 300.

    Without a weight along the path the speed is v_r, and where the samples lie does not matter.
    """
    lqr = blocks.LQR(q=q, v_r=v_r, model="exact")
    small = np.array([1e-5, -2e-5])
    path = blocks.LinePath(y=1.0, x_start=-40.0, x_end=40.0, samples=8001)
    result = loop(path, [0.0, 1.0 + small[0], small[1]], lqr, alpha=0.0, dt=dt, until=300 * dt)
    step, expected = closed_loop(lqr, dt), small
    run = result.run()
    got = np.column_stack((run["error.lateral"], run["error.heading"]))
    for k in range(300):
        # sin(theta) is theta to one part in 1e-10; 1e-15 is the rounding of y = 1.
        np.testing.assert_allclose(got[k], expected, rtol=0.0, atol=1e-8 * 1e-5 + 1e-14)
        expected = step @ expected


def test_the_rate_of_approach_is_the_slowest_eigenvalues() -> None:
    dt = 0.05
    lqr = blocks.LQR(q=[0, 4, 1], v_r=0.5, model="exact")
    eigenvalues = np.linalg.eigvals(closed_loop(lqr, dt))
    slowest = np.abs(eigenvalues).max()
    path = blocks.LinePath(y=0.0, x_end=40.0, samples=4001)
    run = loop(path, [1.0, 0.2, 0.5], lqr, alpha=0.0, dt=dt, until=20.0).run()
    size = np.hypot(run["error.lateral"], run["error.heading"])
    # Well inside the linear part, over whole turns of a complex pair: 100 ticks.
    rate = (size[300] / size[200]) ** 0.01
    assert rate == pytest.approx(slowest, abs=0.01)
    assert size[300] < 1e-3 * size[0]


def test_paper_model_settles_too_and_nearly_as_foretold() -> None:
    """The printed B differs by a term of second order in dt, and so does the approach."""
    path = blocks.LinePath(y=0.0, x_end=40.0, samples=4001)
    ends = []
    for dt in (0.04, 0.02, 0.01):
        runs = [
            loop(
                path,
                [1.0, 0.2, 0.0],
                blocks.LQR(q=[0, 4, 1], model=model),
                alpha=0.0,
                dt=dt,
                until=2.0,
            ).run()["error.lateral"]
            for model in ("paper", "exact")
        ]
        ends.append(np.abs(runs[0] - runs[1]).max())
    assert ends[0] > 2.0 * 0.8 * ends[1] > 4.0 * 0.64 * ends[2] > 0.0
