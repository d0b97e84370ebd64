"""The ring of the benchmark: errors of our solvers, and those of other packages' own runs."""

from __future__ import annotations

import pytest

from benchmarks.continuous import DT, PEERS, STEPS, error_of, exact, ours


@pytest.mark.parametrize(("solver", "order"), [("rk4", 4), ("dopri5", 5)])
def test_the_errors_of_the_ring_fall_with_the_order_of_the_solver(solver: str, order: int) -> None:
    """Halving the step divides the error by 2^order."""
    coarse = ours("python", solver, STEPS // 2, 2 * DT)
    fine = ours("python", solver, STEPS, DT)
    assert coarse[1][0] == pytest.approx(fine[1][0])
    apart = abs(coarse[1] - exact(STEPS // 2, 2 * DT)).max()
    assert apart / error_of(fine) == pytest.approx(2**order, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", PEERS)
def test_errors_are_no_larger_than_those_of_other_packages(name: str) -> None:
    """At equal steps, up to rounding."""
    peer, solver = PEERS[name]
    package = {"PathSim": "pathsim", "python-control": "control"}.get(name.split(",")[0], "bdsim")
    pytest.importorskip(package, reason=f"{package} is not installed")
    assert error_of(ours("python", solver, STEPS, DT)) <= 1.001 * error_of(peer(STEPS, DT))
