"""The ring of the benchmark: errors of our solvers, and those of other packages' own runs."""

from __future__ import annotations

import pytest

from benchmarks import accuracy
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


@pytest.mark.parametrize("title", accuracy.PROBLEMS)
def test_the_problems_are_the_graphs(title: str) -> None:
    """Our blocks and the equations that other packages get are the same: the error is small."""
    problem = accuracy.PROBLEMS[title]
    assert accuracy.error_of(problem, accuracy.ours(problem, "dopri5")) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", accuracy.PEERS)
@pytest.mark.parametrize("title", accuracy.PROBLEMS)
def test_errors_on_other_loops_are_no_larger_either(title: str, name: str) -> None:
    (peer, solver), problem = accuracy.PEERS[name], accuracy.PROBLEMS[title]
    package = name.split(",")[0].lower()
    pytest.importorskip(package, reason=f"{package} is not installed")
    own = accuracy.error_of(problem, accuracy.ours(problem, solver))
    assert own <= 1.001 * accuracy.error_of(problem, peer(problem))
